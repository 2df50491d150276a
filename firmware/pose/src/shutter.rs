//! Rows that are exposed one after the other, and motion while they are: each circle is taken at its own
//! row's time. The motion about the frame's time is the cubic one through this frame's pose and the last
//! three (thesis 4.1.1 asks for a global shutter; Meingast, Geyer and Sastry 2005 for the geometry of the
//! other kind).

use heapless::Vec;
use nalgebra::{Matrix2, Matrix2x6, Matrix6, Vector6};

use crate::geometry::{Pose, rotation_vector, skew};
use crate::lens::Lens;
use crate::{MAX_CIRCLES, Observation, PoseError, Settings, Solution, solve};

/// Solutions after which it ends in any case. Each leaves some tenth of the error before it where the readout
/// takes a third of a frame's time (two or three suffice), and half of it where it takes all of it.
const PASSES: usize = 12;
/// A change below this share of a standard deviation is the last.
const LAST_CHANGE: f64 = 0.01;
/// Poses further back than this say nothing of the motion now, s.
const OLDEST_S: f64 = 0.25;

/// Third differences above this share of the second ones (and its square of the first ones) are a shock,
/// which does not go on: a sine has at most the square of its phase's step from frame to frame, this much at
/// 5.6 Hz and 50 frames/s.
const SMOOTH: f64 = 0.5;

/// What the cubic leaves out of the speed is about this share of what its last term gives: exact for 2 Hz at
/// 40 frames/s, of which it is 0.75 times the phase's step.
const LEFT_OUT: f64 = 0.25;

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

/// The last three poses with the times of their frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct Track {
    /// Latest first; ns.
    past: [Option<(u64, Pose)>; 3],
}

/// The motion about a pose, (v, w) as [`Solution::covariance`]: coefficients of the seconds, their square and
/// cube.
#[derive(Default)]
struct Rates {
    first: Vector6<f64>,
    second: Vector6<f64>,
    third: Vector6<f64>,
    /// How much the speed at the pose follows this pose, and the root of the sum of squares of how much it
    /// follows those before, 1/s.
    by_this: Vector6<f64>,
    by_past: Vector6<f64>,
    /// Standard deviation of the speed from what the cubic leaves out.
    beyond: Vector6<f64>,
}

impl Track {
    /// Takes the pose of a frame.
    pub fn follow(&mut self, time_ns: u64, pose: &Pose) {
        self.past = [Some((time_ns, *pose)), self.past[0], self.past[1]];
    }

    /// Forgets all poses: what comes next does not follow from them.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// The motion about `pose` at a time after those of the track, by Newton's divided differences; none
    /// where nothing is known of it. `variances` are those of each pose.
    fn rates(&self, time_ns: u64, pose: &Pose, variances: &Vector6<f64>) -> Option<Rates> {
        let back = |past: Option<(u64, Pose)>| {
            let (before_ns, before) = past?;
            let seconds = time_ns.checked_sub(before_ns)? as f64 * -1e-9;
            let v = before.translation - pose.translation;
            let w = rotation_vector(&(before.rotation * pose.rotation.transpose()));
            let slope = Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z) / seconds;
            (seconds < 0.0 && seconds > -OLDEST_S).then_some((seconds, slope))
        };
        let (x1, slope1) = back(self.past[0])?;
        let per_second = Vector6::repeat(-1.0 / x1);
        let even = Rates { first: slope1, by_this: per_second, by_past: per_second, ..Rates::default() };
        let (Some((x2, slope2)), Some((x3, slope3))) = (back(self.past[1]), back(self.past[2])) else {
            return Some(even);
        };
        if !(x2 < x1 && x3 < x2) {
            return Some(even);
        }
        let second = (slope2 - slope1) / (x2 - x1);
        let third = ((slope3 - slope1) / (x3 - x1) - second) / (x3 - x2);
        // Each coordinate by itself, by its differences from frame to frame.
        let step = x3 / 3.0;
        let mut rates = even;
        for i in 0..6 {
            let [d1, d2, d3] =
                [step * slope1[i], 2.0 * step * step * second[i], 6.0 * step * step * step * third[i]]
                    .map(|d| d * d);
            // The third difference of four poses has twenty times the variance of one.
            let noise = 20.0 * variances[i];
            if d3 > 9.0 * noise && d3 > SMOOTH * (SMOOTH * d1 + d2) {
                continue;
            }
            // What is not above the noise is noise, which extrapolation would only make larger (Wiener's
            // filter).
            let share = if d3 > noise { 1.0 - noise / d3 } else { 0.0 };
            let third = share * third[i];
            rates.first[i] += third * (x1 * x2) - second[i] * x1;
            rates.second[i] = second[i] - third * (x1 + x2);
            rates.third[i] = third;
            // The weights of the differences 1, 1/2, 1/3 (by `share`), written out for the four poses.
            let past = [2.0 + share, 0.5 + share, share / 3.0].map(|c| c * c);
            rates.by_this[i] *= 1.5 + share / 3.0;
            rates.by_past[i] *= libm::sqrt(past[0] + past[1] + past[2]);
            rates.beyond[i] = LEFT_OUT * third * (x1 * x2);
        }
        Some(rates)
    }
}

impl Rates {
    /// The pose so many seconds later.
    fn pose_at(&self, pose: &Pose, seconds: f64) -> Pose {
        moved_by(pose, &((self.third * seconds + self.second) * seconds + self.first).scale(seconds))
    }
}

fn moved_by(pose: &Pose, d: &Vector6<f64>) -> Pose {
    pose.perturbed([d[0], d[1], d[2]], [d[3], d[4], d[5]])
}

/// As [`solve`], for a frame whose rows were exposed as `shutter` says, after the poses of `track`: the pose
/// at the mid-exposure of the middle row. `prior` is the pose expected then.
///
/// The covariance has in it that the motion is taken from noisy poses, and a guess of what a cubic cannot
/// follow.
///
/// # Errors
/// As [`solve`].
pub fn solve_in_motion(
    observations: &[Observation],
    lens: &Lens,
    settings: &Settings,
    prior: &Pose,
    shutter: &Shutter,
    track: &Track,
    time_ns: u64,
) -> Result<Solution, PoseError> {
    let mut solution = if shutter.line_time_s == 0.0 {
        solve(observations, lens, settings, Some(prior))?
    } else {
        row_by_row(observations, lens, settings, prior, shutter, track, time_ns)?
    };
    at_mid_exposure(&mut solution, shutter, track, time_ns);
    Ok(solution)
}

/// Brings the mean over the exposure, which is what a picture shows, to its middle: `solution` is of the
/// frame at `time_ns`, `track` of those before it. As [`solve_in_motion`] does, for a pose that was made of
/// several.
pub fn at_mid_exposure(solution: &mut Solution, shutter: &Shutter, track: &Track, time_ns: u64) {
    // Over an exposure a point is on average a T^2 / 24 from where it is in the middle.
    if shutter.exposure_s > 0.0
        && let Some(rates) = track.rates(time_ns, &solution.pose, &solution.covariance.diagonal())
    {
        let smear = rates.second * (-shutter.exposure_s * shutter.exposure_s / 12.0);
        solution.pose = moved_by(&solution.pose, &smear);
        if let Some(other) = &mut solution.alternative {
            other.pose = moved_by(&other.pose, &smear);
        }
    }
}

/// Solves, takes the motion from the pose that comes out, and solves again, until that changes nothing.
fn row_by_row(
    observations: &[Observation],
    lens: &Lens,
    settings: &Settings,
    prior: &Pose,
    shutter: &Shutter,
    track: &Track,
    time_ns: u64,
) -> Result<Solution, PoseError> {
    let (mut solution, mut motion): (Option<Solution>, Option<Rates>) = (None, None);
    let mut pose = *prior;
    // Until there is a solution the track's cubic part is left out.
    let mut variances = Vector6::repeat(f64::INFINITY);
    for _ in 0..PASSES {
        let Some(rates) = track.rates(time_ns, &pose, &variances) else { break };
        let corrected: Vec<Observation, MAX_CIRCLES> =
            observations.iter().map(|seen| at_frame_time(seen, lens, shutter, &pose, &rates)).collect();
        let found = solve(&corrected, lens, settings, Some(&pose))?;
        let change = found.pose.translation - pose.translation;
        let settled =
            (0..3).all(|i| change[i] * change[i] < LAST_CHANGE * LAST_CHANGE * found.covariance[(i, i)]);
        pose = found.pose;
        variances = found.covariance.diagonal();
        solution = Some(found);
        motion = Some(rates);
        if settled {
            break;
        }
    }
    if let (Some(solution), Some(rates)) = (&mut solution, &motion) {
        let covariance = uncertain_motion(solution, observations, lens, shutter, rates);
        solution.covariance = covariance.unwrap_or(solution.covariance);
    }
    solution.map_or_else(|| solve(observations, lens, settings, Some(prior)), Ok)
}

/// The covariance with that of the speed in it. A speed that is off by s moves circle i by J_i s t_i, t_i its
/// time: with H = sum J^T W J and M = sum t J^T W J the pose's error e fulfils `(H + M a) e = J^T W n - M s`,
/// where a is how much the speed follows this pose itself.
fn uncertain_motion(
    solution: &Solution,
    observations: &[Observation],
    lens: &Lens,
    shutter: &Shutter,
    rates: &Rates,
) -> Option<Matrix6<f64>> {
    let mut information = Matrix6::zeros();
    let mut in_time = Matrix6::zeros();
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
        in_time += of_circle * ((seen.centre.at[1] - shutter.middle_row) * shutter.line_time_s);
    }
    let by_past = Matrix6::from_diagonal(&rates.by_past);
    let beyond = rates.beyond.component_mul(&rates.beyond);
    let speed = by_past * solution.covariance * by_past + Matrix6::from_diagonal(&beyond);
    let excess = (solution.covariance * information).trace() / 6.0;
    let inverse = (information + in_time * Matrix6::from_diagonal(&rates.by_this)).try_inverse()?;
    let noise = information * excess + in_time * speed * in_time.transpose();
    let covariance = inverse * noise * inverse.transpose();
    covariance.iter().all(|c| c.is_finite()).then_some((covariance + covariance.transpose()) * 0.5)
}

/// Where a circle would have been seen at the frame's time.
fn at_frame_time(
    seen: &Observation,
    lens: &Lens,
    shutter: &Shutter,
    pose: &Pose,
    rates: &Rates,
) -> Observation {
    let later_s = (seen.centre.at[1] - shutter.middle_row) * shutter.line_time_s;
    let then = rates.pose_at(pose, later_s);
    let mut corrected = *seen;
    // A circle that no pose shows stays where it is, and the solver says what is wrong with it.
    if let (Ok(now), Ok(then)) =
        (lens.project(&pose.transform(&seen.point)), lens.project(&then.transform(&seen.point)))
    {
        corrected.centre.at = [0, 1].map(|i| seen.centre.at[i] - (then[i] - now[i]));
    }
    corrected
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn at(x: f64) -> Pose {
        Pose { rotation: Matrix3::identity(), translation: Vector3::new(x, 0.0, 1500.0) }
    }

    #[test]
    fn an_even_acceleration_is_found_from_four_poses_at_uneven_times() {
        let x = |t: f64| 5.0 + 300.0 * t - 0.5 * 4000.0 * t * t;
        let mut track = Track::default();
        track.follow(980_000_000, &at(x(0.98)));
        track.follow(1_000_000_000, &at(x(1.0)));
        track.follow(1_030_000_000, &at(x(1.03)));
        let exact = Vector6::repeat(1e-12);
        let rates = track.rates(1_050_000_000, &at(x(1.05)), &exact).expect("three poses before");
        assert!((rates.first[0] - (300.0 - 4000.0 * 1.05)).abs() < 1e-6, "{}", rates.first);
        assert!((rates.second[0] + 2000.0).abs() < 1e-4, "{}", rates.second);
        assert!((rates.pose_at(&at(x(1.05)), 0.004).translation.x - x(1.054)).abs() < 1e-6);
    }

    #[test]
    fn a_shock_does_not_go_on() {
        for places in [[0.0, 0.0, 0.0, 38.0], [0.0, 0.0, 38.0, 38.0], [0.0, 38.0, 38.0, 38.0]] {
            let mut track = Track::default();
            for (frame, x) in places.iter().take(3).enumerate() {
                track.follow(20_000_000 * frame as u64, &at(*x));
            }
            let rates = track.rates(60_000_000, &at(places[3]), &Vector6::repeat(1e-4)).expect("a track");
            assert_eq!(rates.second[0], 0.0);
            assert!((rates.first[0] - (places[3] - places[2]) / 0.02).abs() < 1e-6);
        }
    }

    #[test]
    fn a_change_of_the_acceleration_counts_as_far_as_it_is_above_the_noise() {
        let x = |t: f64| 3000.0 * t + 1e5 * t * t * t;
        let mut track = Track::default();
        for frame in 0..3 {
            track.follow(frame * 20_000_000, &at(x(0.02 * frame as f64)));
        }
        let rates =
            |variance| track.rates(60_000_000, &at(x(0.06)), &Vector6::repeat(variance)).expect("a track");
        assert!((rates(1e-12).pose_at(&at(x(0.06)), 0.005).translation.x - x(0.065)).abs() < 1e-6);
        // The third difference is 4.8 mm: a standard deviation of 2 mm makes it noise.
        assert_eq!(rates(4.0).third[0], 0.0);
        assert!(rates(0.4).third[0] > 0.6e5 && rates(0.4).third[0] < 0.7e5, "{}", rates(0.4).third);
    }

    #[test]
    fn nothing_is_known_of_the_motion_after_a_gap_or_from_a_clock_that_stands() {
        let mut track = Track::default();
        assert!(track.rates(0, &at(0.0), &Vector6::zeros()).is_none());
        track.follow(1_000_000_000, &at(0.0));
        assert!(track.rates(2_000_000_000, &at(0.0), &Vector6::zeros()).is_none(), "a second is too long");
        assert!(track.rates(1_000_000_000, &at(0.0), &Vector6::zeros()).is_none(), "no time went by");
        assert!(track.rates(900_000_000, &at(0.0), &Vector6::zeros()).is_none(), "time went back");
    }
}
