//! The second pose of a planar set (Schweighofer and Pinz 2006): its tilt mirrored on the line of sight looks
//! nearly the same from afar.

use heapless::Vec;
use nalgebra::{Matrix3, Matrix6, Vector3};

use crate::geometry::{Pose, rotation_vector};
use crate::linear::Basis;
use crate::problem::{Problem, Row};
use crate::refine::{Fit, refine};
use crate::robust::{Consensus, freedom};
use crate::{MAX_CIRCLES, Solution, doubt, scatter, valley};

/// Rotations that differ by less than this (radians) are the same pose.
const SAME_ROTATION: f64 = 1e-3;
/// Standard deviations within which two poses of a plane are beside each other.
const BESIDE: f64 = 12.0;
/// Evidence that settles which of two poses is right: odds of e^12.5, one error in 270,000.
pub const DECISIVE: f64 = 25.0;

/// The other pose that a planar set allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alternative {
    /// The other pose.
    pub pose: Pose,
    /// Its covariance, as [`Solution::covariance`].
    pub covariance: Matrix6<f64>,
    /// Its residual, as [`Solution::residual_px`].
    pub residual_px: f64,
    /// Its residual over the solution's, both weighted by the covariances: far above 1 means that the
    /// solution is the only one, near 1 that the picture cannot tell (infinite for a perfect fit).
    pub ratio: f64,
    /// Twice the logarithm of the odds that this one picture gives for the solution and against this pose,
    /// where the centres may scatter more than their covariances say: from 25 on the picture has decided, at
    /// 0 it cannot tell, below it would rather have the other one.
    pub evidence: f64,
}

/// Evidence for a pose with the sum of squares `this` against one with `other`: the difference of -2 log L,
/// each with the scatter (at least one) that suits it best. Without that freedom a picture whose centres are
/// all off by more than they say would be sure of anything.
fn evidence(this: f64, other: f64, freedom: f64) -> f64 {
    let freedom = freedom.max(1.0);
    let cost = |chi2: f64| if chi2 > freedom { freedom * (1.0 + libm::log(chi2 / freedom)) } else { chi2 };
    cost(other) - cost(this)
}

/// Adds residual and second pose to a consensus. After a cold start the better of the two is taken; with a
/// prior the one that follows from it, as long as the picture is not sure of the other one.
pub(crate) fn solution(problem: &Problem, found: &Consensus, from_prior: bool) -> Solution {
    let mut fit = found.fit;
    let mut other = second(problem, found);
    let freedom = freedom(found.used);
    if let Some(mirrored) = other.as_mut() {
        let limit = if from_prior { DECISIVE } else { 0.0 };
        if evidence(mirrored.chi2, fit.chi2, freedom) > limit {
            core::mem::swap(&mut fit, mirrored);
        }
    }
    let circles = f64::from(found.used.count_ones());
    let residual = |pose: &Pose| {
        let px2: f64 = problem.masked(found.used).map(|(_, row)| problem.error(row, pose).px2).sum();
        libm::sqrt(px2 / circles)
    };
    let residual_px =
        if fit.pose == found.fit.pose { libm::sqrt(found.px2 / circles) } else { residual(&fit.pose) };
    let covariance = |fit: &Fit, other: Option<&Fit>| {
        let excess = scatter::excess(fit.chi2, freedom);
        // How much the circles scatter is told by the better of the two: about one that is wrong they always
        // do.
        let least = |other: &Fit| scatter::excess(fit.chi2.min(other.chi2), freedom);
        if is_plane(problem, found.used) && other.is_none_or(|other| is_beside(fit, other, least(other))) {
            valley::covariance(problem, found.used, fit, excess)
        } else {
            fit.covariance * excess
        }
    };
    let alternative = other.map(|o| Alternative {
        pose: o.pose,
        covariance: covariance(&o, Some(&fit)),
        residual_px: residual(&o.pose),
        ratio: libm::sqrt(o.chi2 / fit.chi2.max(1e-300)),
        evidence: evidence(fit.chi2, o.chi2, freedom),
    });
    let mut covariance = covariance(&fit, other.as_ref());
    if found.used == problem.all() {
        covariance += doubt::of_one_circle(problem, &fit);
    }
    Solution { pose: fit.pose, covariance, residual_px, used: found.used, alternative }
}

/// Whether a plane's other pose is so near, in standard deviations of the turn, that the sum of squares
/// around one of them knows of the other.
fn is_beside(fit: &Fit, other: &Fit, scale: f64) -> bool {
    let turn = rotation_vector(&(fit.pose.rotation * other.pose.rotation.transpose()));
    let turns = fit.covariance.fixed_view::<3, 3>(3, 3) * scale;
    turns.cholesky().is_none_or(|c| turn.dot(&c.solve(&turn)) < BESIDE * BESIDE)
}

/// The mirrored pose, refined, or what the search found beside; `None` where both starts lead to one pose.
fn second(problem: &Problem, found: &Consensus) -> Option<Fit> {
    let basis = basis_of(problem, found.used)?;
    if found.rival.is_some() || !basis.is_planar() {
        return found.rival;
    }
    let fit = refine(problem, found.used, &mirrored(&basis, &found.fit.pose)).ok()?;
    (!is_same(&fit.pose, &found.fit.pose)).then_some(fit)
}

/// Whether the circles used are in one plane.
fn is_plane(problem: &Problem, used: u64) -> bool {
    basis_of(problem, used).is_some_and(|basis| basis.is_planar())
}

/// The shape of the circles used: without those left out a set may be a plane.
pub(crate) fn basis_of(problem: &Problem, used: u64) -> Option<Basis> {
    if used == problem.all() {
        return Some(problem.basis);
    }
    let rows: Vec<Row, MAX_CIRCLES> = problem.masked(used).map(|(_, row)| *row).collect();
    Basis::of(&rows)
}

/// Whether two minima are one.
pub(crate) fn is_same(a: &Pose, b: &Pose) -> bool {
    rotation_vector(&(a.rotation * b.rotation.transpose())).norm() < SAME_ROTATION
}

/// The plane mirrored on the plane across the line of sight through its centroid.
pub(crate) fn mirrored(basis: &Basis, pose: &Pose) -> Pose {
    let centroid = Vector3::from(basis.centroid);
    let seen = pose.transform(&centroid);
    let sight = seen / seen.norm();
    let mirror = Matrix3::identity() - sight * sight.transpose() * 2.0;
    // A mirrored plane is a turned plane: its normal takes the other sign.
    let normal = Vector3::from(basis.axes[2]);
    let flip = Matrix3::identity() - normal * normal.transpose() * 2.0;
    let rotation = mirror * pose.rotation * flip;
    Pose { rotation, translation: seen - rotation * centroid }
}
