//! Where a circle will be seen and how large, and how far its disc's centroid lies from its projected centre:
//! what the tracker needs to place its window and to correct what it finds (Heikkila 2000, and Hartley and
//! Zisserman 2.2 for the dual conic).

use nalgebra::Matrix2;

use crate::geometry::{Circle, Pose};
use crate::lens::{Lens, LensError};

/// The picture of a circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Projection of the circle's centre, px.
    pub centre: [f64; 2],
    /// Second moments (uu, uv, vv) of the projected filled outer disc about its centre, px^2.
    pub shape: [f64; 3],
    /// Centroid of the projected filled outer disc minus projection of the circle's centre, px.
    pub bias: [f64; 2],
    /// Long axis of the outer edge's ellipse, px.
    pub diameter_px: f64,
}

/// Projects a circle. The shape is that of the affine map at the circle's centre, which is what a window
/// needs.
///
/// # Errors
/// As [`Lens::project`], of the circle's centre.
pub fn project_circle(circle: &Circle, pose: &Pose, lens: &Lens) -> Result<Projected, LensError> {
    let point = pose.transform(&circle.point);
    let (centre, jacobian) = lens.project_with_jacobian(&point)?;
    let axis = pose.rotation * circle.normal;
    // A filled disc of radius r in the plane with normal n has the moments r^2/4 (I - n n^T).
    let normal = jacobian * axis;
    let quarter = circle.outer_mm * circle.outer_mm / 16.0;
    let spread = jacobian * jacobian.transpose();
    let uu = quarter * (spread.m11 - normal.x * normal.x);
    let uv = quarter * (spread.m12 - normal.x * normal.y);
    let vv = quarter * (spread.m22 - normal.y * normal.y);
    if !(uu.is_finite() && uv.is_finite() && vv.is_finite()) {
        return Err(LensError::NotFinite);
    }
    // The larger eigenvalue of the moments is (long half axis)^2 / 4.
    let half_difference = 0.5 * (uu - vv);
    let larger = 0.5 * (uu + vv) + libm::sqrt(half_difference * half_difference + uv * uv);
    // The dual conic r^2 (I - n n^T) - P P^T has the ellipse's centre as the pole of the line at infinity.
    let radius2 = 4.0 * quarter;
    let across = radius2 * (1.0 - axis.z * axis.z);
    let denominator = point.z * point.z - across;
    if denominator <= 0.0 {
        return Err(LensError::Behind);
    }
    let (x, y) = (point.x / point.z, point.y / point.z);
    let offset = [
        (radius2 * axis.x * axis.z + x * across) / denominator,
        (radius2 * axis.y * axis.z + y * across) / denominator,
    ];
    let by_ray = jacobian.fixed_columns::<2>(0) * point.z;
    let to_ray = by_ray.try_inverse().ok_or(LensError::NotInvertible)?;
    let moments = to_ray * Matrix2::new(uu, uv, uv, vv) * to_ray.transpose();
    let [u, v] = lens.centroid([x + offset[0], y + offset[1]], &moments);
    let diameter_px = 4.0 * libm::sqrt(larger.max(0.0));
    Ok(Projected { centre, shape: [uu, uv, vv], bias: [u - centre[0], v - centre[1]], diameter_px })
}
