//! `gangway-bench`: a recording through the box's frame loop, to wherever a box can send.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Parser;
use gangway_bench::{Failure, Faults, Pace, Play, Times, check, measure, run, source};
use gangway_engine::{Identity, Settings};
use gangway_link::{Address, Line, Program};
use gangway_setup::Setup;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

const PROGRAM: Program = Program::new("gangway-bench");

/// Plays a recording through the frame loop of the box and sends what it measures.
///
/// As fast as it goes, nothing is lost: a frame waits until the receiver has taken what came before. With
/// --real-time nothing waits, and what the line does not take is lost and counted, as on a box; frames that
/// the loop comes late for are measured late, never left out.
///
/// Frames are numbered from 0, whatever their files are called, and a frame's time is its number over the rate
/// that the recording names, or else the setup's; --times gives others.
#[derive(Parser)]
#[command(name = "gangway-bench", version, max_term_width = 100)]
struct Args {
    /// The setup of the camera and its targets.
    #[arg(long, value_name = "FILE")]
    setup: PathBuf,
    /// The recording: a Y4M file, a directory of PNG or PGM files (in the order of the numbers in their
    /// names), any other video through an installed ffmpeg, or - for Y4M on standard input.
    #[arg(long, value_name = "PATH")]
    frames: PathBuf,
    /// Where the records go: tcp://HOST:PORT (listen there), tcp-connect://HOST:PORT, udp://HOST:PORT,
    /// serial:DEVICE@BAUD (115200 if left out) or file:PATH (a new file).
    #[arg(long, value_name = "ADDRESS", value_parser = Address::parse, required_unless_present = "measure")]
    to: Option<Address>,
    /// Go on in a file that exists, behind what it holds.
    #[arg(long)]
    append: bool,
    /// Play at the recorded rate instead of as fast as it goes.
    #[arg(long)]
    real_time: bool,
    /// Numbers and times of the frames: a CSV file with the columns frame and time_ns, one row a frame.
    #[arg(long, value_name = "FILE")]
    times: Option<PathBuf>,
    /// Play the recording so many times, with numbers and times running on.
    #[arg(
        long, value_name = "N", default_value_t = 1,
        value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true
    )]
    repeat: u32,
    /// Play so many frames at most.
    #[arg(
        long, value_name = "N",
        value_parser = clap::value_parser!(u64).range(1..), allow_negative_numbers = true
    )]
    limit: Option<u64>,
    /// Serial number of the box. Sessions show this and the next two in hexadecimal digits; so written, they
    /// begin with 0x.
    #[arg(long, value_name = "N", default_value = "0", value_parser = id)]
    box_id: u64,
    /// Number of the boot [default: this machine's].
    #[arg(long, value_name = "N", value_parser = id)]
    boot_id: Option<u64>,
    /// Number of the session [default: the time now, ns].
    #[arg(long, value_name = "N", value_parser = id)]
    session_id: Option<u64>,
    /// Give up when nobody took anything for so long [default: wait for ever].
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    wait: Option<Duration>,
    /// Faults, as NAME:RATE,... with rates from 0 to 1. Of the camera, a share of the frames: drop (never
    /// delivered), repeat (delivered twice), torn (reported as corrupt), dark (black), late (after a stall).
    /// Of the link, a share of the records: link-stall (the line takes nothing for a while), link-drop (the
    /// connection is lost within the record), link-garble (a byte is changed).
    #[arg(long, value_name = "LIST", default_value = "", hide_default_value = true)]
    fault: Faults,
    /// Which frames and records the faults hit: the same seed, the same faults.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Measure the loop alone: frames from memory, records to nowhere.
    #[arg(long, conflicts_with_all = ["to", "append", "real_time", "times", "fault", "wait"])]
    measure: bool,
}

/// A number that names something: decimal, or hexadecimal behind `0x`.
fn id(text: &str) -> Result<u64, String> {
    let number = match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16),
        None => text.parse(),
    };
    number.map_err(|_| format!("give a whole number from 0 to {}, or 0x and hexadecimal digits", u64::MAX))
}

fn seconds(text: &str) -> Result<Duration, String> {
    let wrong = || "give a number of seconds from 0 to 1000000".to_owned();
    let seconds = text.parse().ok().filter(|seconds| (0.0..=1e6).contains(seconds)).ok_or_else(wrong)?;
    Duration::try_from_secs_f64(seconds).map_err(|_| wrong())
}

fn main() -> ExitCode {
    PROGRAM.run(|args| play(&args).map(|()| true))
}

fn play(args: &Args) -> anyhow::Result<()> {
    let settings = Setup::read(&args.setup)?.settings();
    let identity = identity(args);
    let times = args.times.as_deref().map(Times::read).transpose()?;
    let frames = source::open(&args.frames)?;
    if args.measure {
        let measured = measure(&settings, frames, identity, args.limit, args.repeat)?;
        PROGRAM.print(&measured.to_string());
        return Ok(());
    }
    let play = Play {
        pace: if args.real_time { Pace::RealTime } else { Pace::AsFast },
        passes: args.repeat,
        limit: args.limit,
        times,
        faults: args.fault,
        seed: args.seed,
        wait: args.wait,
        disk: match &args.to {
            Some(Address::File(path)) => path.clone(),
            _ => PathBuf::from("."),
        },
        ..Play::new(identity)
    };
    let Some(address) = &args.to else { return Ok(()) };
    // A capture is not begun, nor a receiver greeted, for frames that cannot be measured.
    check(&settings, frames.shape(), identity)?;
    let line = if args.append { address.open() } else { address.open_new() }?;
    send(&settings, frames, line, &play)
}

fn send(
    settings: &Settings,
    frames: Box<dyn source::FrameSource>,
    line: Line,
    play: &Play,
) -> anyhow::Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // The first ends properly, a second one at once.
        flag::register_conditional_default(signal, Arc::clone(&stop))?;
        flag::register(signal, Arc::clone(&stop))?;
    }
    let line = if play.pace == Pace::AsFast { line.lossless() } else { line };
    let place = line.to_string();
    if matches!(line, Line::Server(_)) {
        PROGRAM.say(&format!("listening on {place}"));
    }
    match run(settings, frames, line, play, &stop, &|text| PROGRAM.say(text)) {
        Ok(summary) => {
            let ended = if summary.interrupted { "interrupted: " } else { "" };
            PROGRAM.print(&format!("{ended}{summary}; to {place}"));
            if summary.frames > 0 && summary.poses == 0 {
                PROGRAM.say(
                    "no frame has a motion: a rest pose takes at least 10 frames at rest with the targets in sight - \
                     at the setup's seeds_px, or 5 frames more in which they are looked for; the events (gangway \
                     decode) say what was lost",
                );
            }
            Ok(())
        }
        Err(Failure { error, summary }) => {
            if summary.frames > 0 {
                PROGRAM.print(&format!("{summary}; to {place}"));
            }
            Err(error.into())
        }
    }
}

fn identity(args: &Args) -> Identity {
    let mut identity =
        gangway_link::identity(args.box_id, concat!("gangway-bench ", env!("CARGO_PKG_VERSION")));
    identity.boot_id = args.boot_id.unwrap_or(identity.boot_id);
    identity.session_id = args.session_id.unwrap_or(identity.session_id);
    identity
}
