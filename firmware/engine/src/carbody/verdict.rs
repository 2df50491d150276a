//! What becomes of what the windows showed: it stands, or something better is found, or nothing; and where
//! the next windows are.

use gangway_device::Frame;
use gangway_pose::{Assigned, MAX_CIRCLES, Pose, PoseError, Solution};
use gangway_vision::{Illumination, Tracker};
use heapless::Vec;
use nalgebra::Vector3;

use super::{Carbody, Means, nothing, sight, used};
use crate::Settings;
use crate::keep::{self, Question, Verdict};
use crate::lit::Lit;
use crate::windows;

/// Fewest rings, too few for a pose, that tell how far the carbody has moved in the picture ...
const LEAST_FOLLOWED: usize = 3;
/// ... if they have all moved alike, to this share of a diameter.
const ALIKE: f64 = 0.2;

/// Fewest circles that the windows of a pose found in the picture must show of those it rests on.
const LEAST_FOUND: u32 = 6;

impl Carbody {
    /// What the windows showed stands, or something better is found, or nothing. The next windows follow from
    /// that.
    pub(super) fn keep(
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
}
