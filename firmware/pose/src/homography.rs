//! Pose of a planar set from its homography (thesis 3.3; Hartley and Zisserman 4.1; Zhang 2000 for the
//! decomposition), from four circles.

use nalgebra::{Matrix3, Vector3};

use crate::PoseError;
use crate::geometry::Pose;
use crate::linear::{Basis, candidates, cross, dot};
use crate::problem::{Problem, Rays};

/// The homography of the best plane, decomposed.
pub(crate) fn homography(problem: &Problem, rays: &Rays) -> Result<Pose, PoseError> {
    let found = candidates::<3>(&problem.basis, &problem.rows, rays);
    pose_of_plane(&problem.basis, &found.columns[0]).ok_or(PoseError::NoConsensus)
}

/// The pose whose plane has the columns `b` (of any scale and sign) nearest to a rigid plane's.
pub(crate) fn pose_of_plane(basis: &Basis, b: &[[f64; 3]; 3]) -> Option<Pose> {
    let sign = if b[0][2] < 0.0 { -1.0 } else { 1.0 };
    let axis = |k: usize| b[k].map(|c| sign * c / basis.sigma[k - 1]);
    let (p, q) = (axis(1), axis(2));
    // Nearest orthonormal pair: [p q] S^-1/2 with S = [p q]^T [p q]; for 2 x 2, S^1/2 = (S + det^1/2 I) /
    // trace^1/2.
    let (pp, pq, qq) = (dot(&p, &p), dot(&p, &q), dot(&q, &q));
    let root = libm::sqrt((pp * qq - pq * pq).max(0.0));
    let trace = libm::sqrt(pp + qq + 2.0 * root);
    let (spp, spq, sqq) = ((pp + root) / trace, pq / trace, (qq + root) / trace);
    let determinant = spp * sqq - spq * spq;
    let scale = 2.0 / (spp + sqq);
    let mut r1 = [0.0; 3];
    let mut r2 = [0.0; 3];
    for i in 0..3 {
        r1[i] = (sqq * p[i] - spq * q[i]) / determinant;
        r2[i] = (spp * q[i] - spq * p[i]) / determinant;
    }
    let r3 = cross(&r1, &r2);
    pose_of_axes(basis, &[r1, r2, r3], &b[0].map(|c| sign * scale * c))
}

/// The pose that puts the basis' axes along `columns` and its centroid at `centroid`, both in camera
/// coordinates.
pub(crate) fn pose_of_axes(basis: &Basis, columns: &[[f64; 3]; 3], centroid: &[f64; 3]) -> Option<Pose> {
    let [e1, e2, e3] = basis.axes.map(Vector3::from);
    let [c1, c2, c3] = columns.map(Vector3::from);
    let rotation: Matrix3<f64> = c1 * e1.transpose() + c2 * e2.transpose() + c3 * e3.transpose();
    let translation = Vector3::from(*centroid) - rotation * Vector3::from(basis.centroid);
    let pose = Pose { rotation, translation };
    (pose.is_rigid() && centroid[2] > 0.0).then_some(pose)
}
