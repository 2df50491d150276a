//! The circles of one carbody from frame to frame: where they are looked for, what is found, and their pose
//! in the camera (thesis 3.2.5, 3.3).

mod learn;
mod verdict;

use gangway_device::Frame;
use gangway_pose::{
    Circle, MAX_CIRCLES, Observation, PlaneHistory, Pose, PoseError, Shutter, Solution, Track,
    VarianceComponent, solve_in_motion,
};
use gangway_vision::{Illumination, Refusal, Ring, Search, Tracker};
use heapless::Vec;

use crate::Settings;
use crate::acquire::is_near;
use crate::keep::Keeper;
use crate::layout::Layout;
use crate::lit::{Flash, Lit};
use crate::predict::Predictor;
use crate::windows::{self, Sight};

/// A ring that a sweep saw within so many diameters of a window's middle may be in it.
const GLIMPSE: f64 = 1.25;

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
