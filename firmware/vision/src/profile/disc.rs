//! The profile of a disc: a ring without an inner edge, small enough at times that its radius cannot be seen.

use super::{EVEN_SUMS, Radial};

/// Where the squares of the outer and of the inner radius stand among the sums of the normal equations.
const OUTER_SQUARE: usize = 11;
const INNER_SQUARE: usize = 15;

/// Discs below this radius are as wide as their blur, px: radius, blur and level cannot all be told.
const POINT_PX: f64 = 2.5;

/// Holds what the pixels do not tell: the inner edge, which is not there, and the radius of what is hardly
/// more than a point or saturated.
pub(super) fn hold(sums: &mut [f64; EVEN_SUMS], radial: &Radial, saturated: f64) {
    sums[INNER_SQUARE] += 1.0;
    if radial.outer < POINT_PX || saturated < f64::INFINITY {
        sums[OUTER_SQUARE] *= 1e6;
    }
}
