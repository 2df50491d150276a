//! The one program a test engineer meets: one module a subcommand, each with its `Args` and its `run`.
//!
//! Exit codes: 0 done, 1 failed, 2 used wrongly. Every line on standard error starts with the program's name.

mod setup;

use std::fmt;
use std::io::{self, Write as _};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Measures the relative motion of two carbodies: setups, simulated rides, sessions, evaluation.
#[derive(Parser)]
#[command(name = "gangway", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Check a setup file, or show every setting it results in.
    Setup(setup::Args),
}

/// A mistake in how the program was called, found after clap's own checks: exit code 2.
#[derive(Debug)]
pub(crate) struct Usage(pub(crate) String);

impl fmt::Display for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Setup(args) => setup::run(args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read our output has seen enough (`gangway ... | head`).
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            let mut stderr = io::stderr().lock();
            for line in format!("{error:#}").lines().filter(|line| !line.trim().is_empty()) {
                // Nobody is left to be told when standard error itself is gone.
                let _ = writeln!(stderr, "gangway: {line}");
            }
            if error.is::<Usage>() { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
}

/// Whether the error is a write to a pipe that nobody reads any more.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<io::Error>())
        .any(|cause| cause.kind() == io::ErrorKind::BrokenPipe)
}
