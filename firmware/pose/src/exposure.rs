//! Motion within an exposure of all rows at once: a picture shows the mean over it, which is not where the
//! carbody is in its middle.

use nalgebra::{Matrix6, SMatrix, Vector6};

use crate::Solution;
use crate::shutter::{Shutter, shared};
use crate::track::{Track, moved_by};

/// Brings the mean over the exposure to its middle: `solution` is of the frame at `time_ns`, `track` of those
/// before it. As [`crate::solve_in_motion`] does, covariance included, for a pose that was made of several.
pub fn at_mid_exposure(solution: &mut Solution, shutter: &Shutter, track: &mut Track, time_ns: u64) {
    if shutter.exposure_s <= 0.0 {
        return;
    }
    let Some(rates) = track.rates(time_ns, &solution.pose, &solution.covariance) else { return };
    // All circles move alike: what is true of one is true of the pose. `weights` say how far it follows this
    // pose and the three before it.
    let (along, weights) = (rates.along(0.0, shutter.exposure_s), rates.weights());
    let by_pose = |k: usize| -> Vector6<f64> {
        let [second, third] = [0, 1].map(|m| rates.shares[m] * (along[m + 1] * weights[m + 1][k]));
        second + third
    };
    let by_own = (Vector6::repeat(1.0) + by_pose(0)).map(|factor| 1.0 / factor);
    let mean = rates.mean_over(shutter.exposure_s).component_mul(&by_own);
    solution.pose = moved_by(&solution.pose, &-mean);
    if let Some(other) = &mut solution.alternative {
        other.pose = moved_by(&other.pose, &-mean);
    }

    if track.lags.is_none() {
        // Poses that were taken without this motion are off by about what it does to one.
        track.joint.take_for_all(&(solution.covariance + mean * mean.transpose()));
    }
    let mut by_past = SMatrix::<f64, 6, 18>::zeros();
    for k in 0..3 {
        let share = -by_own.component_mul(&by_pose(k + 1));
        by_past.fixed_columns_mut::<6>(6 * k).copy_from(&Matrix6::from_diagonal(&share));
    }
    let by_own = Matrix6::from_diagonal(&by_own);
    let with_past = by_past * track.joint.0;
    let own = by_own * solution.covariance * by_own + with_past * by_past.transpose();
    let left_out = rates.left_out.iter().zip(&along[1..]);
    let covariance = left_out.fold(own, |sum, (left_out, w)| sum + left_out * (w * w));
    if let Some((covariance, share)) = shared(covariance, own, with_past) {
        solution.covariance = covariance;
        track.latest = rates.is_cubic.then_some((time_ns, share));
    }
}
