//! Plays a source through the frame loop into a link, to its end.

use std::fmt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use gangway_device::{Camera, CameraErrorKind, Exposure, Frame, Link};
use gangway_engine::{
    Board, Engine, Identity, Inbox, InboxConsumer, MAX_RECORDS_PER_STEP, Outbox, OutboxProducer, Settings,
    Step,
};
use gangway_link::{Carried, Courier, IDLE};

use crate::clock::{DiskVitals, RecordingClock};
use crate::faults::{Faults, FaultyCamera, FaultyLink};
use crate::lamp::FakeLamp;
use crate::loop_times::LoopTimes;
use crate::recording::{Pace, Recording, Timing};
use crate::source::{FrameSource, Shape, SourceError};
use crate::times::{Times, TimesError};

/// Rest while the outbox has no room.
const GLANCE: Duration = Duration::from_micros(200);
/// Nobody connected for so long is worth a word.
const SILENCE: Duration = Duration::from_millis(300);
/// What is left after an interruption may take so long without moving.
const HASTE: Duration = Duration::from_secs(1);

/// How to play.
#[derive(Clone, Debug)]
pub struct Play {
    /// Who the box is.
    pub identity: Identity,
    /// As fast as it goes or at the recorded rate.
    pub pace: Pace,
    /// How often the recording is played, at least once.
    pub passes: u32,
    /// Frames to play at most.
    pub limit: Option<u64>,
    /// Numbers and times of the frames; without them, numbers count from 0 and time is number over rate.
    pub times: Option<Times>,
    /// Faults.
    pub faults: Faults,
    /// Which frames and records the faults hit.
    pub seed: u64,
    /// How long nothing may move while records wait for a receiver; without it, for ever.
    pub wait: Option<Duration>,
    /// Where free space is read, for the health records.
    pub disk: PathBuf,
}

impl Play {
    /// Plays once, as fast as it goes, without faults, waiting for ever.
    pub fn new(identity: Identity) -> Self {
        Self {
            identity,
            pace: Pace::AsFast,
            passes: 1,
            limit: None,
            times: None,
            faults: Faults::default(),
            seed: 0,
            wait: None,
            disk: PathBuf::from("."),
        }
    }
}

/// What came of a recording.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Frames that the loop worked through.
    pub frames: u64,
    /// Frames that gave a motion.
    pub poses: u64,
    /// Times that the camera had no good frame.
    pub no_frame: u64,
    /// Frames delivered later than their time, at the recorded rate.
    pub late: u64,
    /// Records lost to a full outbox.
    pub lost: u64,
    /// Records that waited in vain for a receiver.
    pub unsent: u64,
    /// What the link carried.
    pub carried: Carried,
    /// From a frame's arrival to the end of its step.
    pub times: LoopTimes,
    /// Somebody asked for the end before the recording's.
    pub interrupted: bool,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let Self { frames, poses, carried, lost, times, .. } = self;
        let (median, most) = (ms(times.median()), ms(times.most()));
        write!(f, "{frames} frames, {poses} poses, {} records, {lost} lost", carried.records)?;
        if self.unsent > 0 {
            write!(f, ", {} not sent", self.unsent)?;
        }
        if carried.cut > 0 {
            write!(f, ", {} cut", carried.cut)?;
        }
        if self.late > 0 {
            write!(f, ", {} frames late", self.late)?;
        }
        write!(f, "; {median:.2} ms a frame (median), {most:.2} ms at most")
    }
}

/// What can go wrong with a run, each in one sentence.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The recording.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The times of its frames.
    #[error(transparent)]
    Times(#[from] TimesError),
    /// Frames of another size than the setup's.
    #[error(
        "the frames are {} x {}, but the setup says {} x {}; give the setup of the camera that took them",
        found.0, found.1, setup.0, setup.1
    )]
    Size {
        /// Size of the frames.
        found: (u16, u16),
        /// Size in the setup.
        setup: (u16, u16),
    },
    /// The seeds give no pose.
    #[error(
        "the setup gives no pose, for {why}; seeds must be at least 4, not on one line, and at their circles"
    )]
    Seeds {
        /// What the solver said.
        why: String,
    },
    /// The link.
    #[error(transparent)]
    Link(#[from] gangway_link::Error),
    /// Nobody took the records.
    #[error("nobody took the records on {line} for {seconds} s; {records} of them were not sent")]
    Unsent {
        /// The link.
        line: String,
        /// The patience given.
        seconds: f64,
        /// Records left.
        records: u64,
    },
    /// Too much for the memory.
    #[error("{frames} frames take more than {gib} GiB of memory; play fewer of them with --limit")]
    Memory {
        /// Frames read so far.
        frames: usize,
        /// The bound.
        gib: u64,
    },
}

/// An error, and what was done before it.
#[derive(Debug, thiserror::Error)]
#[error("{error}")]
pub struct Failure {
    /// What went wrong.
    #[source]
    pub error: BenchError,
    /// What was measured and sent all the same.
    pub summary: Box<Summary>,
}

impl From<BenchError> for Failure {
    fn from(error: BenchError) -> Self {
        Self { error, summary: Box::default() }
    }
}

/// Stack on which the engine is made, bytes: without optimisation its half megabyte is moved several times on
/// the way into its box, which is more than a thread usually has.
const MAKING_STACK: usize = 16 << 20;

/// The loop's state, ready for the first frame.
///
/// # Errors
/// Frames of another size than the setup's, seeds without a pose.
pub(crate) fn prepare(
    settings: &Settings,
    shape: Shape,
    identity: Identity,
) -> Result<Box<Engine>, BenchError> {
    let found = (shape.width, shape.height);
    if found != settings.picture {
        return Err(BenchError::Size { found, setup: settings.picture });
    }
    let make = || Engine::new(settings.clone(), identity).map(Box::new);
    let engine = thread::scope(|scope| {
        match thread::Builder::new().stack_size(MAKING_STACK).spawn_scoped(scope, make) {
            Ok(making) => making.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            Err(_) => make(),
        }
    });
    engine.map_err(|error| BenchError::Seeds { why: error.to_string() })
}

/// Says what [`run`] would refuse at once, before a line is opened for it.
///
/// # Errors
/// Frames of another size than the setup's, seeds without a pose.
pub fn check(settings: &Settings, shape: Shape, identity: Identity) -> Result<(), BenchError> {
    prepare(settings, shape, identity).map(|_| ())
}

/// A camera whose frames set the clock.
pub(crate) struct Stamped<'c, C> {
    pub(crate) camera: C,
    pub(crate) clock: &'c RecordingClock,
}

impl<C: Camera> Camera for Stamped<'_, C> {
    type Error = C::Error;

    fn next_frame(&mut self) -> Result<Frame<'_>, C::Error> {
        let frame = self.camera.next_frame()?;
        self.clock.arrive(frame.time_ns());
        Ok(frame)
    }

    fn set_exposure(&mut self, wanted: Exposure) -> Option<Exposure> {
        self.camera.set_exposure(wanted)
    }
}

/// What the two threads tell one another.
#[derive(Default)]
struct State {
    /// The loop has put in its last record.
    is_done: AtomicBool,
    /// The link has failed for good.
    is_broken: AtomicBool,
}

/// Plays `source` through the frame loop and carries the records to `link`, until the recording is over and
/// everything is sent. `stop` ends it properly at the next frame; `say` is told what a user should know while
/// it goes on.
///
/// # Errors
/// What was measured before an error is sent all the same and stands in the [`Failure`].
pub fn run<L: Link<Error = gangway_link::Error> + fmt::Display + Send>(
    settings: &Settings,
    source: Box<dyn FrameSource>,
    link: L,
    play: &Play,
    stop: &AtomicBool,
    say: &(dyn Fn(&str) + Sync),
) -> Result<Summary, Failure> {
    let mut engine = prepare(settings, source.shape(), play.identity)?;
    let rate_hz = source.rate_hz().unwrap_or(settings.rate_hz);
    let timing = play.times.clone().map_or(Timing::Rate(rate_hz), Timing::Times);
    // A part in a hundred: beyond, times and predictions are of different cameras.
    if play.times.is_none() && (rate_hz / settings.rate_hz - 1.0).abs() > 0.01 {
        say(&format!(
            "the recording has {rate_hz} frames/s, the setup says {}; the recording's rate is used",
            settings.rate_hz
        ));
    }
    if settings.exposure.is_some() {
        say("a recording's exposure is what it was: capture.exposure = \"auto\" is left aside");
    }
    source.remark().iter().for_each(|remark| say(remark));
    let camera = Recording::new(source, play.passes.max(1), play.limit, timing, play.pace, stop);
    let camera = FaultyCamera::new(camera, play.faults.camera, play.seed);
    let clock = RecordingClock::new(play.pace);
    let mut camera = Stamped { camera, clock: &clock };
    let link = FaultyLink::new(link, play.faults.link, play.seed);

    let (mut outbox, mut inbox) = (Box::new(Outbox::new()), Inbox::new());
    let ((mut outbox, taken), (given, mut inbox)) = (outbox.split(), inbox.split());
    let state = State::default();
    let (summary, carried) = thread::scope(|scope| {
        let courier = scope.spawn(|| {
            let mut courier = Courier::new(taken, given, link);
            let outcome = carry(&mut courier, &state, play, stop, say);
            state.is_broken.store(outcome.is_err(), Ordering::Release);
            (courier.carried(), courier.left() as u64, outcome)
        });
        let summary = work(&mut engine, &mut camera, play, &mut inbox, &mut outbox, &state, stop);
        state.is_done.store(true, Ordering::Release);
        (summary, courier.join())
    });
    let mut summary = summary;
    let recording = camera.camera.camera();
    summary.late = recording.late();
    let failure = recording.take_failure();
    let outcome = match carried {
        Ok((carried, unsent, outcome)) => {
            (summary.carried, summary.unsent) = (carried, unsent);
            outcome
        }
        Err(panic) => std::panic::resume_unwind(panic),
    };
    match outcome.err().or(failure) {
        Some(error) => Err(Failure { error, summary: Box::new(summary) }),
        None => Ok(summary),
    }
}

/// The frame loop, to the end of the recording.
fn work<C: Camera<Error = CameraErrorKind>>(
    engine: &mut Engine,
    camera: &mut Stamped<'_, C>,
    play: &Play,
    inbox: &mut InboxConsumer<'_>,
    outbox: &mut OutboxProducer<'_>,
    state: &State,
    stop: &AtomicBool,
) -> Summary {
    let mut vitals = DiskVitals::new(play.disk.clone());
    let mut lamps: [FakeLamp; 0] = [];
    let clock = camera.clock;
    let mut board = Board { camera, clock, vitals: &mut vitals, lamps: &mut lamps };
    let mut summary = Summary::default();
    let ends = || stop.load(Ordering::Acquire) || state.is_broken.load(Ordering::Acquire);
    loop {
        if play.pace == Pace::AsFast {
            wait_for_room(outbox, ends);
        }
        if ends() {
            summary.interrupted = stop.load(Ordering::Acquire);
            break;
        }
        let step = engine.step(&mut board, inbox, outbox);
        match step {
            Step::NoFrame(CameraErrorKind::Ended) => break,
            Step::NoFrame(_) => {
                summary.no_frame += 1;
                continue;
            }
            Step::Measured => summary.poses += 1,
            Step::Unmeasured | Step::Repeated => {}
        }
        summary.frames += 1;
        summary.times.note(clock.since_arrival());
    }
    if play.pace == Pace::AsFast {
        wait_for_room(outbox, ends);
    }
    engine.end(&mut board, outbox);
    summary.lost = u64::from(engine.records_lost());
    summary
}

/// Waits until the outbox has room for all that one step can put into it.
fn wait_for_room(outbox: &OutboxProducer<'_>, ends: impl Fn() -> bool) {
    while outbox.capacity() - outbox.len() < MAX_RECORDS_PER_STEP && !ends() {
        thread::sleep(GLANCE);
    }
}

/// The link's thread: carries until the loop is done and everything is sent, or patience ends.
fn carry<L: Link<Error = gangway_link::Error> + fmt::Display>(
    courier: &mut Courier<'_, L>,
    state: &State,
    play: &Play,
    stop: &AtomicBool,
    say: &(dyn Fn(&str) + Sync),
) -> Result<(), BenchError> {
    let mut moved = Instant::now();
    let mut has_said = false;
    loop {
        // Looked at first: what the loop put in before it was done is then seen below.
        let is_done = state.is_done.load(Ordering::Acquire);
        if courier.turn()? {
            moved = Instant::now();
            has_said = false;
            continue;
        }
        let left = courier.left() as u64;
        if left == 0 {
            if is_done {
                break;
            }
            moved = Instant::now();
        }
        let still = moved.elapsed();
        if !courier.is_connected() && still > SILENCE && !has_said {
            say(&format!("waiting for a receiver on {}", courier.link()));
            has_said = true;
        }
        if stop.load(Ordering::Acquire) && is_done && still > HASTE {
            break;
        }
        // At the recorded rate the loop goes on without a receiver; only its end waits.
        let waits = is_done || play.pace == Pace::AsFast;
        if let Some(patience) = play.wait.filter(|&patience| waits && still > patience) {
            let (line, seconds) = (courier.link().to_string(), patience.as_secs_f64());
            return Err(BenchError::Unsent { line, seconds, records: left });
        }
        thread::sleep(IDLE);
    }
    Ok(courier.finish()?)
}
