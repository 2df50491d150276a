//! Levenberg-Marquardt on the reprojection error, weighted by the centres' covariances, with the whole camera
//! model (thesis 3.3; Triggs et al. 2000). Six unknowns: `t' = t + v`, `R' = Exp(w) R`.

use nalgebra::Matrix6;

use crate::PoseError;
use crate::geometry::Pose;
use crate::normal::{Normal, Sums};
use crate::number::Number;
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
    let mut sums = Sums::ZERO;
    for row in problem.pairs(mask) {
        sums.add(&derivative(problem, &row, pose)?, &row);
    }
    let normal = sums.normal();
    normal.chi2.is_finite().then_some(normal)
}

/// The two independent residuals of a row, weighted by `weight_u` and `weight_v`, and what they fall by (v,
/// w).
pub(crate) struct Derivative<N = f64> {
    pub(crate) a: [N; 6],
    pub(crate) b: [N; 6],
    pub(crate) eu: N,
    pub(crate) ev: N,
}

/// `None` where the circle, or one of several, is out of the camera's sight.
#[inline(always)]
pub(crate) fn derivative<N: Number>(problem: &Problem, row: &Row<N>, pose: &Pose) -> Option<Derivative<N>> {
    let t = pose.translation;
    let [x, y, z] = camera_point(row.point, pose);
    let l = problem.lens.linearise([x, y, z]).ok()?;
    // Turning moves the point by w x (R p): the derivative by w is (R p) x (derivative by the point).
    let arm = [x - N::of(t.x), y - N::of(t.y), z - N::of(t.z)];
    let turned = |d: &[N; 3]| {
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

#[cfg(test)]
mod tests {
    use heapless::Vec;
    use nalgebra::{Matrix3, Vector3};

    use super::*;
    use crate::{Centre, Lens, Observation, Settings};

    /// Rounding in sums of a few numbers.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn circles_taken_two_at_a_time_add_up_to_what_each_adds_alone() {
        let lens = Lens {
            focal: [1400.0, 1410.0],
            skew: 0.3,
            principal: [950.0, 540.0],
            distortion: [-0.07, 0.04, 4e-4, -3e-4, 0.01],
        };
        let observations: Vec<Observation, 7> = (0..7)
            .map(|i| Observation {
                point: Vector3::new(f64::from(i % 3) * 90.0, f64::from(i) * 40.0, f64::from(i * i) * 7.0),
                centre: Centre {
                    at: [600.0 + 70.0 * f64::from(i), 500.0 - 31.0 * f64::from(i * i % 5)],
                    covariance: [1e-4, 3e-5 * f64::from(i % 2), 2e-4],
                },
            })
            .collect();
        let settings = Settings::default();
        let problem = Problem::new(&observations, &lens, &settings).expect("a sound problem");
        let pose = Pose { rotation: Matrix3::identity(), translation: Vector3::new(-150.0, 20.0, 1900.0) };
        // An even and an odd number of circles, with gaps.
        for mask in [0b111_1111, 0b101_1011, 0b1, 0b100_0001] {
            let pairs = linearise(&problem, mask, &pose).expect("all circles are in sight");
            let (mut chi2, mut g) = (0.0, [0.0; 6]);
            for (_, row) in problem.masked(mask) {
                let one = derivative(&problem, row, &pose).expect("the circle is in sight");
                chi2 += row.weight_u * one.eu * one.eu + row.weight_v * one.ev * one.ev;
                for i in 0..6 {
                    g[i] += row.weight_u * one.a[i] * one.eu + row.weight_v * one.b[i] * one.ev;
                }
            }
            assert!((pairs.chi2 / chi2 - 1.0).abs() < ROUNDING, "{mask:b}");
            let largest = g.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            (0..6).for_each(|i| assert!((pairs.g[i] - g[i]).abs() < ROUNDING * largest, "{mask:b}"));
        }
    }
}
