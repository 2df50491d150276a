//! `gangway-pi`: the box on a Raspberry Pi, from the camera to the line.

mod camera;
mod check;
#[cfg(any(test, feature = "libcamera"))]
mod libcamera;
mod pins;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use clap::{Parser, Subcommand};
use gangway_engine::{Engine, Identity, Settings};
use gangway_link::{Address, Program};
use gangway_linux::camera::Recovering;
use gangway_linux::run::{self, Next, Parts, Summary};
use gangway_linux::{Notices, Signals, Status, SystemVitals, Watchdog, lock_memory, log};
use gangway_setup::Setup;

use crate::camera::Device;
use crate::pins::Pins;

/// Debug builds count the allocations of the frame loop, which makes none.
#[cfg(any(debug_assertions, feature = "proof"))]
#[global_allocator]
static ALLOCATOR: gangway_linux::Counting = gangway_linux::Counting;

const PROGRAM: Program = Program::new("gangway-pi");

/// Measures how two carbodies move against each other.
#[derive(Parser)]
#[command(name = "gangway-pi", version, max_term_width = 100)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Measure until SIGTERM or SIGINT; SIGHUP reads the setup again.
    Run {
        #[command(flatten)]
        place: Place,
        /// Serial number of the box [default: the board's].
        #[arg(long, value_name = "N")]
        box_id: Option<u64>,
    },
    /// Say in plain words what works on this board: camera, pins, line, clock, disk, rights.
    Check {
        #[command(flatten)]
        place: Place,
    },
}

#[derive(clap::Args)]
struct Place {
    /// The setup of the camera and its targets.
    #[arg(long, value_name = "FILE", default_value = "/etc/gangway/setup.toml")]
    setup: PathBuf,
    /// Where the records go: tcp://HOST:PORT (listen there), tcp-connect://HOST:PORT, udp://HOST:PORT,
    /// serial:DEVICE@BAUD or file:PATH.
    #[arg(long, value_name = "ADDRESS", value_parser = Address::parse, default_value = "tcp://0.0.0.0:7007")]
    to: Address,
}

fn main() -> ExitCode {
    PROGRAM.run(|args: Args| match &args.command {
        Command::Run { place, box_id } => measure(place, *box_id).map(|summary| {
            PROGRAM.print(&told(&summary, &place.to));
            true
        }),
        Command::Check { place } => check::check(&place.setup, &place.to, &|line| PROGRAM.print(line)),
    })
}

fn told(summary: &Summary, to: &Address) -> String {
    let Summary { frames, poses, losses, lost, unsent, page_faults, allocations, carried } = summary;
    let allocations = allocations.map_or(String::new(), |count| format!(" and {count} allocations"));
    format!(
        "{frames} frames, {poses} poses, {} records, {lost} lost, {} thinned, {unsent} not sent; camera lost {losses} times; \
         {page_faults} page faults{allocations} in the loop; to {to}",
        carried.records, carried.thinned
    )
}

fn measure(place: &Place, box_id: Option<u64>) -> anyhow::Result<Summary> {
    let setup = Setup::read(&place.setup)?;
    let settings = setup.settings();
    let parts = setup.parts();
    let signals = Signals::take_over().context("signals cannot be taken over")?;
    let (notices, said) = Notices::channel();
    if let Err(refusal) = lock_memory() {
        notices.mark(refusal.split(';').next().unwrap_or_default());
        notices.log(refusal);
    }
    // Dark before anything else can fail: a box that was killed may have left them lit.
    let mut pins = Pins::take(&parts.board, notices.clone())?;
    let camera = Device::new(parts, &settings, &notices)?;
    let mut camera = Recovering::new(camera, settings.rate_hz, notices.clone());
    camera.start()?;
    let box_id = box_id.or_else(serial_number).unwrap_or(0);
    let identity = gangway_link::identity(box_id, concat!("gangway-pi ", env!("CARGO_PKG_VERSION")));
    let engine = engine(settings, identity)?;
    let line = place.to.open()?;
    PROGRAM.say(&format!("measuring to {line}"));
    let (status, next) = (Status::default(), Next::default());
    let log = match parts.board.log_dir.as_str() {
        "" => None,
        folder => Some(log::file(Path::new(folder), identity.session_id).map_err(anyhow::Error::msg)),
    };
    // A card that takes no log is no reason not to measure.
    let log = log.and_then(|made| made.inspect_err(|refusal| PROGRAM.say(&format!("{refusal:#}"))).ok());
    let disk = disk(parts, &place.to);
    let lamps = pins.lamps();
    let parts = Parts {
        engine,
        camera,
        lamps,
        line,
        log,
        vitals: SystemVitals::new(&disk),
        watchdog: Watchdog::from_environment(),
        board: parts.board.clone(),
        next: &next,
        signals: &signals,
        status: &status,
        notices,
        said,
    };
    let slow = || {
        pins.turn(status.get());
        if signals.takes_reload() {
            match reload(&place.setup, &setup, identity) {
                Ok(engine) => next.give(engine),
                Err(error) => PROGRAM.say(&format!("the setup stays as it was: {error:#}")),
            }
        }
    };
    Ok(run::run(parts, slow, &|line| PROGRAM.say(line))?)
}

/// Where the records go that stay on the board: its free space is what counts.
fn disk(parts: &gangway_setup::Parts, to: &Address) -> PathBuf {
    match (parts.board.log_dir.as_str(), to) {
        ("", Address::File(path)) => path.parent().unwrap_or(Path::new(".")).to_owned(),
        ("", _) => PathBuf::from("/"),
        (folder, _) => PathBuf::from(folder),
    }
}

fn engine(settings: Settings, identity: Identity) -> anyhow::Result<Box<Engine>> {
    let engine = Engine::new(settings, identity).map(Box::new);
    engine.map_err(|error| {
        anyhow::anyhow!("the setup gives no pose, for {error}; correct its seeds or circles")
    })
}

/// The setup once more, as far as it can change while the camera runs on.
fn reload(file: &Path, before: &Setup, identity: Identity) -> anyhow::Result<Box<Engine>> {
    #[cfg(feature = "proof")]
    assert!(file.exists(), "{} is gone: on purpose, to see what a panic leaves behind", file.display());
    let setup = Setup::read(file)?;
    let (new, old) = (setup.parts(), before.parts());
    let picture = |parts: &gangway_setup::Parts| {
        let camera = parts.camera;
        (camera.width_px, camera.height_px, camera.rate_hz, parts.capture.clone(), parts.board.clone())
    };
    anyhow::ensure!(
        picture(new) == picture(old),
        "size, rate, [capture] and [board] need a restart; systemctl restart gangway"
    );
    engine(setup.settings(), identity)
}

/// The number that every Raspberry Pi is made with.
fn serial_number() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/device-tree/serial-number").ok()?;
    u64::from_str_radix(text.trim_end_matches('\0').trim(), 16).ok()
}
