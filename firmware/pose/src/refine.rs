//! Levenberg-Marquardt on the reprojection error, weighted by the centres' covariances, with the whole camera
//! model (thesis 3.3; Triggs et al. 2000). Six unknowns: `t' = t + v`, `R' = Exp(w) R`.

use nalgebra::Matrix6;

use crate::PoseError;
use crate::geometry::Pose;
use crate::normal::Normal;
use crate::problem::{Problem, Row, camera_point};

/// Evaluations after which it ends in any case.
const MAX_EVALUATIONS: usize = 30;
/// A step that promises to change the weighted sum of squares by less than this is the last: a thousandth of
/// the pose's standard deviation ...
const LAST_STEP: f64 = 1e-6;
/// ... if the step after it, at the rate of the last two, would change it by less than this.
const CONVERGED: f64 = 1e-12;

/// A refined pose.
#[derive(Clone, Copy)]
pub(crate) struct Fit {
    pub(crate) pose: Pose,
    /// Inverse of the normal equations' matrix.
    pub(crate) covariance: Matrix6<f64>,
    /// Weighted sum of squares.
    pub(crate) chi2: f64,
    /// How often the normal equations were set up.
    pub(crate) evaluations: usize,
}

/// Refines `start` on the circles of `mask`. Fails where the start puts a circle out of the camera's sight,
/// or the pose is not determined.
pub(crate) fn refine(problem: &Problem, mask: u64, start: &Pose) -> Result<Fit, PoseError> {
    refine_within(problem, mask, start, MAX_EVALUATIONS)
}

/// As [`refine`], and ends after so many evaluations in any case.
pub(crate) fn refine_within(
    problem: &Problem,
    mask: u64,
    start: &Pose,
    most: usize,
) -> Result<Fit, PoseError> {
    let mut pose = *start;
    let mut here = linearise(problem, mask, &pose).ok_or(PoseError::NoConsensus)?;
    let mut damping = 0.0;
    // Decrease that the step before promised.
    let mut before = 0.0;
    let mut evaluations = 1;
    for _ in 0..most {
        let factor = here.factor(damping).ok_or(PoseError::Singular)?;
        let [vx, vy, vz, wx, wy, wz] = factor.solve(&here.g);
        let promised: f64 = here.g.iter().zip([vx, vy, vz, wx, wy, wz]).map(|(g, d)| g * d).sum();
        let next = pose.perturbed([vx, vy, vz], [wx, wy, wz]);
        // Steps shrink at least as fast as they did last time, so the next one's decrease is known
        // beforehand.
        let settled = promised < LAST_STEP && promised * promised < CONVERGED * before;
        if damping == 0.0 && (settled || promised < CONVERGED) {
            let chi2 = (here.chi2 - promised).max(0.0);
            return Ok(Fit { pose: next.orthonormalised(), covariance: factor.inverse(), chi2, evaluations });
        }
        evaluations += 1;
        match linearise(problem, mask, &next) {
            Some(there) if there.chi2 <= here.chi2 => {
                (pose, here, before) = (next, there, promised);
                damping = if damping > 1e-6 { 0.1 * damping } else { 0.0 };
            }
            // Rounding: nothing left to gain.
            Some(there) if there.chi2 - here.chi2 < 1e-12 * here.chi2 && damping == 0.0 => {
                return Ok(Fit {
                    pose: pose.orthonormalised(),
                    covariance: factor.inverse(),
                    chi2: here.chi2,
                    evaluations,
                });
            }
            _ => {
                damping = if damping > 0.0 { 10.0 * damping } else { 1e-3 };
                before = 0.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
    }
    let factor = here.factor(0.0).ok_or(PoseError::Singular)?;
    Ok(Fit { pose: pose.orthonormalised(), covariance: factor.inverse(), chi2: here.chi2, evaluations })
}

/// The normal equations at a pose; `None` where a circle is out of the camera's sight.
pub(crate) fn linearise(problem: &Problem, mask: u64, pose: &Pose) -> Option<Normal> {
    let mut normal = Normal::zero();
    for (_, row) in problem.masked(mask) {
        let Derivative { a, b, eu, ev } = derivative(problem, row, pose)?;
        let wa = a.map(|c| row.weight_u * c);
        let wb = b.map(|c| row.weight_v * c);
        normal.add([&a, &b], [&wa, &wb], [eu, ev]);
        normal.chi2 += row.weight_u * eu * eu + row.weight_v * ev * ev;
    }
    normal.chi2.is_finite().then_some(normal)
}

/// The two independent residuals of a row, weighted by `weight_u` and `weight_v`, and what they fall by (v,
/// w).
pub(crate) struct Derivative {
    pub(crate) a: [f64; 6],
    pub(crate) b: [f64; 6],
    pub(crate) eu: f64,
    pub(crate) ev: f64,
}

/// `None` where the circle is out of the camera's sight.
#[inline(always)]
pub(crate) fn derivative(problem: &Problem, row: &Row, pose: &Pose) -> Option<Derivative> {
    let t = &pose.translation;
    let [x, y, z] = camera_point(row, pose);
    let l = problem.lens.linearise(x, y, z).ok()?;
    // Turning moves the point by w x (R p): the derivative by w is (R p) x (derivative by the point).
    let arm = [x - t.x, y - t.y, z - t.z];
    let turned = |d: &[f64; 3]| {
        [arm[1] * d[2] - arm[2] * d[1], arm[2] * d[0] - arm[0] * d[2], arm[0] * d[1] - arm[1] * d[0]]
    };
    let s = row.slope;
    let dv = [l.dv[0] - s * l.du[0], l.dv[1] - s * l.du[1], l.dv[2] - s * l.du[2]];
    let (tu, tv) = (turned(&l.du), turned(&dv));
    let eu = row.at[0] - l.at[0];
    Some(Derivative {
        a: [l.du[0], l.du[1], l.du[2], tu[0], tu[1], tu[2]],
        b: [dv[0], dv[1], dv[2], tv[0], tv[1], tv[2]],
        eu,
        ev: row.at[1] - l.at[1] - s * eu,
    })
}
