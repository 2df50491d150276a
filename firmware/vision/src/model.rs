//! The model ring: an elliptic ring with blurred edges on white that may slope, and what its pixels say of
//! its centre.

use multiversion::multiversion;

use crate::edge::edge;
use crate::lanes::{BLOCK, Column, Lanes, RUNS, inverse_sqrt};
use crate::length;
use crate::patch::{Part, Patch};
use crate::profile::{Places, Profile, Radial};

/// Weight of a pixel without light, and how much less it is of white: half way between what photons' noise
/// asks for and what noise that is everywhere the same does. Either costs 2 % of the standard deviation at
/// the most.
const WEIGHT: [f32; 2] = [1.6, 1.0];

/// Weight of a white pixel.
pub(crate) const WHITE_WEIGHT: f64 = (WEIGHT[0] - WEIGHT[1]) as f64;

/// Share of full scale below saturation over which pixels count less and less. Where all of a pixel counted
/// or nothing, which of them do would depend on where the ring lies between them, and the centre with it.
const FADING: f64 = 0.25;

/// What the model ring looks like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Model {
    pub(crate) centre: [f64; 2],
    /// Second moments of the outer ellipse over the root of their determinant.
    pub(crate) shape: [f64; 3],
    pub(crate) radial: Radial,
    /// Slope of the white in the circle's plane, a px.
    pub(crate) slope: [f64; 2],
    /// How far perspective moves the outer edge from the circle's centre, in the circle's plane, px, and the
    /// inner edge's share of that: it grows with the radius squared (thesis 3.2.4). Slope and centre could
    /// not be told apart without it.
    pub(crate) bias: [f64; 2],
    pub(crate) inner_bias: f64,
}

impl Model {
    /// Square root of the inverse of `shape`: takes the outer ellipse to a circle of its own area, the
    /// circle's plane.
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

    /// The centre of an edge that perspective moves by this share of the outer edge's bias.
    pub(crate) fn centre_of(&self, share: f64) -> [f64; 2] {
        let [u, v] = self.out_of_circle(self.bias.map(|bias| share * bias));
        [self.centre[0] + u, self.centre[1] + v]
    }

    /// The mean of both edges' centres by their lengths: about it the ring's profile is sharpest.
    pub(crate) fn middle(&self) -> [f64; 2] {
        let outer = self.radial.outer_share();
        self.centre_of(outer + (1.0 - outer) * self.inner_bias)
    }

    /// Mean square distance of the edges' centres from their mean along one axis, px^2.
    pub(crate) fn apart(&self) -> f64 {
        let outer = self.radial.outer_share();
        let apart = length(self.bias[0], self.bias[1]) * (1.0 - self.inner_bias);
        0.5 * outer * (1.0 - outer) * apart * apart
    }

    /// By how much blur moves an edge of 1 px radius further inwards at the ends of the ellipse's longer axis
    /// than in the mean, px. Blur moves what is bent by half its variance along the edge over the radius, and
    /// in the circle's plane more of it is along the edge there. Between the axes that goes as the cosine of
    /// twice the angle.
    pub(crate) fn bend(&self) -> f64 {
        let [uu, _, vv] = self.shape;
        let trace = uu + vv;
        // The difference of the eigenvalues, which are the ratio of the axes and its inverse.
        let apart = libm::sqrt((trace * trace - 4.0).max(0.0));
        0.25 * self.radial.blur * self.radial.blur * apart
    }

    /// A gradient in the circle's plane as one in the picture.
    pub(crate) fn gradient_out_of_circle(&self, gradient: [f64; 2]) -> [f64; 2] {
        // The transpose of `in_circle`, which is symmetric.
        self.in_circle(gradient)
    }
}

/// What pixels near an edge say.
struct Pixels {
    /// Value less model.
    residual: Column,
    /// How much the value changes as the edge moves outwards, over the greatest such change.
    steep: Column,
    /// How much it grows with the white.
    by_white: Column,
    /// How much it counts: photons are noisier where it is brighter.
    weight: Column,
}

impl Pixels {
    /// Makes pixels from number `count` on say nothing.
    fn forget_from(&mut self, count: usize) {
        for column in [&mut self.steep, &mut self.by_white] {
            column.get_mut(count..).unwrap_or_default().fill(0.0);
        }
    }
}

/// One of a ring's edges.
#[derive(Clone, Copy)]
struct Edge {
    /// Its own centre, from the patch's corner: perspective moves it.
    centre: [f32; 2],
    radius: f32,
    /// How far the other edge's centre lies from this one's, in the circle's plane.
    to_other: [f32; 2],
    /// How much brighter it is outside than inside, share of white.
    rise: f32,
}

/// A model ring made ready for the pixels of a patch: single numbers that loops over a block take as they
/// are.
pub(crate) struct Kernel {
    /// The profile's centre from the patch's corner.
    middle: [f32; 2],
    root: [f32; 3],
    edges: [Edge; 2],
    /// Whether pixels of one edge's belt see the other one.
    overlap: bool,
    white: f32,
    slope: [f32; 2],
    /// Weight of a pixel without light, and how much less it is of one at the white's level.
    weight: [f32; 2],
    /// White less black, share of white.
    depth: f32,
    /// Where the model is above this the sensor is saturated; infinite where that is nowhere. And one over
    /// the levels below it at which pixels count less and less.
    saturated: f32,
    per_fading: f32,
    /// 1 / half width of an edge, 1/px, by its direction (x, y): [0] + y ([1] x + [2] y). The picture's blur
    /// is round, but in the circle's plane it is not.
    per_width: [f32; 3],
    /// The next term of that series: [1] ([0] - 1 / half width)^2.
    per_width_square: [f32; 2],
    /// How blur bends the edges, as [`Model::bend`]: inwards by [1] (1 / half width - [0]) over the radius.
    /// It matters where blur joins them.
    bend: [f32; 2],
}

/// Sums over the pixels of an edge's belt, with its steepness s, residual r, direction (x, y) and light w,
/// which is what the white adds with its slope: s r x, s r y, s r, s s, s r s r, s r x y y, s r y y y, w r x,
/// w r y, s w, w w.
const SUMS: usize = 11;

/// What a belt says of its edge and of the slope.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeSums {
    /// First harmonic of steepness times residual, and its mean.
    pub(crate) side: [f64; 2],
    pub(crate) even: f64,
    /// Squares of the steepness, and of it times the residual.
    pub(crate) square: f64,
    pub(crate) noise: f64,
    /// Third harmonic.
    pub(crate) third: [f64; 2],
    /// The same of the slope as of the edge, and what both have in common.
    pub(crate) slope_side: [f64; 2],
    pub(crate) slope_square: f64,
    pub(crate) cross: f64,
}

impl Kernel {
    /// For a patch from `origin`; what the model makes brighter than `saturated` says nothing.
    pub(crate) fn new(model: &Model, origin: [f64; 2], saturated: f64, overlap: bool) -> Self {
        let radial = &model.radial;
        // The square of how fast the radius grows with a step in the picture is n^T root^2 n, and root^2 the
        // inverse of the shape; 1 / sqrt(g) is 3/2 - g/2 about 1. The squares of a direction sum to 1.
        let [uu, uv, vv] = model.shape;
        let mut narrow = [1.5 - 0.5 * vv, uv, 0.5 * (vv - uu)];
        if saturated == f64::INFINITY {
            // The profile's width is that of all directions together: without the next term, which clipped
            // edges have, their mean is to be 1.
            narrow[0] = 1.0 - 0.5 * narrow[2];
        }
        let half_width = radial.half_width();
        let mean = narrow[0] + 0.5 * narrow[2];
        let depth = (radial.contrast / radial.white) as f32;
        let in_patch = |at: [f64; 2]| [0, 1].map(|i| (at[i] - origin[i]) as f32);
        let edge = |radius: f64, share: f64, other: f64, rise: f32| Edge {
            centre: in_patch(model.centre_of(share)),
            radius: radius as f32,
            to_other: model.bias.map(|bias| ((other - share) * bias) as f32),
            rise,
        };
        let inner_bias = model.inner_bias;
        Self {
            middle: in_patch(model.middle()),
            root: model.root().map(|x| x as f32),
            edges: [edge(radial.outer, 1.0, inner_bias, depth), edge(radial.inner, inner_bias, 1.0, -depth)],
            overlap,
            white: radial.white as f32,
            slope: model.slope.map(|x| x as f32),
            weight: if radial.is_disc() { [1.0, 0.0] } else { WEIGHT },
            depth,
            saturated: saturated as f32,
            per_fading: (1.0 / (FADING * saturated)) as f32,
            per_width: narrow.map(|x| (x / half_width) as f32),
            per_width_square: [1.0 / half_width, 1.5 * half_width].map(|x| x as f32),
            bend: [mean / half_width, radial.blur * radial.blur * half_width].map(|x| x as f32),
        }
    }

    /// Adds pixels to the profile about the middle of both edges.
    pub(crate) fn collect(&self, patch: &Patch, part: Part, profile: &mut Profile) {
        let mut places = Places::new();
        for ((columns, rows, values), count) in patch.blocks(part) {
            place(self, self.middle, columns, rows, &mut places);
            places.forget_from(count);
            profile.add(&places, values);
        }
    }

    /// What the belts of the outer and of the inner edge say.
    pub(crate) fn fit(&self, patch: &Patch, belts: [Part; 2]) -> [EdgeSums; 2] {
        [0, 1].map(|i| self.fit_edge(patch, belts[i], i))
    }

    fn fit_edge(&self, patch: &Patch, belt: Part, edge: usize) -> EdgeSums {
        let zero = [0.0; BLOCK];
        let mut places = Places::new();
        let mut pixels = Pixels { residual: zero, steep: zero, by_white: zero, weight: zero };
        let mut sums = [Lanes::ZERO; SUMS];
        let centre = self.edges[edge & 1].centre;
        for ((columns, rows, values), count) in patch.blocks(belt) {
            place(self, centre, columns, rows, &mut places);
            match (self.saturated < f32::INFINITY, self.overlap) {
                (false, false) => compare::<false, false>(self, edge, &places, values, &mut pixels),
                (false, true) => compare::<false, true>(self, edge, &places, values, &mut pixels),
                (true, false) => compare::<true, false>(self, edge, &places, values, &mut pixels),
                (true, true) => compare::<true, true>(self, edge, &places, values, &mut pixels),
            }
            pixels.forget_from(count);
            add_pixels(&places, &pixels, &mut sums);
        }
        let [x, y, even, square, noise, xyy, yyy, slope_x, slope_y, cross, slope_square] =
            sums.map(Lanes::sum);
        EdgeSums {
            side: [x, y],
            even,
            square,
            noise,
            third: [x - 4.0 * xyy, 3.0 * y - 4.0 * yyy],
            slope_side: [slope_x, slope_y],
            slope_square,
            cross,
        }
    }
}

/// Where pixels are, about a centre. Not inlined, as [`compare`]: so the compiler makes one loop
/// over whole vectors of it; and two loops, so that a processor has several turns of either under way.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn place(kernel: &Kernel, centre: [f32; 2], columns: &[u8; BLOCK], rows: &[u8; BLOCK], places: &mut Places) {
    for i in 0..BLOCK {
        let (du, dv) = (f32::from(columns[i]) - centre[0], f32::from(rows[i]) - centre[1]);
        let (x, y) = (kernel.root[0] * du + kernel.root[1] * dv, kernel.root[1] * du + kernel.root[2] * dv);
        let square = x * x + y * y;
        let per_radius = inverse_sqrt(square);
        (places.x[i], places.y[i]) = (x * per_radius, y * per_radius);
        places.radius[i] = square * per_radius;
    }
}

/// Pixels of the belt of edge `near`, which see the other one only with `OVERLAP`.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn compare<const CLIPPED: bool, const OVERLAP: bool>(
    kernel: &Kernel,
    near: usize,
    places: &Places,
    values: &[u16; BLOCK],
    pixels: &mut Pixels,
) {
    let (near, far) = (kernel.edges[near & 1], kernel.edges[1 - (near & 1)]);
    // By how much the other edge darkens the middle between the levels of this one.
    let between = if OVERLAP { 1.0 } else { 1.0 - 0.5 * kernel.depth };
    for i in 0..BLOCK {
        let (x, y, radius) = (places.x[i], places.y[i], places.radius[i]);
        let mut per_width = kernel.per_width[0] + y * (kernel.per_width[1] * x + kernel.per_width[2] * y);
        if CLIPPED {
            // What is left of an edge is all on one side of it: its width is felt as its place.
            let narrower = kernel.per_width_square[0] - per_width;
            per_width += kernel.per_width_square[1] * narrower * narrower;
        }
        let bend = if OVERLAP { kernel.bend[1] * (per_width - kernel.bend[0]) / radius } else { 0.0 };
        let (mut steep, height) = edge((radius + bend - near.radius) * per_width);
        let mut by_white = between + near.rise * height;
        if OVERLAP {
            let moved = near.to_other[0] * x + near.to_other[1] * y;
            let (far_steep, far_height) = edge((radius + bend - far.radius - moved) * per_width);
            steep -= far_steep;
            by_white += far.rise * far_height;
        }
        let white = kernel.white + (kernel.slope[0] * x + kernel.slope[1] * y) * radius;
        let model = white * by_white;
        let mut weight = kernel.weight[0] - kernel.weight[1] * by_white;
        if CLIPPED {
            let share = (kernel.saturated - model) * kernel.per_fading;
            let share = if share < 1.0 { share } else { 1.0 };
            weight *= if share > 0.0 { share } else { 0.0 };
        }
        pixels.residual[i] = f32::from(values[i]) - model;
        pixels.steep[i] = steep;
        pixels.weight[i] = weight;
        pixels.by_white[i] = by_white;
    }
}

/// Not inlined, with a copy of the sums: so the compiler keeps them in vectors.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn add_pixels(places: &Places, pixels: &Pixels, sums: &mut [Lanes; SUMS]) {
    let mut sum = *sums;
    for run in 0..RUNS {
        let at = |column: &Column| Lanes::load(column, run);
        let (x, y, steep, weight) = (at(&places.x), at(&places.y), at(&pixels.steep), at(&pixels.weight));
        let residual = weight * at(&pixels.residual);
        let even = steep * residual;
        let weighted = weight * steep;
        let (side_x, side_y, square_y) = (even * x, even * y, y * y);
        sum[0] += side_x;
        sum[1] += side_y;
        sum[2] += even;
        sum[3] += weighted * steep;
        sum[4] += even * even;
        sum[5] += side_x * square_y;
        sum[6] += side_y * square_y;
        let light = at(&pixels.by_white) * at(&places.radius);
        let light_residual = light * residual;
        sum[7] += light_residual * x;
        sum[8] += light_residual * y;
        sum[9] += weighted * light;
        sum[10] += weight * light * light;
    }
    *sums = sum;
}

#[cfg(test)]
mod tests {
    use gangway_device::{Frame, Layout};

    use super::*;
    use crate::loader::Rect;
    use crate::patch::Belt;

    #[test]
    fn what_fills_up_a_block_says_nothing() {
        let bytes = [200; 64 * 64];
        let frame = Frame::new(&bytes, (64, 64), 64, Layout::GREY, 0, 0).unwrap();
        let rect = Rect::clipped(&frame, [2.0, 2.0], [61.0, 61.0]).unwrap();
        let mut patch = std::boxed::Box::new(Patch::new());
        for (outer, uu) in [(6.0, 1.0), (9.3, 1.2), (20.0, 0.9)] {
            let radial = Radial { white: 200.0, contrast: 150.0, outer, inner: 0.5 * outer, blur: 0.7 };
            let shape = [uu, 0.0, 1.0 / uu];
            let model = Model {
                centre: [30.3, 31.8],
                shape,
                radial,
                slope: [0.0; 2],
                bias: [0.0; 2],
                inner_bias: 0.25,
            };
            patch.clear(rect);
            let all = patch.take(&frame, model.centre, shape, &Belt::whole(outer + 4.0), 1);
            let kernel = Kernel::new(&model, patch.origin(), f64::INFINITY, true);
            let [sums, none] = kernel.fit(&patch, [all, Part::default()]);
            // Beyond the outer edge all is white, and grows with a slope as its radius.
            let pixels = (0..64 * 64).map(|i| [f64::from(i % 64) - 30.3, f64::from(i / 64) - 31.8]);
            let radii = pixels.map(|at| {
                let [x, y] = model.in_circle(at);
                x.hypot(y)
            });
            let inside = radii.filter(|radius| *radius < outer + 4.0);
            let most: f64 = inside.map(|radius| radius * radius).sum();
            // White weighs 0.6 and the ring's black takes three quarters of its share away; a single pixel of
            // filling would add 60,000.
            let slope_square = sums.slope_square;
            assert_eq!(none.slope_square, 0.0);
            assert!((0.3 * most..0.6 * most).contains(&slope_square), "{outer}: {slope_square} of {most}");
        }
    }
}
