//! Where each ring will be in the next frame: the last pose carried on by the last motion, projected.

use gangway_pose::Pose;
use nalgebra::{Matrix3, Rotation3};

/// Frames without a pose over which the last motion is still carried on; then the last place is kept.
const COASTING_FRAMES: u32 = 3;
/// Share of what rings were off that is still to be expected a frame later.
const FADING: f64 = 0.9;

/// The last poses, by frame number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Predictor {
    last: Pose,
    /// Frame of the last pose; `None` while that is the one known beforehand.
    frame: Option<u32>,
    /// Motion from one frame to the next, camera frame: `R' = turn R`, `t' = t + shift`.
    motion: Option<Pose>,
    /// How far rings were off their windows' middles lately, px root mean square: at most, fading.
    off_px: f64,
}

impl Predictor {
    /// Starts from a pose known beforehand.
    pub(crate) fn from_pose(pose: Pose) -> Self {
        Self { last: pose, frame: None, motion: None, off_px: 0.0 }
    }

    /// Takes the pose measured in `frame`.
    pub(crate) fn update(&mut self, frame: u32, pose: Pose) {
        // Over a short gap the motion is spread evenly; over a long one nothing is known, and holding still
        // is the better guess.
        let gap = self.frame.map_or(u32::MAX, |before| frame.wrapping_sub(before));
        self.motion = (1..=COASTING_FRAMES).contains(&gap).then(|| Pose {
            rotation: share(&(pose.rotation * self.last.rotation.transpose()), gap),
            translation: (pose.translation - self.last.translation) / f64::from(gap),
        });
        self.last = pose;
        self.frame = Some(frame);
    }

    /// Takes how far the rings of a frame were off where they were expected, px root mean square.
    pub(crate) fn learn(&mut self, off_px: f64) {
        self.off_px = off_px.max(FADING * self.off_px);
    }

    /// How far rings may be off where they are expected in `frame`, px: what they were off from one frame to
    /// the next is an acceleration, and adds up as one.
    pub(crate) fn uncertain_px(&self, frame: u32) -> f64 {
        let Some(before) = self.frame else { return 0.0 };
        let gap = f64::from(frame.wrapping_sub(before).min(COASTING_FRAMES + 1));
        self.off_px * 0.5 * gap * (gap + 1.0)
    }

    /// Forgets the last motion: it was a jump, and jumps do not go on.
    pub(crate) fn hold(&mut self) {
        self.motion = None;
    }

    /// The last pose that was measured.
    pub(crate) fn last(&self) -> Option<Pose> {
        self.frame.map(|_| self.last)
    }

    /// The camera has moved: a point X that it saw is now at `by` X.
    pub(crate) fn rebase(&mut self, by: &Pose) {
        self.last = by.after(&self.last);
        if let Some(motion) = &mut self.motion {
            motion.rotation = by.rotation * motion.rotation * by.rotation.transpose();
            motion.translation = by.rotation * motion.translation;
        }
    }

    /// The pose expected in `frame`.
    pub(crate) fn predict(&self, frame: u32) -> Pose {
        let mut pose = self.last;
        if let (Some(before), Some(motion)) = (self.frame, &self.motion) {
            for _ in 0..frame.wrapping_sub(before).min(COASTING_FRAMES) {
                pose.rotation = motion.rotation * pose.rotation;
                pose.translation += motion.translation;
            }
        }
        pose
    }
}

/// The `parts`-th part of a rotation.
fn share(rotation: &Matrix3<f64>, parts: u32) -> Matrix3<f64> {
    if parts == 1 {
        return *rotation;
    }
    let turn = Rotation3::from_matrix_unchecked(*rotation).scaled_axis() / f64::from(parts);
    Rotation3::new(turn).into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn at(x: f64) -> Pose {
        Pose { rotation: Matrix3::identity(), translation: Vector3::new(x, 0.0, 1000.0) }
    }

    #[test]
    fn an_even_motion_is_carried_on() {
        let mut predictor = Predictor::from_pose(at(0.0));
        predictor.update(7, at(1.0));
        predictor.update(8, at(3.0));
        assert_eq!(predictor.predict(9), at(5.0));
        assert_eq!(predictor.predict(10), at(7.0));
    }

    #[test]
    fn a_short_gap_shares_the_motion_among_its_frames() {
        let mut predictor = Predictor::from_pose(at(0.0));
        predictor.update(0, at(0.0));
        let turned = Pose { rotation: Rotation3::new(Vector3::new(0.0, 0.02, 0.0)).into_inner(), ..at(6.0) };
        predictor.update(2, turned);
        let next = predictor.predict(3);
        assert_eq!(next.translation.x, 9.0);
        let expected = Rotation3::new(Vector3::new(0.0, 0.03, 0.0)).into_inner();
        assert!((next.rotation - expected).norm() < 1e-12, "rounding only");
    }

    #[test]
    fn the_motion_goes_on_in_a_camera_that_was_knocked() {
        let mut predictor = Predictor::from_pose(at(0.0));
        predictor.update(0, at(0.0));
        predictor.update(1, at(3.0));
        let knock = Pose::of_camera([2.0, 1.0, -4.0], [3.0, -2.0, 5.0]);
        predictor.rebase(&knock);
        let off = predictor.predict(2).translation - knock.after(&at(6.0)).translation;
        assert!(off.norm() < 1e-9, "rounding only");
    }

    #[test]
    fn what_rings_were_off_is_expected_again_and_adds_up_over_a_gap() {
        let mut predictor = Predictor::from_pose(at(0.0));
        predictor.update(0, at(0.0));
        assert_eq!(predictor.uncertain_px(1), 0.0, "nothing was off yet");
        predictor.learn(4.0);
        assert_eq!([1, 2, 3].map(|frame| predictor.uncertain_px(frame)), [4.0, 12.0, 24.0]);
        assert_eq!(predictor.uncertain_px(1000), predictor.uncertain_px(4), "no more than can be looked at");
        (0..40).for_each(|_| predictor.learn(0.1));
        assert_eq!(predictor.uncertain_px(1), 0.1, "it fades");
    }

    #[test]
    fn a_long_gap_does_not_run_away() {
        let mut predictor = Predictor::from_pose(at(0.0));
        predictor.update(0, at(0.0));
        predictor.update(1, at(2.0));
        assert_eq!(predictor.predict(1000), at(8.0));
        predictor.update(1000, at(50.0));
        assert_eq!(predictor.predict(1001), at(50.0), "no motion is derived across the gap");
    }
}
