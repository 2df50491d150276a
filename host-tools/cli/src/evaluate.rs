//! `gangway evaluate`: a session against the truth, as a table, as JSON and as pictures.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use gangway_report::sync::{Recorder, synchronise};
use gangway_report::{Reference, Sample};
use gangway_store::Session;

/// Arguments of `gangway evaluate`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The session's folder, or a capture.
    session: PathBuf,
    /// The truth: a CSV file with the columns frame, dx_mm, dy_mm, dz_mm, roll_deg, pitch_deg, yaw_deg.
    /// Without it, the motion is described on its own.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// The truth is a recorder's, of another rate and clock: its first column is time_s, time_ms, time_us or
    /// time_ns instead of frame. Its clock is found from the motion, and the offset is told with its
    /// uncertainty.
    #[arg(long, requires = "truth")]
    sync: bool,
    /// Print JSON instead of the table.
    #[arg(long)]
    json: bool,
    /// Folder for table and pictures [default: `evaluation` in the session's folder, NAME.evaluation beside
    /// a capture NAME.gw].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Runs `gangway evaluate`.
pub(crate) fn run(args: Args) -> anyhow::Result<()> {
    // Read before the session: a mistake in it is told at once.
    let (recorder, reference) = match args.truth.as_deref() {
        Some(path) if args.sync => (Some(Recorder::read(path)?), None),
        path => (None, path.map(Reference::read).transpose()?),
    };
    let (session, recovery) = Session::open(&args.session)?;
    if !recovery.is_whole() {
        crate::tell(&format!("{}: {recovery}", args.session.display()));
    }
    let samples: Vec<Sample> = session.poses()?.iter().map(Sample::from).collect();
    let name = args.session.display().to_string();
    let (alignment, reference) = match recorder {
        Some(recorder) => {
            let (alignment, reference) = synchronise(&name, &samples, &recorder)?;
            (Some(alignment), Some(reference))
        }
        None => (None, reference),
    };
    let mut evaluation = gangway_report::evaluate(&name, &samples, reference.as_ref())?;
    evaluation.sync = alignment;

    // Printed before anything is written: a full disk does not cost the result.
    let mut out = io::stdout().lock();
    if args.json {
        writeln!(out, "{}", evaluation.to_json())?;
    } else {
        write!(out, "{}", evaluation.table())?;
    }
    let folder = args.out.unwrap_or_else(|| default_folder(&args.session));
    for path in evaluation.write_all(&folder)? {
        // Standard output is the JSON's alone.
        crate::tell(&format!("wrote {}", path.display()));
    }
    Ok(())
}

/// In the session's folder; beside a capture.
fn default_folder(session: &Path) -> PathBuf {
    if session.is_dir() { session.join("evaluation") } else { session.with_extension("evaluation") }
}
