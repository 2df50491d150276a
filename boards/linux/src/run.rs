//! The whole box but for its pins: frame thread, link thread, and the slow things in the calling thread.

mod carry;
mod frames;
mod status;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::thread;
use std::time::{Duration, Instant};

use gangway_device::{Camera, CameraErrorKind, Lamp};
use gangway_engine::{Board, Engine, Inbox, Outbox};
use gangway_link::{Carried, Courier, Line};
use gangway_setup::Board as BoardSettings;

use self::carry::carry;
use self::frames::Frames;
pub use self::status::{State, Status};
use crate::notice::{Notice, Notices};
use crate::{Signals, SystemClock, SystemVitals, Watchdog, clock, log, signals};

/// Stack of the frame thread, bytes: the solver's matrices need a quarter of it. Locked memory is all
/// resident.
pub const FRAME_STACK: usize = 512 << 10;
/// Stack of the link thread, bytes.
const LINK_STACK: usize = 256 << 10;
/// How often the slow things are looked at.
const SLOW: Duration = Duration::from_millis(50);
/// Stack of the thread that keeps the log, bytes.
const LOG_STACK: usize = 64 << 10;

/// What came of a session.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Frames that the loop worked through.
    pub frames: u64,
    /// Frames that gave a motion.
    pub poses: u64,
    /// Times that the camera was lost or stalled.
    pub losses: u64,
    /// Records lost to a full outbox.
    pub lost: u64,
    /// Records that nobody took.
    pub unsent: u64,
    /// Page faults of the frame thread after its first frames.
    pub page_faults: i64,
    /// Calls of the allocator while frames were worked on, after the first ones; `None` where nobody counts.
    pub allocations: Option<u64>,
    /// What the link carried.
    pub carried: Carried,
}

/// A loop with another setup, made ready by a slow thread and taken over by the frame thread between two
/// frames.
#[derive(Default)]
pub struct Next(Mutex<Option<Box<Engine>>>);

impl Next {
    /// Puts a loop there; it takes over before the next frame.
    pub fn give(&self, engine: Box<Engine>) {
        if let Ok(mut next) = self.0.lock() {
            *next = Some(engine);
        }
    }

    /// Never waits: what is just being put there is taken one frame later.
    fn take(&self) -> Option<Box<Engine>> {
        self.0.try_lock().ok()?.take()
    }
}

/// The parts of a box.
pub struct Parts<'p, C, L> {
    /// The frame loop's state.
    pub engine: Box<Engine>,
    /// Where frames come from.
    pub camera: C,
    /// The lamps of lit targets, dark at the end.
    pub lamps: Vec<L>,
    /// Where records go.
    pub line: Line,
    /// The ride on the board's own disk, if it is to be kept.
    pub log: Option<(PathBuf, File)>,
    /// The board's condition.
    pub vitals: SystemVitals,
    /// systemd.
    pub watchdog: Watchdog,
    /// Pins and scheduling.
    pub board: BoardSettings,
    /// A loop that is to take over.
    pub next: &'p Next,
    /// What the signals ask.
    pub signals: &'p Signals,
    /// The state that a lamp shows.
    pub status: &'p Status,
    /// What the parts have to say.
    pub notices: Notices,
    /// The other end of `notices`.
    pub said: Receiver<Notice>,
}

/// Runs a box until a signal ends it. `slow` is called some times a second in this thread; `say` writes the
/// log.
///
/// A panic of the frame loop or of the link leaves every lamp dark before it goes on.
///
/// # Errors
/// The link's, where it fails for good.
pub fn run<C, L>(
    parts: Parts<'_, C, L>,
    mut slow: impl FnMut(),
    say: &(dyn Fn(&str) + Sync),
) -> Result<Summary, gangway_link::Error>
where
    C: Camera<Error = CameraErrorKind> + Send,
    L: Lamp + Send,
{
    let Parts {
        mut engine,
        mut camera,
        mut lamps,
        line,
        log,
        vitals,
        watchdog,
        board,
        next,
        signals,
        status,
        notices,
        said,
    } = parts;
    let (mut outbox, mut inbox) = (Box::new(Outbox::new()), Inbox::new());
    let ((mut outbox, taken), (given, mut inbox)) = (outbox.split(), inbox.split());
    let is_done = AtomicBool::new(false);
    let readings = vitals.clone();
    readings.refresh();
    let (worked, carried) = thread::scope(|scope| {
        let mut courier = Courier::new(taken, given, line).thinning().timing(clock::monotonic_ns);
        if let Some((path, file)) = log {
            let (mut log, writer) = log::open(file, &path, &notices);
            let thread = thread::Builder::new().name("log".into()).stack_size(LOG_STACK);
            match thread.spawn_scoped(scope, || {
                signals::block();
                writer.run();
            }) {
                Ok(_) => courier = courier.keeping(move |record| log.put(record)),
                Err(error) => say(&format!("there is no log: {error}")),
            }
        }
        let (done, counted) = (&is_done, notices.clone());
        let link = thread::Builder::new().name("link".into()).stack_size(LINK_STACK).spawn_scoped(
            scope,
            move || {
                signals::block();
                let _end = StopOnPanic(signals);
                carry(courier, &said, &counted, done, signals, say)
            },
        );
        let frames =
            thread::Builder::new().name("frames".into()).stack_size(FRAME_STACK).spawn_scoped(scope, || {
                signals::block();
                let mut hardware = Board {
                    camera: &mut camera,
                    clock: &SystemClock,
                    vitals: &mut vitals.clone(),
                    lamps: &mut lamps,
                };
                let _end = End { done, signals };
                let engine = &mut engine;
                Frames { engine, watchdog, board, next, signals, status, notices }.work(
                    &mut hardware,
                    &mut inbox,
                    &mut outbox,
                )
            });
        let _end = StopOnPanic(signals);
        if frames.is_err() {
            done.store(true, Ordering::Release);
        }
        let mut refreshed = Instant::now();
        while !done.load(Ordering::Acquire) {
            thread::sleep(SLOW);
            if refreshed.elapsed() > Duration::from_secs(1) {
                readings.refresh();
                refreshed = Instant::now();
            }
            slow();
        }
        (frames.map(thread::ScopedJoinHandle::join), link.map(thread::ScopedJoinHandle::join))
    });
    // Whatever happened: nothing shines on when the box does not measure.
    for lamp in &mut lamps {
        let _ = lamp.set_lit(false);
    }
    let mut summary = match worked {
        Ok(Ok(summary)) => summary,
        Ok(Err(panic)) => std::panic::resume_unwind(panic),
        Err(error) => panic!("no thread can be started: {error}"),
    };
    match carried {
        Ok(Ok(carried)) => (summary.carried, summary.unsent) = carried?,
        Ok(Err(panic)) => std::panic::resume_unwind(panic),
        Err(error) => panic!("no thread can be started: {error}"),
    }
    Ok(summary)
}

/// Ends the other threads when the frame thread ends, in whatever way.
struct End<'s> {
    done: &'s AtomicBool,
    signals: &'s Signals,
}

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.signals.stop();
        self.done.store(true, Ordering::Release);
    }
}

/// A thread that panics ends the session, lamps and all.
struct StopOnPanic<'s>(&'s Signals);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.stop();
        }
    }
}
