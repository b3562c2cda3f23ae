//! The command line program. All of it lives in [`antumbra::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    antumbra::cli::run(std::env::args_os())
}
