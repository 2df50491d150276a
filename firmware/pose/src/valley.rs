//! The uncertainty of a plane near its frontal view. Its tilt then shows by its square: the weighted sum of
//! squares is no bowl but a bent valley that holds both mirror images, and what is linearised at its lowest
//! point is far too sure of the tilt and of all that follows from it. So the valley is walked along as a
//! profile of the likelihood (Bates and Watts 1988, 6.1): to either side to where the sum has risen by nine,
//! three standard deviations.

use nalgebra::{Matrix6, Vector3, Vector6};

use crate::eigen;
use crate::geometry::Pose;
use crate::problem::Problem;
use crate::refine::{Fit, linearise};
use crate::rest::difference;

/// Standard deviations that are walked to either side.
const SIGMAS: f64 = 3.0;
/// Places at the most that are looked at on one side, each at most twice as far as the one before: to 96
/// linear standard deviations.
const WALKS: usize = 6;
/// A place that is further by less than this factor need not be looked at.
const NEAR: f64 = 1.05;
/// No further than this, radians: what is less certain is uncertain enough.
const FURTHEST: f64 = 0.5;
/// Steps at the most that bring a place beside the valley down to its floor, and the fall, as a share of the
/// rise that is looked for, below which one is the last.
const DESCENTS: usize = 4;
const SMALL_FALL: f64 = 0.01;

/// The covariance of a fit, as wide as the profiles of its two least certain turns, a plane's tilts. `scale`
/// is the factor by which the circles scatter more than their covariances say; it is in what is returned.
pub(crate) fn covariance(problem: &Problem, used: u64, fit: &Fit, scale: f64) -> Matrix6<f64> {
    let linear = fit.covariance * scale;
    let turns = linear.fixed_view::<3, 3>(3, 3).into_owned();
    let (variances, axes) = eigen::symmetric::<3>(turns.into());
    let mut wider = linear;
    for (variance, axis) in variances.into_iter().zip(axes).skip(1) {
        let axis = Vector3::from(axis);
        let along = linear.fixed_columns::<3>(3) * axis / libm::sqrt(variance);
        let valley = Valley { problem, used, fit, axis, along };
        // Where the way leads a circle out of the camera's sight, the straight line must do.
        wider += valley.more(scale).unwrap_or_default();
    }
    wider
}

struct Valley<'a> {
    problem: &'a Problem<'a>,
    used: u64,
    fit: &'a Fit,
    /// The axis of a turn.
    axis: Vector3<f64>,
    /// One standard deviation of that turn, with all that moves along: (v, w).
    along: Vector6<f64>,
}

impl Valley<'_> {
    /// What the variance along the valley has more than that along its straight line.
    fn more(&self, scale: f64) -> Option<Matrix6<f64>> {
        let enough = SIGMAS * SIGMAS * scale;
        // It bends to both sides alike.
        let mut bend = Vector6::zeros();
        let (left, right) = (self.end(-1.0, enough, &mut bend)?, self.end(1.0, enough, &mut bend)?);
        let bent = (left * left.transpose() + right * right.transpose()) / (2.0 * SIGMAS * SIGMAS);
        Some(bent - self.along * self.along.transpose())
    }

    /// The way along the valley, (v, w), to where the sum of squares has risen enough on one side, and never
    /// less than the linear one. `bend` times the square of the standard deviations is by how much the valley
    /// leaves its straight line, as far as that is known.
    fn end(&self, side: f64, enough: f64, bend: &mut Vector6<f64>) -> Option<Vector6<f64>> {
        let sigma = self.along.fixed_rows::<3>(3).norm();
        let root = |rise: f64| libm::sqrt(rise.max(0.0) / enough);
        let (mut shorter, mut root_before) = (0.0, 0.0);
        let mut way = SIGMAS;
        for _ in 0..WALKS {
            let root_here = root(self.floor(side * way, enough, bend)?);
            if root_here >= 1.0 {
                // The root of the sum rises about evenly.
                let share = (1.0 - root_before) / (root_here - root_before);
                way = (shorter + share * (way - shorter)).max(SIGMAS);
                break;
            }
            if way * sigma > FURTHEST {
                break;
            }
            (shorter, root_before) = (way, root_here);
            way = (way / root_here).min(2.0 * way);
            if way < NEAR * shorter {
                break;
            }
        }
        Some(self.at(side * way, bend))
    }

    /// The way along the valley to so many standard deviations.
    fn at(&self, sigmas: f64, bend: &Vector6<f64>) -> Vector6<f64> {
        self.along * sigmas + bend * (sigmas * sigmas)
    }

    /// By how much the sum of squares is higher at the lowest pose with the turn at so many standard
    /// deviations, to a share of what is `enough`; and how the valley bends to get there.
    fn floor(&self, sigmas: f64, enough: f64, bend: &mut Vector6<f64>) -> Option<f64> {
        let mut pose = moved(&self.fit.pose, &self.at(sigmas, bend));
        let mut rise = 0.0;
        for _ in 0..=DESCENTS {
            let here = linearise(self.problem, self.used, &pose)?;
            let factor = here.factor(0.0)?;
            let step = Vector6::from(factor.solve(&here.g));
            // All that the step says but the turn about the axis, which stays.
            let with_turn = factor.inverse().fixed_columns::<3>(3) * self.axis;
            let turn = |step: &Vector6<f64>| step.fixed_rows::<3>(3).dot(&self.axis);
            let step = step - with_turn * (turn(&step) / turn(&with_turn));
            pose = moved(&pose, &step);
            let falls = step.dot(&Vector6::from(here.g));
            rise = here.chi2 - falls - self.fit.chi2;
            if falls < SMALL_FALL * enough {
                break;
            }
        }
        let way = difference(&pose.orthonormalised(), &self.fit.pose);
        *bend = (way - self.along * sigmas) / (sigmas * sigmas);
        Some(rise)
    }
}

fn moved(pose: &Pose, step: &Vector6<f64>) -> Pose {
    let [vx, vy, vz, wx, wy, wz] = (*step).into();
    pose.perturbed([vx, vy, vz], [wx, wy, wz])
}
