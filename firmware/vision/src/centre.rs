//! The sub-pixel centre: a model ring with blurred edges fitted to the grey levels.
//!
//! Gauss-Newton on the squared residuals of all pixels, as the Cramer-Rao bound asks for it: a pixel counts by
//! how much it changes when the ring moves. A first pass over half of the rows settles levels, radii and shape, a
//! second over all rows the centre, its covariance and whether the ring is whole.

use gangway_device::Frame;
use gangway_pose::Centre;

use crate::candidate::Candidate;
use crate::lanes::{LANES, Lanes};
use crate::loader::{Rect, full_scale};
use crate::patch::Patch;
use crate::{MAX_SIDE, Refusal, Ring, Search, Settings};

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

/// A pass with a step below this, px, is the last over half of the rows: the next one's error is of its third power.
const SMALL_STEP_PX: f64 = 0.2;

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
    /// Square root of the inverse of `shape`: takes the outer ellipse to a circle of its own area.
    fn root(&self) -> [f64; 3] {
        // Cayley-Hamilton, for a determinant of 1.
        let [uu, uv, vv] = self.shape;
        let scale = 1.0 / libm::sqrt(uu + vv + 2.0);
        [(vv + 1.0) * scale, -uv * scale, (uu + 1.0) * scale]
    }

    /// A step in the circle's plane as one in the picture.
    fn out_of_circle(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        // The inverse of a symmetric matrix of determinant 1.
        let [uu, uv, vv] = self.root();
        [vv * x - uv * y, uu * y - uv * x]
    }

    /// Change of a pixel's value where an edge is steepest and moves by 1 px.
    fn peak(&self) -> f64 {
        0.9375 / (HALF_WIDTH * self.blur) * self.white * self.depth
    }

    /// Share of the outer edge in the length of both, and so in the information on the centre.
    fn outer_share(&self) -> f64 {
        self.outer / (self.outer + self.inner)
    }

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
        if step < SMALL_STEP_PX {
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
    patch.visit(centre, inverse(&shape, candidate.outer + MARGIN), (0, 2), |dy, dx, span| {
        bands.add(dy, dx, span, &mut sum);
    });
    let [n, s, ss, whites, white_s, white_x, white_y, x, y, rr, blacks, black_s, clipped] =
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
    // The squared distances from the centre are half along u and half along v.
    let slope = [white_x - white * x, white_y - white * y].map(|sum| 2.0 * sum / rr.max(1.0));
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
const STARTED: usize = 13;

impl Bands {
    /// The sums of [`start`]. Not inlined, with the sums in memory: so the compiler keeps the four together.
    #[inline(never)]
    fn add(&self, dy: f32, dx: f32, span: &[[f32; LANES]], sum: &mut [Lanes; STARTED]) {
        let dy = Lanes::splat(dy);
        let mut dx = Lanes::count_from(dx);
        for values in span {
            self.add_four(dy, dx, Lanes::of(*values), sum);
            dx += Lanes::splat(LANES as f32);
        }
    }

    #[inline(always)]
    fn add_four(&self, dy: Lanes, dx: Lanes, value: Lanes, sum: &mut [Lanes; STARTED]) {
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
            white * square,
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
    /// How much the value falls as the nearer edge moves towards its white, over the greatest such fall.
    steep: Lanes,
    /// Distance from the nearer edge in half widths of the edge, positive in its white, -1 to 1.
    from_edge: Lanes,
}

/// A model ring made ready for four pixels at once.
struct Kernel {
    root: [Lanes; 3],
    /// Radius of the middle of the ring and half its thickness, px.
    middle: Lanes,
    half_thickness: Lanes,
    /// 1 / half width of an edge, 1/px.
    per_width: Lanes,
    white: Lanes,
    slope: [Lanes; 2],
    depth: Lanes,
    /// How far pixels count for the levels.
    reach: Lanes,
    /// Where the pixels of the row at hand are.
    places: [Place; MAX_SIDE / LANES],
}

/// Where four pixels are, in the plane where the outer ellipse is a circle of its own area: direction from the centre
/// and radius, px.
#[derive(Clone, Copy)]
struct Place {
    x: Lanes,
    y: Lanes,
    radius: Lanes,
}

/// Sums of the two passes.
const ADJUSTED: usize = 12;
const JUDGED: usize = 8;

/// Integrals over an edge in units of its half width, with w = (1 - z^2)^2: of w over that of w^2, and of z^2 w^2
/// over that of w^2.
const PER_SQUARE: f64 = 1.3125;
const WIDTH_PER_SQUARE: f64 = 1.0 / 11.0;

impl Kernel {
    fn new(model: &Model) -> Self {
        let splat = |x: f64| Lanes::splat(x as f32);
        Self {
            root: model.root().map(splat),
            middle: splat(0.5 * (model.outer + model.inner)),
            half_thickness: splat(0.5 * (model.outer - model.inner)),
            per_width: splat(1.0 / (HALF_WIDTH * model.blur)),
            white: splat(model.white),
            slope: model.slope.map(splat),
            depth: splat(model.depth),
            reach: splat(model.reach()),
            places: [Place { x: Lanes::ZERO, y: Lanes::ZERO, radius: Lanes::ZERO }; MAX_SIDE / LANES],
        }
    }

    /// The places of a row's pixels. A loop of its own: the root takes long, but several are under way at a time.
    #[inline(always)]
    fn locate(&mut self, dy: f32, dx: f32, span: &[[f32; LANES]]) {
        let dy = Lanes::splat(dy);
        let (row_u, row_v) = (self.root[1] * dy, self.root[2] * dy);
        let mut dx = Lanes::count_from(dx);
        for (place, _) in self.places.iter_mut().zip(span) {
            let (u, v) = (self.root[0] * dx + row_u, self.root[1] * dx + row_v);
            let square = u * u + v * v;
            let per_radius = square.inverse_sqrt();
            *place = Place { x: u * per_radius, y: v * per_radius, radius: square * per_radius };
            dx += Lanes::splat(LANES as f32);
        }
    }

    /// White of the model at the start of a row and its rise from four pixels to the next.
    #[inline(always)]
    fn white(&self, dy: f32, dx: f32) -> (Lanes, Lanes) {
        let [along, down] = self.slope;
        let start = self.white + along * Lanes::count_from(dx) + down * Lanes::splat(dy);
        (start, along * Lanes::splat(LANES as f32))
    }

    #[inline(always)]
    fn at(&self, radius: Lanes, white: Lanes, value: Lanes) -> Pixel {
        let splat = Lanes::splat;
        // The nearer edge is the other's mirror image in the middle of the ring.
        let from_middle = radius - self.middle;
        let inner = from_middle.less(Lanes::ZERO);
        let distance = from_middle.abs() - self.half_thickness;
        let z = (distance * self.per_width).max(splat(-1.0)).min(splat(1.0));
        let z_square = z * z;
        let density = splat(1.0) - z_square;
        // Half less the integral of 15/16 (1 - z^2)^2.
        let covered = splat(0.5) - z * (splat(0.9375) - z_square * (splat(0.625) - splat(0.1875) * z_square));
        Pixel {
            residual: value - white + white * (self.depth * covered),
            covered,
            inner,
            steep: density * density,
            from_edge: z,
        }
    }

    /// The sums of [`adjust`]. Not inlined, with the sums in memory: so the compiler keeps the four together.
    #[inline(never)]
    fn adjust(&mut self, dy: f32, dx: f32, span: &[[f32; LANES]], sum: &mut [Lanes; ADJUSTED]) {
        self.locate(dy, dx, span);
        let (mut white, rise) = self.white(dy, dx);
        for (values, place) in span.iter().zip(&self.places) {
            self.adjust_four(place, white, Lanes::of(*values), sum);
            white += rise;
        }
    }

    #[inline(always)]
    fn adjust_four(&self, place: &Place, white: Lanes, value: Lanes, sum: &mut [Lanes; ADJUSTED]) {
        let pixel = self.at(place.radius, white, value);
        let (x, y) = (place.x, place.y);
        let steep_residual = pixel.steep * pixel.residual;
        let inner_residual = steep_residual * pixel.inner;
        let outer_residual = steep_residual - inner_residual;
        let edge_residual = inner_residual - outer_residual;
        let flat = pixel.steep.less(Lanes::splat(1e-6)) * place.radius.less(self.reach);
        let flat_residual = pixel.residual * flat;
        let edge_x = edge_residual * x;
        let terms = [
            edge_x,
            edge_residual * y,
            pixel.steep * pixel.steep,
            outer_residual,
            inner_residual,
            edge_x * x,
            edge_x * y,
            flat,
            flat_residual,
            flat * pixel.covered,
            flat_residual * pixel.covered,
            steep_residual * pixel.from_edge,
        ];
        sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }

    /// The sums of [`judge`].
    #[inline(never)]
    fn judge(&mut self, dy: f32, dx: f32, span: &[[f32; LANES]], sum: &mut [Lanes; JUDGED]) {
        self.locate(dy, dx, span);
        let (mut white, rise) = self.white(dy, dx);
        for (values, place) in span.iter().zip(&self.places) {
            self.judge_four(place, white, Lanes::of(*values), sum);
            white += rise;
        }
    }

    #[inline(always)]
    fn judge_four(&self, place: &Place, white: Lanes, value: Lanes, sum: &mut [Lanes; JUDGED]) {
        let pixel = self.at(place.radius, white, value);
        let (x, y) = (place.x, place.y);
        let residual = pixel.steep * pixel.residual;
        let inner_residual = residual * pixel.inner;
        let outer_residual = residual - inner_residual;
        let (outer_x, outer_y) = (outer_residual * x, outer_residual * y);
        let four_xy = x * y * Lanes::splat(4.0);
        let terms = [
            outer_x,
            outer_y,
            inner_residual * x,
            inner_residual * y,
            pixel.steep * pixel.steep,
            residual * residual,
            outer_x - outer_y * four_xy,
            outer_x * four_xy - outer_y,
        ];
        sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }
}

/// One pass over every second row: corrects levels, radii, shape and centre and returns the centre's step, px.
fn adjust(patch: &Patch, model: &mut Model, first: usize) -> Result<f64, Refusal> {
    let mut kernel = Kernel::new(model);
    let mut sum = [Lanes::ZERO; ADJUSTED];
    patch.visit(model.centre, inverse(&model.shape, model.reach()), (first, 2), |dy, dx, span| {
        kernel.adjust(dy, dx, span, &mut sum)
    });
    let [x, y, square, outer, inner, xx, xy, flat, flat_residual, flat_black, black_residual, width] =
        sum.map(Lanes::sum);
    if square < 1.0 {
        return Err(Refusal::Outline);
    }
    // Levels from the pixels that no edge touches; where there are too few, they stay.
    let mean = |sum: f64, count: f64| if count > 4.0 { sum / count } else { 0.0 };
    let white_step = mean(flat_residual - black_residual, flat - flat_black);
    let black_step = mean(black_residual, flat_black);
    let black = model.white * (1.0 - model.depth) + black_step;

    // What a pixel's value changes by where an edge is steepest and moves by 1 px; sums of steepness by edge.
    let per_px = model.peak();
    let share = model.outer_share();
    let (outer_square, inner_square) = (share * square, (1.0 - share) * square);
    // An edge lies half in the white and half in the black.
    let both = 0.5 * (white_step + black_step) * PER_SQUARE;
    let outer_step = (both - outer / outer_square) / per_px;
    let inner_step = (inner / inner_square - both) / per_px;
    // The wider an edge, the darker its white and the brighter its black.
    let blur_step = -width / (WIDTH_PER_SQUARE * square) / per_px / HALF_WIDTH;
    let step = model.out_of_circle([2.0 * x / square / per_px, 2.0 * y / square / per_px]);
    // An ellipse that is wider along x and narrower along y by a share a of its radius.
    let lever = 0.5 * square * per_px * (share * model.outer + (1.0 - share) * model.inner);
    let cosine = (2.0 * xx - (inner - outer)) / lever;
    let sine = 2.0 * xy / lever;

    model.white += white_step;
    model.depth = 1.0 - black / model.white;
    model.outer += outer_step;
    model.inner += inner_step;
    model.blur = (model.blur + blur_step).clamp(BLUR.0, BLUR.1);
    let shape = [model.shape[0] + 2.0 * cosine, model.shape[1] + 2.0 * sine, model.shape[2] - 2.0 * cosine];
    let determinant = shape[0] * shape[2] - shape[1] * shape[1];
    let length = libm::hypot(step[0], step[1]);
    let moved = [outer_step, inner_step, length].iter().all(|step| step.abs() < 2.0);
    // Written so that a NaN is refused too.
    if !(moved && determinant > 0.01 && model.depth > 0.0 && model.white > 0.0 && model.inner > 0.5) {
        return Err(Refusal::Outline);
    }
    let root = libm::sqrt(determinant);
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
    let mut kernel = Kernel::new(model);
    let mut sum = [Lanes::ZERO; JUDGED];
    patch.visit(
        model.centre,
        inverse(&model.shape, model.outer + HALF_WIDTH * model.blur),
        (0, 1),
        |dy, dx, span| kernel.judge(dy, dx, span, &mut sum),
    );
    let [outer_x, outer_y, inner_x, inner_y, square, residual, cosine, sine] = sum.map(Lanes::sum);
    if square < 1.0 {
        return Err(Refusal::Outline);
    }
    let per_px = model.peak();
    let share = model.outer_share();
    // A step outwards makes the outer edge darker, the inner one brighter. In the circle's plane the information is
    // the same in all directions: half the squares for each of two.
    let scale = 2.0 / (square * per_px);
    let outer = model.out_of_circle([-outer_x * scale / share, -outer_y * scale / share]);
    let inner = model.out_of_circle([inner_x * scale / (1.0 - share), inner_y * scale / (1.0 - share)]);
    let step = [0, 1].map(|i| share * outer[i] + (1.0 - share) * inner[i]);
    // Rounding to whole grey levels is noise too.
    let variance = (residual / square).max(1.0 / 12.0);
    let circle = 2.0 * variance / (square * per_px * per_px);
    Ok(Fit {
        step,
        covariance: model.shape.map(|moment| moment * circle),
        outer_share: share,
        apart: libm::hypot(outer[0] - inner[0], outer[1] - inner[1]),
        third: libm::hypot(cosine, sine) * scale / share,
        residual: libm::sqrt(variance),
    })
}
