//! The rest pose: robust mean of the poses of the rest interval (thesis 5.3.2: a poor first frame biases
//! every later one). Mean on SO(3) x R^3 by iteration in the tangent space, weights that fall to zero.

use heapless::Vec;
use nalgebra::{Matrix6, Vector6};

use crate::geometry::{Pose, rotation_vector};
use crate::motion::RestPose;
use crate::{PoseError, Solution};

/// Most poses of one rest interval.
pub const MAX_REST_POSES: usize = 256;
/// Iterations after which it ends in any case; three to six are usual.
const ITERATIONS: usize = 30;
/// Poses up to this many times the typical distance from the mean have full weight; at twice as many, none.
const FULL_WEIGHT: f64 = 2.0;

/// The robust mean of poses at rest and its covariance.
///
/// Each pose counts by its own covariance, less from twice the median distance to the mean, and from four
/// times not at all. The covariance of the mean is enlarged where the poses scatter more than their own
/// covariances say (vibration).
///
/// # Errors
/// None or too many solutions, one whose pose or covariance is none, or a singular mean.
pub fn rest_mean(solutions: &[Solution]) -> Result<RestPose, PoseError> {
    if solutions.is_empty() {
        return Err(PoseError::TooFew { circles: 0, needed: 1 });
    }
    if solutions.len() > MAX_REST_POSES {
        return Err(PoseError::TooMany);
    }
    let mut information: Vec<Matrix6<f64>, MAX_REST_POSES> = Vec::new();
    for (solution, i) in solutions.iter().zip(0..=u8::MAX) {
        if !solution.pose.is_rigid() {
            return Err(PoseError::NotFinite { circle: i });
        }
        let inverse = solution.covariance.cholesky().map(|c| c.inverse());
        let inverse = inverse.ok_or(PoseError::Covariance { circle: i })?;
        information.push(inverse).map_err(|_| PoseError::TooMany)?;
    }
    let mut mean = median(solutions).ok_or(PoseError::TooMany)?;
    let mut covariance = Matrix6::zeros();
    for _ in 0..ITERATIONS {
        let distances = distances(solutions, &information, &mean).ok_or(PoseError::TooMany)?;
        let typical = middle(&distances).ok_or(PoseError::TooMany)?;
        let mut h = Matrix6::zeros();
        let mut g = Vector6::zeros();
        let (mut scatter, mut weights) = (0.0, 0.0);
        for ((solution, information), distance) in solutions.iter().zip(&information).zip(&distances) {
            let limit = FULL_WEIGHT * typical;
            let weight = if *distance > limit { (2.0 - distance / limit).max(0.0) } else { 1.0 };
            h += information * weight;
            g += information * difference(&solution.pose, &mean) * weight;
            scatter += weight * distance * distance;
            weights += weight;
        }
        let inverse = h.cholesky().map(|c| c.inverse()).ok_or(PoseError::Singular)?;
        let step = inverse * g;
        mean = mean.perturbed([step[0], step[1], step[2]], [step[3], step[4], step[5]]);
        // Six numbers a pose, six of them spent on the mean.
        let freedom = 6.0 * (weights - 1.0);
        let excess = if freedom > 0.5 { (scatter / freedom).max(1.0) } else { 1.0 };
        covariance = inverse * excess;
        if step.dot(&g) < 1e-12 {
            break;
        }
    }
    Ok(RestPose::new(mean.orthonormalised(), covariance))
}

/// (v, w) that takes `mean` to `pose`.
pub(crate) fn difference(pose: &Pose, mean: &Pose) -> Vector6<f64> {
    let v = pose.translation - mean.translation;
    let w = rotation_vector(&(pose.rotation * mean.rotation.transpose()));
    Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
}

fn distances(
    solutions: &[Solution],
    information: &[Matrix6<f64>],
    mean: &Pose,
) -> Option<Vec<f64, MAX_REST_POSES>> {
    let mut distances = Vec::new();
    for (solution, information) in solutions.iter().zip(information) {
        let d = difference(&solution.pose, mean);
        distances.push(libm::sqrt(d.dot(&(information * d)))).ok()?;
    }
    Some(distances)
}

/// Start: the median of each coordinate, in the tangent space of the first pose.
fn median(solutions: &[Solution]) -> Option<Pose> {
    let first = solutions.first()?.pose;
    let mut centre = [0.0; 6];
    for (i, coordinate) in centre.iter_mut().enumerate() {
        let mut values: Vec<f64, MAX_REST_POSES> = Vec::new();
        for solution in solutions {
            values.push(difference(&solution.pose, &first)[i]).ok()?;
        }
        *coordinate = middle(&values)?;
    }
    let [vx, vy, vz, wx, wy, wz] = centre;
    Some(first.perturbed([vx, vy, vz], [wx, wy, wz]))
}

fn middle(values: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64, MAX_REST_POSES> = Vec::from_slice(values).ok()?;
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}
