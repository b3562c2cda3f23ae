//! Ending at a signal without leaving half of a file.

/// From now on SIGTERM removes the files aside and ends the process with exit code 143, whatever
/// the other threads are doing.
#[cfg(unix)]
pub(super) fn handle_termination() {
    use crate::capture::output;
    use signal_hook::consts::SIGTERM;
    use signal_hook::iterator::Signals;

    let spawned = Signals::new([SIGTERM]).and_then(|mut signals| {
        let wait = move || {
            if let Some(signal) = signals.forever().next() {
                let _nobody_writes = output::abandon_all();
                // Not `std::process::exit`: drivers' exit handlers and their threads that still run
                // do not go together.
                signal_hook::low_level::exit(128 + signal);
            }
        };
        std::thread::Builder::new()
            .name("signals".into())
            .spawn(wait)
    });
    if let Err(error) = spawned {
        log::warn!("SIGTERM will end the program as the system does: {error}");
    }
}

/// Other systems have no SIGTERM.
#[cfg(not(unix))]
pub(super) fn handle_termination() {}
