//! One carbody against the other, both seen by one camera: whatever the camera does cancels (conventions of
//! thesis 3.4.3, with the camera's own carbody in the camera's place).

use nalgebra::{Matrix3, Vector3};

use crate::ambiguity::Alternative;
use crate::geometry::{Pose, skew};
use crate::motion::blocks;
use crate::{RestPose, Solution};

/// The pose of `other` in the frame of `own`, `R_own^T R` and `R_own^T (t - t_own)`: the carbody in that of
/// the camera.
///
/// The covariance is of (v, w) along the axes of `own` and has both poses' own in it, which share no circle.
/// `used` is of both, whose masks must name circles of one list; the residual is the mean of all their
/// circles. A second pose of `other` is carried along.
pub fn relative_pose(own: &Solution, other: &Solution) -> Solution {
    let (pose, covariance) = between(own, &other.pose, &other.covariance);
    let (of_own, of_other) = (f64::from(own.used.count_ones()), f64::from(other.used.count_ones()));
    let square = |residual_px: f64| residual_px * residual_px;
    let both =
        (of_own * square(own.residual_px) + of_other * square(other.residual_px)) / (of_own + of_other);
    let alternative = other.alternative.map(|second| {
        let (pose, covariance) = between(own, &second.pose, &second.covariance);
        Alternative { pose, covariance, ..second }
    });
    Solution { pose, covariance, residual_px: libm::sqrt(both), used: own.used | other.used, alternative }
}

/// With `R' = Exp(w) R`, `t' = t + v` of both poses the relative one is turned by `Q^T (w - w1)` and moved by
/// `Q^T (v - v1 + (t - s) x w1)`, where `[Q | s]` and v1, w1 are those of `own`.
fn between(
    own: &Solution,
    pose: &Pose,
    covariance: &nalgebra::Matrix6<f64>,
) -> (Pose, nalgebra::Matrix6<f64>) {
    let back = own.pose.rotation.transpose();
    let way: Vector3<f64> = pose.translation - own.pose.translation;
    let relative = Pose { rotation: back * pose.rotation, translation: back * way };
    let by_pose = blocks(&back, &Matrix3::zeros(), &back);
    let by_own = blocks(&-back, &(back * skew(&way)), &-back);
    let covariance =
        by_pose * covariance * by_pose.transpose() + by_own * own.covariance * by_own.transpose();
    (relative, covariance)
}

impl Pose {
    /// This pose and then `inner` before it: a point of the frame that `inner` starts from, in the frame that
    /// this pose leads to.
    pub fn after(&self, inner: &Self) -> Self {
        Self { rotation: self.rotation * inner.rotation, translation: self.transform(&inner.translation) }
    }

    /// The way back.
    pub fn inverse(&self) -> Self {
        let back = self.rotation.transpose();
        Self { rotation: back, translation: -(back * self.translation) }
    }

    /// (v, w) that takes `from` to this pose: `t = t_from + v` (mm), `R = Exp(w) R_from` (radians).
    pub fn difference(&self, from: &Self) -> [f64; 6] {
        crate::rest::difference(self, from).into()
    }
}

impl RestPose {
    /// The same rest as seen from a frame in which that of this pose has the pose `outer`; the covariances
    /// turn with it.
    pub fn seen_from(&self, outer: &Pose) -> Self {
        let turn = blocks(&outer.rotation, &Matrix3::zeros(), &outer.rotation);
        let turned = |covariance| turn * covariance * turn.transpose();
        Self {
            pose: outer.after(&self.pose),
            covariance: turned(self.covariance),
            common: turned(self.common),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix6, Vector6};

    fn solution(pose: Pose, covariance: Matrix6<f64>) -> Solution {
        Solution { pose, covariance, residual_px: 0.1, used: 0b1111, alternative: None }
    }

    fn own() -> Pose {
        Pose::of_camera([-900.0, 30.0, 250.0], [1.0, 4.0, -2.0])
    }

    fn other() -> Pose {
        Pose::of_camera([-1600.0, 60.0, 240.0], [3.0, 2.0, 5.0])
    }

    #[test]
    fn the_relative_pose_does_not_depend_on_where_the_camera_is() {
        let none = Matrix6::zeros();
        let first = relative_pose(&solution(own(), none), &solution(other(), none));
        let knock = Pose::of_camera([3.0, -2.0, 7.0], [0.3, -0.2, 0.4]);
        let moved = [own(), other()].map(|pose| solution(knock.after(&pose), none));
        let second = relative_pose(&moved[0], &moved[1]);
        // Rounding only, at lengths of a metre.
        assert!((first.pose.rotation - second.pose.rotation).norm() < 1e-12);
        assert!((first.pose.translation - second.pose.translation).norm() < 1e-9);
        assert!((own().after(&first.pose).translation - other().translation).norm() < 1e-9);
    }

    #[test]
    fn the_covariance_is_that_of_the_derivative_by_both_poses() {
        let zero = Matrix6::zeros();
        let at = relative_pose(&solution(own(), zero), &solution(other(), zero)).pose;
        for of_own in [true, false] {
            for axis in 0..6 {
                // A unit variance along one axis gives the square of the derivative along it.
                let mut unit = zero;
                unit[(axis, axis)] = 1.0;
                let [first, second] = if of_own { [unit, zero] } else { [zero, unit] };
                let covariance =
                    relative_pose(&solution(own(), first), &solution(other(), second)).covariance;
                let h = 1e-6;
                let mut d = [0.0; 6];
                d[axis] = h;
                let step = |pose: Pose| pose.perturbed([d[0], d[1], d[2]], [d[3], d[4], d[5]]);
                let (a, b) = if of_own { (step(own()), other()) } else { (own(), step(other())) };
                let moved = relative_pose(&solution(a, zero), &solution(b, zero)).pose;
                let slope = Vector6::from(moved.difference(&at)) / h;
                let expected = slope * slope.transpose();
                // Second order in h times a lever of 700 mm, squared.
                assert!((covariance - expected).norm() < 1e-3 * expected.norm().max(1.0), "{of_own} {axis}");
            }
        }
    }

    #[test]
    fn a_rest_pose_seen_from_elsewhere_has_the_same_covariance_in_its_own_frame() {
        let mut covariance = Matrix6::from_diagonal(&Vector6::new(1.0, 2.0, 3.0, 1e-4, 2e-4, 3e-4));
        (covariance[(0, 4)], covariance[(4, 0)]) = (1e-3, 1e-3);
        let rest = RestPose::new(other(), covariance);
        let elsewhere = rest.seen_from(&own());
        let off = elsewhere.covariance_in_rest_frame() - rest.covariance_in_rest_frame();
        assert!(off.norm() < 1e-9, "rounding only");
        assert!((elsewhere.pose.inverse().after(&elsewhere.pose).translation).norm() < 1e-9);
    }
}
