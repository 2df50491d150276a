//! A program at the command line: its arguments, what it says, and how it ends.

use std::fmt;
use std::io::{self, Write as _};
use std::process::ExitCode;

use clap::Parser;

/// What every program of a box has in common.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    name: &'static str,
}

impl Program {
    /// A program with the name that its lines begin with.
    pub const fn new(name: &'static str) -> Self {
        Self { name }
    }

    /// Runs with the arguments. Exit codes: 0 done (or help was asked for), 1 `run` failed or found something
    /// amiss (`false`), 2 used wrongly.
    pub fn run<A: Parser, E: fmt::Display>(&self, run: impl FnOnce(A) -> Result<bool, E>) -> ExitCode {
        match self.arguments().map(run) {
            Ok(Ok(true)) => ExitCode::SUCCESS,
            Ok(Ok(false)) => ExitCode::FAILURE,
            Ok(Err(error)) => {
                self.say(&format!("{error:#}"));
                ExitCode::FAILURE
            }
            Err(used_wrongly) => used_wrongly,
        }
    }

    /// Reads the arguments; ends the process where help or the version was asked for.
    ///
    /// # Errors
    /// The exit code where the program is used wrongly; the user is told how it is used.
    pub fn arguments<A: Parser>(&self) -> Result<A, ExitCode> {
        A::try_parse().map_err(|error| {
            if !error.use_stderr() {
                error.exit();
            }
            let text = error.to_string();
            self.say(text.strip_prefix("error: ").unwrap_or(&text));
            ExitCode::from(2)
        })
    }

    /// Lines on standard error, each with the program's name.
    pub fn say(&self, text: &str) {
        let mut stderr = io::stderr().lock();
        for line in text.lines().filter(|line| !line.trim().is_empty()) {
            // In one piece, for other programs may write there too. Nobody is left to be told when standard
            // error itself is gone.
            let _ = stderr.write_all(format!("{}: {line}\n", self.name).as_bytes());
        }
    }

    /// A line of what the program is for. Whoever read it may have gone.
    pub fn print(&self, text: &str) {
        let _ = writeln!(io::stdout().lock(), "{text}");
    }
}
