//! The motion about a frame: the cubic through its pose and the last three, each coordinate's cubic part by
//! how far it is above the noise (Wiener's filter), with the covariance of what it rests on and of what it
//! leaves out.

use nalgebra::{Matrix6, SMatrix, Vector6};

use crate::eigen::symmetric;
use crate::exposure::Bends;
use crate::geometry::{Pose, rotation_vector};

/// Poses further back than this say nothing of the motion now, s.
const OLDEST_S: f64 = 0.25;

/// Third differences above this share of the second ones (and its square of the first ones) are a shock,
/// which does not go on: a sine has at most the square of its phase's step from frame to frame, this much at
/// 5.6 Hz and 50 frames/s.
pub(crate) const SMOOTH: f64 = 0.5;

/// A difference whose square is above this many times its noise's variance is no chance.
const CLEAR: f64 = 16.0;
/// A sine's square is at most twice its mean, that of two sines four times: what is above is new.
pub(crate) const NEW: f64 = 4.0;

/// Frames whose mean a [`Power`] is in the end. What the cubic leaves out is large where its own last term is
/// small, a quarter of a period later, so that it takes a period to tell it; and more to tell it from noise,
/// which six numbers of n frames exceed by up to `2 sqrt(6 / n)` of it in some direction.
pub(crate) const FRAMES: f64 = 100.0;

/// The last poses with the times of their frames, and how far they are to be trusted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Track {
    /// Latest first; ns.
    past: [Option<(u64, Pose)>; 4],
    /// Joint covariance of the errors of the last three that come from their centres. They hang together:
    /// each was corrected by the motion that those before it gave.
    pub(crate) joint: Joint,
    /// What the frame solved last adds to that, with its time.
    pub(crate) latest: Option<(u64, Share)>,
    /// Covariance of the last pose's errors, and theirs with those one, two and three frames before, where
    /// they are known.
    pub(crate) lags: Option<Lags>,
    /// Poses one after the other that were taken by the cubic through those before. Without that they are off
    /// by more than their centres say, and nothing is learnt from them.
    run: usize,
    /// Of the third and the fourth divided difference.
    power: [Power; 2],
    /// How much the motion has bent, and how it did at the frame solved last, with its time.
    pub(crate) bends: Bends,
    pub(crate) bend: Option<(u64, Vector6<f64>)>,
}

/// Covariances of the errors of poses so many frames apart.
type Lags = [Matrix6<f64>; 4];

/// Covariance of the errors of three poses; none of those not known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Joint(pub(crate) SMatrix<f64, 18, 18>);

impl Default for Joint {
    fn default() -> Self {
        Self(SMatrix::zeros())
    }
}

impl Joint {
    /// Takes the covariance for that of each of the three, which have nothing in common.
    pub(crate) fn take_for_all(&mut self, each: &Matrix6<f64>) {
        for k in 0..3 {
            self.0.fixed_view_mut::<6, 6>(6 * k, 6 * k).copy_from(each);
        }
    }
}

/// The part of a pose's covariance that comes from the centres of its own frame and of those before it, and
/// its covariance with the errors of the last three.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Share {
    pub(crate) own: Matrix6<f64>,
    pub(crate) with_past: SMatrix<f64, 6, 18>,
}

/// What the divided differences of some order have been so far, (mm or radians / s^order)^2.
#[derive(Clone, Copy, Debug, Default)]
struct Power {
    /// Means of their outer product and of the covariance of their noise.
    square: Matrix6<f64>,
    noise: Matrix6<f64>,
    /// The first without the second.
    signal: Matrix6<f64>,
    frames: f64,
}

impl Power {
    fn learn(&mut self, difference: &Vector6<f64>, noise: &Matrix6<f64>) {
        self.frames = (self.frames + 1.0).min(FRAMES);
        self.square += (difference * difference.transpose() - self.square) / self.frames;
        self.noise += (noise - self.noise) / self.frames;
        self.signal = without(&self.square, &self.noise).unwrap_or(self.square);
    }

    /// Covariance of a difference without its noise. Where nothing is known yet, or this one is clearly above
    /// all before, it stands for all.
    fn of(&self, difference: &Vector6<f64>, noise: &Matrix6<f64>) -> Matrix6<f64> {
        let square = difference.component_mul(difference);
        let is_new = |i| square[i] > CLEAR * noise[(i, i)] && square[i] > NEW * self.square[(i, i)];
        if self.frames > 0.0 && !(0..6).any(is_new) {
            return self.signal;
        }
        let kept = Vector6::from_fn(|i, _| {
            let share = 1.0 - noise[(i, i)] / square[i];
            if share > 0.0 { difference[i] * libm::sqrt(share) } else { 0.0 }
        });
        kept * kept.transpose()
    }
}

/// What is left of a covariance without that of the noise in it, in no direction below zero.
fn without(whole: &Matrix6<f64>, noise: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let root = noise.cholesky()?.l();
    let half = root.solve_lower_triangular(whole)?;
    let white = root.solve_lower_triangular(&half.transpose())?;
    let (values, vectors) = symmetric::<6>(white.into());
    let mut left = Matrix6::zeros();
    for (value, vector) in values.iter().zip(vectors) {
        let direction = root * Vector6::from(vector);
        left += direction * direction.transpose() * (value - 1.0).max(0.0);
    }
    Some(left)
}

/// The motion about a pose, (v, w) as [`crate::Solution::covariance`]: coefficients of the seconds, their
/// square and cube; and what they rest on.
pub(crate) struct Rates {
    pub(crate) first: Vector6<f64>,
    pub(crate) second: Vector6<f64>,
    pub(crate) third: Vector6<f64>,
    /// Seconds of the last three poses, at most 0.
    pub(crate) past: [f64; 3],
    /// How much of the second and the third divided difference was taken, each coordinate by itself.
    pub(crate) shares: [Vector6<f64>; 2],
    /// Whether there were so many poses that the cubic could be taken, and so many that what it leaves out
    /// could be weighed.
    pub(crate) is_cubic: bool,
    pub(crate) is_weighed: bool,
    /// Covariance of what was not taken of the second, third and fourth.
    pub(crate) left_out: [Matrix6<f64>; 3],
}

/// Weights of the divided difference of `N` poses at these times: `1 / prod (x_k - x_j)`.
fn divided<const N: usize>(times: [f64; N]) -> [f64; N] {
    core::array::from_fn(|k| {
        let others = (0..N).filter(|j| *j != k);
        1.0 / others.map(|j| times[k] - times[j]).product::<f64>()
    })
}

/// Covariance of the sum of poses with these weights, one after the other.
fn noise<const N: usize>(weights: [f64; N], lags: &Lags) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    for (lag, covariance) in lags.iter().enumerate() {
        let products = weights.iter().zip(&weights[lag..]).map(|(a, b)| a * b).sum::<f64>();
        sum += (covariance + covariance.transpose()) * if lag == 0 { 0.5 * products } else { products };
    }
    sum
}

impl Track {
    /// Takes the pose of a frame.
    pub fn follow(&mut self, time_ns: u64, pose: &Pose) {
        if let Some((_, bend)) = self.bend.take().filter(|(at_ns, _)| *at_ns == time_ns) {
            self.bends.learn(&bend);
        }
        let latest = self.latest.take().filter(|(at_ns, _)| *at_ns == time_ns).map(|(_, share)| share);
        match &latest {
            Some(share) => {
                let with = |k: usize| share.with_past.fixed_columns::<6>(6 * k).into_owned();
                let lags = [share.own, with(0), with(1), with(2)];
                self.lags = Some(lags);
                self.run = self.run.saturating_add(1);
                if self.run > self.past.len()
                    && let [Some(third), Some(fourth)] = self.differences(time_ns, pose, &lags)
                {
                    self.power[0].learn(&third.0, &third.1);
                    self.power[1].learn(&fourth.0, &fourth.1);
                }
                let mut joint = SMatrix::<f64, 18, 18>::zeros();
                joint.fixed_view_mut::<6, 6>(0, 0).copy_from(&share.own);
                let with_past = share.with_past.fixed_columns::<12>(0);
                joint.fixed_view_mut::<6, 12>(0, 6).copy_from(&with_past);
                joint.fixed_view_mut::<12, 6>(6, 0).copy_from(&with_past.transpose());
                joint.fixed_view_mut::<12, 12>(6, 6).copy_from(&self.joint.0.fixed_view::<12, 12>(0, 0));
                self.joint = Joint(joint);
            }
            None => {
                self.joint = Joint::default();
                self.lags = None;
                self.run = 0;
                self.power = [Power::default(); 2];
            }
        }
        self.past = [Some((time_ns, *pose)), self.past[0], self.past[1], self.past[2]];
    }

    /// Forgets all poses: what comes next does not follow from them.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Seconds since `time_ns` (below 0) of a pose before it and its difference (v, w) from `pose`.
    fn back(&self, i: usize, time_ns: u64, pose: &Pose) -> Option<(f64, Vector6<f64>)> {
        let (before_ns, before) = self.past[i]?;
        let seconds = time_ns.checked_sub(before_ns)? as f64 * -1e-9;
        let v = before.translation - pose.translation;
        let w = rotation_vector(&(before.rotation * pose.rotation.transpose()));
        let is_near = seconds < 0.0 && seconds > -OLDEST_S;
        is_near.then_some((seconds, Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)))
    }

    /// Third and fourth divided difference, each with the covariance of its noise, where there are so many
    /// poses one after the other.
    fn differences(
        &self,
        time_ns: u64,
        pose: &Pose,
        lags: &Lags,
    ) -> [Option<(Vector6<f64>, Matrix6<f64>)>; 2] {
        let back = |i| self.back(i, time_ns, pose);
        let (Some((x1, d1)), Some((x2, d2)), Some((x3, d3))) = (back(0), back(1), back(2)) else {
            return [None; 2];
        };
        if !(x2 < x1 && x3 < x2) {
            return [None; 2];
        }
        let c = divided([0.0, x1, x2, x3]);
        let third = (d1 * c[1] + d2 * c[2] + d3 * c[3], noise(c, lags));
        let fourth = back(3).filter(|(x4, _)| *x4 < x3).map(|(x4, d4)| {
            let c = divided([0.0, x1, x2, x3, x4]);
            (d1 * c[1] + d2 * c[2] + d3 * c[3] + d4 * c[4], noise(c, lags))
        });
        [Some(third), fourth]
    }

    /// The motion about `pose` at a time after those of the track, by Newton's divided differences; none
    /// where nothing is known of it. `covariance` is that of the pose; `smooth` is [`SMOOTH`], or infinite
    /// where the motion is known to be no shock.
    pub(crate) fn rates(
        &self,
        time_ns: u64,
        pose: &Pose,
        covariance: &Matrix6<f64>,
        smooth: f64,
    ) -> Option<Rates> {
        let (x1, d1) = self.back(0, time_ns, pose)?;
        let slope1 = d1 / x1;
        let zero = Vector6::zeros();
        let mut rates = Rates {
            first: slope1,
            second: zero,
            third: zero,
            past: [x1, 2.0 * x1, 3.0 * x1],
            shares: [zero; 2],
            is_cubic: false,
            is_weighed: false,
            left_out: [Matrix6::zeros(); 3],
        };
        let lags = self.lags.unwrap_or([*covariance, Matrix6::zeros(), Matrix6::zeros(), Matrix6::zeros()]);
        let [Some((third, noise3)), fourth] = self.differences(time_ns, pose, &lags) else {
            return Some(rates);
        };
        let (x2, d2) = self.back(1, time_ns, pose)?;
        let (x3, _) = self.back(2, time_ns, pose)?;
        let second = (d2 / x2 - slope1) / (x2 - x1);
        rates.past = [x1, x2, x3];
        rates.is_cubic = true;
        let step = x3 / 3.0;
        let power = self.power[0].of(&third, &noise3);
        let mut not_taken = Vector6::zeros();
        // Each coordinate by itself.
        for i in 0..6 {
            // Differences from frame to frame.
            let [d1, d2, d3] =
                [step * slope1[i], 2.0 * step * step * second[i], 6.0 * step * step * step * third[i]]
                    .map(|d| d * d);
            // Never where the bound is infinite: times 0 that is no number, and fails the comparison too.
            if third[i] * third[i] > CLEAR * noise3[(i, i)] && d3 > smooth * (smooth * d1 + d2) {
                rates.left_out[0][(i, i)] = second[i] * second[i];
                continue;
            }
            // Of a difference that is in part noise, that share is the best estimate (Wiener's filter).
            let signal = power[(i, i)];
            let share = if signal > 0.0 { signal / (signal + noise3[(i, i)].max(0.0)) } else { 0.0 };
            rates.first[i] -= second[i] * x1 - share * third[i] * (x1 * x2);
            rates.second[i] = second[i] - share * third[i] * (x1 + x2);
            rates.third[i] = share * third[i];
            rates.shares[0][i] = 1.0;
            rates.shares[1][i] = share;
            not_taken[i] = 1.0 - share;
        }
        let not_taken = Matrix6::from_diagonal(&not_taken);
        rates.left_out[1] = not_taken * power * not_taken;
        if let Some((fourth, noise4)) = &fourth {
            rates.is_weighed = true;
            rates.left_out[2] = self.power[1].of(fourth, noise4);
        }
        Some(rates)
    }
}

impl Rates {
    /// The pose so many seconds later, on average over an exposure.
    pub(crate) fn pose_at(&self, pose: &Pose, seconds: f64, exposure_s: f64) -> Pose {
        let [a, b, c, _] = powers(seconds, exposure_s);
        moved_by(pose, &(self.first * a + self.second * b + self.third * c))
    }

    /// How much of the first to fourth divided difference is in the motion so many seconds later, on average
    /// over an exposure: Newton's `t`, `t (t - t_1)` ...
    pub(crate) fn along(&self, seconds: f64, exposure_s: f64) -> [f64; 4] {
        let [a, b, c, d] = powers(seconds, exposure_s);
        let [x1, x2, x3] = self.past;
        [
            a,
            b - x1 * a,
            c - (x1 + x2) * b + x1 * x2 * a,
            d - (x1 + x2 + x3) * c + (x1 * x2 + x1 * x3 + x2 * x3) * b - x1 * x2 * x3 * a,
        ]
    }

    /// How the first to third difference, one row each, are made of this pose and the three before it.
    pub(crate) fn weights(&self) -> [[f64; 4]; 3] {
        let [x1, x2, x3] = self.past;
        let [c10, c11] = divided([0.0, x1]);
        let [c20, c21, c22] = divided([0.0, x1, x2]);
        [[c10, c11, 0.0, 0.0], [c20, c21, c22, 0.0], divided([0.0, x1, x2, x3])]
    }
}

/// The seconds and their square, cube and fourth power, on average over an exposure about them: with
/// `f'' T^2 / 24` (exact up to the cube).
fn powers(t: f64, exposure_s: f64) -> [f64; 4] {
    let b = exposure_s * exposure_s / 12.0;
    [t, t * t + b, t * (t * t + 3.0 * b), t * t * (t * t + 6.0 * b)]
}

pub(crate) fn moved_by(pose: &Pose, d: &Vector6<f64>) -> Pose {
    pose.perturbed([d[0], d[1], d[2]], [d[3], d[4], d[5]])
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
        let exact = Matrix6::identity() * 1e-12;
        let rates = track.rates(1_050_000_000, &at(x(1.05)), &exact, SMOOTH).expect("three poses before");
        assert!((rates.first[0] - (300.0 - 4000.0 * 1.05)).abs() < 1e-6, "{}", rates.first);
        assert!((rates.second[0] + 2000.0).abs() < 1e-4, "{}", rates.second);
        assert!((rates.pose_at(&at(x(1.05)), 0.004, 0.0).translation.x - x(1.054)).abs() < 1e-6);
    }

    #[test]
    fn a_shock_does_not_go_on() {
        for places in [[0.0, 0.0, 0.0, 38.0], [0.0, 0.0, 38.0, 38.0], [0.0, 38.0, 38.0, 38.0]] {
            let mut track = Track::default();
            for (frame, x) in places.iter().take(3).enumerate() {
                track.follow(20_000_000 * frame as u64, &at(*x));
            }
            let rates = track
                .rates(60_000_000, &at(places[3]), &(Matrix6::identity() * 1e-4), SMOOTH)
                .expect("a track");
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
        let rates = |variance| {
            track.rates(60_000_000, &at(x(0.06)), &(Matrix6::identity() * variance), SMOOTH).expect("a track")
        };
        assert!((rates(1e-12).pose_at(&at(x(0.06)), 0.005, 0.0).translation.x - x(0.065)).abs() < 1e-6);
        // The third difference is 4.8 mm: a standard deviation of 2 mm makes it noise.
        assert_eq!(rates(4.0).third[0], 0.0);
        assert!(rates(0.4).third[0] > 0.6e5 && rates(0.4).third[0] < 0.7e5, "{}", rates(0.4).third);
    }

    #[test]
    fn nothing_is_known_of_the_motion_after_a_gap_or_from_a_clock_that_stands() {
        let mut track = Track::default();
        assert!(track.rates(0, &at(0.0), &Matrix6::zeros(), SMOOTH).is_none());
        track.follow(1_000_000_000, &at(0.0));
        assert!(
            track.rates(2_000_000_000, &at(0.0), &Matrix6::zeros(), SMOOTH).is_none(),
            "a second is too long"
        );
        assert!(track.rates(1_000_000_000, &at(0.0), &Matrix6::zeros(), SMOOTH).is_none(), "no time went by");
        assert!(track.rates(900_000_000, &at(0.0), &Matrix6::zeros(), SMOOTH).is_none(), "time went back");
    }
}
