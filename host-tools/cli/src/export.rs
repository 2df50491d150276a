//! `gangway export`: a session as a table.

use std::io;
use std::path::PathBuf;

use clap::ValueEnum;
use gangway_store::Rows;

use crate::decode::open;
use crate::tell;

/// Arguments of `gangway export`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// A session's folder, or a capture of one session.
    session: PathBuf,
    /// Format of the table.
    #[arg(long, value_enum, default_value = "csv")]
    format: Format,
    /// The file to write, or - for standard output.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// The circles' centres instead of the poses.
    #[arg(long)]
    markers: bool,
}

/// Formats.
#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// Comma-separated values.
    Csv,
    /// Apache Parquet.
    Parquet,
}

/// Runs `gangway export`.
pub(crate) fn run(args: Args) -> anyhow::Result<()> {
    let rows = Rows::read(&open(&args.session)?, args.markers)?;
    let format = match args.format {
        Format::Csv => gangway_store::Format::Csv,
        Format::Parquet => gangway_store::Format::Parquet,
    };
    if args.out.as_os_str() == "-" {
        rows.write(format, io::stdout())?;
        return Ok(());
    }
    rows.save(format, &args.out)?;
    tell(&format!("{}: {} rows", args.out.display(), rows.len()));
    Ok(())
}
