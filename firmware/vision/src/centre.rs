//! The sub-pixel centre: a model ring with blurred edges fitted to the grey levels.
//!
//! Gauss-Newton on the squared residuals of all pixels, as the Cramer-Rao bound asks for it: a pixel counts by
//! how much it changes when the ring moves. A first pass over half of the rows settles levels, radii and shape, a
//! second over all rows the centre, its covariance and whether the ring is whole.

use gangway_device::Frame;
use gangway_pose::Centre;

use crate::candidate::Candidate;
use crate::lanes::Lanes;
use crate::loader::{Rect, full_scale};
use crate::patch::Patch;
use crate::{Refusal, Ring, Search, Settings};

/// White that a ring needs around it, px: the layout of an A3 7-CCC at 5 m leaves 4.
const MARGIN: f64 = 3.0;

/// Half the width of the model's edge in standard deviations of its blur: that of the density (1 - z^2)^2 on
/// -1..1, whose variance is 1/7.
const HALF_WIDTH: f64 = 2.645_751_311_064_590_6;

/// Distance from an edge at which pixels are taken as wholly white or black at the start, px, and its largest share
/// of the ring's thickness.
const CLEAR_PX: f64 = 1.8;
const CLEAR: f64 = 0.4;

/// Largest share of saturated pixels in the white: above, its level is not known.
const MAX_CLIPPED: f64 = 0.5;

/// Bounds of the blur's standard deviation, px. The pixel's own area gives 0.29; above the upper one the edge does
/// not fit into the margin.
const BLUR: (f64, f64) = (0.4, 1.04);

/// Largest step of the last pass, px: beyond it the passes did not converge.
const LAST_STEP_PX: f64 = 0.1;

/// Bounds of a whole ring on what [`Fit`] holds, beyond what noise makes likely: coding artefacts and motion within the
/// exposure take up to 0.25 px, 0.12 px and 0.1, a hidden piece of edge that moves the centre by 0.2 px takes more.
const MAX_APART_PX: f64 = 0.25;
const MAX_THIRD_PX: f64 = 0.12;
const MAX_RESIDUAL: f64 = 0.2;

/// Standard deviations of noise that are let pass.
const SIGMAS: f64 = 4.0;

/// Most passes over half of the rows.
const PASSES: usize = 4;

/// What the model ring looks like.
#[derive(Clone, Copy, Debug)]
struct Model {
    centre: [f64; 2],
    /// Second moments of the outer ellipse over the root of their determinant.
    shape: [f64; 3],
    outer: f64,
    inner: f64,
    /// Level of the white at the centre and its slope along u and v.
    white: f64,
    slope: [f64; 2],
    /// White less black, share of white.
    depth: f64,
    /// Standard deviation of the edges' blur, px.
    blur: f64,
}

impl Model {
    /// Radius up to which the first pass uses pixels: a little white beyond the edge.
    fn reach(&self) -> f64 {
        self.outer + HALF_WIDTH * self.blur + 0.5
    }
}

/// Fits the ring that `candidate` (in the window at `window`) shows roughly.
pub(crate) fn measure(
    frame: &Frame,
    patch: &mut Patch,
    window: Rect,
    candidate: &Candidate,
    levels: (f64, f64),
    search: &Search,
    settings: &Settings,
) -> Result<Ring, Refusal> {
    let centre = [candidate.centre[0] + f64::from(window.x), candidate.centre[1] + f64::from(window.y)];
    // Half the ellipse's extent is twice the standard deviation of its filled area.
    let half = [0, 2].map(|i| 2.0 * libm::sqrt(candidate.shape[i].max(0.0)) + MARGIN + 0.5);
    let low = [centre[0] - half[0], centre[1] - half[1]];
    let high = [centre[0] + half[0], centre[1] + half[1]];
    let (right, below) = (f64::from(frame.width()) - 1.0, f64::from(frame.height()) - 1.0);
    if !(low[0] >= 0.0 && low[1] >= 0.0 && high[0] <= right && high[1] <= below) {
        return Err(Refusal::CutByPicture);
    }
    patch.load(frame, Rect::clipped(frame, low, high).ok_or(Refusal::CutByPicture)?);

    let full = f64::from(full_scale(frame));
    let mut model = start(patch, candidate, centre, levels, full, settings)?;
    for pass in 0..PASSES {
        let step = adjust(patch, &mut model, pass % 2)?;
        if step < LAST_STEP_PX {
            break;
        }
    }
    let fit = judge(patch, &model)?;
    let contrast = model.white * model.depth;
    fit.check(contrast)?;
    // The projective bias of an edge grows with its radius squared; the two count by their information.
    let inner_bias = 1.0 / (search.ratio * search.ratio);
    let bias = search.bias.map(|bias| bias * (fit.outer_share + inner_bias * (1.0 - fit.outer_share)));
    let white = model.white;
    Ok(Ring {
        centre: Centre {
            at: [0, 1].map(|i| model.centre[i] + fit.step[i] - bias[i]),
            covariance: fit.covariance,
        },
        diameter_px: 2.0 * model.outer,
        white: (white / full) as f32,
        black: (white * (1.0 - model.depth) / full) as f32,
        noise: (fit.residual / full) as f32,
        blur_px: model.blur as f32,
    })
}

/// Levels, slope and blur from the samples that are clearly white or black, on every second row.
fn start(
    patch: &Patch,
    candidate: &Candidate,
    centre: [f64; 2],
    levels: (f64, f64),
    full: f64,
    settings: &Settings,
) -> Result<Model, Refusal> {
    let root = libm::sqrt(candidate.shape[0] * candidate.shape[2] - candidate.shape[1] * candidate.shape[1]);
    let shape = candidate.shape.map(|moment| moment / root);
    let middle = 0.5 * (levels.0 + levels.1);
    // How far from an edge a pixel is wholly on one side; thin rings leave less than blurred edges want.
    let clear = (CLEAR * (candidate.outer - candidate.inner)).min(CLEAR_PX);
    let square = |radius: f64| Lanes::splat((radius.max(1.0) * radius.max(1.0)) as f32);
    let bands = Bands {
        q: inverse(&shape, 1.0).map(|x| Lanes::splat(x as f32)),
        middle: Lanes::splat(middle as f32),
        hole: square(candidate.inner - CLEAR_PX),
        black: (square(candidate.inner + clear), square(candidate.outer - clear)),
        margin: (square(candidate.outer + CLEAR_PX), square(candidate.outer + MARGIN)),
        clipped: Lanes::splat((full - 0.5 - middle) as f32),
    };
    let mut sum = [Lanes::ZERO; STARTED];
    patch.visit(centre, inverse(&shape, candidate.outer + MARGIN), (0, 2), |dx, dy, value| {
        bands.add(dx, dy, value, &mut sum);
    });
    let [n, s, ss, whites, white_s, white_x, white_y, x, y, xx, yy, blacks, black_s, clipped] =
        sum.map(Lanes::sum);
    if whites < 4.0 || blacks < 2.0 {
        return Err(Refusal::LowContrast);
    }
    if clipped > MAX_CLIPPED * whites {
        return Err(Refusal::Saturated);
    }
    let (white, black) = (white_s / whites, black_s / blacks);
    let contrast = white - black;
    // Written so that a NaN is refused too.
    if !(contrast > settings.min_contrast * full && white + middle > 0.0) {
        return Err(Refusal::LowContrast);
    }
    let slope = [(white_x - white * x) / xx.max(1.0), (white_y - white * y) / yy.max(1.0)];
    // Over an edge of blur s, (white - value) (value - black) sums to contrast^2 s / sqrt(pi) a pixel of its
    // length, elsewhere to next to nothing.
    let between = -ss + (white + black) * s - n * white * black;
    let edge = core::f64::consts::PI * (candidate.outer + candidate.inner); // half the edges: half the rows
    let blur = between / (contrast * contrast * edge) * libm::sqrt(core::f64::consts::PI);
    Ok(Model {
        centre,
        shape,
        outer: candidate.outer,
        inner: candidate.inner,
        white: white + middle,
        slope,
        depth: contrast / (white + middle),
        blur: blur.clamp(BLUR.0, BLUR.1),
    })
}

/// Where pixels are wholly white or black, by squared radius (d^T q d).
struct Bands {
    q: [Lanes; 3],
    middle: Lanes,
    /// Below this white, ...
    hole: Lanes,
    /// ... between these black, ...
    black: (Lanes, Lanes),
    /// ... and between these white; beyond the last nothing counts.
    margin: (Lanes, Lanes),
    /// Values above this are saturated.
    clipped: Lanes,
}

/// Sums of the start.
const STARTED: usize = 14;

impl Bands {
    /// The sums of [`start`]. Not inlined, with the sums in memory: so the compiler keeps the four together.
    #[inline(never)]
    fn add(&self, dx: Lanes, dy: Lanes, value: Lanes, sum: &mut [Lanes; STARTED]) {
        let q = &self.q;
        let across = q[1] * dx * dy;
        let square = q[0] * dx * dx + across + across + q[2] * dy * dy;
        let valid = square.less(self.margin.1);
        let value = (value - self.middle) * valid;
        let white = (square.less(self.hole) + self.margin.0.less(square)) * valid;
        let black = self.black.0.less(square) * square.less(self.black.1);
        let white_value = value * white;
        let (white_x, white_y) = (white * dx, white * dy);
        let terms = [
            valid,
            value,
            value * value,
            white,
            white_value,
            white_value * dx,
            white_value * dy,
            white_x,
            white_y,
            white_x * dx,
            white_y * dy,
            black,
            black * value,
            white * self.clipped.less(value),
        ];
        sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }
}

/// The matrix q of the ellipse d^T q d = 1 with unit-determinant moments `shape` and mean radius `radius`.
fn inverse(shape: &[f64; 3], radius: f64) -> [f64; 3] {
    let square = radius * radius;
    [shape[2] / square, -shape[1] / square, shape[0] / square]
}

/// What one pixel says, four pixels at once.
struct Pixel {
    /// Value less model.
    residual: Lanes,
    /// Share of the pixel that the ring covers.
    covered: Lanes,
    /// 1 where the inner edge is nearer than the outer one, else 0.
    inner: Lanes,
    /// How much the value falls as the nearer edge moves by 1 px towards its white.
    steep: Lanes,
    /// Distance from the nearer edge in half widths of the edge, positive in its white, -1 to 1.
    from_edge: Lanes,
    /// Outward gradient of the radius.
    gradient: [Lanes; 2],
    /// Radius in the plane where the outer ellipse is a circle of its own area, px.
    radius: Lanes,
}

/// A model ring made ready for four pixels at once.
struct Kernel {
    root: [Lanes; 3],
    /// Radius of the middle of the ring and half its thickness, px.
    middle: Lanes,
    half_thickness: Lanes,
    /// 1 / half width of an edge and its greatest steepness, 1/px.
    per_width: Lanes,
    peak: Lanes,
    white: Lanes,
    slope: [Lanes; 2],
    depth: Lanes,
    /// Inner to outer radius, and how far from the outer edge pixels count.
    ratio: Lanes,
    reach: Lanes,
}

/// Sums of the two passes.
const ADJUSTED: usize = 20;
const JUDGED: usize = 11;

impl Kernel {
    fn new(model: &Model) -> Self {
        // Square root of the shape's inverse, which has determinant 1 (Cayley-Hamilton).
        let [uu, uv, vv] = model.shape;
        let scale = 1.0 / libm::sqrt(uu + vv + 2.0);
        Self {
            root: [vv + 1.0, -uv, uu + 1.0].map(|x| Lanes::splat((x * scale) as f32)),
            middle: Lanes::splat((0.5 * (model.outer + model.inner)) as f32),
            half_thickness: Lanes::splat((0.5 * (model.outer - model.inner)) as f32),
            per_width: Lanes::splat((1.0 / (HALF_WIDTH * model.blur)) as f32),
            peak: Lanes::splat((0.9375 / (HALF_WIDTH * model.blur)) as f32),
            white: Lanes::splat(model.white as f32),
            slope: model.slope.map(|x| Lanes::splat(x as f32)),
            depth: Lanes::splat(model.depth as f32),
            ratio: Lanes::splat((model.inner / model.outer) as f32),
            reach: Lanes::splat(model.reach() as f32),
        }
    }

    #[inline(always)]
    fn at(&self, dx: Lanes, dy: Lanes, value: Lanes) -> Pixel {
        let splat = Lanes::splat;
        // Into the plane where the ellipse is a circle: the radius there and its gradient here.
        let (u, v) = (self.root[0] * dx + self.root[1] * dy, self.root[1] * dx + self.root[2] * dy);
        let square = u * u + v * v;
        let per_radius = square.inverse_sqrt();
        let radius = square * per_radius;
        let (u, v) = (u * per_radius, v * per_radius);
        let gradient = [self.root[0] * u + self.root[1] * v, self.root[1] * u + self.root[2] * v];
        // The nearer edge is the other's mirror image in the middle of the ring.
        let inner = radius.less(self.middle);
        let sign = splat(1.0) - inner - inner;
        let distance = (radius - self.middle) * sign - self.half_thickness;
        let z = (distance * self.per_width).max(splat(-1.0)).min(splat(1.0));
        let z_square = z * z;
        let density = splat(1.0) - z_square;
        // Half less the integral of 15/16 (1 - z^2)^2.
        let covered = splat(0.5) - z * (splat(0.9375) - z_square * (splat(0.625) - splat(0.1875) * z_square));
        let white = self.white + self.slope[0] * dx + self.slope[1] * dy;
        let contrast = white * self.depth;
        Pixel {
            residual: value - white + contrast * covered,
            covered,
            inner,
            steep: density * density * self.peak * contrast,
            from_edge: z,
            gradient,
            radius,
        }
    }

    /// The sums of [`adjust`]. Not inlined, with the sums in memory: so the compiler keeps the four together.
    #[inline(never)]
    fn adjust(&self, dx: Lanes, dy: Lanes, value: Lanes, sum: &mut [Lanes; ADJUSTED]) {
        let pixel = self.at(dx, dy, value);
        let inside = pixel.radius.less(self.reach);
        let residual = pixel.residual * inside;
        let [gx, gy] = pixel.gradient;
        let inner_steep = pixel.steep * pixel.inner;
        let outer_steep = pixel.steep - inner_steep;
        let edge = inner_steep - outer_steep;
        // A wider or narrower ellipse moves the inner edge less.
        let second = self.ratio * inner_steep - outer_steep;
        let flat = pixel.steep.less(Lanes::splat(1e-6)) * inside;
        let (jx, jy) = (edge * gx, edge * gy);
        let second_residual = second * residual;
        let flat_black = pixel.covered * flat;
        let outer_residual = outer_steep * residual;
        let inner_residual = inner_steep * residual;
        let width = pixel.steep * pixel.from_edge;
        let terms = [
            jx * residual,
            jy * residual,
            jx * jx,
            jx * jy,
            jy * jy,
            outer_residual,
            outer_steep,
            outer_steep * outer_steep,
            inner_residual,
            inner_steep,
            inner_steep * inner_steep,
            second_residual * (gx * gx - gy * gy),
            second_residual * (gx * gy),
            second * second,
            flat,
            flat * residual,
            flat_black,
            flat_black * residual,
            width * residual,
            width * width,
        ];
        sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }

    /// The sums of [`judge`].
    #[inline(never)]
    fn judge(&self, dx: Lanes, dy: Lanes, value: Lanes, sum: &mut [Lanes; JUDGED]) {
        let pixel = self.at(dx, dy, value);
        let [gx, gy] = pixel.gradient;
        let edge_residual = pixel.steep * pixel.residual;
        let (jx, jy) = (pixel.steep * gx, pixel.steep * gy);
        let inner_residual = edge_residual * pixel.inner;
        let outer_residual = edge_residual - inner_residual;
        let inner_steep = pixel.steep * pixel.inner;
        let (outer_x, outer_y) = (outer_residual * gx, outer_residual * gy);
        let four_xy = gx * gy * Lanes::splat(4.0);
        let terms = [
            outer_x,
            outer_y,
            inner_residual * gx,
            inner_residual * gy,
            jx * jx,
            jx * jy,
            jy * jy,
            edge_residual * edge_residual,
            inner_steep * inner_steep,
            outer_x - outer_y * four_xy,
            outer_x * four_xy - outer_y,
        ];
        sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }
}

/// One pass over every second row: corrects levels, radii, shape and centre and returns the centre's step, px.
fn adjust(patch: &Patch, model: &mut Model, first: usize) -> Result<f64, Refusal> {
    let kernel = Kernel::new(model);
    let mut sum = [Lanes::ZERO; ADJUSTED];
    patch.visit(model.centre, inverse(&model.shape, model.reach()), (first, 2), |dx, dy, value| {
        kernel.adjust(dx, dy, value, &mut sum);
    });
    let s = sum.map(Lanes::sum);
    let step = solve([s[2], s[3], s[4]], [s[0], s[1]]).ok_or(Refusal::Outline)?;
    let (flat_white, flat_black) = (s[14] - s[16], s[16]);
    // Levels from the pixels that no edge touches; where there are too few, they stay.
    let white_step = if flat_white > 4.0 { (s[15] - s[17]) / flat_white } else { 0.0 };
    let black_step = if flat_black > 4.0 { s[17] / flat_black } else { 0.0 };
    // An edge lies half in the white and half in the black.
    let both = 0.5 * (white_step + black_step);
    let outer_step = -(s[5] - both * s[6]) / s[7].max(1e-9);
    let inner_step = (s[8] - both * s[9]) / s[10].max(1e-9);
    let cosine = 2.0 * s[11] / s[13].max(1e-9);
    let sine = 4.0 * s[12] / s[13].max(1e-9);

    let blur_step = -s[18] / s[19].max(1e-9) / HALF_WIDTH;

    let black = model.white * (1.0 - model.depth) + black_step;
    model.white += white_step;
    model.depth = 1.0 - black / model.white;
    model.outer += outer_step;
    model.inner += inner_step;
    model.blur = (model.blur + blur_step).clamp(BLUR.0, BLUR.1);
    // An edge moved out by a cos 2p + b sin 2p changes the moments so.
    let (a, b) = (2.0 * cosine / model.outer, 2.0 * sine / model.outer);
    let shape = [model.shape[0] + a, model.shape[1] + b, model.shape[2] - a];
    let square = shape[0] * shape[2] - shape[1] * shape[1];
    let length = libm::hypot(step[0], step[1]);
    let moved = [outer_step, inner_step, cosine, sine, length].iter().all(|step| step.abs() < 2.0);
    // Written so that a NaN is refused too.
    if !(moved && square > 0.01 && model.depth > 0.0 && model.white > 0.0 && model.inner > 0.5) {
        return Err(Refusal::Outline);
    }
    let root = libm::sqrt(square);
    model.shape = shape.map(|moment| moment / root);
    model.centre = [model.centre[0] + step[0], model.centre[1] + step[1]];
    Ok(length)
}

/// What the last pass found.
struct Fit {
    /// What is still to be added to the centre, px.
    step: [f64; 2],
    covariance: [f64; 3],
    /// Share of the outer edge in the information on the centre.
    outer_share: f64,
    /// Distance between the centres of the outer and the inner edge, px.
    apart: f64,
    /// Amplitude of the outer edge's third harmonic, px.
    third: f64,
    /// Root mean square residual at the edges.
    residual: f64,
}

impl Fit {
    /// Refuses what is not one whole ring: something that hides a part of an edge bends it there, and the outer edge
    /// more than the inner one.
    fn check(&self, contrast: f64) -> Result<(), Refusal> {
        let sigma = libm::sqrt(self.covariance[0].max(self.covariance[2]));
        let apart = sigma / libm::sqrt(self.outer_share * (1.0 - self.outer_share));
        let third = sigma / libm::sqrt(self.outer_share);
        let step = libm::hypot(self.step[0], self.step[1]);
        // Written so that a NaN is refused too.
        let whole = self.apart <= MAX_APART_PX + SIGMAS * apart
            && self.third <= MAX_THIRD_PX + SIGMAS * third
            && step <= LAST_STEP_PX + SIGMAS * sigma
            && self.residual <= MAX_RESIDUAL * contrast;
        if whole { Ok(()) } else { Err(Refusal::Outline) }
    }
}

/// The last pass, over all rows.
fn judge(patch: &Patch, model: &Model) -> Result<Fit, Refusal> {
    let kernel = Kernel::new(model);
    let limit = model.outer + HALF_WIDTH * model.blur;
    let mut sum = [Lanes::ZERO; JUDGED];
    patch.visit(model.centre, inverse(&model.shape, limit), (0, 1), |dx, dy, value| {
        kernel.judge(dx, dy, value, &mut sum);
    });
    let s = sum.map(Lanes::sum);
    let information = [s[4], s[5], s[6]];
    let outer_share = 1.0 - s[8] / (s[4] + s[6]);
    // Written so that a NaN is refused too.
    if !(outer_share > 0.0 && outer_share < 1.0) {
        return Err(Refusal::Outline);
    }
    // A step outwards makes the outer edge darker, the inner one brighter.
    let step = solve(information, [s[2] - s[0], s[3] - s[1]]).ok_or(Refusal::Outline)?;
    let outer = solve(information, [-s[0], -s[1]]).ok_or(Refusal::Outline)?.map(|x| x / outer_share);
    let inner = [0, 1].map(|i| (step[i] - outer_share * outer[i]) / (1.0 - outer_share));
    let variance = s[7] / (s[4] + s[6]);
    Ok(Fit {
        step,
        covariance: covariance(information, variance).ok_or(Refusal::Outline)?,
        outer_share,
        apart: libm::hypot(outer[0] - inner[0], outer[1] - inner[1]),
        third: 2.0 * libm::hypot(s[9], s[10]) / (outer_share * (s[4] + s[6])),
        residual: libm::sqrt(variance),
    })
}

/// Solves the symmetric system (uu, uv, vv) x = right; `None` where it is singular or not a number.
fn solve([uu, uv, vv]: [f64; 3], [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let determinant = uu * vv - uv * uv;
    (determinant > 1e-6 * (uu * vv).abs() && uu > 0.0)
        .then(|| [(vv * x - uv * y) / determinant, (uu * y - uv * x) / determinant])
}

/// Covariance of the least squares solution with this information if `variance` is that of the pixels at the edges,
/// never less than what rounding to whole grey levels leaves.
fn covariance(information: [f64; 3], variance: f64) -> Option<[f64; 3]> {
    let [x, y] = [solve(information, [1.0, 0.0])?, solve(information, [0.0, 1.0])?];
    let variance = variance.max(1.0 / 12.0);
    Some([x[0] * variance, x[1] * variance, y[1] * variance])
}
