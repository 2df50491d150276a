//! The frame loop's one step: frame, windows, centres, pose, motion, records.

use gangway_device::{Camera, CameraError, CameraErrorKind, Clock, Exposure, Frame, Lamp, Vitals};
use gangway_pose::{
    MAX_CIRCLES, Observation, PlaneHistory, Pose, PoseError, Solution, Track, VarianceComponent,
    solve_in_motion,
};
use gangway_vision::{Refusal, Ring, Search, Tracker};
use gangway_wire::{self as wire, Pong, PoseFlags, Record, What};
use heapless::Vec;

use crate::announce::Announcer;
use crate::expose::Exposer;
use crate::health::Pulse;
use crate::keep::{self, Keeper, Verdict};
use crate::lamp::{LampMode, Lamps};
use crate::light::Light;
use crate::lit::{Flash, Lit};
use crate::predict::Predictor;
use crate::recorder::Recorder;
use crate::rest::{Found, RestFinder};
use crate::visibility::Watch;
use crate::{Command, InboxConsumer, OutboxProducer, Settings, report, windows};

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

/// The frame loop's state: one box, one camera, one session.
///
/// It is some hundred KiB large: boards place it once, in a static or a box.
pub struct Engine {
    settings: Settings,
    identity: Identity,
    tracker: Tracker,
    predictor: Predictor,
    rest_finder: RestFinder,
    /// Rest is being looked for: at start, and after a command.
    seeking_rest: bool,
    rest: Option<Found>,
    keeper: Keeper,
    plane: PlaneHistory,
    /// The last pose could be the other one of a plane.
    ambiguous: bool,
    /// The last poses by the time of their frames.
    track: Track,
    variance: VarianceComponent,
    time_ns: u64,
    searches: Vec<Search, MAX_CIRCLES>,
    outcomes: [Result<Ring, Refusal>; MAX_CIRCLES],
    centres: wire::Centres,
    watches: [Watch; MAX_CIRCLES],
    light: Light,
    lamps: Lamps,
    flash: Flash,
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
    /// The seeds do not determine a pose: too few, on one line, or not where these targets can be seen. There are none
    /// and no target has enough circles to be known by them.
    pub fn new(settings: Settings, identity: Identity) -> Result<Self, PoseError> {
        let seeded = settings.seeds.iter().any(Option::is_some);
        let keeper = Keeper::new(&settings, seeded);
        let first = if seeded || !keeper.is_able() { windows::seed_pose(&settings)? } else { Pose::FACING };
        let predictor = Predictor::from_pose(first);
        Ok(Self {
            tracker: Tracker::new(settings.vision),
            predictor,
            rest_finder: RestFinder::new(settings.rest),
            seeking_rest: true,
            rest: None,
            keeper,
            plane: PlaneHistory::default(),
            ambiguous: false,
            track: Track::default(),
            variance: VarianceComponent::default(),
            time_ns: 0,
            searches: Vec::new(),
            outcomes: [Err(Refusal::NotFound); MAX_CIRCLES],
            centres: wire::Centres::new(),
            watches: [Watch::default(); MAX_CIRCLES],
            light: Light::default(),
            lamps: Lamps::default(),
            flash: Flash::default(),
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

        let solution = self.follow(&frame);
        let solution = self.keep(&frame, solution);
        self.find_rest(frame.number(), solution.as_ref().ok(), outbox);
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
        self.lamps.drive(&self.settings, time_ns, board.clock, board.lamps);
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

    /// Ends the session: says so and puts every lamp out.
    pub fn end<L: Lamp>(&mut self, lamps: &mut [L], outbox: &mut OutboxProducer<'_>) {
        for lamp in lamps {
            // Nothing is left to be done about a pin that fails now.
            let _ = lamp.set_lit(false);
        }
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
        self.time_ns = frame.time_ns();
        if (frame.width(), frame.height()) != self.settings.picture {
            self.recorder.event(outbox, What::FrameCorrupt);
            flags |= PoseFlags::CORRUPT;
        }
        Some(flags)
    }

    /// A window for every circle, where the last poses say that it will be, its ring, and the pose of them all.
    fn follow(&mut self, frame: &Frame<'_>) -> Result<Solution, PoseError> {
        if !self.keeper.follows() {
            self.outcomes = [Err(Refusal::NotFound); MAX_CIRCLES];
            self.flash.pass_over();
            return Err(self.nothing());
        }
        let pose = self.predictor.predict(frame.number());
        let first = self.pulse.frames() == 0;
        windows::searches(&self.settings, &pose, first, &mut self.searches);
        self.look(frame);
        self.solve(&pose)
    }

    /// Every ring in its window.
    fn look(&mut self, frame: &Frame<'_>) {
        let count = self.searches.len();
        if let Some(outcomes) = self.outcomes.get_mut(..count) {
            self.tracker.track(frame, &self.searches, outcomes);
            match self.flash.judge(&self.searches, outcomes) {
                Lit::Not if self.settings.lamps == LampMode::Alternate => {
                    self.tracker.keep_dark(frame, &self.searches);
                }
                Lit::Unknown | Lit::Not | Lit::InPart => self.tracker.forget_dark(),
                Lit::Wholly => {}
            }
        }
    }

    /// The pose of the rings seen. The solution's mask names circles of the setup.
    fn solve(&self, prior: &Pose) -> Result<Solution, PoseError> {
        let mut observations = Vec::<Observation, MAX_CIRCLES>::new();
        let mut seen = Vec::<usize, MAX_CIRCLES>::new();
        for (i, (circle, outcome)) in self.settings.circles.iter().zip(&self.outcomes).enumerate() {
            if let Ok(ring) = outcome {
                // At most as many as circles, and all are bounded by MAX_CIRCLES.
                let centre = self.variance.with(ring.centre);
                let _ = observations.push(Observation { point: circle.point, centre });
                let _ = seen.push(i);
            }
        }
        let Settings { lens, solver, shutter, .. } = &self.settings;
        let mut solution =
            solve_in_motion(&observations, lens, solver, prior, shutter, &self.track, self.time_ns)?;
        let used = seen.iter().enumerate().filter(|(bit, _)| solution.used >> bit & 1 == 1);
        solution.used = used.fold(0, |mask, (_, circle)| mask | 1 << circle);
        Ok(solution)
    }

    /// What the windows showed stands, or something better is found, or nothing. The next windows follow from that.
    fn keep(
        &mut self,
        frame: &Frame<'_>,
        solution: Result<Solution, PoseError>,
    ) -> Result<Solution, PoseError> {
        if self.flash.excuses() {
            return self.without_lamps(frame, solution);
        }
        let in_picture = self.in_picture();
        let reference = self.rest.as_ref().map(|found| found.pose.pose).or(self.settings.reference);
        let verdict = self.keeper.judge(
            frame,
            &self.settings,
            &self.searches,
            &solution,
            in_picture,
            reference.as_ref(),
        );
        let mut found = match verdict {
            Verdict::Keep => solution,
            Verdict::Refuse => solution.and(Err(PoseError::NoConsensus)),
            Verdict::Try(pose) => self.look_from(frame, &pose, solution),
        };
        self.choose_side(frame.number(), &mut found);
        if let Ok(pose) = found.map(|solution| solution.pose) {
            self.learn_variance(&found);
            self.predictor.update(frame.number(), pose);
            self.track.follow(frame.time_ns(), &pose);
            if used(&found) > used(&solution) {
                self.predictor.hold();
                self.track.forget();
            }
        }
        self.keeper.note(found.ok().map(|_| used(&found)), self.in_picture());
        found
    }

    /// How far the rings in the pose scatter beyond their pixels' noise.
    fn learn_variance(&mut self, found: &Result<Solution, PoseError>) {
        let Ok(solution) = found else { return };
        let seen = self.outcomes.iter().enumerate().filter(|(i, _)| solution.used >> i & 1 == 1);
        let covariances = seen.filter_map(|(_, outcome)| Some(outcome.ok()?.centre.covariance));
        self.variance.learn(solution.residual_px, covariances);
    }

    /// A frame without lamps between others: what is not lit tells where everything is, if it is enough, and nothing is
    /// in doubt because the rest is missing.
    fn without_lamps(
        &mut self,
        frame: &Frame<'_>,
        mut solution: Result<Solution, PoseError>,
    ) -> Result<Solution, PoseError> {
        let printed = self.searches.iter().filter(|search| !search.is_disc()).count() as u32;
        if !keep::is_trusted(used(&solution), printed) {
            return solution.and(Err(self.nothing()));
        }
        self.choose_side(frame.number(), &mut solution);
        if let Ok(pose) = solution.map(|solution| solution.pose) {
            self.predictor.update(frame.number(), pose);
            self.track.follow(frame.time_ns(), &pose);
        }
        solution
    }

    /// The better of `first` and of what the windows of a pose show.
    fn look_from(
        &mut self,
        frame: &Frame<'_>,
        pose: &Pose,
        first: Result<Solution, PoseError>,
    ) -> Result<Solution, PoseError> {
        let (outcomes, searches, flash) = (self.outcomes, self.searches.clone(), self.flash.clone());
        windows::searches(&self.settings, pose, false, &mut self.searches);
        self.look(frame);
        let other = self.solve(pose);
        if used(&other) > used(&first) {
            return other;
        }
        (self.outcomes, self.searches) = (outcomes, searches);
        // Discs that shone in part are found, though they do not count.
        if self.flash.state() != Lit::InPart {
            self.flash = flash;
        }
        first
    }

    fn in_picture(&self) -> u32 {
        windows::in_picture(&self.searches, self.settings.picture)
    }

    /// No circle is seen.
    fn nothing(&self) -> PoseError {
        PoseError::TooFew { circles: 0, needed: self.settings.solver.min_circles }
    }

    /// Of a plane's two poses the one that follows from the frames before.
    fn choose_side(&mut self, frame: u32, found: &mut Result<Solution, PoseError>) {
        match found {
            Ok(solution) => {
                let expected = self.predictor.predict(frame);
                self.ambiguous = self.plane.choose(solution, &expected);
            }
            Err(_) => self.plane.forget(),
        }
    }

    fn seen(&self) -> usize {
        rings(&self.outcomes, self.settings.circles.len()).count()
    }

    /// While rest is sought: shows this frame to the finder, and takes over what it finds.
    fn find_rest(&mut self, frame: u32, solution: Option<&Solution>, outbox: &mut OutboxProducer<'_>) {
        let (true, Some(solution)) = (self.seeking_rest, solution) else { return };
        let seen = rings(&self.outcomes, self.settings.circles.len());
        let used = seen.filter(|(circle, _)| solution.used >> circle & 1 == 1);
        let used = used.map(|(circle, ring)| (circle, ring.centre.at));
        if let Some(found) = self.rest_finder.observe(frame, used, solution) {
            self.seeking_rest = false;
            self.recorder.event(outbox, What::RestSet { frames: found.frames });
            self.recorder.put(outbox, &report::rest(&found));
            self.rest = Some(found);
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
        let rest_is_ambiguous = self.rest.as_ref().is_some_and(|found| found.ambiguous);
        if solution.is_ok() && (self.ambiguous || rest_is_ambiguous) {
            flags |= PoseFlags::AMBIGUOUS;
        }
        let used = solution.map_or(0, |solution| solution.used);
        if solution.is_ok() && used.count_ones() as usize != self.seen() {
            flags |= PoseFlags::OUTLIERS;
        }
        if solution.is_ok() && !keep::is_trusted(used.count_ones(), self.in_picture()) {
            flags |= PoseFlags::SPARSE;
        }
        flags |= match self.flash.state() {
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
        let states = self.outcomes.iter().zip(&mut self.watches).take(circles).enumerate();
        for (circle, (outcome, watch)) in states {
            if *outcome == Err(Refusal::Unlit) && self.flash.excuses() {
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

/// Circles that went into a pose.
fn used(solution: &Result<Solution, PoseError>) -> u32 {
    solution.as_ref().map_or(0, |solution| solution.used.count_ones())
}

/// The rings seen, with the numbers of their circles.
fn rings(outcomes: &[Result<Ring, Refusal>], circles: usize) -> impl Iterator<Item = (usize, &Ring)> + Clone {
    let outcomes = outcomes.iter().take(circles).enumerate();
    outcomes.filter_map(|(circle, outcome)| Some((circle, outcome.as_ref().ok()?)))
}
