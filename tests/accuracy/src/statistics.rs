//! How far a pose is from the truth, and what many of them come to.

use gangway_pose::{Pose, Solution};
use nalgebra::{Matrix6, Vector3, Vector6};

/// A normalised squared error of six degrees of freedom stays below this in all but one of 10,000 cases.
pub const ONE_IN_10_000: f64 = 27.86;

/// (v, w) that takes a pose to the true one, mm and radians along the camera's axes: what
/// [`Solution::covariance`] speaks of.
pub fn error(pose: &Pose, truth: &Pose) -> Vector6<f64> {
    let v = truth.translation - pose.translation;
    let t = truth.rotation * pose.rotation.transpose();
    let w = Vector3::new(t.m32 - t.m23, t.m13 - t.m31, t.m21 - t.m12) / 2.0;
    Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
}

/// The error squared in the metric of a covariance.
pub fn squared(error: &Vector6<f64>, covariance: &Matrix6<f64>) -> f64 {
    covariance.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(error)))
}

/// The normalised squared error of a solution.
pub fn squared_error(solution: &Solution, truth: &Pose) -> f64 {
    squared(&error(&solution.pose, truth), &solution.covariance)
}

/// The middle of some numbers.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[n / 2],
        n => 0.5 * (values[n / 2 - 1] + values[n / 2]),
    }
}

/// The mean.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
