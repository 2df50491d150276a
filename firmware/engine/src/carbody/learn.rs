//! What a carbody's poses teach of it: where its circles are, how far they scatter, how far its windows miss.

use gangway_pose::{PoseError, Solution, VarianceComponent, solve};

use super::{Carbody, Means};
use crate::Settings;

impl Carbody {
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

    /// How far the rings in the pose were off where they were expected.
    pub(super) fn learn_off(&mut self, found: &Result<Solution, PoseError>) {
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

    /// Where the circles are that no rest interval has shown: a rolling shutter would move those of a moving
    /// train.
    pub(super) fn learn_layout(&mut self, means: &Means<'_>, found: &Result<Solution, PoseError>) {
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
    pub(super) fn learn_variance(&mut self, found: &Result<Solution, PoseError>) {
        let Ok(solution) = found else { return };
        // Those that no rest interval has shown are off by more than that.
        if self.layout.is_surveyed() && !self.layout.has(solution.used) {
            return;
        }
        let seen = self.outcomes.iter().enumerate().filter(|(i, _)| solution.used >> i & 1 == 1);
        let covariances = seen.filter_map(|(_, outcome)| Some(outcome.ok()?.centre.covariance));
        self.variance.learn(solution.residual_px, covariances);
    }
}
