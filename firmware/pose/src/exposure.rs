//! Motion within an exposure of all rows at once: a picture shows the mean over it, which is not where the
//! carbody is in its middle, but `a T^2 / 24` further.

use nalgebra::{Matrix6, SMatrix, Vector6};

use crate::Solution;
use crate::shutter::{Shutter, shared};
use crate::track::{FRAMES, NEW, Rates, SMOOTH, Track, moved_by};

/// Frames that [`Bends`] needs.
const ENOUGH: f64 = 25.0;

/// How much the motion has bent so far: mean squares of the coefficient of its seconds' square, each
/// coordinate by itself.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bends {
    squares: Vector6<f64>,
    frames: f64,
}

impl Bends {
    pub(crate) fn learn(&mut self, bend: &Vector6<f64>) {
        if bend.iter().all(|bend| bend.is_finite()) {
            self.frames = (self.frames + 1.0).min(FRAMES);
            self.squares += (bend.component_mul(bend) - self.squares) / self.frames;
        }
    }

    /// Whether it has bent like that before.
    fn know(&self, bend: &Vector6<f64>) -> bool {
        self.frames >= ENOUGH && (0..6).all(|i| bend[i] * bend[i] <= NEW * self.squares[i])
    }
}

/// How far the mean over an exposure is from its middle.
struct Smear {
    mean: Vector6<f64>,
    /// How it follows the pose and the three before it, each coordinate by itself.
    by_pose: [Vector6<f64>; 4],
    /// Covariance of what they do not tell.
    left_out: Matrix6<f64>,
    /// Whether all four are known.
    is_followed: bool,
}

impl Smear {
    fn of(rates: &Rates, exposure_s: f64) -> Self {
        // All circles move alike: what is true of one is true of the pose.
        let (along, weights) = (rates.along(0.0, exposure_s), rates.weights());
        let by_pose = [0, 1, 2, 3].map(|k| -> Vector6<f64> {
            let [second, third] = [0, 1].map(|m| rates.shares[m] * (along[m + 1] * weights[m + 1][k]));
            second + third
        });
        let left_out = rates.left_out.iter().zip(&along[1..]);
        Self {
            mean: rates.second * along[1],
            by_pose,
            left_out: left_out.map(|(left_out, w)| left_out * (w * w)).sum(),
            is_followed: rates.is_cubic,
        }
    }

    /// The share of it that is best taken off, for what is left out of it and the mean squares of it that are
    /// usual (Wiener's filter): vibration of a fifth of the frame rate and more is foretold so late that all
    /// of it does more harm than good. What the poses' noise makes of it is not counted: most of that is this
    /// pose's own, and lessens it. What is left out bounds what stays.
    fn best(mut self, usual: &Vector6<f64>) -> Self {
        let share = Vector6::from_fn(|i, _| {
            let (off, square) = (self.left_out[(i, i)], usual[i]);
            if off < square { 1.0 - off / square } else { 0.0 }
        });
        self.mean.component_mul_assign(&share);
        self.by_pose.iter_mut().for_each(|by_pose| by_pose.component_mul_assign(&share));
        self
    }

    /// Takes it off, and tells the covariance of that.
    fn take_off(self, solution: &mut Solution, track: &mut Track, time_ns: u64) {
        // It is that of the motion without it.
        let by_own = (Vector6::repeat(1.0) + self.by_pose[0]).map(|factor| 1.0 / factor);
        let mean = self.mean.component_mul(&by_own);
        solution.pose = moved_by(&solution.pose, &-mean);

        if track.lags.is_none() {
            // Poses that were taken without this motion are off by about what it does to one.
            track.joint.take_for_all(&(solution.covariance + mean * mean.transpose()));
        }
        let mut by_past = SMatrix::<f64, 6, 18>::zeros();
        for (k, by_pose) in self.by_pose[1..].iter().enumerate() {
            let share = Matrix6::from_diagonal(&-by_own.component_mul(by_pose));
            by_past.fixed_columns_mut::<6>(6 * k).copy_from(&share);
        }
        let by_own = Matrix6::from_diagonal(&by_own);
        let with_past = by_past * track.joint.0;
        let with_that =
            |covariance: &Matrix6<f64>| by_own * covariance * by_own + with_past * by_past.transpose();
        if let Some(other) = &mut solution.alternative {
            other.pose = moved_by(&other.pose, &-mean);
            let own = with_that(&other.covariance);
            if let Some((covariance, _)) = shared(own + self.left_out, own, with_past) {
                other.covariance = covariance;
            }
        }
        let own = with_that(&solution.covariance);
        if let Some((covariance, share)) = shared(own + self.left_out, own, with_past) {
            solution.covariance = covariance;
            track.latest = self.is_followed.then_some((time_ns, share));
        }
    }
}

/// Brings the mean over the exposure to its middle: `solution` is of the frame at `time_ns`, `track` of those
/// before it. As [`crate::solve_in_motion`] does, covariance included, for a pose that was made of several.
pub fn at_mid_exposure(solution: &mut Solution, shutter: &Shutter, track: &mut Track, time_ns: u64) {
    let Shutter { exposure_s, .. } = *shutter;
    if exposure_s <= 0.0 {
        return;
    }
    let rates = |smooth| track.rates(time_ns, &solution.pose, &solution.covariance, smooth);
    let Some(whole) = rates(f64::INFINITY) else { return };
    let [_, per_bend, ..] = whole.along(0.0, exposure_s);
    let usual = track.bends.squares * (per_bend * per_bend);
    // What bends no more than usual is no shock.
    let smear = if whole.is_weighed && track.bends.know(&whole.second) {
        Smear::of(&whole, exposure_s).best(&usual)
    } else {
        let Some(cautious) = rates(SMOOTH) else { return };
        let mut smear = Smear::of(&cautious, exposure_s);
        if !whole.is_weighed && track.bends.frames >= ENOUGH {
            smear.left_out += Matrix6::from_diagonal(&usual);
        }
        smear
    };
    track.bend = whole.is_cubic.then_some((time_ns, whole.second));
    smear.take_off(solution, track, time_ns);
}
