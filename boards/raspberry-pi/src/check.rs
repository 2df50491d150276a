//! `gangway-pi check`: what works on this board and what does not, one line each.

use std::path::Path;
use std::time::Duration;

use gangway_device::Clock as _;
use gangway_device::Vitals as _;
use gangway_engine::{Engine, Identity};
use gangway_link::Address;
use gangway_linux::camera::{Source as _, Stream, TimeSource};
use gangway_linux::{Notice, Notices, SystemClock, SystemVitals, enter, lock_memory, log};
use gangway_setup::{Board, Setup};

use crate::camera::Device;
use crate::pins::Pins;

/// Pictures that are waited for.
const PICTURES: u32 = 25;
/// The first one may take so long.
const PATIENCE: Duration = Duration::from_secs(2);
/// Less free space than this is worth a word, bytes: an hour of records takes some 60 MB.
const LITTLE: u64 = 200_000_000;

/// Checks everything; true when all is well.
pub(crate) fn check(file: &Path, to: &Address, print: &dyn Fn(&str)) -> anyhow::Result<bool> {
    let mut all = true;
    let mut tell = |what: &str, found: Result<String, String>| {
        all &= found.is_ok();
        match found {
            Ok(text) => print(&format!("ok    {what}: {text}")),
            Err(text) => print(&format!("no    {what}: {text}")),
        }
    };
    let setup = Setup::read(file)?;
    let (parts, settings) = (setup.parts(), setup.settings());
    let identity = Identity { box_id: 0, boot_id: 0, session_id: 0, firmware: "" };
    let (circles, targets) = (settings.circles.len(), parts.targets.len());
    let engine = Engine::new(settings.clone(), identity).map(Box::new);
    tell(
        "setup",
        match engine {
            Ok(_) => Ok(format!("{circles} circles on {targets} targets")),
            Err(error) => Err(format!("the setup gives no pose, for {error}")),
        },
    );

    let (notices, said) = Notices::channel();
    let mut camera = Device::new(parts, &settings, &notices)?;
    match camera.open() {
        Err(error) => tell("camera", Err(error.sentence)),
        Ok(mut stream) => {
            tell("camera", Ok(format!("{}, {}", parts.capture.device, stream.describe())));
            tell("controls", Ok(stream.describe_controls()));
            tell("frames", frames(&mut stream, settings.rate_hz));
        }
    }
    tell(
        "pins",
        match Pins::take(&parts.board, notices) {
            Ok(_) => Ok(pins(&parts.board)),
            Err(error) => Err(format!("{error:#}")),
        },
    );
    tell("line", to.open().map(|line| line.to_string()).map_err(|error| error.to_string()));
    tell(
        "clock",
        match SystemClock.utc_offset_ns() {
            Some((_, uncertainty)) => Ok(format!("UTC is known to {:.1} ms", uncertainty as f64 / 1e6)),
            None => {
                Err("UTC is not known; install chrony or systemd-timesyncd to have records with a date"
                    .into())
            }
        },
    );
    if !parts.board.log_dir.is_empty() {
        let folder = Path::new(&parts.board.log_dir);
        let made = log::file(folder, 0);
        // An empty file of session 0 is of this check.
        if let Ok((path, _)) = &made {
            let _ = std::fs::remove_file(path);
        }
        tell("log", made.map(|_| format!("every ride is kept in {}", folder.display())));
    }
    let mut vitals = SystemVitals::new(&crate::disk(parts, to));
    vitals.refresh();
    let reading = vitals.read();
    tell(
        "disk",
        match reading.free_bytes {
            Some(free) if free >= LITTLE => Ok(format!("{} MB free", free / 1_000_000)),
            Some(free) => Err(format!("only {} MB free; make room", free / 1_000_000)),
            None => Err("its free space is not known".to_owned()),
        },
    );
    let rights = std::thread::spawn({
        let (priority, core) = (parts.board.realtime_priority, parts.board.core);
        move || enter(priority, (core >= 0.0).then_some(core as usize))
    });
    let mut refusals = rights.join().unwrap_or_default();
    refusals.extend(lock_memory().err());
    tell(
        "real time",
        match refusals.is_empty() {
            true => Ok("memory locked, frame thread ahead of all others".to_owned()),
            false => Err(refusals.join("; ")),
        },
    );
    for notice in said.try_iter() {
        if let Notice::Command(gangway_engine::Command::Mark(text)) = notice {
            print(&format!("note  {text}"));
        }
    }
    Ok(all)
}

/// The pins that the setup names and what they are for.
fn pins(board: &Board) -> String {
    let lamps = board.lamp_pins.iter().map(|pin| ("lamp", *pin));
    let others = [("status", board.status_pin), ("button", board.button_pin), ("sync", board.sync_pin)];
    let named: Vec<String> =
        lamps.chain(others).filter(|(_, pin)| *pin > 0).map(|(what, pin)| format!("{what} {pin}")).collect();
    if named.is_empty() { "the setup names none".to_owned() } else { named.join(", ") }
}

/// Waits for some pictures: their rate, the gaps between them, and what their times mean.
fn frames(stream: &mut impl Stream, rate_hz: f64) -> Result<String, String> {
    let mut stamps = Vec::new();
    for _ in 0..PICTURES {
        match stream.wait(PATIENCE) {
            Ok(stamp) => stamps.push(stamp),
            Err(error) => {
                let (count, seconds) = (stamps.len(), PATIENCE.as_secs());
                return Err(format!(
                    "after {count} of {PICTURES} pictures {error} ({seconds} s); check cable and supply"
                ));
            }
        }
    }
    let (Some(first), Some(last)) = (stamps.first(), stamps.last()) else { return Err("none came".into()) };
    let count = last.sequence.wrapping_sub(first.sequence);
    let rate = f64::from(count) * 1e9 / last.time_ns.saturating_sub(first.time_ns).max(1) as f64;
    let missed = count.saturating_sub(PICTURES - 1);
    let source = match first.source {
        TimeSource::StartOfExposure => "times of the start of exposure",
        TimeSource::StartOfReadout => "times of the start of the readout",
        TimeSource::EndOfFrame => "times of the end of the frame",
        TimeSource::Arrival => "times of arrival",
    };
    let text = format!("{rate:.2} a second, {missed} missed, {source}");
    if (rate / rate_hz - 1.0).abs() > 0.02 {
        Err(format!("{text}; the setup says {rate_hz}"))
    } else {
        Ok(text)
    }
}
