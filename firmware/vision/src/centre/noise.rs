//! The noise of the pixels at a ring's edges: what their squared residuals leave when all that the model
//! knows to be none of it is taken away.

use crate::edge::{FOURTH, SQUARE};
use crate::model::{EdgeSums, Model};

/// Share of the squared residuals that is noise at the least, however much of them radii seem to explain:
/// what is left of clipped edges is explained by nearly any.
const LEAST_LEFT: f64 = 0.25;

/// What is left of the pixels' mean square residual, by their weight, without what is no noise, and the
/// variance of their noise. `step` is the square of what this pass moves the ring by, px in the circle's
/// plane; `overlap` where blur joins the edges, and the model itself bends them.
///
/// Every pixel's own residual counts by how much it moves the centre, so noise may differ from white to
/// black.
pub(super) fn noise(model: &Model, [outer, inner]: [&EdgeSums; 2], step: f64, overlap: bool) -> (f64, f64) {
    let radial = &model.radial;
    let (share, per_px) = (radial.outer_share(), radial.peak());
    let square = outer.square + inner.square;
    let all = (outer.noise + inner.noise) / square;
    // The step takes a part of the residuals away; what is even about the centre is the radii's error and no
    // noise, and so is what bends the edges.
    let moved = 0.5 * per_px * per_px * step;
    let other = (1.0 - share).max(f64::MIN_POSITIVE);
    let even = (outer.even * outer.even / share + inner.even * inner.even / other) / (square * square);
    let bent = if overlap { 0.0 } else { bent(model) };
    let taken = (moved + even + bent) * (FOURTH / SQUARE);
    // The fit follows the noise of two in as many pixels as carry the information.
    let carrying = radial.edges_px() * radial.half_width() * (SQUARE * SQUARE / FOURTH);
    let residual = (all - taken).max(LEAST_LEFT * all) / (1.0 - 4.0 / carrying.max(8.0));
    // Rounding to whole grey levels is noise too.
    (residual, residual.max(1.0 / 12.0))
}

/// Mean square residual by what a tilted ring's blur bends its edges, over that where they are steepest: a
/// sine's.
fn bent(model: &Model) -> f64 {
    let radial = &model.radial;
    let share = radial.outer_share();
    let of = |radius: f64, share: f64| share / (radius * radius);
    let bend = radial.peak() * model.bend();
    0.5 * bend * bend * (of(radial.outer, share) + of(radial.inner, 1.0 - share))
}
