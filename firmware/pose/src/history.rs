//! Which of a plane's two poses is right, through time. Near the frontal view one picture cannot tell; but a
//! plane does not turn over from one frame to the next, so what one frame is sure of holds for the frames
//! after it, as long as the two poses stay apart, and what no frame is sure of several may be together.

use nalgebra::{Matrix3, Vector3};

use crate::Solution;
use crate::ambiguity::DECISIVE;
use crate::geometry::{Pose, rotation_vector};

/// How much of the evidence a frame leaves to the next: the last ten frames count. Errors that many frames
/// share (calibration, printing) must not add up to certainty.
const FADE: f64 = 0.9;
/// Evidence against the pose that motion has chosen from which the other one is taken.
const SWITCH: f64 = 10.0;
/// Two poses nearer than this many standard deviations of their difference may be taken for each other.
const APART_SIGMAS: f64 = 6.0;
/// A pose follows from the frames before if the other one is this many times further from what they expect.
const CLEARLY: f64 = 3.0;

/// Keeps the right one of a plane's two poses from frame to frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlaneHistory {
    /// For the chosen pose, against the other one.
    evidence: f64,
    /// Whether the chosen pose is known to be the right one.
    settled: bool,
    /// Whether the last frame's is not the one that follows from those before.
    turned: bool,
}

impl PlaneHistory {
    /// Knows nothing any more: after a gap, or where nothing is known of the motion.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Takes the solution of the next frame, whose pose is `expected` from those before, and puts the pose
    /// that follows from them before the other one. Whether it could be the other one all the same: neither
    /// this picture nor those before tell.
    pub fn choose(&mut self, solution: &mut Solution, expected: &Pose) -> bool {
        let Some(other) = solution.alternative else {
            // One pose, but so near to its mirror image that it does not tell on which side the next one is.
            self.forget();
            return false;
        };
        let (mut near, mut far) = (distance(&solution.pose, expected), distance(&other.pose, expected));
        if far < near && other.evidence < DECISIVE {
            solution.swap();
            core::mem::swap(&mut near, &mut far);
        }
        let evidence = solution.alternative.map_or(0.0, |other| other.evidence);
        // NaN fails both comparisons.
        let follows = CLEARLY * near < far && apart(solution) > APART_SIGMAS * APART_SIGMAS;
        let before = if follows { *self } else { Self::default() };
        self.evidence = FADE * before.evidence + evidence;
        self.settled = before.settled;
        self.turned = false;
        if self.evidence < -SWITCH || evidence < -DECISIVE {
            solution.swap();
            self.evidence = self.evidence.abs();
            self.settled = false;
            self.turned = true;
        }
        self.settled = (self.settled && self.evidence > 0.0) || self.evidence >= DECISIVE;
        !self.settled
    }

    /// Whether the last pose was taken against those before: the motion between them is none.
    pub fn has_turned(&self) -> bool {
        self.turned
    }
}

/// Brings the poses of an interval at rest to one side: of each the one that is nearer to the first one's, or
/// all of them turned over where the pictures together would rather have that. Whether the pictures together
/// cannot tell.
pub fn untangle(solutions: &mut [Solution]) -> bool {
    let Some(first) = solutions.first().map(|solution| solution.pose) else { return false };
    let mut evidence = 0.0;
    let mut frames = 0.0;
    let mut sure = 0.0_f64;
    for solution in solutions.iter_mut() {
        let Some(other) = solution.alternative else {
            sure += 1.0;
            continue;
        };
        if distance(&other.pose, &first) < distance(&solution.pose, &first) {
            solution.swap();
        }
        evidence += solution.alternative.map_or(0.0, |other| other.evidence);
        frames += 1.0;
    }
    if evidence < 0.0 && sure == 0.0 {
        solutions.iter_mut().for_each(Solution::swap);
    }
    // No more than ten frames' worth, as in a ride.
    let counted = evidence.abs() * (10.0_f64).min(frames) / frames;
    frames > sure && counted < DECISIVE
}

/// Angle between two rotations.
fn distance(a: &Pose, b: &Pose) -> f64 {
    rotation_vector(&(a.rotation * b.rotation.transpose())).norm()
}

/// The squared distance of the two rotations, in standard deviations of their difference.
fn apart(solution: &Solution) -> f64 {
    let Some(other) = &solution.alternative else { return f64::INFINITY };
    let turn: Vector3<f64> = rotation_vector(&(solution.pose.rotation * other.pose.rotation.transpose()));
    let of = |covariance: &nalgebra::Matrix6<f64>| -> Matrix3<f64> {
        covariance.fixed_view::<3, 3>(3, 3).into_owned()
    };
    let sum = of(&solution.covariance) + of(&other.covariance);
    sum.cholesky().map_or(0.0, |c| turn.dot(&c.solve(&turn)))
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix6;

    use super::*;
    use crate::{Alternative, rotation};

    #[test]
    fn a_pose_taken_against_those_before_is_told() {
        let at = |pitch: f64| Pose { rotation: rotation(0.0, pitch, 0.0), ..Pose::FACING };
        let covariance = Matrix6::identity() * 1e-6;
        let of = |evidence: f64| {
            let other = Alternative { pose: at(-0.2), covariance, residual_px: 0.1, ratio: 1.0, evidence };
            Solution { pose: at(0.2), covariance, residual_px: 0.1, used: 0x7f, alternative: Some(other) }
        };
        let mut history = PlaneHistory::default();
        // Motion says which one; the picture does not.
        for _ in 0..3 {
            history.choose(&mut of(0.0), &at(0.19));
            assert!(!history.has_turned());
        }
        // The picture is sure of the other one.
        let mut sure = of(-2.0 * DECISIVE);
        history.choose(&mut sure, &at(0.19));
        assert!(history.has_turned());
        assert_eq!(sure.pose, at(-0.2));
        // From there on motion follows.
        history.choose(&mut of(0.0), &at(-0.19));
        assert!(!history.has_turned());
    }
}
