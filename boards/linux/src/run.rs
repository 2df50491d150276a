//! The whole box but for its pins: frame thread, link thread, and the slow things in the calling thread.

use std::fs::File;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::thread;
use std::time::{Duration, Instant};

use gangway_device::{Camera, CameraErrorKind, Lamp, Vitals};
use gangway_engine::{Board, Command, Engine, Inbox, InboxConsumer, Outbox, OutboxProducer, Step};
use gangway_link::{Carried, Courier, IDLE, Line};
use gangway_setup::Board as BoardSettings;

use crate::notice::{Notice, Notices};
use crate::{
    Faults, Signals, SystemClock, SystemVitals, Watchdog, allocations, clock, log, realtime, signals,
};

/// Stack of the frame thread, bytes: the solver's matrices need a quarter of it. Locked memory is all resident.
pub const FRAME_STACK: usize = 512 << 10;
/// Stack of the link thread, bytes.
const LINK_STACK: usize = 256 << 10;
/// How often the slow things are looked at.
const SLOW: Duration = Duration::from_millis(50);
/// Signs of trouble are looked for once in so many frames.
const LOOK: u64 = 64;
/// Stack of the thread that keeps the log, bytes.
const LOG_STACK: usize = 64 << 10;
/// What is left at the end may take so long to be sent.
const PATIENCE: Duration = Duration::from_secs(3);

/// What the status lamp says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// No rest pose yet, or no targets in sight.
    Waiting = 0,
    /// Frames give motions.
    Measuring = 1,
    /// No camera.
    Fault = 2,
}

/// The box's state, for whoever shows it.
#[derive(Debug, Default)]
pub struct Status(AtomicU8);

impl Status {
    /// The state at the moment.
    pub fn get(&self) -> State {
        match self.0.load(Ordering::Relaxed) {
            1 => State::Measuring,
            2 => State::Fault,
            _ => State::Waiting,
        }
    }

    fn set(&self, state: State) {
        self.0.store(state as u8, Ordering::Relaxed);
    }
}

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

/// A loop with another setup, made ready by a slow thread and taken over by the frame thread between two frames.
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

/// Runs a box until a signal ends it. `slow` is called some times a second in this thread; `say` writes the log.
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
        let done = &is_done;
        let link = thread::Builder::new().name("link".into()).stack_size(LINK_STACK).spawn_scoped(
            scope,
            move || {
                signals::block();
                let _end = StopOnPanic(signals);
                carry(courier, &said, done, signals, say)
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

/// The frame thread: what its loop works on beside the hardware and the queues.
struct Frames<'f> {
    engine: &'f mut Box<Engine>,
    watchdog: Watchdog,
    board: BoardSettings,
    next: &'f Next,
    signals: &'f Signals,
    status: &'f Status,
    notices: Notices,
}

impl Frames<'_> {
    /// The frame loop. The watchdog is fed by its turns, also by those that only wait for a camera.
    fn work<C: Camera<Error = CameraErrorKind>, L: Lamp>(
        mut self,
        hardware: &mut Board<'_, C, SystemClock, impl Vitals, L>,
        inbox: &mut InboxConsumer<'_>,
        outbox: &mut OutboxProducer<'_>,
    ) -> Summary {
        let core = (self.board.core >= 0.0).then_some(self.board.core as usize);
        for refusal in realtime::enter(self.board.realtime_priority, core) {
            self.notices.mark(refusal.split(';').next().unwrap_or_default());
            self.notices.log(refusal);
        }
        self.watchdog.ready();
        let mut summary = Summary::default();
        let mut costs = Costs::default();
        while !self.signals.stops() {
            if let Some(mut next) = self.next.take() {
                next.succeed(self.engine, outbox);
                *self.engine = next;
                self.notices.log("the new setup is taken over".to_owned());
            }
            let before = allocations();
            let step = self.engine.step(hardware, inbox, outbox);
            let asked = allocations().zip(before).map(|(after, before)| after - before);
            self.watchdog.feed();
            match step {
                Step::Measured => self.status.set(State::Measuring),
                Step::Unmeasured => self.status.set(State::Waiting),
                Step::Repeated => {}
                Step::NoFrame(CameraErrorKind::Ended) => break,
                Step::NoFrame(CameraErrorKind::Lost | CameraErrorKind::Stalled) => {
                    summary.losses += 1;
                    self.status.set(State::Fault);
                    continue;
                }
                Step::NoFrame(_) => continue,
            }
            summary.frames += 1;
            summary.poses += u64::from(step == Step::Measured);
            costs.note(summary.frames, asked, &self.notices);
        }
        self.watchdog.stopping();
        self.engine.end(hardware, outbox);
        summary.lost = u64::from(self.engine.records_lost());
        (summary.page_faults, summary.allocations) = (costs.page_faults, costs.allocations);
        summary
    }
}

/// What frames must not cost: page faults and allocations.
#[derive(Default)]
struct Costs {
    faults: Option<Faults>,
    page_faults: i64,
    allocations: Option<u64>,
}

impl Costs {
    /// Notes the allocations of a frame, where they are counted, and looks for page faults now and then. What the first
    /// frames touch for the first time is no trouble; the first trouble is told in the records.
    fn note(&mut self, frames: u64, asked: Option<u64>, notices: &Notices) {
        if frames < LOOK {
            return;
        }
        let Some(faults) = &self.faults else {
            self.faults = Some(Faults::start());
            self.allocations = asked.map(|_| 0);
            return;
        };
        if let (Some(all), Some(asked)) = (&mut self.allocations, asked) {
            if *all == 0 && asked > 0 {
                notices.mark("the frame loop allocates");
            }
            *all += asked;
        }
        if frames.is_multiple_of(LOOK) {
            let count = faults.count();
            if count > 0 && self.page_faults == 0 {
                notices.mark("page faults in the frame loop: memory is short or not locked");
            }
            self.page_faults = count;
        }
    }
}

type Delivered = Result<(Carried, u64), gangway_link::Error>;

/// The link thread: records out, commands and the board's own notices in, until everything is sent.
fn carry(
    mut courier: Courier<'_, Line>,
    said: &Receiver<Notice>,
    done: &AtomicBool,
    signals: &Signals,
    say: &(dyn Fn(&str) + Sync),
) -> Delivered {
    let mut waiting: Option<Command> = None;
    loop {
        let is_done = done.load(Ordering::Acquire);
        loop {
            let command = match waiting
                .take()
                .map_or_else(|| said.try_recv(), |command| Ok(Notice::Command(command)))
            {
                Ok(Notice::Log(sentence)) => {
                    say(&sentence);
                    continue;
                }
                Ok(Notice::Command(command)) => command,
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => break,
            };
            waiting = courier.command(command).err();
            if waiting.is_some() {
                break;
            }
        }
        if is_done {
            break;
        }
        match courier.turn() {
            Ok(true) => {}
            Ok(false) => thread::sleep(IDLE),
            Err(error) => {
                signals.stop();
                return Err(error);
            }
        }
    }
    let unsent = courier.drain(PATIENCE)? as u64;
    Ok((courier.carried(), unsent))
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;
    use std::os::unix::net::UnixDatagram;
    use std::sync::Arc;

    use embedded_hal::digital::{ErrorType, OutputPin};
    use gangway_device::Frame;
    use gangway_engine::Identity;
    use gangway_link::Address;
    use gangway_setup::Setup;

    use super::*;

    /// A camera that never comes.
    struct Away;

    impl Camera for Away {
        type Error = CameraErrorKind;

        fn next_frame(&mut self) -> Result<Frame<'_>, CameraErrorKind> {
            thread::sleep(Duration::from_millis(1));
            Err(CameraErrorKind::Waiting)
        }
    }

    /// A lamp that somebody has lit.
    struct Lit(Arc<AtomicBool>);

    impl ErrorType for Lit {
        type Error = Infallible;
    }

    impl OutputPin for Lit {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0.store(false, Ordering::Release);
            Ok(())
        }
        fn set_high(&mut self) -> Result<(), Infallible> {
            self.0.store(true, Ordering::Release);
            Ok(())
        }
    }

    /// Runs a box without a camera. `slow` is told how many signs of life systemd has heard. Tells whether the lamp still
    /// shines, and all that systemd heard.
    fn play(mut slow: impl FnMut(&Signals, usize)) -> (bool, Vec<String>, thread::Result<Summary>) {
        let place = tempfile::tempdir().unwrap();
        let socket = UnixDatagram::bind(place.path().join("notify")).unwrap();
        socket.set_nonblocking(true).unwrap();
        let is_lit = Arc::new(AtomicBool::new(true));
        let text = include_str!("../../setup/examples/ride.toml");
        let settings = Setup::parse(text, "ride.toml").unwrap().settings();
        let identity = Identity { box_id: 1, boot_id: 2, session_id: 3, firmware: "test" };
        let (signals, status, next) = (Signals::default(), Status::default(), Next::default());
        let (notices, said) = Notices::channel();
        let name = place.path().join("notify");
        let parts = Parts {
            engine: Box::new(Engine::new(settings, identity).unwrap()),
            camera: Away,
            lamps: vec![Lit(Arc::clone(&is_lit))],
            line: Address::File(place.path().join("box.gw")).open().unwrap(),
            log: Some(log::file(place.path(), 3).unwrap()),
            vitals: SystemVitals::new(place.path()),
            watchdog: Watchdog::new(Some(name.as_os_str()), Some(Duration::from_millis(200))),
            board: BoardSettings { realtime_priority: 0, ..BoardSettings::default() },
            next: &next,
            signals: &signals,
            status: &status,
            notices,
            said,
        };
        let mut heard: Vec<String> = Vec::new();
        let hear = |heard: &mut Vec<String>| {
            let mut bytes = [0; 64];
            while let Ok(count) = socket.recv(&mut bytes) {
                heard.push(String::from_utf8_lossy(&bytes[..count]).into_owned());
            }
        };
        let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let turn = || {
                hear(&mut heard);
                slow(&signals, heard.iter().filter(|heard| *heard == "WATCHDOG=1").count());
            };
            run(parts, turn, &|_| {}).unwrap()
        }));
        hear(&mut heard);
        let kept = std::fs::read(place.path().join("0000000000000003.gw")).unwrap();
        assert_eq!(kept, std::fs::read(place.path().join("box.gw")).unwrap(), "the log is what was sent");
        (is_lit.load(Ordering::Acquire), heard, ended)
    }

    #[test]
    fn a_box_without_a_camera_lives_for_its_watchdog_and_ends_dark() {
        let (is_lit, heard, ended) = play(|signals, signs| {
            if signs > 2 {
                signals.stop();
            }
        });
        assert!(!is_lit);
        assert_eq!(heard.first().map(String::as_str), Some("READY=1"));
        assert_eq!(heard.last().map(String::as_str), Some("STOPPING=1"));
        let summary = ended.unwrap();
        assert_eq!((summary.frames, summary.unsent), (0, 0));
        assert!(summary.carried.records > 3, "it announced itself: {summary:?}");
    }

    #[test]
    fn a_panic_in_another_thread_leaves_every_lamp_dark() {
        let (is_lit, _, ended) = play(|_, _| panic!("on purpose"));
        assert!(!is_lit);
        assert!(ended.is_err(), "and is not hidden");
    }
}
