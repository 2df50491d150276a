//! The model ring: an elliptic ring with blurred edges on white that may slope, and what its pixels say of its centre.

use crate::edge::edge;
use crate::lanes::{LANES, Lanes};
use crate::patch::{BLOCK, Block, Patch, RUNS};
use crate::profile::{Profile, Radial};

/// What the model ring looks like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Model {
    pub(crate) centre: [f64; 2],
    /// Second moments of the outer ellipse over the root of their determinant.
    pub(crate) shape: [f64; 3],
    pub(crate) radial: Radial,
    /// Slope of the white in the circle's plane, a px.
    pub(crate) slope: [f64; 2],
    /// How far perspective moves the outer and the inner edge from the circle's centre, in the circle's plane, px: it
    /// grows with their radius squared (thesis 3.2.4). Slope and centre could not be told apart without it.
    pub(crate) bias: [[f64; 2]; 2],
}

impl Model {
    /// Square root of the inverse of `shape`: takes the outer ellipse to a circle of its own area, the circle's plane.
    fn root(&self) -> [f64; 3] {
        // Cayley-Hamilton, for a determinant of 1.
        let [uu, uv, vv] = self.shape;
        let scale = 1.0 / libm::sqrt(uu + vv + 2.0);
        [(vv + 1.0) * scale, -uv * scale, (uu + 1.0) * scale]
    }

    /// A step in the picture as one in the circle's plane.
    pub(crate) fn in_circle(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [uu, uv, vv] = self.root();
        [uu * u + uv * v, uv * u + vv * v]
    }

    /// A step in the circle's plane as one in the picture.
    pub(crate) fn out_of_circle(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        // The inverse of a symmetric matrix of determinant 1.
        let [uu, uv, vv] = self.root();
        [vv * x - uv * y, uu * y - uv * x]
    }

    /// A gradient in the circle's plane as one in the picture.
    pub(crate) fn gradient_out_of_circle(&self, gradient: [f64; 2]) -> [f64; 2] {
        // The transpose of `in_circle`, which is symmetric.
        self.in_circle(gradient)
    }
}

/// A number for each pixel of a block.
type Column = [f32; BLOCK];

/// Where pixels are in the circle's plane.
struct Places {
    /// Distance from the centre along x and y, px.
    x: Column,
    y: Column,
    /// Distance from the centre and its inverse, px and 1/px.
    radius: Column,
    per_radius: Column,
}

/// What pixels say.
struct Pixels {
    /// Value less model.
    residual: Column,
    /// How much the value changes as the outer and the inner edge move outwards, over the greatest such change.
    outer: Column,
    inner: Column,
    /// How much it grows with the white.
    by_white: Column,
}

/// A model ring made ready for the pixels of a patch: single numbers that loops over a block take as they are.
pub(crate) struct Kernel {
    /// The centre from the patch's corner.
    centre: [f32; 2],
    root: [f32; 3],
    outer: f32,
    inner: f32,
    /// 1 / half width of an edge, 1/px.
    per_width: f32,
    white: f32,
    slope: [f32; 2],
    outer_bias: [f32; 2],
    inner_bias: [f32; 2],
    /// White less black, share of white.
    depth: f32,
    /// Values above this are no samples, and where the model is above the other the sensor is saturated.
    most: f32,
    saturated: f32,
    /// How much narrower than its mean an edge is, by its direction: the picture's blur is round, but in the circle's
    /// plane it is not.
    narrow: [f32; 3],
}

/// How far samples are moved from the edges for each step that they are beyond saturation, px.
const FAR: f32 = 1e4;

/// Sums of the fit.
pub(crate) const SUMS: usize = 12;

/// Columns of a run's pixels from its first one.
const STEPS: Lanes = Lanes::of([0.0, 1.0, 2.0, 3.0]);

impl Kernel {
    /// For a patch from `origin`, with samples up to `full`; what the model makes brighter than `saturated` says nothing.
    pub(crate) fn new(model: &Model, origin: [f64; 2], full: f64, saturated: f64) -> Self {
        let radial = &model.radial;
        // The square of how fast the radius grows with a step in the picture is n^T root^2 n, and root^2 the inverse of
        // the shape; 1 / sqrt(g) is 3/2 - g/2 about 1.
        let [uu, uv, vv] = model.shape;
        Self {
            centre: [0, 1].map(|i| (model.centre[i] - origin[i]) as f32),
            root: model.root().map(|x| x as f32),
            outer: radial.outer as f32,
            inner: radial.inner as f32,
            per_width: (1.0 / radial.half_width()) as f32,
            white: radial.white as f32,
            slope: model.slope.map(|x| x as f32),
            outer_bias: model.bias[0].map(|x| x as f32),
            inner_bias: model.bias[1].map(|x| x as f32),
            depth: (radial.contrast / radial.white) as f32,
            most: (full + 0.5) as f32,
            saturated: saturated as f32,
            narrow: [1.5 - 0.5 * vv, uv, 1.5 - 0.5 * uu].map(|x| x as f32),
        }
    }

    /// Not inlined, as [`Self::compare`]: so the compiler makes one loop over whole vectors of it.
    #[inline(never)]
    fn locate(&self, (columns, rows, _): Block, places: &mut Places) {
        let (mut du, mut dv) = ([0.0; BLOCK], [0.0; BLOCK]);
        for run in 0..RUNS {
            (Lanes::splat(f32::from(columns[run]) - self.centre[0]) + STEPS).store(&mut du, run);
            Lanes::splat(f32::from(rows[run]) - self.centre[1]).store(&mut dv, run);
        }
        let root = self.root;
        for i in 0..BLOCK {
            let (x, y) = (root[0] * du[i] + root[1] * dv[i], root[1] * du[i] + root[2] * dv[i]);
            let square = x * x + y * y;
            let per_radius = inverse_sqrt(square);
            (places.x[i], places.y[i]) = (x, y);
            (places.radius[i], places.per_radius[i]) = (square * per_radius, per_radius);
        }
    }

    #[inline(never)]
    fn compare(&self, (_, _, values): Block, places: &Places, pixels: &mut Pixels) {
        for (i, &value) in values.iter().enumerate() {
            let (x, y) = (places.x[i] * places.per_radius[i], places.y[i] * places.per_radius[i]);
            // What fills up runs says nothing, as if it were far from any edge.
            let over = value - self.most;
            let over = if over > 0.0 { over } else { 0.0 };
            let radius = places.radius[i] + over * FAR;
            let narrow = self.narrow[0] * x * x + self.narrow[1] * x * y + self.narrow[2] * y * y;
            let per_width = self.per_width * narrow;
            let outer_bias = self.outer_bias[0] * x + self.outer_bias[1] * y;
            let inner_bias = self.inner_bias[0] * x + self.inner_bias[1] * y;
            let (outer, outer_sum) = edge((radius - self.outer - outer_bias) * per_width);
            let (inner, inner_sum) = edge((radius - self.inner - inner_bias) * per_width);
            let by_white = 1.0 - self.depth * (inner_sum - outer_sum);
            let white = self.white + self.slope[0] * places.x[i] + self.slope[1] * places.y[i];
            let model = white * by_white;
            let counts = if model + over * FAR < self.saturated { 1.0 } else { 0.0 };
            pixels.residual[i] = value - model;
            pixels.outer[i] = outer * counts;
            pixels.inner[i] = inner * counts;
            pixels.by_white[i] = by_white * counts;
        }
    }

    /// Adds the pixels of a patch to the profile about this centre.
    pub(crate) fn collect(&self, patch: &Patch, profile: &mut Profile) {
        let mut places = Places::new();
        for block in patch.blocks() {
            self.locate(block, &mut places);
            profile.add((&places.x, &places.y, &places.radius), block.2);
        }
    }

    /// Sums over the pixels of a patch for the centre by either edge, the noise, the outer edge's third harmonic and
    /// the slope.
    pub(crate) fn fit(&self, patch: &Patch, sum: &mut [Lanes; SUMS]) {
        let mut places = Places::new();
        let zero = [0.0; BLOCK];
        let mut pixels = Pixels { residual: zero, outer: zero, inner: zero, by_white: zero };
        for block in patch.blocks() {
            self.locate(block, &mut places);
            self.compare(block, &places, &mut pixels);
            add(&places, &pixels, sum);
        }
    }
}

impl Places {
    fn new() -> Self {
        let zero = [0.0; BLOCK];
        Self { x: zero, y: zero, radius: zero, per_radius: zero }
    }
}

/// Not inlined, with the sums in memory: so the compiler keeps the four together.
#[inline(never)]
fn add(places: &Places, pixels: &Pixels, sum: &mut [Lanes; SUMS]) {
    for run in 0..RUNS {
        let at = |column: &Column| Lanes::load(column, run);
        let per_radius = at(&places.per_radius);
        let (x, y) = (at(&places.x) * per_radius, at(&places.y) * per_radius);
        let (outer, inner, residual) = (at(&pixels.outer), at(&pixels.inner), at(&pixels.residual));
        let (outer_residual, inner_residual) = (outer * residual, inner * residual);
        let (outer_x, outer_y) = (outer_residual * x, outer_residual * y);
        let steep = outer - inner;
        let steep_residual = outer_residual - inner_residual;
        let two_xy = x * y + x * y;
        let four_xy = two_xy + two_xy;
        sum[0] += outer_x;
        sum[1] += outer_y;
        sum[2] += inner_residual * x;
        sum[3] += inner_residual * y;
        sum[4] += steep * steep;
        sum[5] += steep_residual * steep_residual;
        sum[6] += outer_x - outer_y * four_xy;
        sum[7] += outer_x * four_xy - outer_y;
        let by_white = at(&pixels.by_white);
        let white_residual = by_white * residual;
        let slope = by_white * at(&places.radius);
        sum[8] += white_residual * at(&places.x);
        sum[9] += white_residual * at(&places.y);
        sum[10] += steep * slope;
        sum[11] += slope * slope;
    }
}

const _: () = assert!(LANES == 4 && BLOCK == RUNS * LANES);

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
