//! `gangway send`: commands to the box.

use std::io::{self, Write as _};
use std::time::Duration;

use clap::Subcommand;
use gangway_store::{Address, Answer, Command, MAX_MARK, send};

use crate::receive::seconds;

/// Arguments of `gangway send`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The box: tcp://HOST:PORT or serial:DEVICE@BAUD.
    #[arg(long, value_name = "ADDRESS", value_parser = of_a_box)]
    to: Address,
    /// Longest wait for the answer, seconds.
    #[arg(
        long, value_name = "SECONDS", default_value = "5",
        value_parser = seconds, allow_negative_numbers = true, global = true
    )]
    wait: Duration,
    #[command(subcommand)]
    command: What,
}

#[derive(Subcommand)]
enum What {
    /// Wait for rest again and set a new rest pose.
    SetRest,
    /// Put a mark into the records.
    Mark {
        /// Its text, at most 64 bytes.
        #[arg(value_parser = mark)]
        text: String,
    },
    /// Ask for the box's clock.
    Ping,
}

/// An address that takes commands.
fn of_a_box(text: &str) -> Result<Address, String> {
    match text.parse() {
        Ok(to @ (Address::Tcp(_) | Address::Serial { .. })) => Ok(to),
        Err(error) if text.starts_with("tcp://") || text.starts_with("serial:") => Err(error.to_string()),
        // The address's own complaint would name those that only bring records.
        _ => Err("commands go to tcp://HOST:PORT or serial:DEVICE@BAUD".to_owned()),
    }
}

fn mark(text: &str) -> Result<String, String> {
    if text.len() > MAX_MARK {
        return Err(format!("a mark has at most {MAX_MARK} bytes, this one has {}", text.len()));
    }
    Ok(text.to_owned())
}

/// Runs `gangway send`.
pub(crate) fn run(args: Args) -> anyhow::Result<()> {
    let command = match args.command {
        What::SetRest => Command::SetRest,
        What::Mark { text } => Command::Mark(text),
        What::Ping => Command::Ping,
    };
    let said = match send(&args.to, &command, args.wait)? {
        Answer::Taken { frame, time_ns } => {
            format!("taken at frame {frame}, {:.3} s of the box's clock", time_ns as f64 * 1e-9)
        }
        Answer::Pong { host_time_ns, time_ns, round_trip } => format!(
            "box clock {time_ns} ns, host clock {host_time_ns} ns since 1970 (UTC), round trip {:.3} ms",
            round_trip.as_secs_f64() * 1e3
        ),
    };
    writeln!(io::stdout(), "{said}")?;
    Ok(())
}
