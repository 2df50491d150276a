//! `gangway decode`: a capture, a session or standard input as lines.

use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;

use anyhow::{Context, bail};
use gangway_store::{Session, StoreError, Tally, foreign_version, line, walk};

use crate::tell;

/// Arguments of `gangway decode`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// A capture, a session's folder, or - for standard input.
    #[arg(value_name = "FILE|SESSION|-")]
    what: PathBuf,
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
}

/// Runs `gangway decode`.
pub(crate) fn run(args: Args) -> anyhow::Result<()> {
    let stdout = io::stdout().lock();
    if args.what.as_os_str() == "-" {
        // Line by line: somebody may be watching.
        return decode("standard input", io::stdin().lock(), stdout, args.json);
    }
    let name = args.what.display().to_string();
    let input = if args.what.is_dir() {
        open(&args.what)?.stream()?
    } else {
        File::open(&args.what).with_context(|| format!("cannot open {name}"))?
    };
    decode(&name, input, BufWriter::with_capacity(1 << 16, stdout), args.json)
}

/// Opens a session and says what was cut off, if anything was.
pub(crate) fn open(path: &std::path::Path) -> anyhow::Result<Session> {
    let (session, recovery) = Session::open(path)?;
    if !recovery.is_whole() {
        tell(&format!("{}: {recovery}", path.display()));
    }
    Ok(session)
}

fn decode(name: &str, input: impl Read, mut out: impl Write, json: bool) -> anyhow::Result<()> {
    let mut tally = Tally::default();
    let mut written = Ok(());
    let mut foreign = None;
    let walked = walk(input, |found| {
        tally.note(&found.decoded);
        written = writeln!(out, "{}", line(found, json));
        foreign = foreign_version(&found.decoded);
        if written.is_ok() && foreign.is_none() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    })
    .with_context(|| format!("cannot read {name}"))?;
    written.and_then(|()| out.flush())?;
    if let Some(version) = foreign {
        return Err(StoreError::Foreign { what: name.to_owned(), version }.into());
    }
    tally.wire = walked.counts;
    tally.unfinished = walked.unfinished;
    if walked.counts.records + walked.counts.newer == 0 {
        bail!("{name}: no record in {} bytes; a capture of Gangway is needed", walked.bytes);
    }
    tell(&format!("{name}: {tally}"));
    Ok(())
}
