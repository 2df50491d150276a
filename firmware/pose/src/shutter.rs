//! Rows that are exposed one after the other, and motion while they are: each circle is taken at its own
//! row's time. The motion about the frame's time is the cubic one through this frame's pose and the last
//! three (thesis 4.1.1 asks for a global shutter; Meingast, Geyer and Sastry 2005 for the geometry of the
//! other kind).

use heapless::Vec;
use nalgebra::{Matrix2, Matrix2x6, Matrix6, SMatrix};

use crate::exposure::at_mid_exposure;
use crate::geometry::{Pose, skew};
use crate::lens::Lens;
use crate::robust::freedom;
use crate::track::{Rates, SMOOTH, Share, Track};
use crate::{MAX_CIRCLES, Observation, PoseError, Settings, Solution, scatter, solve};

/// Solutions after which it ends in any case. Each leaves some tenth of the error before it where the readout
/// takes a third of a frame's time (two or three suffice), and half of it where it takes all of it.
const PASSES: usize = 12;
/// A change below this share of a standard deviation is the last.
const LAST_CHANGE: f64 = 0.01;

/// When the rows of a frame are exposed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shutter {
    /// From the exposure of one row to that of the next one below, s; 0 for a global shutter, below 0 where
    /// the lowest row comes first.
    pub line_time_s: f64,
    /// Duration of each row's exposure, s; 0 where it is not known.
    pub exposure_s: f64,
    /// The row whose mid-exposure is the frame's time: the middle of the picture.
    pub middle_row: f64,
}

impl Shutter {
    /// All rows at once, for no time at all.
    pub const INSTANT: Self = Self { line_time_s: 0.0, exposure_s: 0.0, middle_row: 0.0 };
}

/// As [`solve`], for a frame whose rows were exposed as `shutter` says, after the poses of `track`: the pose
/// at the mid-exposure of the middle row. `prior` is the pose expected then.
///
/// The covariance has in it that the motion is taken from noisy poses, and what a cubic does not follow of it,
/// by how much it did not in the frames before. `track` remembers what [`Track::follow`] needs for that.
///
/// # Errors
/// As [`solve`].
pub fn solve_in_motion(
    observations: &[Observation],
    lens: &Lens,
    settings: &Settings,
    prior: &Pose,
    shutter: &Shutter,
    track: &mut Track,
    time_ns: u64,
) -> Result<Solution, PoseError> {
    if shutter.line_time_s != 0.0 {
        return row_by_row(observations, lens, settings, prior, shutter, track, time_ns);
    }
    let mut solution = solve(observations, lens, settings, Some(prior))?;
    at_mid_exposure(&mut solution, shutter, track, time_ns);
    Ok(solution)
}

/// Solves, takes the motion from the pose that comes out, and solves again, until that changes nothing.
fn row_by_row(
    observations: &[Observation],
    lens: &Lens,
    settings: &Settings,
    prior: &Pose,
    shutter: &Shutter,
    track: &mut Track,
    time_ns: u64,
) -> Result<Solution, PoseError> {
    let (mut solution, mut motion): (Option<Solution>, Option<Rates>) = (None, None);
    let mut pose = *prior;
    // Until there is a solution the track's cubic part is left out.
    let mut covariance = Matrix6::from_diagonal_element(f64::INFINITY);
    for _ in 0..PASSES {
        let Some(rates) = track.rates(time_ns, &pose, &covariance, SMOOTH) else { break };
        let corrected: Vec<Observation, MAX_CIRCLES> =
            observations.iter().map(|seen| at_frame_time(seen, lens, shutter, &pose, &rates)).collect();
        let found = solve(&corrected, lens, settings, Some(&pose))?;
        let change = found.pose.translation - pose.translation;
        let settled =
            (0..3).all(|i| change[i] * change[i] < LAST_CHANGE * LAST_CHANGE * found.covariance[(i, i)]);
        pose = found.pose;
        covariance = found.covariance;
        solution = Some(found);
        motion = Some(rates);
        if settled {
            break;
        }
    }
    let Some(mut solution) = solution else {
        return solve(observations, lens, settings, Some(prior));
    };
    if let Some(rates) = &motion
        && let Some((covariance, share)) =
            uncertain_motion(&solution, observations, lens, shutter, rates, track)
    {
        solution.covariance = covariance;
        track.latest = rates.is_cubic.then_some((time_ns, share));
    }
    Ok(solution)
}

/// The covariance with that of the motion in it. Circle i, seen at t_i, was moved back by the polynomial
/// `sum_m s_m D_m w_m(t_i)` of the divided differences `D_m = sum_k c_mk x_k` of the poses x_k, with
/// `w_m(t) = t (t - t_1) .. (t - t_(m-1))`, m from 1 to 3, and their shares s_m. With `H = sum J^T W J` and
/// `M_m = sum w_m(t_i) J^T W J` the errors e_k of the poses and what was left out, r_m, make
///
/// `(H + sum_m M_m s_m c_m0) e_0 = J^T W n - sum_k (sum_m M_m s_m c_mk) e_k - sum_m M_m r_m`.
///
/// The r_m are of a smooth motion and move the poses before by all but the same, which leaves their differences
/// as they are: of the r_m alone, `H e_0 = - sum_m M_m r_m`.
fn uncertain_motion(
    solution: &Solution,
    observations: &[Observation],
    lens: &Lens,
    shutter: &Shutter,
    rates: &Rates,
    track: &mut Track,
) -> Option<(Matrix6<f64>, Share)> {
    let mut information = Matrix6::zeros();
    let (mut in_time, mut squared) = ([Matrix6::zeros(); 4], [Matrix6::zeros(); 3]);
    for (i, seen) in observations.iter().enumerate() {
        if solution.used >> i & 1 == 0 {
            continue;
        }
        let point = solution.pose.transform(&seen.point);
        let (_, by_point) = lens.project_with_jacobian(&point).ok()?;
        let by_turn = by_point * -skew(&(point - solution.pose.translation));
        let mut jacobian = Matrix2x6::zeros();
        jacobian.fixed_columns_mut::<3>(0).copy_from(&by_point);
        jacobian.fixed_columns_mut::<3>(3).copy_from(&by_turn);
        let [uu, uv, vv] = seen.centre.covariance;
        let weight = Matrix2::new(uu, uv, uv, vv).try_inverse()?;
        let of_circle = jacobian.transpose() * weight * jacobian;
        information += of_circle;
        let t = (seen.centre.at[1] - shutter.middle_row) * shutter.line_time_s;
        let along = rates.along(t, shutter.exposure_s);
        for (sum, w) in in_time.iter_mut().zip(along) {
            *sum += of_circle * w;
        }
        for (sum, w) in squared.iter_mut().zip(&along[1..]) {
            *sum += of_circle * (w * w);
        }
    }
    let weights = rates.weights();
    let by_pose = |k: usize| {
        let mut sum = in_time[0] * weights[0][k];
        for m in 0..2 {
            sum += in_time[m + 1] * Matrix6::from_diagonal(&(rates.shares[m] * weights[m + 1][k]));
        }
        sum
    };
    let inverse = (information + by_pose(0)).try_inverse()?;
    let mut by_past = SMatrix::<f64, 6, 18>::zeros();
    for k in 0..3 {
        by_past.fixed_columns_mut::<6>(6 * k).copy_from(&(inverse * -by_pose(k + 1)));
    }
    let at_rest = information.try_inverse()?;
    let mut excess = (solution.covariance * information).trace() / 6.0;
    if excess > 1.0 {
        // What was left out shows in the residuals too, and is not to be counted twice.
        let freedom = freedom(solution.used);
        let chi2_of = |m: usize| {
            let not_followed = squared[m] - in_time[m + 1] * at_rest * in_time[m + 1];
            (rates.left_out[m] * not_followed).trace().max(0.0)
        };
        let expected = freedom + chi2_of(0) + chi2_of(1) + chi2_of(2);
        excess = scatter::excess(excess * (freedom - 2.0) * freedom / expected, freedom).min(excess);
    }
    if track.lags.is_none() {
        // Poses that were taken without this motion are off by about what it does to one.
        let way = at_rest * in_time[0] * rates.first;
        track.joint.take_for_all(&(at_rest * excess + way * way.transpose()));
    }
    let with_past = by_past * track.joint.0;
    let own = inverse * information * inverse.transpose() * excess + with_past * by_past.transpose();
    let mut covariance = own;
    for (m, left_out) in rates.left_out.iter().enumerate() {
        let by_left_out = at_rest * in_time[m + 1];
        covariance += by_left_out * left_out * by_left_out.transpose();
    }
    shared(covariance, own, with_past)
}

/// A covariance and the part of it that later ones hang together with; none where it is no number.
pub(crate) fn shared(
    covariance: Matrix6<f64>,
    own: Matrix6<f64>,
    with_past: SMatrix<f64, 6, 18>,
) -> Option<(Matrix6<f64>, Share)> {
    let symmetric = |c: Matrix6<f64>| (c + c.transpose()) * 0.5;
    let is_finite = covariance.iter().chain(with_past.iter()).all(|c| c.is_finite());
    is_finite.then(|| (symmetric(covariance), Share { own: symmetric(own), with_past }))
}

/// Where a circle would have been seen at the frame's time, had that taken no time.
fn at_frame_time(
    seen: &Observation,
    lens: &Lens,
    shutter: &Shutter,
    pose: &Pose,
    rates: &Rates,
) -> Observation {
    let later_s = (seen.centre.at[1] - shutter.middle_row) * shutter.line_time_s;
    let then = rates.pose_at(pose, later_s, shutter.exposure_s);
    let mut corrected = *seen;
    // A circle that no pose shows stays where it is, and the solver says what is wrong with it.
    if let (Ok(now), Ok(then)) =
        (lens.project(&pose.transform(&seen.point)), lens.project(&then.transform(&seen.point)))
    {
        corrected.centre.at = [0, 1].map(|i| seen.centre.at[i] - (then[i] - now[i]));
    }
    corrected
}
