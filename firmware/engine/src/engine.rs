//! The frame loop's one step: frame, windows, centres, pose, motion, records.

use gangway_device::{Camera, CameraError, CameraErrorKind, Clock, Exposure, Frame, Lamp, Vitals};
use gangway_pose::{MAX_CIRCLES, Pose, PoseError, Shutter, Solution, relative_pose};
use gangway_vision::{Refusal, Ring, Tracker};
use gangway_wire::{self as wire, Pong, PoseFlags, Record, What};

use nalgebra::{Matrix6, Vector3};

use crate::acquire::WORK_A_RING;
use crate::announce::Announcer;
use crate::carbody::{Carbody, Means};
use crate::expose::Exposer;
use crate::health::Pulse;
use crate::keep;
use crate::lamp::{LampMode, Lamps};
use crate::light::Light;
use crate::lit::Lit;
use crate::moved::Suspicion;
use crate::own::Own;
use crate::recorder::Recorder;
use crate::rest::{Found, RestFinder};
use crate::visibility::{self, Watch};
use crate::{Command, InboxConsumer, OutboxProducer, Settings, report};

/// Most records that one step can put into the outbox: an event a circle, answers to a full inbox, and the
/// pose, markers, rest, announcement, health and camera's events beside them.
pub const MAX_RECORDS_PER_STEP: usize = MAX_CIRCLES + crate::INBOX_SLOTS + 20;
const _: () = assert!(MAX_RECORDS_PER_STEP < crate::OUTBOX_SLOTS);

/// Who this box is.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    /// Serial number of the box.
    pub box_id: u64,
    /// Number of this boot.
    pub boot_id: u64,
    /// Number of this session.
    pub session_id: u64,
    /// Version of the firmware, at most 32 bytes.
    pub firmware: &'static str,
}

/// The hardware that a step works on; all of it is passed in.
pub struct Board<'b, C, K, V, L> {
    /// Where frames come from.
    pub camera: &'b mut C,
    /// Monotonic time and UTC.
    pub clock: &'b K,
    /// Temperature and free space.
    pub vitals: &'b mut V,
    /// The lamps of active targets.
    pub lamps: &'b mut [L],
}

/// What a step came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A frame was measured and has its motion.
    Measured,
    /// A frame was worked through but gave no motion; its record says why.
    Unmeasured,
    /// A frame came again; it has no record of its own.
    Repeated,
    /// The camera gave no frame.
    NoFrame(CameraErrorKind),
}

/// One window of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Number of the circle.
    pub circle: u8,
    /// Its middle, px; not numbers for a circle that no window can be put on.
    pub at: [f64; 2],
    /// Its side, px.
    pub side_px: f64,
    /// Where the ring's centre was seen, px, or why not.
    pub seen: Result<[f64; 2], wire::LostReason>,
}

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
    /// Prepares the loop: the seeds give the first pose, and that gives the first windows. Without seeds the targets are
    /// looked for.
    ///
    /// # Errors
    /// For either carbody: the seeds do not determine a pose (too few, on one line, or not where these targets can be
    /// seen), or there are none and no target has enough circles to be known by them.
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

    /// Ends the session: puts every lamp out, tells how the loop did since the last record of it, and that this is the
    /// end.
    pub fn end<C, K: Clock, V: Vitals, L: Lamp>(
        &mut self,
        board: &mut Board<'_, C, K, V, L>,
        outbox: &mut OutboxProducer<'_>,
    ) {
        for lamp in board.lamps.iter_mut() {
            // Nothing is left to be done about a pin that fails now.
            let _ = lamp.set_lit(false);
        }
        self.report_health(board.clock, board.vitals, outbox);
        self.recorder.event(outbox, What::Ended);
    }

    /// Takes the place of `before`, whose setup was another one: goes on with its session, its numbers and counts, says
    /// that the setup has changed and announces the new one. Rest is looked for again: it belongs to its setup.
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

    /// Work of the frames since this was asked last, in instructions that tracking takes: windows looked into, each as a ring
    /// of 16 to 19 px, and the search. What a frame costs in any case is not in it.
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

    /// Does what host and link have asked for since the last frame.
    fn obey(&mut self, inbox: &mut InboxConsumer<'_>, clock: &impl Clock, outbox: &mut OutboxProducer<'_>) {
        let starts = !core::mem::replace(&mut self.started, true);
        if starts {
            // `Hello` has sequence 0: on a line without connections nothing else says where a session begins.
            self.announcer.restart();
            self.greet(clock, outbox);
            self.recorder.event(outbox, What::Started);
        }
        while let Some(command) = inbox.dequeue() {
            match command {
                Command::SetRest => {
                    self.seeking_rest = true;
                    self.rest_finder.clear();
                    self.own.iter_mut().for_each(Own::forget_anchor);
                    self.recorder.event(outbox, What::RestRequested);
                }
                Command::Mark(text) => self.recorder.event(outbox, What::Mark { text: &text }),
                Command::Ping { number, host_time_ns } => {
                    let pong = Pong { number, host_time_ns, time_ns: clock.now_ns() };
                    self.recorder.put(outbox, &Record::Pong(pong));
                }
                // Who came before the start hears the start's own greeting.
                Command::Announce if starts => {}
                Command::Announce => self.announcer.restart(),
                Command::Thinned { count } => self.recorder.event(outbox, What::QueueOverflow { count }),
                Command::Delivered(times) => self.pulse.delivered(&times),
                Command::Refused { kind } => self.recorder.event(outbox, What::CommandRefused { kind }),
            }
        }
        // Before the wait for the next frame: a new listener can read it from the first on.
        self.greet(clock, outbox);
    }

    /// `Hello`, the time and the rest pose, if that is due.
    fn greet(&mut self, clock: &impl Clock, outbox: &mut OutboxProducer<'_>) {
        let rest = self.rest.as_ref();
        self.announcer.greet(&self.settings, &self.identity, rest, clock, &mut self.recorder, outbox);
    }

    /// The camera gave no frame: says why, and goes on sending the setup to who listens.
    fn without_frame(
        &mut self,
        kind: CameraErrorKind,
        clock: &impl Clock,
        outbox: &mut OutboxProducer<'_>,
    ) -> Step {
        let what = match kind {
            CameraErrorKind::Ended | CameraErrorKind::Waiting => None,
            CameraErrorKind::Stalled => Some(What::CameraStalled),
            CameraErrorKind::Lost => Some(What::CameraLost),
            CameraErrorKind::Reopened => Some(What::CameraReopened),
            CameraErrorKind::Corrupt => Some(What::FrameCorrupt),
        };
        if let Some(what) = what {
            // No frame has a time to give; the end of a recording belongs to its last frame.
            self.recorder.at(self.last_frame.unwrap_or(0), clock.now_ns());
            self.recorder.event(outbox, what);
        }
        self.announcer.step(&self.settings, &mut self.recorder, outbox);
        Step::NoFrame(kind)
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

    /// The pose of CB_02 that this frame shows: in the camera, or in the camera's own carbody where that has reference
    /// targets.
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
        own.relate(frame.time_ns(), &solution?, settings)
    }

    /// How many circles should show in the picture, of those that could go into the pose.
    fn in_picture(&self) -> u32 {
        let own = self.own.as_ref().filter(|own| own.is_seen());
        let own = own.map_or(0, |own| own.carbody().in_picture(&self.settings));
        self.carbody.in_picture(&self.settings) + own
    }

    fn is_ambiguous(&self) -> bool {
        let own = self.own.as_ref().is_some_and(|own| own.is_seen() && own.carbody().is_ambiguous());
        own || self.carbody.is_ambiguous() || self.rest.as_ref().is_some_and(|found| found.ambiguous)
    }

    /// CB_02 and, where it has reference targets, CB_01.
    fn carbodies(&self) -> impl Iterator<Item = &Carbody> {
        core::iter::once(&self.carbody).chain(self.own.iter().map(Own::carbody))
    }

    /// Whether the lamps shone in this frame, as the first carbody with lit targets shows it.
    fn lit(&self) -> Lit {
        self.carbodies().map(Carbody::lit).find(|lit| *lit != Lit::Unknown).unwrap_or_default()
    }

    fn seen(&self) -> usize {
        rings(&self.outcomes, self.settings.circles.len()).count()
    }

    /// While rest is sought: shows this frame to the finder, and takes over what it finds. Later the same tells when the
    /// train stands again.
    fn find_rest(&mut self, frame: &Frame<'_>, solution: Option<&Solution>, outbox: &mut OutboxProducer<'_>) {
        let Some(solution) = solution else { return self.suspicion.interrupt() };
        if !self.seeking_rest {
            return self.suspect(frame, solution, outbox);
        }
        let mut centres = heapless::Vec::<(usize, [f64; 2]), MAX_CIRCLES>::new();
        let Settings { circles, lens, .. } = &self.settings;
        for (circle, ring) in rings(&self.outcomes, circles.len()) {
            let moved_px = match (&mut self.own, circles.get(circle)) {
                _ if solution.used >> circle & 1 == 0 => continue,
                (Some(own), Some(circle)) => own.moved_px(&solution.pose.transform(&circle.point), lens),
                _ => [0.0; 2],
            };
            // As many as circles, at most.
            let _ = centres.push((circle, [0, 1].map(|i| ring.centre.at[i] - moved_px[i])));
        }
        if self.rest_finder.observe(frame.number(), centres.iter().copied(), solution) {
            let surveyed = self.survey();
            let Some(mut found) = self.rest_finder.mean(frame.number(), surveyed) else { return };
            if surveyed.is_some() {
                // What the layout did to this pose it does to all. The circles of a target are off together.
                found.pose.common = solution.covariance * self.carbody.correlation();
            }
            self.seeking_rest = false;
            found.own = self.own.as_ref().and_then(|own| own.carbody().last());
            self.recorder.event(outbox, What::RestSet { frames: found.frames });
            self.recorder.put(outbox, &report::rest(&found));
            self.rest = Some(found);
            self.suspicion.forget();
        } else if self.rest_finder.begins() {
            self.carbody.restart_survey();
            self.own.iter_mut().for_each(Own::restart_survey);
        }
    }

    /// Takes the circles to be where the rest interval showed them; gives the covariance of a frame's pose with that.
    fn survey(&mut self) -> Option<Matrix6<f64>> {
        let settings = &self.settings;
        let frames = settings.rest.frames;
        if settings.rest.layout_mm <= 0.0 {
            return None;
        }
        let solution = self.carbody.survey(frames, settings);
        let Some(own) = &mut self.own else { return Some(solution?.covariance) };
        Some(relative_pose(&own.survey(frames, settings)?, &solution?).covariance)
    }

    /// Without reference targets: whether the camera may have moved.
    fn suspect(&mut self, frame: &Frame<'_>, solution: &Solution, outbox: &mut OutboxProducer<'_>) {
        let (None, Some(rest)) = (&self.own, &self.rest) else { return };
        let Settings { circles, limits, .. } = &self.settings;
        let middle = circles.iter().map(|circle| circle.point).sum::<Vector3<f64>>() / circles.len() as f64;
        if self.carbody.is_ambiguous() {
            self.suspicion.interrupt();
        }
        let now = (frame.number(), frame.time_ns());
        let shock = self.suspicion.follow(now, solution, &middle, limits);
        let used =
            rings(&self.outcomes, circles.len()).filter(|(circle, _)| solution.used >> circle & 1 == 1);
        let centres = used.map(|(circle, ring)| (circle, ring.centre.at));
        let stands = self.rest_finder.observe(frame.number(), centres, solution);
        let elsewhere = stands.then(|| self.suspicion.stands(solution, &rest.pose, limits)).flatten();
        for what in [shock, elsewhere].into_iter().flatten() {
            self.recorder.event(outbox, what);
        }
    }

    /// The motion against rest, with the flags that say how far it can be trusted.
    fn relate(
        &self,
        frame: &Frame<'_>,
        solution: Result<&Solution, &PoseError>,
        flags: PoseFlags,
    ) -> wire::Pose {
        let rest = self.rest.as_ref().map(|found| &found.pose);
        let (motion, trust) = report::motion(rest, solution, &self.settings);
        let mut flags = flags | trust;
        if solution.is_ok() && self.is_ambiguous() {
            flags |= PoseFlags::AMBIGUOUS;
        }
        if self.suspicion.has_moved(frame.time_ns()) {
            flags |= PoseFlags::CAMERA_MOVED;
        }
        if self.own.as_ref().is_some_and(|own| !own.is_seen()) {
            flags |= PoseFlags::UNREFERENCED;
        }
        let used = solution.map_or(0, |solution| solution.used);
        if solution.is_ok() && used.count_ones() as usize != self.seen() {
            flags |= PoseFlags::OUTLIERS;
        }
        if solution.is_ok() && !keep::is_trusted(used.count_ones(), self.in_picture()) {
            flags |= PoseFlags::SPARSE;
        }
        flags |= match self.lit() {
            Lit::Not => PoseFlags::DARK,
            Lit::InPart => PoseFlags::SWITCHED,
            Lit::Unknown | Lit::Wholly => PoseFlags::default(),
        };
        let markers = used.count_ones() as u8;
        wire::Pose { frame: frame.number(), time_ns: frame.time_ns(), flags, markers, motion }
    }

    /// Pose and centres of the frame, and what changed with it.
    fn record(&mut self, pose: &wire::Pose, used: u64, outbox: &mut OutboxProducer<'_>) {
        self.recorder.put(outbox, &Record::Pose(*pose));
        let circles = self.settings.circles.len();
        report::centres(rings(&self.outcomes, circles), used, &mut self.centres);
        self.recorder.put(outbox, &Record::Markers(self.centres.markers(pose.frame)));

        let solved =
            !pose.flags.contains(PoseFlags::FEW_MARKERS) && !pose.flags.contains(PoseFlags::NO_SOLUTION);
        let patience = libm::ceil(self.settings.rate_hz) as u32;
        let is_excused = self.carbodies().any(Carbody::is_excused);
        let states = self.outcomes.iter().zip(&mut self.watches).take(circles).enumerate();
        for (circle, (outcome, watch)) in states {
            if *outcome == Err(Refusal::Unlit) && is_excused {
                continue;
            }
            let refused = solved && used >> circle & 1 == 0;
            let state = match outcome {
                Ok(_) if refused => Err(Refusal::Residual),
                Ok(_) => Ok(()),
                Err(refusal) => Err(*refusal),
            };
            if let Some(what) = watch.update(circle as u8, pose.frame, state, patience) {
                self.recorder.event(outbox, what);
            }
        }
        let whites = rings(&self.outcomes, circles).map(|(_, ring)| ring.white);
        if let Some(what) = self.light.update(whites) {
            self.recorder.event(outbox, what);
        }
    }

    fn announce(&mut self, frame_time_ns: u64, clock: &impl Clock, outbox: &mut OutboxProducer<'_>) {
        self.announcer.tick(frame_time_ns);
        self.greet(clock, outbox);
        self.announcer.step(&self.settings, &mut self.recorder, outbox);
    }

    fn report_health(
        &mut self,
        clock: &impl Clock,
        vitals: &mut impl Vitals,
        outbox: &mut OutboxProducer<'_>,
    ) {
        let (lost, high_water) = (self.recorder.lost(), self.recorder.high_water());
        let health = self.pulse.take(clock.now_ns(), vitals.read(), lost, high_water);
        self.recorder.put(outbox, &Record::Health(health));
    }
}

/// The rings seen, with the numbers of their circles.
fn rings(outcomes: &[Result<Ring, Refusal>], circles: usize) -> impl Iterator<Item = (usize, &Ring)> + Clone {
    let outcomes = outcomes.iter().take(circles).enumerate();
    outcomes.filter_map(|(circle, outcome)| Some((circle, outcome.as_ref().ok()?)))
}
