//! Rest, by test and not by assumption: the interval in which no circle leaves its place, and the robust mean
//! of its poses (thesis 3.4.3; 5.3.2 shows what a poor first frame does to every later one).

use gangway_pose::{MAX_CIRCLES, Pose, RestPose, Solution, rest_mean, untangle};
use heapless::Vec;
use nalgebra::Matrix6;

use crate::RestSettings;

/// Most frames that a rest interval may have.
pub const MAX_REST_FRAMES: usize = 250;

/// What one circle did in the interval so far.
#[derive(Clone, Copy, Debug)]
struct Path {
    least: [f64; 2],
    greatest: [f64; 2],
    sum: [[f64; 2]; 2],
    count: [u16; 2],
}

impl Path {
    const EMPTY: Self = Self {
        least: [f64::INFINITY; 2],
        greatest: [f64::NEG_INFINITY; 2],
        sum: [[0.0; 2]; 2],
        count: [0; 2],
    };

    fn add(&mut self, at: [f64; 2], half: usize) {
        for (axis, px) in at.into_iter().enumerate() {
            self.least[axis] = self.least[axis].min(px);
            self.greatest[axis] = self.greatest[axis].max(px);
            self.sum[half][axis] += px;
        }
        self.count[half] += 1;
    }

    /// Half the range, px.
    fn excursion(&self) -> f64 {
        let range = |axis: usize| self.greatest[axis] - self.least[axis];
        0.5 * range(0).max(range(1))
    }

    /// Mean of the second half minus mean of the first, px.
    fn drift(&self) -> Option<[f64; 2]> {
        let [first, second] = self.count;
        if first == 0 || second == 0 {
            return None;
        }
        let mean = |half: usize, axis: usize| self.sum[half][axis] / f64::from(self.count[half]);
        Some([mean(1, 0) - mean(0, 0), mean(1, 1) - mean(0, 1)])
    }
}

/// A rest interval that was found.
pub(crate) struct Found {
    pub(crate) first_frame: u32,
    pub(crate) last_frame: u32,
    pub(crate) frames: u16,
    /// The circles are in one plane, and all its frames together cannot tell which of two poses is right.
    pub(crate) ambiguous: bool,
    pub(crate) pose: RestPose,
    /// The camera's own carbody in the camera at rest, where `pose` is in that carbody's frame.
    pub(crate) own: Option<Pose>,
}

/// Looks for an interval of rest in the frames that it is shown.
pub(crate) struct RestFinder {
    settings: RestSettings,
    paths: [Path; MAX_CIRCLES],
    solutions: Vec<Solution, MAX_REST_FRAMES>,
    first_frame: u32,
}

impl RestFinder {
    pub(crate) fn new(settings: RestSettings) -> Self {
        Self { settings, paths: [Path::EMPTY; MAX_CIRCLES], solutions: Vec::new(), first_frame: 0 }
    }

    /// Takes one frame's centres and pose; says whether this frame completes an interval at rest.
    ///
    /// A circle that moves starts the interval anew with this frame, so that rest is found `frames` frames
    /// after the motion ends.
    pub(crate) fn observe(
        &mut self,
        frame: u32,
        centres: impl Iterator<Item = (usize, [f64; 2])> + Clone,
        solution: &Solution,
    ) -> bool {
        if self.is_full() {
            self.clear();
        }
        self.completes(frame, centres, solution)
    }

    /// Whether the interval begins with the last frame, or with the next one.
    pub(crate) fn begins(&self) -> bool {
        self.solutions.len() <= 1 || (self.is_full() && !self.at_rest())
    }

    fn completes(
        &mut self,
        frame: u32,
        centres: impl Iterator<Item = (usize, [f64; 2])> + Clone,
        solution: &Solution,
    ) -> bool {
        self.add(frame, centres.clone(), solution);
        if self.paths.iter().any(|path| path.excursion() > self.settings.excursion_px) {
            self.clear();
            self.add(frame, centres, solution);
        }
        self.is_full() && self.at_rest()
    }

    fn is_full(&self) -> bool {
        self.solutions.len() >= self.frames()
    }

    /// The mean of the interval that `last_frame` has completed, all of its poses on one side of a plane;
    /// each with this covariance, if there is one for all.
    pub(crate) fn mean(&mut self, last_frame: u32, covariance: Option<Matrix6<f64>>) -> Option<Found> {
        let ambiguous = untangle(&mut self.solutions);
        if let Some(covariance) = covariance {
            self.solutions.iter_mut().for_each(|solution| solution.covariance = covariance);
        }
        let pose = rest_mean(&self.solutions).ok()?;
        let frames = self.solutions.len() as u16;
        Some(Found { first_frame: self.first_frame, last_frame, frames, ambiguous, pose, own: None })
    }

    fn frames(&self) -> usize {
        usize::from(self.settings.frames).min(MAX_REST_FRAMES)
    }

    fn add(&mut self, frame: u32, centres: impl Iterator<Item = (usize, [f64; 2])>, solution: &Solution) {
        if self.solutions.is_empty() {
            self.first_frame = frame;
        }
        let half = usize::from(self.solutions.len() * 2 >= self.frames());
        for (circle, at) in centres {
            if let Some(path) = self.paths.get_mut(circle) {
                path.add(at, half);
            }
        }
        // Full only if the settings were not validated; the interval then ends here.
        let _ = self.solutions.push(*solution);
    }

    /// Whether the circles' common drift over the interval is small: slow motion stays below the excursion
    /// bound of a single circle, but not in the mean of all.
    fn at_rest(&self) -> bool {
        let mut sum = [0.0; 2];
        let mut circles = 0.0;
        for drift in self.paths.iter().filter_map(Path::drift) {
            sum = [sum[0] + drift[0], sum[1] + drift[1]];
            circles += 1.0;
        }
        circles > 0.0 && libm::hypot(sum[0], sum[1]) / circles <= self.settings.drift_px
    }

    /// Starts anew with the next frame.
    pub(crate) fn clear(&mut self) {
        self.paths = [Path::EMPTY; MAX_CIRCLES];
        self.solutions.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn solution() -> Solution {
        Solution {
            pose: Pose { rotation: Matrix3::identity(), translation: Vector3::new(0.0, 0.0, 1600.0) },
            covariance: Matrix6::identity(),
            residual_px: 0.01,
            used: 0b1111,
            alternative: None,
        }
    }

    /// First frame of the first interval that is taken for rest while four circles move by `path` px.
    fn first_rest(frames: u32, path: impl Fn(u32) -> f64) -> Option<u32> {
        let mut finder = RestFinder::new(RestSettings::default());
        (0..frames).find_map(|frame| {
            let circles = (0..4).map(|circle| (circle, [100.0 * circle as f64 + path(frame), 50.0]));
            let is_found = finder.observe(frame, circles, &solution());
            is_found.then(|| finder.mean(frame, None).unwrap().first_frame)
        })
    }

    #[test]
    fn ten_frames_at_rest_suffice() {
        assert_eq!(first_rest(9, |_| 0.0), None);
        assert_eq!(first_rest(10, |_| 0.0), Some(0));
    }

    #[test]
    fn trembling_within_the_bound_is_rest() {
        assert_eq!(first_rest(10, |frame| if frame % 2 == 0 { 0.2 } else { -0.2 }), Some(0));
    }

    #[test]
    fn rest_begins_with_the_frame_in_which_the_motion_ended() {
        let braking = |frame: u32| 4.0 * f64::from(7u32.saturating_sub(frame));
        assert_eq!(first_rest(30, braking), Some(7));
    }

    #[test]
    fn slow_drift_is_not_rest() {
        // 0.05 px a frame: 0.45 px over the interval, within the excursion of a single circle.
        assert_eq!(first_rest(200, |frame| 0.05 * f64::from(frame)), None);
    }

    #[test]
    fn shaking_is_not_rest() {
        // The same in both halves: no drift, but an excursion of 0.6 px.
        let shaking = |frame: u32| [0.6, -0.6, 0.6, -0.6, 0.0][frame as usize % 5];
        assert_eq!(first_rest(200, shaking), None);
    }
}
