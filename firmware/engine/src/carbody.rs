//! The circles of one carbody from frame to frame: where they are looked for, what is found, and their pose
//! in the camera (thesis 3.2.5, 3.3).

use gangway_device::Frame;
use gangway_pose::{
    Assigned, Circle, MAX_CIRCLES, Observation, PlaneHistory, Pose, PoseError, Shutter, Solution, Track,
    VarianceComponent, solve, solve_in_motion,
};
use gangway_vision::{Illumination, Refusal, Ring, Search, Tracker};
use heapless::Vec;
use nalgebra::Vector3;

use crate::Settings;
use crate::acquire::is_near;
use crate::keep::{self, Keeper, Question, Verdict};
use crate::layout::Layout;
use crate::lit::{Flash, Lit};
use crate::predict::Predictor;
use crate::windows::{self, Sight};

/// A ring that a sweep saw within so many diameters of a window's middle may be in it.
const GLIMPSE: f64 = 1.25;

/// Fewest rings, too few for a pose, that tell how far the carbody has moved in the picture ...
const LEAST_FOLLOWED: usize = 3;
/// ... if they have all moved alike, to this share of a diameter.
const ALIKE: f64 = 0.2;

/// Fewest circles that the windows of a pose found in the picture must show of those it rests on.
const LEAST_FOUND: u32 = 6;

/// What is known of one carbody.
pub(crate) struct Carbody {
    /// Its circles, and their numbers in the setup.
    circles: Vec<Circle, MAX_CIRCLES>,
    numbers: Vec<u8, MAX_CIRCLES>,
    seeds: Vec<Option<[f64; 2]>, MAX_CIRCLES>,
    keeper: Keeper,
    predictor: Predictor,
    plane: PlaneHistory,
    ambiguous: bool,
    /// The last poses by the time of their frames.
    track: Track,
    /// How far its rings scatter beyond their pixels' noise.
    variance: VarianceComponent,
    layout: Layout,
    flash: Flash,
    /// The light over its targets, with this frame and as it was before.
    light: Illumination,
    light_before: Illumination,
    /// Whether the last pose does not follow from those before.
    is_new: bool,
    /// The last windows, and how many of them were looked into in the last frame.
    searches: Vec<Search, MAX_CIRCLES>,
    looked: u32,
    outcomes: [Result<Ring, Refusal>; MAX_CIRCLES],
}

/// What a frame is measured with.
pub(crate) struct Means<'m> {
    pub(crate) settings: &'m Settings,
    pub(crate) shutter: Shutter,
    /// Windows of the other carbody's circles: what shows there is none of this one's.
    pub(crate) others: &'m [Search],
    /// Whether this carbody may search the picture now.
    pub(crate) may_search: bool,
    /// Whether its discs' windows are kept where their lamps are dark, to be taken off the next frame.
    pub(crate) keeps_dark: bool,
    /// Which of two poses that explain the rings equally well can be.
    pub(crate) is_plausible: &'m dyn Fn(&Pose) -> bool,
}

impl Carbody {
    /// The circles of the setup that `mask` names. The seeds give the first pose, and that the first windows;
    /// without seeds the targets are looked for. With `fixed` the carbody does not move in the camera.
    ///
    /// # Errors
    /// As [`crate::Engine::new`].
    pub(crate) fn new(settings: &Settings, mask: u64, fixed: bool) -> Result<Self, PoseError> {
        let (mut circles, mut numbers, mut seeds) = (Vec::new(), Vec::new(), Vec::new());
        for (i, (circle, seed)) in settings.circles.iter().zip(&settings.seeds).enumerate() {
            if mask >> i & 1 == 1 {
                // At most as many as circles, and all are bounded by MAX_CIRCLES.
                let _ = circles.push(*circle);
                let _ = numbers.push(i as u8);
                let _ = seeds.push(*seed);
            }
        }
        let sight = Sight { settings, circles: &circles, seeds: &seeds };
        let seeded = seeds.iter().any(Option::is_some);
        let keeper = Keeper::new(&sight, seeded, fixed);
        let layout = Layout::new(&circles);
        let first = if seeded || !keeper.is_able() { windows::seed_pose(&sight)? } else { Pose::FACING };
        Ok(Self {
            keeper,
            predictor: Predictor::from_pose(first),
            circles,
            numbers,
            seeds,
            plane: PlaneHistory::default(),
            ambiguous: false,
            track: Track::default(),
            variance: VarianceComponent::default(),
            layout,
            flash: Flash::default(),
            light: Illumination::default(),
            light_before: Illumination::default(),
            is_new: false,
            searches: Vec::new(),
            looked: 0,
            outcomes: [Err(Refusal::NotFound); MAX_CIRCLES],
        })
    }

    /// The pose that a frame shows; `first` is the first one of all. The solution's mask names circles of the
    /// setup.
    pub(crate) fn measure(
        &mut self,
        frame: &Frame<'_>,
        tracker: &mut Tracker,
        means: &Means<'_>,
        first: bool,
    ) -> Result<Solution, PoseError> {
        self.light_before.clone_from(&self.light);
        let solution = self.follow(frame, tracker, means, first);
        let mut solution = self.keep(frame, tracker, means, solution)?;
        let used = self.numbers.iter().enumerate().filter(|(i, _)| solution.used >> i & 1 == 1);
        solution.used = used.fold(0, |mask, (_, number)| mask | 1 << number);
        Ok(solution)
    }

    /// Puts what its windows showed to the circles of the setup.
    pub(crate) fn show(&self, outcomes: &mut [Result<Ring, Refusal>; MAX_CIRCLES]) {
        for (number, outcome) in self.numbers.iter().zip(&self.outcomes) {
            if let Some(into) = outcomes.get_mut(usize::from(*number)) {
                *into = *outcome;
            }
        }
    }

    /// What the last frame's windows showed, with the numbers of the circles in the setup; nothing if none
    /// were looked into.
    pub(crate) fn looks(&self) -> impl Iterator<Item = (u8, &Search, &Result<Ring, Refusal>)> {
        let looks = self.numbers.iter().zip(&self.searches).zip(&self.outcomes);
        looks.filter(|_| self.looked > 0).map(|((n, s), o)| (*n, s, o))
    }

    /// The windows of the last frame; none while nothing is known.
    pub(crate) fn searches(&self) -> &[Search] {
        if self.keeper.is_kept() { &self.searches } else { &[] }
    }

    /// How many circles should show in the picture, as a whole.
    pub(crate) fn in_picture(&self, settings: &Settings) -> u32 {
        windows::in_picture(&self.searches, settings.picture)
    }

    /// Whether its last pose does not follow from those before, which were wrong.
    pub(crate) fn is_new(&self) -> bool {
        self.is_new
    }

    /// Whether the last pose could be the other one of a plane.
    pub(crate) fn is_ambiguous(&self) -> bool {
        self.ambiguous
    }

    /// Whether the lamps of its lit targets shone in the last frame.
    pub(crate) fn lit(&self) -> Lit {
        self.flash.state()
    }

    /// Whether its discs are missing only because their lamps are being driven.
    pub(crate) fn is_excused(&self) -> bool {
        self.flash.excuses()
    }

    /// As [`Keeper::is_calm`].
    pub(crate) fn is_calm(&self) -> bool {
        self.keeper.is_calm()
    }

    /// Whether nothing is known of its place.
    pub(crate) fn is_lost(&self) -> bool {
        self.keeper.is_lost()
    }

    /// Whether a slice of a search was spent on it in the last frame.
    pub(crate) fn has_searched(&self) -> bool {
        self.keeper.has_searched()
    }

    /// Work of the search since this was asked last.
    pub(crate) fn take_spent(&mut self) -> u32 {
        self.keeper.take_spent()
    }

    /// The last pose, if there was one.
    pub(crate) fn last(&self) -> Option<Pose> {
        self.predictor.last()
    }

    /// As [`Layout::correlation`].
    pub(crate) fn correlation(&self) -> f64 {
        self.layout.correlation()
    }

    /// Rest begins with the next frame, if it does: where the circles are is seen anew.
    pub(crate) fn restart_survey(&mut self) {
        self.layout.restart();
    }

    /// Rest was found, with the carbody in the camera there: its circles are where these frames showed them.
    /// Gives what the last frame says of its pose with that.
    pub(crate) fn survey(&mut self, frames: u16, settings: &Settings) -> Option<Solution> {
        let rest = self.predictor.last()?;
        // The frame in which the interval began was seen before that was known.
        let least = frames.saturating_sub(1);
        self.layout.survey(&mut self.circles, least, settings.rest.layout_mm, &rest);
        self.variance = VarianceComponent::default();
        let (observations, _) = self.observations(settings, &rest);
        solve(&observations, &settings.lens, &settings.solver, Some(&rest)).ok()
    }

    /// The camera has moved: what was seen is now seen there, as `by` says.
    pub(crate) fn rebase(&mut self, by: &Pose) {
        self.predictor.rebase(by);
    }

    /// A window for every circle, where the last poses say that it will be, its ring, and the pose of them
    /// all.
    fn follow(
        &mut self,
        frame: &Frame<'_>,
        tracker: &mut Tracker,
        means: &Means<'_>,
        first: bool,
    ) -> Result<Solution, PoseError> {
        self.looked = 0;
        if !self.keeper.follows() {
            self.outcomes = [Err(Refusal::NotFound); MAX_CIRCLES];
            self.flash.pass_over();
            return Err(nothing(means));
        }
        let pose = self.predictor.predict(frame.number());
        windows::searches(&sight(means, &self.circles, &self.seeds), &pose, first, &mut self.searches);
        if !self.keeper.is_lost() {
            let uncertain_px = self.predictor.uncertain_px(frame.number());
            self.searches.iter_mut().for_each(|search| search.uncertain_px = uncertain_px);
        }
        match self.keeper.glimpses() {
            None => self.look(frame, tracker, means),
            Some(rings) => {
                // A look back at a place where there is nothing costs more than finding something does.
                let shows = |search: &Search| rings.iter().any(|ring| is_near(ring, search, GLIMPSE));
                let whole = self.searches.clone();
                let idle = self.searches.iter_mut().filter(|search| !shows(search));
                idle.for_each(|search| search.at = [f64::NAN; 2]);
                self.look(frame, tracker, means);
                self.searches = whole;
            }
        }
        self.solve(frame, means, &pose)
    }

    /// Every ring in its window.
    fn look(&mut self, frame: &Frame<'_>, tracker: &mut Tracker, means: &Means<'_>) {
        let count = self.searches.len();
        let Some(outcomes) = self.outcomes.get_mut(..count) else { return };
        let is_somewhere = |search: &&Search| search.at.iter().all(|c| c.is_finite());
        self.looked = self.searches.iter().filter(is_somewhere).count() as u32;
        tracker.track(frame, &self.searches, &mut self.light, outcomes);
        match self.flash.judge(&self.searches, outcomes) {
            Lit::Not if means.keeps_dark => tracker.keep_dark(frame, &self.searches),
            Lit::Unknown | Lit::Not | Lit::InPart if self.has_discs() => tracker.forget_dark(),
            Lit::Unknown | Lit::Not | Lit::InPart | Lit::Wholly => {}
        }
    }

    fn has_discs(&self) -> bool {
        self.searches.iter().any(Search::is_disc)
    }

    /// The pose of the rings seen. The solution's mask names circles of this carbody.
    fn solve(&mut self, frame: &Frame<'_>, means: &Means<'_>, prior: &Pose) -> Result<Solution, PoseError> {
        let (observations, seen) = self.observations(means.settings, prior);
        let Settings { lens, solver, rest, .. } = means.settings;
        let slack = self.layout.slack(rest.layout_mm, &self.circles, prior, lens);
        let gate_px =
            if self.layout.is_surveyed() { solver.gate_px } else { solver.gate_px.max(slack.whole_px) };
        let solver = gangway_pose::Settings { gate_px, ..*solver };
        let (shutter, time_ns) = (&means.shutter, frame.time_ns());
        let mut solution =
            solve_in_motion(&observations, lens, &solver, prior, shutter, &mut self.track, time_ns)?;
        let used = seen.iter().enumerate().filter(|(bit, _)| solution.used >> bit & 1 == 1);
        solution.used = used.fold(0, |mask, (_, circle)| mask | 1 << circle);
        Ok(solution)
    }

    /// The rings seen, for a carbody about there, and their circles.
    fn observations(
        &self,
        settings: &Settings,
        about: &Pose,
    ) -> (Vec<Observation, MAX_CIRCLES>, Vec<usize, MAX_CIRCLES>) {
        let slack = self.layout.slack(settings.rest.layout_mm, &self.circles, about, &settings.lens);
        let (mut observations, mut seen) = (Vec::new(), Vec::new());
        for (i, (circle, outcome)) in self.circles.iter().zip(&self.outcomes).enumerate() {
            if let Ok(ring) = outcome {
                let centre = self.layout.with(i, self.variance.with(ring.centre), &slack);
                // At most as many as circles, and all are bounded by MAX_CIRCLES.
                let _ = observations.push(Observation { point: circle.point, centre });
                let _ = seen.push(i);
            }
        }
        (observations, seen)
    }

    /// What the windows showed stands, or something better is found, or nothing. The next windows follow from
    /// that.
    fn keep(
        &mut self,
        frame: &Frame<'_>,
        tracker: &mut Tracker,
        means: &Means<'_>,
        solution: Result<Solution, PoseError>,
    ) -> Result<Solution, PoseError> {
        self.is_new = false;
        if self.flash.excuses() {
            return self.without_lamps(frame, means, solution);
        }
        let question = Question {
            sight: sight(means, &self.circles, &self.seeds),
            searches: &self.searches,
            looked: self.looked,
            solution: &solution,
            in_picture: self.in_picture(means.settings),
            others: means.others,
            may_search: means.may_search,
            is_plausible: means.is_plausible,
        };
        let mut found = match self.keeper.judge(frame, &question) {
            Verdict::Keep => {
                self.learn_off(&solution);
                solution
            }
            Verdict::Refuse => solution.and(Err(PoseError::NoConsensus)),
            Verdict::Try { found, instead } => {
                let first = if instead { solution.and(Err(PoseError::NoConsensus)) } else { solution };
                self.look_from(frame, tracker, means, &found, first)
            }
        };
        self.choose_side(frame.number(), &mut found);
        if let Ok(pose) = found.map(|solution| solution.pose) {
            self.learn_variance(&found);
            self.learn_layout(means, &found);
            self.predictor.update(frame.number(), pose);
            self.track.follow(frame.time_ns(), &pose);
            if used(&found) > used(&solution) {
                self.predictor.hold();
                self.is_new = true;
            }
            self.is_new |= self.plane.has_turned();
            if self.is_new {
                self.track.forget();
            }
        }
        let follows = found.is_err() && !self.keeper.is_lost() && self.follow_few(frame.number(), means);
        self.keeper.note(found.ok().map(|_| used(&found)), follows, self.in_picture(means.settings));
        if self.keeper.is_lost() {
            // Where it is found again the light may be another.
            self.light = Illumination::default();
        }
        found
    }

    /// How far the rings in the pose were off where they were expected.
    fn learn_off(&mut self, found: &Result<Solution, PoseError>) {
        let Ok(solution) = found else { return };
        let mut sum = 0.0;
        for (i, (search, outcome)) in self.searches.iter().zip(&self.outcomes).enumerate() {
            if let (Ok(ring), 1) = (outcome, solution.used >> i & 1) {
                let [u, v] = [0, 1].map(|axis| ring.centre.at[axis] - search.at[axis]);
                sum += u * u + v * v;
            }
        }
        self.predictor.learn(libm::sqrt(sum / f64::from(solution.used.count_ones().max(1))));
    }

    /// Of a carbody that shows too little for a pose: moves its windows along with the rings that are still
    /// where they were expected, so that the others are looked for where they must come back. False if there
    /// are not enough.
    fn follow_few(&mut self, frame: u32, means: &Means<'_>) -> bool {
        let Settings { lens, .. } = means.settings;
        let pose = self.predictor.predict(frame);
        let (mut moves, mut depth) = (Vec::<([f64; 2], f64), MAX_CIRCLES>::new(), 0.0);
        for ((circle, search), outcome) in self.circles.iter().zip(&self.searches).zip(&self.outcomes) {
            let Ok(ring) = outcome else { continue };
            let by = [0, 1].map(|i| ring.centre.at[i] - search.at[i]);
            // At most as many as circles, and all are bounded by MAX_CIRCLES.
            let _ = moves.push((by, search.diameter_px()));
            depth += pose.transform(&circle.point).z;
        }
        if moves.len() < LEAST_FOLLOWED {
            return false;
        }
        let share = 1.0 / moves.len() as f64;
        let mean = moves.iter().fold([0.0; 2], |sum, (by, _)| [0, 1].map(|i| sum[i] + share * by[i]));
        let is_alike = |(by, diameter): &([f64; 2], f64)| {
            libm::hypot(by[0] - mean[0], by[1] - mean[1]) < ALIKE * diameter
        };
        if !moves.iter().all(is_alike) {
            return false;
        }
        let [x, y] = [0, 1].map(|i| share * depth * mean[i] / lens.focal[i]);
        let moved = Pose { translation: pose.translation + Vector3::new(x, y, 0.0), ..pose };
        self.predictor.update(frame, moved);
        true
    }

    /// Where the circles are that no rest interval has shown: a rolling shutter would move those of a moving
    /// train.
    fn learn_layout(&mut self, means: &Means<'_>, found: &Result<Solution, PoseError>) {
        let (Ok(solution), Settings { rest, lens, shutter, .. }) = (found, means.settings) else { return };
        let is_surveyed = self.layout.is_surveyed();
        if rest.layout_mm <= 0.0 || (is_surveyed && shutter.line_time_s != 0.0) {
            return;
        }
        self.layout.observe(&self.circles, &self.outcomes, solution, lens);
        if is_surveyed {
            self.layout.adopt(&mut self.circles, rest.frames, rest.layout_mm);
        }
    }

    /// How far the rings in the pose scatter beyond their pixels' noise.
    fn learn_variance(&mut self, found: &Result<Solution, PoseError>) {
        let Ok(solution) = found else { return };
        // Those that no rest interval has shown are off by more than that.
        if self.layout.is_surveyed() && !self.layout.has(solution.used) {
            return;
        }
        let seen = self.outcomes.iter().enumerate().filter(|(i, _)| solution.used >> i & 1 == 1);
        let covariances = seen.filter_map(|(_, outcome)| Some(outcome.ok()?.centre.covariance));
        self.variance.learn(solution.residual_px, covariances);
    }

    /// A frame without lamps between others: what is not lit tells where everything is, if it is enough, and
    /// nothing is in doubt because the rest is missing.
    fn without_lamps(
        &mut self,
        frame: &Frame<'_>,
        means: &Means<'_>,
        mut solution: Result<Solution, PoseError>,
    ) -> Result<Solution, PoseError> {
        let printed = self.searches.iter().filter(|search| !search.is_disc()).count() as u32;
        if !keep::is_trusted(used(&solution), printed) {
            return solution.and(Err(nothing(means)));
        }
        self.choose_side(frame.number(), &mut solution);
        if let Ok(pose) = solution.map(|solution| solution.pose) {
            self.predictor.update(frame.number(), pose);
            self.track.follow(frame.time_ns(), &pose);
        }
        solution
    }

    /// The better of `first` and of what the windows of a pose show that was found in the picture.
    fn look_from(
        &mut self,
        frame: &Frame<'_>,
        tracker: &mut Tracker,
        means: &Means<'_>,
        found: &Assigned,
        first: Result<Solution, PoseError>,
    ) -> Result<Solution, PoseError> {
        let (outcomes, searches, flash) = (self.outcomes, self.searches.clone(), self.flash.clone());
        let (light, track) = (self.light.clone(), self.track);
        self.light.clone_from(&self.light_before);
        windows::searches(&sight(means, &self.circles, &self.seeds), &found.pose, false, &mut self.searches);
        self.look(frame, tracker, means);
        let other = self.solve(frame, means, &found.pose);
        // It was found in the frames before: where the train has moved on since, windows may show less, and
        // something else.
        let shows_it =
            keep::is_trusted(used(&other), found.found) && used(&other) >= found.found.min(LEAST_FOUND);
        if used(&other) > used(&first) && shows_it {
            return other;
        }
        (self.outcomes, self.searches) = (outcomes, searches);
        (self.light, self.track) = (light, track);
        // Discs that shone in part are found, though they do not count.
        if self.flash.state() != Lit::InPart {
            self.flash = flash;
        }
        first
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
}

fn sight<'s>(means: &Means<'s>, circles: &'s [Circle], seeds: &'s [Option<[f64; 2]>]) -> Sight<'s> {
    Sight { settings: means.settings, circles, seeds }
}

/// No circle is seen.
fn nothing(means: &Means<'_>) -> PoseError {
    PoseError::TooFew { circles: 0, needed: means.settings.solver.min_circles }
}

/// Circles that went into a pose.
fn used(solution: &Result<Solution, PoseError>) -> u32 {
    solution.as_ref().map_or(0, |solution| solution.used.count_ones())
}
