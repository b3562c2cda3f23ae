//! A progress bar for what takes longer than a second, on a terminal only.

use std::io::IsTerminal as _;
use std::sync::mpsc::{self, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Shown after a second, gone when dropped. Never written into a pipe or a file.
pub(super) struct Progress {
    bar: ProgressBar,
    /// The thread that shows the bar; dropping the sender ends it.
    shower: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Progress {
    /// A bar of so many steps; one step alone has no bar, only a word and a clock.
    pub(super) fn new(steps: u64) -> Self {
        let bar = ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::hidden());
        let template = if steps > 1 {
            "{msg} [{bar:30}] {pos}/{len} {elapsed} (about {eta} left)"
        } else {
            "{msg} {elapsed}"
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        if !std::io::stderr().is_terminal() {
            return Self { bar, shower: None };
        }
        let (end, ended) = mpsc::channel();
        let shown = bar.clone();
        let show = move || {
            let second = Duration::from_secs(1);
            if ended.recv_timeout(second) == Err(mpsc::RecvTimeoutError::Timeout) {
                shown.set_draw_target(ProgressDrawTarget::stderr());
                shown.enable_steady_tick(Duration::from_millis(200));
                // Until the end.
                let _ = ended.recv();
                shown.finish_and_clear();
            }
        };
        let spawned = thread::Builder::new().name("progress".into()).spawn(show);
        let shower = spawned.ok().map(|thread| (end, thread));
        Self { bar, shower }
    }

    /// What is being done.
    pub(super) fn say(&self, what: impl Into<String>) {
        self.bar.set_message(what.into());
    }

    /// One step more is done.
    pub(super) fn step(&self) {
        self.bar.inc(1);
    }

    /// Prints above the bar.
    pub(super) fn above<T>(&self, print: impl FnOnce() -> T) -> T {
        self.bar.suspend(print)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some((end, thread)) = self.shower.take() {
            drop(end);
            // It only draws.
            let _ = thread.join();
        }
        self.bar.finish_and_clear();
    }
}
