//! Pose of a general set by the direct linear transformation (thesis 3.3; Hartley and Zisserman 7.1), from
//! six circles. K is known, so the rays are used and `[R | t]` is the rigid one nearest to the solution.

use crate::PoseError;
use crate::eigen;
use crate::geometry::Pose;
use crate::homography::pose_of_axes;
use crate::linear::{Basis, candidates, cross, dot};
use crate::problem::{Problem, Rays};

/// Circles that the DLT needs.
pub(crate) const MIN_CIRCLES_DLT: usize = 6;
/// The second smallest eigenvalue must be this many times what noise makes of the smallest: else two
/// solutions fit, which is how a plane with a few circles off it shows.
const GAP: f64 = 25.0;

/// The DLT of all circles.
pub(crate) fn dlt(problem: &Problem, rays: &Rays) -> Result<Pose, PoseError> {
    let circles = problem.rows.len();
    if circles < MIN_CIRCLES_DLT {
        return Err(PoseError::TooFew { circles: circles as u8, needed: MIN_CIRCLES_DLT as u8 });
    }
    if problem.basis.is_planar() {
        return Err(PoseError::NearlyOnePlane);
    }
    let found = candidates::<4>(&problem.basis, &problem.rows, rays);
    let [smallest, second, _, largest] = found.eigenvalues;
    if second < GAP * smallest.max(noise(problem)).max(1e-15 * largest) {
        return Err(PoseError::NearlyOnePlane);
    }
    pose_of_columns(&problem.basis, &found.columns[0]).ok_or(PoseError::NoConsensus)
}

/// What the centres' noise makes of an eigenvalue that would be zero: the rays' mean variance.
fn noise(problem: &Problem) -> f64 {
    let [fx, fy] = problem.lens.focal;
    let sum: f64 =
        problem.rows.iter().map(|row| 1.0 / (row.weight_u * fx * fx) + 1.0 / (row.weight_v * fy * fy)).sum();
    sum / problem.rows.len() as f64
}

/// The pose nearest to columns `b` of any scale and sign: the orthogonal factor of the polar decomposition.
pub(crate) fn pose_of_columns(basis: &Basis, b: &[[f64; 3]; 4]) -> Option<Pose> {
    let sign = if b[0][2] < 0.0 { -1.0 } else { 1.0 };
    let mut m = [[0.0; 3]; 3];
    for k in 0..3 {
        m[k] = b[k + 1].map(|c| sign * c / basis.sigma[k]);
    }
    let gram = m.map(|row| m.map(|column| dot(&row, &column)));
    let (values, vectors) = eigen::symmetric(gram);
    let roots = values.map(|v| libm::sqrt(v.max(0.0)));
    if dot(&cross(&m[0], &m[1]), &m[2]) <= 0.0 || roots[0] <= 0.0 {
        return None;
    }
    // M (M^T M)^-1/2, column by column.
    let mut columns = [[0.0; 3]; 3];
    for (root, vector) in roots.iter().zip(&vectors) {
        for k in 0..3 {
            for j in 0..3 {
                let share = vector[j] * vector[k] / root;
                for i in 0..3 {
                    columns[k][i] += share * m[j][i];
                }
            }
        }
    }
    let scale = 3.0 / (roots[0] + roots[1] + roots[2]);
    pose_of_axes(basis, &columns, &b[0].map(|c| sign * scale * c))
}
