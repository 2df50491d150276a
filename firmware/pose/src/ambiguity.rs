//! The second pose of a planar set (Schweighofer and Pinz 2006): its tilt mirrored on the line of sight looks
//! nearly the same from afar.

use nalgebra::{Matrix3, Vector3};

use crate::Solution;
use crate::geometry::{Pose, rotation_vector};
use crate::problem::Problem;
use crate::refine::{Fit, refine};
use crate::robust::Consensus;

/// Rotations that differ by less than this (radians) are the same pose.
const SAME_ROTATION: f64 = 1e-3;
/// From a prior, the pose near to it is kept unless the other one's weighted sum of squares is smaller by this
/// factor and by this difference: noise alone does not turn the plane over.
const KEEP_FACTOR: f64 = 2.0;
const KEEP_DIFFERENCE: f64 = 30.0;

/// The other pose that a planar set allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alternative {
    /// The other pose.
    pub pose: Pose,
    /// Its residual over the solution's, both weighted by the covariances: far above 1 means that the solution
    /// is the only one, near 1 that the picture cannot tell (infinite for a perfect fit).
    pub ratio: f64,
}

/// Adds residual and second pose to a consensus. After a cold start the better of the two is taken; with a
/// prior the one that follows from it, as long as the other is not clearly better.
pub(crate) fn solution(problem: &Problem, found: &Consensus, from_prior: bool) -> Solution {
    let mut fit = found.fit;
    let mut px2 = found.px2;
    let mut other = second(problem, found);
    if let Some(mirrored) = other.as_mut() {
        let better = if from_prior {
            fit.chi2 > KEEP_FACTOR * mirrored.chi2 + KEEP_DIFFERENCE
        } else {
            fit.chi2 > mirrored.chi2
        };
        if better {
            core::mem::swap(&mut fit, mirrored);
            px2 = problem.masked(found.used).map(|(_, row)| problem.error(row, &fit.pose).px2).sum();
        }
    }
    let alternative =
        other.map(|o| Alternative { pose: o.pose, ratio: libm::sqrt(o.chi2 / fit.chi2.max(1e-300)) });
    Solution {
        pose: fit.pose,
        covariance: fit.covariance,
        residual_px: libm::sqrt(px2 / f64::from(found.used.count_ones())),
        used: found.used,
        alternative,
    }
}

/// The mirrored pose, refined, or what the search found beside; `None` where both starts lead to one pose.
fn second(problem: &Problem, found: &Consensus) -> Option<Fit> {
    if !problem.basis.is_planar() {
        return found.rival;
    }
    let fit = refine(problem, found.used, &mirrored(problem, &found.fit.pose)).ok()?;
    (!is_same(&fit.pose, &found.fit.pose)).then_some(fit)
}

/// Whether two minima are one.
pub(crate) fn is_same(a: &Pose, b: &Pose) -> bool {
    rotation_vector(&(a.rotation * b.rotation.transpose())).norm() < SAME_ROTATION
}

/// The plane mirrored on the plane across the line of sight through its centroid.
fn mirrored(problem: &Problem, pose: &Pose) -> Pose {
    let centroid = Vector3::from(problem.basis.centroid);
    let seen = pose.transform(&centroid);
    let sight = seen / seen.norm();
    let mirror = Matrix3::identity() - sight * sight.transpose() * 2.0;
    // A mirrored plane is a turned plane: its normal takes the other sign.
    let normal = Vector3::from(problem.basis.axes[2]);
    let flip = Matrix3::identity() - normal * normal.transpose() * 2.0;
    let rotation = mirror * pose.rotation * flip;
    Pose { rotation, translation: seen - rotation * centroid }
}
