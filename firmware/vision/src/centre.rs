//! The sub-pixel centre: a model ring with blurred edges fitted to the grey levels.
//!
//! Gauss-Newton on the squared residuals of all pixels, as the Cramer-Rao bound asks for it: a pixel counts by
//! how much it changes when the ring moves. A first pass over half of the rows or fewer settles levels,
//! slope, radii, blur and shape, a second over all rows the centre, its covariance and whether the ring is whole.

use gangway_device::Frame;
use gangway_pose::Centre;

use crate::candidate::Candidate;
use crate::lanes::Lanes;
use crate::loader::{Rect, full_scale};
use crate::model::{ADJUSTED, HALF_WIDTH, JUDGED, Kernel, Model, PER_SQUARE, WIDTH_PER_SQUARE};
use crate::patch::Patch;
use crate::{Refusal, Ring, Search, Settings};

/// White that a ring needs around it, px: the layout of an A3 7-CCC at 5 m leaves 4.
const MARGIN: f64 = 3.0;

/// Rows through a ring that the first passes take at the least, out of every second one.
const ADJUSTED_ROWS: f64 = 12.0;

/// Largest share of saturated pixels in the white: above, its level is not known.
const MAX_CLIPPED: f64 = 0.5;

/// Bounds of the blur's standard deviation, px. The pixel's own area gives 0.29; above the upper one the edge does
/// not fit into the margin.
const BLUR: (f64, f64) = (0.4, 1.04);

/// Blur of a sharp lens, px, as a start.
const FIRST_BLUR: f64 = 0.7;

/// A pass with steps below these, px and shares of the blur and (from the centre to the edge) of the contrast, is the
/// last over some of the rows: the next one's error is of their square or less.
const SMALL_STEP_PX: f64 = 0.2;
const SMALL_BLUR_STEP: f64 = 0.25;
const SMALL_TILT: f64 = 0.05;

/// Largest step of the last pass, px: beyond it the passes did not converge.
const LAST_STEP_PX: f64 = 0.1;

/// Bounds of a whole ring on what [`Fit`] holds, beyond what noise makes likely: coding artefacts and motion within the
/// exposure take up to 0.25 px, 0.12 px and 0.1, a hidden piece of edge that moves the centre by 0.2 px takes more.
const MAX_APART_PX: f64 = 0.25;
const MAX_THIRD_PX: f64 = 0.12;
const MAX_RESIDUAL: f64 = 0.2;

/// Standard deviations of noise that are let pass.
const SIGMAS: f64 = 4.0;

/// Most passes over some of the rows.
const PASSES: usize = 4;

/// Fits the ring that `candidate` (in the window at `window`) shows roughly, from the window's dark and bright level.
pub(crate) fn measure(
    frame: &Frame,
    patch: &mut Patch,
    window: Rect,
    candidate: &Candidate,
    (dark, bright): (f64, f64),
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
    let rect = Rect::clipped(frame, low, high).ok_or(Refusal::CutByPicture)?;

    let [uu, uv, vv] = candidate.shape;
    let root = libm::sqrt(uu * vv - uv * uv);
    let mut model = Model {
        centre,
        shape: [uu / root, uv / root, vv / root],
        outer: candidate.outer,
        inner: candidate.inner,
        white: bright,
        slope: [0.0; 2],
        depth: (bright - dark) / bright,
        blur: FIRST_BLUR,
    };
    let full = f64::from(full_scale(frame));
    let least = settings.min_contrast * full;
    let every = ((2.0 * model.outer / ADJUSTED_ROWS) as usize).max(2);
    patch.take(frame, rect, centre, model.ellipse(model.outer + MARGIN), every);
    for _ in 0..PASSES {
        if adjust(patch, &mut model, full, least)? {
            break;
        }
    }
    patch.take(frame, rect, model.centre, model.ellipse(model.end()), 1);
    let fit = judge(patch, &model, full)?;
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

/// One pass over what `patch` holds: corrects the model and returns whether it was little. `full` is the value of a
/// saturated sample, `least` the least contrast.
fn adjust(patch: &Patch, model: &mut Model, full: f64, least: f64) -> Result<bool, Refusal> {
    let kernel = Kernel::new(model, patch.origin(), MARGIN, full);
    let mut sum = [Lanes::ZERO; ADJUSTED];
    kernel.adjust(patch, &mut sum);
    let [
        x,
        y,
        square,
        outer,
        inner,
        xx,
        xy,
        width,
        whites,
        white_residual,
        residual_u,
        residual_v,
        white_u,
        white_v,
        white_square,
        blacks,
        black_residual,
        clipped,
    ] = sum.map(Lanes::sum);
    if square < 1.0 {
        return Err(Refusal::Outline);
    }
    if clipped > MAX_CLIPPED * whites {
        return Err(Refusal::Saturated);
    }
    // Levels from the pixels that no edge touches; where there are too few, they stay.
    let mean = |sum: f64, count: f64| if count > 4.0 { sum / count } else { 0.0 };
    let white_step = mean(white_residual, whites);
    let black_step = mean(black_residual, blacks);
    let black = model.white * (1.0 - model.depth) + black_step;
    // The squared distances from the centre are half along u and half along v.
    let slope_step = [residual_u - white_step * white_u, residual_v - white_step * white_v]
        .map(|sum| 2.0 * sum / white_square.max(1.0));

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
    // White that slopes looks like a step of the outer edge and, less, like one back of the inner edge.
    let tilt = (1.0 - 0.5 * model.depth) * PER_SQUARE * (share * model.outer - (1.0 - share) * model.inner);
    let step = [0, 1].map(|i| step[i] + slope_step[i] * tilt / per_px);
    // An ellipse that is wider along x and narrower along y by a share a of its radius.
    let lever = 0.5 * square * per_px * (share * model.outer + (1.0 - share) * model.inner);
    let cosine = (2.0 * xx - (inner - outer)) / lever;
    let sine = 2.0 * xy / lever;

    let old_blur = model.blur;
    model.white += white_step;
    model.depth = 1.0 - black / model.white;
    model.slope = [0, 1].map(|i| model.slope[i] + slope_step[i]);
    model.outer += outer_step;
    model.inner += inner_step;
    model.blur = (model.blur + blur_step).clamp(BLUR.0, BLUR.1);
    // Written so that a NaN is refused too.
    if !(model.white > 0.0 && model.white * model.depth > least) {
        return Err(Refusal::LowContrast);
    }
    let shape = [model.shape[0] + 2.0 * cosine, model.shape[1] + 2.0 * sine, model.shape[2] - 2.0 * cosine];
    let determinant = shape[0] * shape[2] - shape[1] * shape[1];
    let length = libm::hypot(step[0], step[1]);
    let moved = [outer_step, inner_step, length].iter().all(|step| step.abs() < 2.0);
    if !(moved && determinant > 0.01 && model.inner > 0.5) {
        return Err(Refusal::Outline);
    }
    let root = libm::sqrt(determinant);
    model.shape = shape.map(|moment| moment / root);
    model.centre = [model.centre[0] + step[0], model.centre[1] + step[1]];
    let tilted = libm::hypot(slope_step[0], slope_step[1]) * model.outer;
    Ok(length < SMALL_STEP_PX
        && (model.blur - old_blur).abs() < SMALL_BLUR_STEP * old_blur
        && tilted < SMALL_TILT * model.white * model.depth)
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
fn judge(patch: &Patch, model: &Model, full: f64) -> Result<Fit, Refusal> {
    let kernel = Kernel::new(model, patch.origin(), MARGIN, full);
    let mut sum = [Lanes::ZERO; JUDGED];
    kernel.judge(patch, &mut sum);
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
