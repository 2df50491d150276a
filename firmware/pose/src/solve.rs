//! The front door: observations in, pose with covariance out. Warm from the last pose where there is one,
//! else cold by the method of the settings; what does not fit is left out, and what does not hold is refused.

use heapless::Vec;
use nalgebra::Matrix6;

use crate::ambiguity::{self, Alternative};
use crate::dlt::{MIN_CIRCLES_DLT, dlt};
use crate::epnp::epnp;
use crate::geometry::{Observation, Pose};
use crate::homography::homography;
use crate::lens::Lens;
use crate::problem::{MIN_CIRCLES, Problem, Rays};
use crate::refine::refine;
use crate::robust::{self, Consensus};
use crate::search::{poses_of_triple, search};
use crate::{Method, PoseError, Settings};

/// Circles up to which `Method::Auto` takes DLT or homography (thesis 5.4.7).
const AUTO_DLT_CIRCLES: usize = 15;

/// A pose and how far it can be trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// The pose.
    pub pose: Pose,
    /// Covariance of (v, w), v in mm and w in radians, both along the camera's axes: the true pose is
    /// `t' = t + v`, `R' = Exp(w) R`. From the centres' covariances: `(J^T W J)^-1`, times the mean of the
    /// factor by which the circles may scatter more than those covariances say: all but one where chance
    /// explains their residuals, chi squared over its degrees of freedom (less two) where it does not. Wider
    /// for a plane so near its mirror image that its tilt shows by its square, and where one of few circles
    /// (5 to 9) may be wrong and the others do not tell which.
    pub covariance: Matrix6<f64>,
    /// Root mean square distance between measured and reprojected centre over the circles used, px.
    pub residual_px: f64,
    /// Bit i is set where observation i went into the pose; the others were beyond the gate.
    pub used: u64,
    /// The second pose that a planar set has, where there is one; after a cold start also that of four
    /// circles in space.
    pub alternative: Option<Alternative>,
}

impl Solution {
    /// Takes the second pose for the first, where there is one.
    pub(crate) fn swap(&mut self) {
        if let Some(other) = &mut self.alternative {
            core::mem::swap(&mut self.pose, &mut other.pose);
            core::mem::swap(&mut self.covariance, &mut other.covariance);
            core::mem::swap(&mut self.residual_px, &mut other.residual_px);
            other.ratio = 1.0 / other.ratio;
            other.evidence = -other.evidence;
        }
    }
}

/// The pose of `observations` (4 to 64). `prior` is the last pose, if there is one; a start from it that
/// leads nowhere, or to a worse pose than a cold start would, costs time but never a wrong answer.
///
/// # Errors
/// Why these observations have no pose, see [`PoseError`].
pub fn solve(
    observations: &[Observation],
    lens: &Lens,
    settings: &Settings,
    prior: Option<&Pose>,
) -> Result<Solution, PoseError> {
    let problem = Problem::new(observations, lens, settings)?;
    if let Some(prior) = prior.filter(|p| p.is_rigid())
        && let Some(found) = from_prior(&problem, &prior.orthonormalised())
    {
        return Ok(ambiguity::solution(&problem, &found, true));
    }
    let found = cold(&problem)?;
    Ok(ambiguity::solution(&problem, &found, false))
}

/// Refines a start; what does not fit is taken out.
fn from_start(problem: &Problem, start: &Pose) -> Option<Consensus> {
    let fit = refine(problem, problem.all(), start).ok()?;
    robust::trimmed(problem, fit)
}

/// As [`from_start`]. Wrong circles may have pulled the pose over into another minimum before they were taken
/// out: then the one that follows from the prior is taken and the other remembered.
fn from_prior(problem: &Problem, prior: &Pose) -> Option<Consensus> {
    let found = from_start(problem, prior)?;
    if found.used == problem.all() {
        return Some(found);
    }
    let Ok(fit) = refine(problem, found.used, prior) else { return Some(found) };
    if ambiguity::is_same(&fit.pose, &found.fit.pose) {
        return Some(found);
    }
    let px2 = problem.masked(found.used).map(|(_, row)| problem.error(row, &fit.pose).px2).sum();
    Some(Consensus { fit, px2, rival: Some(found.fit), ..found })
}

fn cold(problem: &Problem) -> Result<Consensus, PoseError> {
    let rays = problem.rays()?;
    let mut whole = None;
    let found = match first_pose(problem, &rays) {
        Ok(start) => {
            let fit = refine(problem, problem.all(), &start).ok();
            whole = fit.and_then(|fit| robust::whole(problem, fit));
            fit.and_then(|fit| robust::trimmed(problem, fit))
        }
        // What the chosen method cannot do is said, not mended behind the user's back.
        Err(error @ (PoseError::NearlyOnePlane | PoseError::TooFew { .. })) => return Err(error),
        Err(_) => None,
    };
    let found = match found {
        Some(found) => found,
        None => match (search(problem, &rays), whole) {
            (Ok(found), _) => found,
            (Err(_), Some(whole)) => whole,
            (Err(error), None) => return Err(error),
        },
    };
    Ok(if has_minimal_ambiguity(problem, found.used) { with_rivals(problem, &rays, found) } else { found })
}

/// Four circles in space: three of them have up to four poses, and the fourth may tell them apart by little.
fn has_minimal_ambiguity(problem: &Problem, used: u64) -> bool {
    used.count_ones() as usize == MIN_CIRCLES
        && !ambiguity::basis_of(problem, used).is_some_and(|basis| basis.is_planar())
}

/// The best of all poses that three of four circles have; the second best is remembered.
fn with_rivals(problem: &Problem, rays: &Rays, found: Consensus) -> Consensus {
    let mut four = Vec::<usize, MIN_CIRCLES>::new();
    for (i, _) in problem.masked(found.used) {
        // Four, as many as there is room for.
        let _ = four.push(i);
    }
    let mut best = found;
    for left_out in 0..four.len() {
        let mut three = four.iter().enumerate().filter(|(i, _)| *i != left_out).map(|(_, i)| *i);
        let (Some(a), Some(b), Some(c)) = (three.next(), three.next(), three.next()) else { continue };
        for pose in poses_of_triple(problem, rays, [a, b, c]) {
            let Ok(fit) = refine(problem, found.used, &pose) else { continue };
            if ambiguity::is_same(&fit.pose, &best.fit.pose) {
                continue;
            }
            if fit.chi2 < best.fit.chi2 {
                let px2 = problem.masked(found.used).map(|(_, row)| problem.error(row, &fit.pose).px2).sum();
                best = Consensus { fit, px2, rival: Some(best.fit), ..best };
            } else if best.rival.is_none_or(|rival| fit.chi2 < rival.chi2) {
                best.rival = Some(fit);
            }
        }
    }
    best
}

/// The first pose by the method of the settings.
fn first_pose(problem: &Problem, rays: &Rays) -> Result<Pose, PoseError> {
    let planar = problem.basis.is_planar();
    match problem.settings.method {
        Method::Dlt if planar => homography(problem, rays),
        Method::Dlt => dlt(problem, rays),
        Method::Epnp => epnp(problem, rays),
        Method::Auto if problem.rows.len() > AUTO_DLT_CIRCLES => epnp(problem, rays),
        Method::Auto if planar => homography(problem, rays),
        Method::Auto if problem.rows.len() < MIN_CIRCLES_DLT => epnp(problem, rays),
        Method::Auto => dlt(problem, rays).or_else(|_| epnp(problem, rays)),
    }
}
