//! The model ring: an elliptic ring with blurred edges on white that may slope, and how its pixels change with it.

use crate::lanes::{LANES, Lanes};
use crate::patch::{BLOCK, Block, Patch};

/// Half the width of the model's edge in standard deviations of its blur: that of the density (1 - z^2)^2 on
/// -1..1, whose variance is 1/7.
pub(crate) const HALF_WIDTH: f64 = 2.645_751_311_064_590_6;

/// Integrals over an edge in units of its half width, with w = (1 - z^2)^2: of w over that of w^2, and of z^2 w^2
/// over that of w^2.
pub(crate) const PER_SQUARE: f64 = 1.3125;
pub(crate) const WIDTH_PER_SQUARE: f64 = 1.0 / 11.0;

/// Pixels less steep than these tell of the levels of white and, as there are few, of black.
const FLAT: f32 = 1e-3;
const NEARLY_FLAT: f32 = 0.2;

/// What the model ring looks like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Model {
    pub(crate) centre: [f64; 2],
    /// Second moments of the outer ellipse over the root of their determinant.
    pub(crate) shape: [f64; 3],
    pub(crate) outer: f64,
    pub(crate) inner: f64,
    /// Level of the white at the centre and its slope along u and v.
    pub(crate) white: f64,
    pub(crate) slope: [f64; 2],
    /// White less black, share of white.
    pub(crate) depth: f64,
    /// Standard deviation of the edges' blur, px.
    pub(crate) blur: f64,
}

impl Model {
    /// Square root of the inverse of `shape`: takes the outer ellipse to a circle of its own area.
    fn root(&self) -> [f64; 3] {
        // Cayley-Hamilton, for a determinant of 1.
        let [uu, uv, vv] = self.shape;
        let scale = 1.0 / libm::sqrt(uu + vv + 2.0);
        [(vv + 1.0) * scale, -uv * scale, (uu + 1.0) * scale]
    }

    /// A step in the circle's plane as one in the picture.
    pub(crate) fn out_of_circle(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        // The inverse of a symmetric matrix of determinant 1.
        let [uu, uv, vv] = self.root();
        [vv * x - uv * y, uu * y - uv * x]
    }

    /// The matrix q of the ellipse d^T q d = 1 of this shape and mean radius.
    pub(crate) fn ellipse(&self, radius: f64) -> [f64; 3] {
        let square = radius * radius;
        [self.shape[2] / square, -self.shape[1] / square, self.shape[0] / square]
    }

    /// Radius from which on nothing tells of the ring.
    pub(crate) fn end(&self) -> f64 {
        self.outer + HALF_WIDTH * self.blur
    }

    /// Change of a pixel's value where an edge is steepest and moves by 1 px.
    pub(crate) fn peak(&self) -> f64 {
        0.9375 / (HALF_WIDTH * self.blur) * self.white * self.depth
    }

    /// Share of the outer edge in the length of both, and so in the information on the centre.
    pub(crate) fn outer_share(&self) -> f64 {
        self.outer / (self.outer + self.inner)
    }
}

/// A number for each pixel of a block.
type Column = [f32; BLOCK];

/// Where pixels are.
struct Places {
    /// Distance from the centre in the picture along u and v, px.
    u: Column,
    v: Column,
    /// Direction from the centre and radius in the plane where the outer ellipse is a circle of its own area, px.
    x: Column,
    y: Column,
    radius: Column,
}

/// What pixels say.
struct Pixels {
    /// Value less model.
    residual: Column,
    /// Share of the pixel that the ring covers.
    covered: Column,
    /// 1 where the inner edge is nearer than the outer one, else 0.
    inner: Column,
    /// How much the value falls as the nearer edge moves towards its white, over the greatest such fall.
    steep: Column,
    /// Distance from the nearer edge in half widths of the edge, positive in its white, -1 to 1.
    from_edge: Column,
}

/// A model ring made ready for the pixels of a patch: single numbers that loops over a block take as they are.
pub(crate) struct Kernel {
    /// The centre from the patch's corner.
    centre: [f32; 2],
    root: [f32; 3],
    /// Radius of the middle of the ring and half its thickness, px.
    middle: f32,
    half_thickness: f32,
    /// 1 / half width of an edge, 1/px.
    per_width: f32,
    white: f32,
    slope: [f32; 2],
    depth: f32,
    /// Values above this are saturated.
    clipped: f32,
    /// How far pixels count for the levels.
    reach: f32,
}

/// Sums of the two passes.
pub(crate) const ADJUSTED: usize = 18;
pub(crate) const JUDGED: usize = 8;

impl Kernel {
    /// For a patch from `origin`, white up to `margin` px from the ring, and samples up to `full`.
    pub(crate) fn new(model: &Model, origin: [f64; 2], margin: f64, full: f64) -> Self {
        Self {
            centre: [0, 1].map(|i| (model.centre[i] - origin[i]) as f32),
            root: model.root().map(|x| x as f32),
            middle: (0.5 * (model.outer + model.inner)) as f32,
            half_thickness: (0.5 * (model.outer - model.inner)) as f32,
            per_width: (1.0 / (HALF_WIDTH * model.blur)) as f32,
            white: model.white as f32,
            slope: model.slope.map(|x| x as f32),
            depth: model.depth as f32,
            clipped: (full - 0.5) as f32,
            reach: (model.outer + margin) as f32,
        }
    }

    /// Not inlined, as [`Self::compare`]: so the compiler makes one loop over whole vectors of it.
    #[inline(never)]
    fn locate(&self, (x, y, _): Block, places: &mut Places) {
        let root = self.root;
        for i in 0..BLOCK {
            let (du, dv) = (f32::from(x[i]) - self.centre[0], f32::from(y[i]) - self.centre[1]);
            let (u, v) = (root[0] * du + root[1] * dv, root[1] * du + root[2] * dv);
            let square = u * u + v * v;
            let per_radius = inverse_sqrt(square);
            (places.u[i], places.v[i]) = (du, dv);
            (places.x[i], places.y[i]) = (u * per_radius, v * per_radius);
            places.radius[i] = square * per_radius;
        }
    }

    #[inline(never)]
    fn compare(&self, (_, _, values): Block, places: &Places, pixels: &mut Pixels) {
        for (i, value) in values.iter().enumerate() {
            // The nearer edge is the other's mirror image in the middle of the ring.
            let from_middle = places.radius[i] - self.middle;
            let z = (from_middle.abs() - self.half_thickness) * self.per_width;
            let z = if z > -1.0 { z } else { -1.0 };
            let z = if z < 1.0 { z } else { 1.0 };
            let z_square = z * z;
            let density = 1.0 - z_square;
            // Half less the integral of 15/16 (1 - z^2)^2.
            let covered = 0.5 - z * (0.9375 - z_square * (0.625 - 0.1875 * z_square));
            let white = self.white + self.slope[0] * places.u[i] + self.slope[1] * places.v[i];
            pixels.residual[i] = value - white + white * (self.depth * covered);
            pixels.covered[i] = covered;
            pixels.inner[i] = if from_middle < 0.0 { 1.0 } else { 0.0 };
            pixels.steep[i] = density * density;
            pixels.from_edge[i] = z;
        }
    }

    /// Visits all blocks of a patch.
    #[inline(always)]
    fn visit(&self, patch: &Patch, mut visitor: impl FnMut(&Places, &Pixels, &Column)) {
        let zero = [0.0; BLOCK];
        let mut places = Places { u: zero, v: zero, x: zero, y: zero, radius: zero };
        let mut pixels = Pixels { residual: zero, covered: zero, inner: zero, steep: zero, from_edge: zero };
        for block in patch.blocks() {
            self.locate(block, &mut places);
            self.compare(block, &places, &mut pixels);
            visitor(&places, &pixels, block.2);
        }
    }

    /// Sums for levels, slope, radii, blur, shape and centre.
    pub(crate) fn adjust(&self, patch: &Patch, sum: &mut [Lanes; ADJUSTED]) {
        self.visit(patch, |places, pixels, values| self.add_adjusted(places, pixels, values, sum));
    }

    /// Sums for the centre by either edge, the noise and the outer edge's third harmonic.
    pub(crate) fn judge(&self, patch: &Patch, sum: &mut [Lanes; JUDGED]) {
        self.visit(patch, |places, pixels, _| add_judged(places, pixels, sum));
    }

    /// Not inlined, with the sums in memory: so the compiler keeps the four together.
    #[inline(never)]
    fn add_adjusted(&self, places: &Places, pixels: &Pixels, values: &Column, sum: &mut [Lanes; ADJUSTED]) {
        for i in (0..BLOCK).step_by(LANES) {
            let at = |column: &Column| Lanes::of(core::array::from_fn(|lane| column[i + lane]));
            let (x, y, radius) = (at(&places.x), at(&places.y), at(&places.radius));
            let (u, v) = (at(&places.u), at(&places.v));
            let (steep, residual, covered) = (at(&pixels.steep), at(&pixels.residual), at(&pixels.covered));
            let steep_residual = steep * residual;
            let inner_residual = steep_residual * at(&pixels.inner);
            let outer_residual = steep_residual - inner_residual;
            let edge_residual = inner_residual - outer_residual;
            let edge_x = edge_residual * x;
            let splat = Lanes::splat;
            let black = steep.less(splat(NEARLY_FLAT)) * covered;
            let white = steep.less(splat(FLAT)) * radius.less(splat(self.reach)) * (splat(1.0) - covered);
            let white_residual = white * residual;
            let terms = [
                edge_x,
                edge_residual * y,
                steep * steep,
                outer_residual,
                inner_residual,
                edge_x * x,
                edge_x * y,
                steep_residual * at(&pixels.from_edge),
                white,
                white_residual,
                white_residual * u,
                white_residual * v,
                white * u,
                white * v,
                white * radius * radius,
                black,
                black * residual,
                white * splat(self.clipped).less(at(values)),
            ];
            sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
    }
}

#[inline(never)]
fn add_judged(places: &Places, pixels: &Pixels, sum: &mut [Lanes; JUDGED]) {
    for i in (0..BLOCK).step_by(LANES) {
        let at = |column: &Column| Lanes::of(core::array::from_fn(|lane| column[i + lane]));
        let (x, y, steep) = (at(&places.x), at(&places.y), at(&pixels.steep));
        let residual = steep * at(&pixels.residual);
        let inner_residual = residual * at(&pixels.inner);
        let outer_residual = residual - inner_residual;
        let (outer_x, outer_y) = (outer_residual * x, outer_residual * y);
        let four_xy = x * y * Lanes::splat(4.0);
        let terms = [
            outer_x,
            outer_y,
            inner_residual * x,
            inner_residual * y,
            steep * steep,
            residual * residual,
            outer_x - outer_y * four_xy,
            outer_x * four_xy - outer_y,
        ];
        sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }
}

/// 1 / sqrt(x) to 7e-4 of itself, finite for every x >= 0.
#[inline(always)]
fn inverse_sqrt(x: f32) -> f32 {
    // The bits of a float are nearly its logarithm: halve and negate it, then one of Newton's steps. The constants
    // (J. Kadlec) make the largest error least.
    let y = f32::from_bits(0x5f1f_fff9_u32.wrapping_sub(x.to_bits() >> 1));
    y * (1.681_913_9 - x * y * y * 0.703_952_25)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_root_is_good_to_seven_ten_thousandths() {
        for i in -20..40 {
            let x = 1.37f32 * 2f32.powi(i);
            let exact = 1.0 / f64::from(x).sqrt();
            assert!((f64::from(inverse_sqrt(x)) / exact - 1.0).abs() < 7e-4);
        }
        assert!(inverse_sqrt(0.0).is_finite());
    }
}
