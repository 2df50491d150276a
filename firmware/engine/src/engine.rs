//! The frame loop's one step: frame, windows, centres, pose, motion, records. What the steps within it are is
//! in the files below: `relate`, `stand` and `tell`.

mod board;
mod relate;
mod stand;
mod tell;

use gangway_device::{Camera, CameraError, Clock, Exposure, Frame, Lamp, Vitals};
use gangway_pose::{MAX_CIRCLES, Pose, PoseError, Shutter, Solution};
use gangway_vision::{Refusal, Ring, Tracker};
use gangway_wire::{self as wire, PoseFlags, What};

pub use self::board::{Board, Identity, Look, Step};
use crate::acquire::WORK_A_RING;
use crate::announce::Announcer;
use crate::carbody::{Carbody, Means};
use crate::expose::Exposer;
use crate::health::Pulse;
use crate::keep;
use crate::lamp::{LampMode, Lamps};
use crate::light::Light;
use crate::moved::Suspicion;
use crate::own::Own;
use crate::recorder::Recorder;
use crate::rest::{Found, RestFinder};
use crate::visibility::{self, Watch};
use crate::{InboxConsumer, OutboxProducer, Settings};

/// Most records that one step can put into the outbox: an event a circle, answers to a full inbox, and the
/// pose, markers, rest, announcement, health and camera's events beside them.
pub const MAX_RECORDS_PER_STEP: usize = MAX_CIRCLES + crate::INBOX_SLOTS + 20;
const _: () = assert!(MAX_RECORDS_PER_STEP < crate::OUTBOX_SLOTS);

/// Records with which a session ends: what was lost, how the loop did, and that it is over.
const LAST_RECORDS: usize = 3;

/// The frame loop's state: one box, one camera, one session.
///
/// It is some hundred KiB large: boards place it once, in a static or a box.
pub struct Engine {
    settings: Settings,
    identity: Identity,
    tracker: Tracker,
    /// CB_02, whose motion is measured.
    carbody: Carbody,
    /// CB_01, the camera's own, where it has reference targets ...
    own: Option<Own>,
    /// ... and where it has none, whether the camera may have moved.
    suspicion: Suspicion,
    rest_finder: RestFinder,
    /// Rest is being looked for: at start, and after a command.
    seeking_rest: bool,
    rest: Option<Found>,
    outcomes: [Result<Ring, Refusal>; MAX_CIRCLES],
    centres: wire::Centres,
    watches: [Watch; MAX_CIRCLES],
    light: Light,
    lamps: Lamps,
    exposer: Exposer,
    announcer: Announcer,
    recorder: Recorder,
    pulse: Pulse,
    last_frame: Option<u32>,
    started: bool,
}

impl Engine {
    /// Prepares the loop: the seeds give the first pose, and that gives the first windows. Without seeds the
    /// targets are looked for.
    ///
    /// # Errors
    /// For either carbody: the seeds do not determine a pose (too few, on one line, or not where these
    /// targets can be seen), or there are none and no target has enough circles to be known by them.
    pub fn new(settings: Settings, identity: Identity) -> Result<Self, PoseError> {
        let own = if settings.own == 0 { None } else { Some(Own::new(&settings)?) };
        Ok(Self {
            tracker: Tracker::new(settings.vision),
            carbody: Carbody::new(&settings, !settings.own, false)?,
            own,
            suspicion: Suspicion::default(),
            rest_finder: RestFinder::new(settings.rest),
            seeking_rest: true,
            rest: None,
            outcomes: [Err(Refusal::NotFound); MAX_CIRCLES],
            centres: wire::Centres::new(),
            watches: [Watch::default(); MAX_CIRCLES],
            light: Light::default(),
            lamps: Lamps::default(),
            exposer: Exposer::new(
                settings.exposure,
                settings.circles.iter().any(|circle| circle.inner_mm <= 0.0),
            ),
            announcer: Announcer::default(),
            recorder: Recorder::default(),
            pulse: Pulse::default(),
            last_frame: None,
            started: false,
            settings,
            identity,
        })
    }

    /// One frame, from the camera to the outbox. Blocks nowhere but in the camera's own wait for a frame.
    pub fn step<C: Camera, K: Clock, V: Vitals, L: Lamp>(
        &mut self,
        board: &mut Board<'_, C, K, V, L>,
        inbox: &mut InboxConsumer<'_>,
        outbox: &mut OutboxProducer<'_>,
    ) -> Step {
        self.obey(inbox, board.clock, outbox);
        let frame = match board.camera.next_frame() {
            Ok(frame) => frame,
            Err(error) => return self.without_frame(error.kind(), board.clock, outbox),
        };
        let woken_ns = board.clock.now_ns();
        self.pulse.woken(frame.complete_ns().map(|complete_ns| woken_ns.saturating_sub(complete_ns)));
        let Some(flags) = self.arrive(&frame, outbox) else { return Step::Repeated };

        let solution = self.measure(&frame, outbox);
        self.find_rest(&frame, solution.as_ref().ok(), outbox);
        let pose = self.relate(&frame, solution.as_ref(), flags);
        self.record(&pose, solution.as_ref().map_or(0, |solution| solution.used), outbox);

        self.announce(frame.time_ns(), board.clock, outbox);
        self.pulse.beat(board.clock.now_ns().saturating_sub(woken_ns));
        if self.pulse.due(frame.time_ns()) {
            self.report_health(board.clock, board.vitals, outbox);
        }
        let (time_ns, step) =
            (frame.time_ns(), if pose.motion.is_some() { Step::Measured } else { Step::Unmeasured });
        let wanted = self.exposer.wanted(&frame, &self.outcomes);
        if let Some(wanted) = wanted {
            self.expose(wanted, board.camera, outbox);
        }
        self.lamps.drive(&self.settings, self.carbody.is_lost(), time_ns, board.clock, board.lamps);
        step
    }

    /// Tells the camera another exposure, and the records what it took.
    fn expose(&mut self, wanted: Exposure, camera: &mut impl Camera, outbox: &mut OutboxProducer<'_>) {
        let Some(taken) = self.exposer.took(camera.set_exposure(wanted)) else { return };
        self.settings.shutter.exposure_s = taken.time_s;
        // The casts saturate.
        let exposure_us = libm::round(taken.time_s * 1e6) as u32;
        let gain_permille = libm::round(taken.gain * 1e3) as u32;
        self.recorder.event(outbox, What::ExposureChanged { exposure_us, gain_permille });
    }

    /// Ends the session: puts every lamp out, tells how the loop did since the last record of it, and that
    /// this is the end.
    pub fn end<C, K: Clock, V: Vitals, L: Lamp>(
        &mut self,
        board: &mut Board<'_, C, K, V, L>,
        outbox: &mut OutboxProducer<'_>,
    ) {
        for lamp in board.lamps.iter_mut() {
            // Nothing is left to be done about a pin that fails now.
            let _ = lamp.set_lit(false);
        }
        self.announcer.finish(&self.settings, LAST_RECORDS, &mut self.recorder, outbox);
        self.report_health(board.clock, board.vitals, outbox);
        self.recorder.event(outbox, What::Ended);
    }

    /// Takes the place of `before`, whose setup was another one: goes on with its session, its numbers and
    /// counts, says that the setup has changed and announces the new one. Rest is looked for again: it
    /// belongs to its setup.
    pub fn succeed(&mut self, before: &mut Self, outbox: &mut OutboxProducer<'_>) {
        core::mem::swap(&mut self.recorder, &mut before.recorder);
        core::mem::swap(&mut self.pulse, &mut before.pulse);
        core::mem::swap(&mut self.announcer, &mut before.announcer);
        (self.last_frame, self.started) = (before.last_frame, before.started);
        self.identity = before.identity;
        self.recorder.event(outbox, What::SetupChanged);
        self.announcer.restart();
    }

    /// Frames that came since start.
    pub fn frames(&self) -> u32 {
        self.pulse.frames()
    }

    /// Records lost to a full outbox since start.
    pub fn records_lost(&self) -> u32 {
        self.recorder.lost()
    }

    /// Work of the frames since this was asked last, in instructions that tracking takes: windows looked
    /// into, each as a ring of 16 to 19 px, and the search. What a frame costs in any case is not in it.
    pub fn take_work(&mut self) -> u32 {
        let windows = self.tracker.take_looks().saturating_mul(WORK_A_RING);
        let own = self.own.as_mut().map_or(0, Own::take_spent);
        windows.saturating_add(self.carbody.take_spent()).saturating_add(own)
    }

    /// Where the last frame was looked at, and what was seen there: for pictures of what the loop does.
    pub fn looks(&self) -> impl Iterator<Item = Look> {
        let own = self.own.iter().flat_map(|own| own.carbody().looks());
        let diameters = self.settings.vision.window_diameters;
        self.carbody.looks().chain(own).map(move |(circle, search, outcome)| Look {
            circle,
            at: search.at,
            side_px: search.side_px(diameters),
            seen: match outcome {
                Ok(ring) => Ok(ring.centre.at),
                Err(refusal) => Err(visibility::lost_reason(*refusal)),
            },
        })
    }

    /// Compares number and size with what must come: the flags that follow, `None` for a frame already seen.
    fn arrive(&mut self, frame: &Frame<'_>, outbox: &mut OutboxProducer<'_>) -> Option<PoseFlags> {
        self.recorder.at(frame.number(), frame.time_ns());
        let mut flags = PoseFlags::default();
        if let Some(last) = self.last_frame {
            // The number may wrap: more than half way round is backwards.
            let ahead = frame.number().wrapping_sub(last);
            if ahead == 0 || ahead > u32::MAX / 2 {
                self.recorder.event(outbox, What::FrameRepeated);
                return None;
            }
            if ahead > 1 {
                self.pulse.missed(ahead - 1);
                self.recorder.event(outbox, What::FramesMissed { count: ahead - 1 });
                flags |= PoseFlags::AFTER_GAP;
            }
        }
        self.last_frame = Some(frame.number());
        if (frame.width(), frame.height()) != self.settings.picture {
            self.recorder.event(outbox, What::FrameCorrupt);
            flags |= PoseFlags::CORRUPT;
        }
        Some(flags)
    }

    /// The pose of CB_02 that this frame shows: in the camera, or in the camera's own carbody where that has
    /// reference targets.
    fn measure(&mut self, frame: &Frame<'_>, outbox: &mut OutboxProducer<'_>) -> Result<Solution, PoseError> {
        let first = self.pulse.frames() == 0;
        let (settings, tracker) = (&self.settings, &mut self.tracker);
        if let Some(own) = &mut self.own {
            let told = own.measure(frame, tracker, settings, &mut self.carbody, first);
            for what in told.into_iter().flatten() {
                self.recorder.event(outbox, what);
            }
        }
        let own = self.own.as_ref();
        let at_rest = self.rest.as_ref().map(|found| found.pose.pose);
        let at_rest = at_rest.and_then(|rest| own.map_or(Some(rest), |own| own.in_camera(&rest)));
        let reference = at_rest.or(settings.reference);
        let is_plausible =
            |pose: &Pose| reference.is_some_and(|reference| keep::is_within(pose, &reference, settings));
        let shutter = match own {
            // What the exposure does to the motion is told of the one carbody against the other.
            Some(_) => Shutter { exposure_s: 0.0, ..settings.shutter },
            None => settings.shutter,
        };
        let means = Means {
            settings,
            shutter,
            others: own.map_or(&[], |own| own.carbody().searches()),
            may_search: !own.is_some_and(|own| own.carbody().has_searched()),
            keeps_dark: settings.lamps == LampMode::Alternate,
            is_plausible: &is_plausible,
        };
        let solution = self.carbody.measure(frame, tracker, &means, first);
        self.carbody.show(&mut self.outcomes);
        let Some(own) = &mut self.own else { return solution };
        own.carbody().show(&mut self.outcomes);
        own.relate(frame.time_ns(), &solution?, self.carbody.is_new(), settings)
    }
}

/// The rings seen, with the numbers of their circles.
fn rings(outcomes: &[Result<Ring, Refusal>], circles: usize) -> impl Iterator<Item = (usize, &Ring)> + Clone {
    let outcomes = outcomes.iter().take(circles).enumerate();
    outcomes.filter_map(|(circle, outcome)| Some((circle, outcome.as_ref().ok()?)))
}
