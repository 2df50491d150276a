//! The one program a test engineer meets: one module a subcommand, each with its `Args` and its `run`.
//!
//! Exit codes: 0 done, 1 failed, 2 used wrongly. Every line on standard error starts with the program's name.

mod decode;
mod demo;
mod evaluate;
mod experiment;
mod export;
mod receive;
mod send;
mod setup;
mod simulate;

use std::fmt;
use std::io;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Context;
use clap::{Parser, Subcommand};
use gangway_bench::link::Program;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

const PROGRAM: Program = Program::new("gangway");

/// Measures the relative motion of two carbodies: setups, simulated rides, sessions, evaluation.
#[derive(Parser)]
#[command(name = "gangway", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Simulate a ride and measure it, end to end: table, pictures, page.
    Demo(demo::Args),
    /// Check a setup file, or show every setting it results in.
    Setup(setup::Args),
    /// Render a scene: frames, exact truth and the setup file.
    Simulate(simulate::Args),
    /// Receive from one or several boxes into sessions on disk.
    Receive(receive::Args),
    /// Show a capture, a session or standard input record by record.
    Decode(decode::Args),
    /// Write a session as a table: CSV or Parquet.
    Export(export::Args),
    /// Compare a session with the truth: table, pictures.
    Evaluate(evaluate::Args),
    /// Simulate an experiment of the thesis and set our figures beside the published ones.
    Experiment(experiment::Args),
    /// Send a command to a box and wait for its answer.
    Send(send::Args),
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
    let cli: Cli = match PROGRAM.arguments() {
        Ok(cli) => cli,
        Err(used_wrongly) => return used_wrongly,
    };
    let result = match cli.command {
        Command::Demo(args) => demo::run(args),
        Command::Setup(args) => setup::run(args),
        Command::Simulate(args) => simulate::run(args),
        Command::Receive(args) => receive::run(args),
        Command::Decode(args) => decode::run(args),
        Command::Export(args) => export::run(args),
        Command::Evaluate(args) => evaluate::run(args),
        Command::Experiment(args) => experiment::run(args),
        Command::Send(args) => send::run(args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read our output has seen enough (`gangway ... | head`).
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // A file's own errors name it: what comes bare is from standard output.
            let is_bare = error.chain().next().is_some_and(|first| first.is::<io::Error>());
            let whose = if is_bare { "standard output cannot be written: " } else { "" };
            tell(&format!("{whose}{error:#}"));
            if error.is::<Usage>() { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
}

/// Lines on standard error.
pub(crate) fn tell(text: &str) {
    PROGRAM.say(text);
}

/// A flag that is set when somebody asks for the end. The second time the program ends at once; what is on
/// disk stays.
pub(crate) fn stop_on_signals() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&stop))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&stop)))
            .context("cannot listen to signals")?;
    }
    Ok(stop)
}

/// Whether the error is a write to a pipe that nobody reads any more.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<io::Error>())
        .any(|cause| cause.kind() == io::ErrorKind::BrokenPipe)
}
