//! `gangway receive`: from one or several boxes into sessions on disk.

use std::io::{self, Write as _};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::bail;
use gangway_store::{Address, Received, Receiver, StoreError, Until};

use crate::{Usage, stop_on_signals, tell};

/// Arguments of `gangway receive`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Where a box sends: tcp://HOST:PORT (the box listens there), tcp-listen://HOST:PORT (we listen),
    /// udp://HOST:PORT (we listen), serial:DEVICE@BAUD, file:PATH or - for standard input. Once for every
    /// box.
    #[arg(long, required = true, value_name = "ADDRESS")]
    from: Vec<Address>,
    /// Folder that gets a folder of its own for every session.
    #[arg(long, default_value = "rides", value_name = "DIR")]
    into: PathBuf,
    /// End after this many seconds.
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    duration: Option<Duration>,
    /// End when the other side closes, instead of waiting for it to come back.
    #[arg(long)]
    once: bool,
    /// Wait for the next session when the box says that one has ended.
    #[arg(long)]
    stay: bool,
}

/// A time in seconds.
pub(crate) fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.001..=1e8).contains(seconds));
    seconds.map(Duration::from_secs_f64).ok_or("a number of seconds from 0.001 to 1e8 is needed".to_owned())
}

/// Runs `gangway receive`.
pub(crate) fn run(args: Args) -> anyhow::Result<()> {
    for (number, from) in args.from.iter().enumerate() {
        if args.from[..number].contains(from) {
            bail!(Usage(format!("{from} is given twice; one --from for every box")));
        }
    }
    let stop = stop_on_signals()?;
    let until = Until { duration: args.duration, once: args.once, stay: args.stay };
    let open = |from: &Address| Receiver::open(from, &args.into, until);
    let receivers = args.from.iter().map(open).collect::<Result<Vec<_>, _>>()?;
    for (receiver, from) in receivers.iter().zip(&args.from) {
        if let Some(address) = receiver.local_address() {
            tell(&format!("{from}: listening on {address}"));
        }
    }
    let several = receivers.len() > 1;
    let results: Vec<_> = thread::scope(|scope| {
        let start = |receiver: Receiver| {
            scope.spawn(|| {
                // The others may go on for hours: what has failed is told now.
                receive(receiver, &stop).inspect_err(|error| {
                    if several {
                        tell(&error.to_string());
                    }
                })
            })
        };
        let threads: Vec<_> = receivers.into_iter().map(start).collect();
        threads.into_iter().map(|thread| thread.join()).collect()
    });

    let (all, mut sessions, mut failed) = (results.len(), Vec::new(), 0);
    for result in results {
        match result {
            Ok(Ok(received)) => sessions.extend(received),
            Ok(Err(error)) if !several => return Err(error.into()),
            Ok(Err(_)) => failed += 1,
            Err(_) => bail!("a receiving thread failed"),
        }
    }
    if failed > 0 {
        bail!("{failed} of {all} addresses failed; what came from the others is stored");
    }
    if sessions.is_empty() {
        bail!("nothing was received");
    }
    let empty = |one: &Received| one.tally.wire.records + one.tally.wire.newer == 0;
    if sessions.iter().all(empty) {
        bail!(
            "no record was received; a box or a capture of Gangway is needed, and a serial line's right speed"
        );
    }
    Ok(())
}

/// Receives from one address; a line on standard output for every session.
fn receive(receiver: Receiver, stop: &AtomicBool) -> Result<Vec<Received>, StoreError> {
    let say = |what: &str| {
        if !stop.load(Ordering::Relaxed) {
            tell(what);
        }
    };
    let done = |one: &Received| {
        // Nobody reads it; the session is on disk all the same.
        let _ = writeln!(io::stdout(), "{}: {}; {}", one.folder.display(), one.tally, one.why);
    };
    receiver.run(stop, say, done)
}
