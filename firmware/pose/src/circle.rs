//! Where a circle will be seen and how large: what the tracker needs to place its window.

use crate::geometry::{Circle, Pose};
use crate::lens::{Lens, LensError};

/// The picture of a circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Projection of the circle's centre, px.
    pub centre: [f64; 2],
    /// Second moments (uu, uv, vv) of the projected filled outer disc about its centre, px^2.
    pub shape: [f64; 3],
    /// Long axis of the outer edge's ellipse, px.
    pub diameter_px: f64,
}

/// Projects a circle. The shape is that of the affine map at the circle's centre, which is what a window needs.
pub fn project_circle(circle: &Circle, pose: &Pose, lens: &Lens) -> Result<Projected, LensError> {
    let (centre, jacobian) = lens.project_with_jacobian(&pose.transform(&circle.point))?;
    // A filled disc of radius r in the plane with normal n has the moments r^2/4 (I - n n^T).
    let normal = jacobian * (pose.rotation * circle.normal);
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
    Ok(Projected { centre, shape: [uu, uv, vv], diameter_px: 4.0 * libm::sqrt(larger.max(0.0)) })
}
