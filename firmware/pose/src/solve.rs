//! The front door: observations in, pose with covariance out. Warm from the last pose where there is one, else
//! cold by the method of the settings; what does not fit is left out, and what does not hold is refused.

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
use crate::{Method, PoseError, Settings};

/// Circles up to which `Method::Auto` takes DLT or homography (thesis 5.4.7).
const AUTO_DLT_CIRCLES: usize = 15;

/// A pose and how far it can be trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// The pose.
    pub pose: Pose,
    /// Covariance of (v, w), v in mm and w in radians, both along the camera's axes: the true pose is
    /// `t' = t + v`, `R' = Exp(w) R`. From the centres' covariances alone: `(J^T W J)^-1`.
    pub covariance: Matrix6<f64>,
    /// Root mean square distance between measured and reprojected centre over the circles used, px.
    pub residual_px: f64,
    /// Bit i is set where observation i went into the pose; the others were beyond the gate.
    pub used: u64,
    /// The second pose that a planar set has, where there is one; after a cold start also that of four circles in
    /// space.
    pub alternative: Option<Alternative>,
}

/// The pose of `observations` (4 to 64). `prior` is the last pose, if there is one; a start from it that leads
/// nowhere, or to a worse pose than a cold start would, costs time but never a wrong answer.
pub fn solve(
    observations: &[Observation],
    lens: &Lens,
    settings: &Settings,
    prior: Option<&Pose>,
) -> Result<Solution, PoseError> {
    let problem = Problem::new(observations, lens, settings)?;
    if let Some(prior) = prior.filter(|p| p.is_rigid())
        && let Some(found) = from_start(&problem, &prior.orthonormalised())
    {
        return Ok(ambiguity::solution(&problem, &found, true));
    }
    let found = cold(&problem)?;
    Ok(ambiguity::solution(&problem, &found, false))
}

/// Refines a start; what remains beyond the gate is taken out, the worst first.
fn from_start(problem: &Problem, start: &Pose) -> Option<Consensus> {
    let fit = refine(problem, problem.all(), start).ok()?;
    robust::trimmed(problem, fit)
}

fn cold(problem: &Problem) -> Result<Consensus, PoseError> {
    let rays = problem.rays()?;
    match first_pose(problem, &rays) {
        Ok(start) => {
            if let Some(found) = from_start(problem, &start) {
                return Ok(if has_minimal_ambiguity(problem) {
                    better_of_search(problem, &rays, found)
                } else {
                    found
                });
            }
        }
        // What the chosen method cannot do is said, not mended behind the user's back.
        Err(error @ (PoseError::NearlyOnePlane | PoseError::TooFew { .. })) => return Err(error),
        Err(_) => {}
    }
    robust::search(problem, &rays)
}

/// Four circles in space: three of them have up to four poses, and the fourth may tell them apart by little.
fn has_minimal_ambiguity(problem: &Problem) -> bool {
    problem.rows.len() == MIN_CIRCLES && !problem.basis.is_planar()
}

/// The better of a consensus and what the search over all triples finds; the other one is remembered.
fn better_of_search(problem: &Problem, rays: &Rays, found: Consensus) -> Consensus {
    let Ok(mut best) = robust::search(problem, rays) else { return found };
    if found.fit.chi2 < best.fit.chi2 {
        let other =
            if ambiguity::is_same(&found.fit.pose, &best.fit.pose) { best.rival } else { Some(best.fit) };
        best = Consensus { rival: other, ..found };
    } else if best.rival.is_none() && !ambiguity::is_same(&found.fit.pose, &best.fit.pose) {
        best.rival = Some(found.fit);
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
