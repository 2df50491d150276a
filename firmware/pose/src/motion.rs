//! Relative motion of the carbodies against the rest pose (thesis 3.4.3, equation 3.22), its angles and its
//! covariance.

use nalgebra::{Matrix3, Matrix6, Vector3};

use crate::Solution;
use crate::geometry::{Pose, skew};

/// Degrees of one radian.
const DEGREES: f64 = 180.0 / core::f64::consts::PI;

/// The rest pose `[R0 | t0]`, both carbodies aligned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestPose {
    /// The pose.
    pub pose: Pose,
    /// Its covariance, as in [`Solution::covariance`], but for what is in `common`.
    pub covariance: Matrix6<f64>,
    /// Covariance of what every pose of the ride has in common with this one, as if the carbody's own axes
    /// were elsewhere in it: what a layout is off by. A motion feels it only as far as it goes.
    pub common: Matrix6<f64>,
}

impl RestPose {
    /// A rest pose that has nothing in common with later ones.
    pub fn new(pose: Pose, covariance: Matrix6<f64>) -> Self {
        Self { pose, covariance, common: Matrix6::zeros() }
    }

    /// Covariance of (x, y, z, roll, pitch, yaw) of this pose in its own frame; mm and degrees.
    pub fn covariance_in_rest_frame(&self) -> Matrix6<f64> {
        let turn = self.pose.rotation.transpose();
        let jacobian = blocks(&turn, &Matrix3::zeros(), &(turn * DEGREES));
        jacobian * (self.covariance + self.common) * jacobian.transpose()
    }
}

/// Motion of `CB_02` in the rest frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// x, y, z, mm.
    pub displacement_mm: [f64; 3],
    /// Roll, pitch, yaw, degrees.
    pub rotation_deg: [f64; 3],
    /// Covariance of (x, y, z, roll, pitch, yaw), mm and degrees, the rest pose's own included.
    pub covariance: Matrix6<f64>,
}

/// Equation 3.22: `dR = R0^T R`, `d = R0^T (t - t0)`, with the covariance of both poses carried through the
/// derivative of these equations and of the angles.
pub fn relative_motion(rest: &RestPose, solution: &Solution) -> Motion {
    let turn = rest.pose.rotation.transpose();
    let shift = solution.pose.translation - rest.pose.translation;
    let displacement = turn * shift;
    let [roll, pitch, yaw] = angles(&(turn * solution.pose.rotation));
    // R' = Exp(w) R makes dR' = Exp(R0^T w) dR; R0' = Exp(w0) R0 makes dR' = Exp(-R0^T w0) dR.
    let by_turn = angle_rates(pitch, yaw) * turn * DEGREES;
    let of_pose = blocks(&turn, &Matrix3::zeros(), &by_turn);
    let of_rest = blocks(&-turn, &(turn * skew(&shift)), &-by_turn);
    // Both poses with other axes of the carbody: R Exp(g) = Exp(R g) R.
    let carried = solution.pose.rotation * turn;
    let of_both = of_rest + of_pose * blocks(&carried, &Matrix3::zeros(), &carried);
    let covariance = of_pose * solution.covariance * of_pose.transpose()
        + of_rest * rest.covariance * of_rest.transpose()
        + of_both * rest.common * of_both.transpose();
    Motion {
        displacement_mm: displacement.into(),
        rotation_deg: [roll * DEGREES, pitch * DEGREES, yaw * DEGREES],
        covariance,
    }
}

/// Roll, pitch, yaw (radians) of `Rz(yaw) Ry(pitch) Rx(roll)`.
pub fn angles(rotation: &Matrix3<f64>) -> [f64; 3] {
    let r = rotation;
    let yaw = libm::atan2(r.m21, r.m11);
    let (sine, cosine) = (libm::sin(yaw), libm::cos(yaw));
    let pitch = libm::atan2(-r.m31, cosine * r.m11 + sine * r.m21);
    let roll = libm::atan2(sine * r.m13 - cosine * r.m23, -sine * r.m12 + cosine * r.m22);
    [roll, pitch, yaw]
}

/// `Rz(yaw) Ry(pitch) Rx(roll)`; radians.
pub fn rotation(roll: f64, pitch: f64, yaw: f64) -> Matrix3<f64> {
    let (sr, cr) = (libm::sin(roll), libm::cos(roll));
    let (sp, cp) = (libm::sin(pitch), libm::cos(pitch));
    let (sy, cy) = (libm::sin(yaw), libm::cos(yaw));
    Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
}

/// Derivative of (roll, pitch, yaw) by a left rotation vector of `Rz Ry Rx`.
fn angle_rates(pitch: f64, yaw: f64) -> Matrix3<f64> {
    let (sy, cy) = (libm::sin(yaw), libm::cos(yaw));
    let (sp, cp) = (libm::sin(pitch), libm::cos(pitch));
    Matrix3::new(cy / cp, sy / cp, 0.0, -sy, cy, 0.0, cy * sp / cp, sy * sp / cp, 1.0)
}

/// `[[a, b], [0, d]]`.
pub(crate) fn blocks(a: &Matrix3<f64>, b: &Matrix3<f64>, d: &Matrix3<f64>) -> Matrix6<f64> {
    let mut whole = Matrix6::zeros();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(a);
    whole.fixed_view_mut::<3, 3>(0, 3).copy_from(b);
    whole.fixed_view_mut::<3, 3>(3, 3).copy_from(d);
    whole
}

/// Displacement (mm) and angles (degrees) as the pose that they make from a rest pose: the inverse of
/// [`relative_motion`].
pub fn moved(rest: &Pose, displacement_mm: [f64; 3], rotation_deg: [f64; 3]) -> Pose {
    let [roll, pitch, yaw] = rotation_deg.map(|a| a / DEGREES);
    Pose {
        rotation: rest.rotation * rotation(roll, pitch, yaw),
        translation: rest.translation + rest.rotation * Vector3::from(displacement_mm),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;

    #[test]
    fn what_both_poses_have_in_common_is_other_axes_of_the_carbody() {
        let rest = Pose::of_camera([-1600.0, 40.0, 300.0], [0.5, 4.0, -1.0]);
        let now = moved(&rest, [12.0, -170.0, 45.0], [2.0, -1.0, 6.0]);
        let solution = |pose| Solution {
            pose,
            covariance: Matrix6::zeros(),
            residual_px: 0.0,
            used: 0b1111,
            alternative: None,
        };
        let values = |axes: &Pose| {
            let motion = relative_motion(
                &RestPose::new(rest.after(axes), Matrix6::zeros()),
                &solution(now.after(axes)),
            );
            let [d, a] = [motion.displacement_mm, motion.rotation_deg];
            Vector6::new(d[0], d[1], d[2], a[0], a[1], a[2])
        };
        let at_home = Pose { rotation: Matrix3::identity(), translation: Vector3::zeros() };
        for i in 0..6 {
            // Along the camera's axes at rest, and as it looks from the carbody.
            let mut step = [[0.0; 3]; 2];
            step[i / 3][i % 3] = 1e-5;
            let [v, w] = step.map(|step| rest.rotation.transpose() * Vector3::from(step));
            let axes = at_home.perturbed(v.into(), w.into());
            let change = (values(&axes) - values(&at_home)) / 1e-5;
            let mut common = Matrix6::zeros();
            common[(i, i)] = 1.0;
            let covariance = relative_motion(
                &RestPose { pose: rest, covariance: Matrix6::zeros(), common },
                &solution(now),
            )
            .covariance;
            let off = (covariance - change * change.transpose()).norm();
            assert!(off < 1e-4 * covariance.norm().max(1e-6), "{i}: {off} of {}", covariance.norm());
            // A train at rest feels nothing of it.
            let still = relative_motion(
                &RestPose { pose: rest, covariance: Matrix6::zeros(), common },
                &solution(rest),
            );
            assert!(still.covariance.norm() < 1e-12);
        }
    }
}
