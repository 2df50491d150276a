//! The sub-pixel centre: a model ring with blurred edges fitted to the grey levels.
//!
//! Gauss-Newton on the squared residuals, as the Cramer-Rao bound asks for it: a pixel counts by how much it
//! changes when the ring moves. The radial profile of some rows settles levels, radii, blur and the white's
//! slope, and roughly the centre; all pixels near the edges then give centre and slope of the light together.
//! Levels, radii and blur are even about the centre and do not move it, so they need not be known as well.

mod disc;
mod noise;

use gangway_device::Frame;
use gangway_pose::Centre;

use crate::candidate::Candidate;
use crate::light::Light;
use crate::loader::{Rect, full_scale};
use crate::model::{Kernel, Model, WHITE_WEIGHT};
use crate::patch::{Belt, Part, Patch};
use crate::profile::{FINE, Lean, Profile, ROUGH, Radial};
use crate::{Refusal, Ring, Search, Settings, length};
use noise::noise;

pub(crate) use disc::measure as measure_disc;

/// White that is looked at around a ring, px: the layout of an A3 7-CCC at 5 m leaves 4. Less is taken where
/// less is white.
const MARGIN: f64 = 4.0;

/// White to which the profile is fitted, px: dark beyond the margin is blurred less far in.
const FITTED: f64 = 2.5;

/// A bin of the profile that is darker than it should be by more than this share of the contrast is no longer
/// white. Of a ring larger than this radius, px, less is borne with: perspective moves the white's border
/// with its square, and what leaks in on one side only moves the centre.
const NO_LONGER_WHITE: f64 = 0.02;
const LEAKS_FROM_PX: f64 = 12.0;
/// How far before the end of the white blur darkens it unseen, standard deviations of the blur.
const DARKENED: f64 = 1.5;

/// Rows through a ring that make its profile; of a small ring it is every third one. What clipped white
/// leaves of the edges needs all of them.
const PROFILE_ROWS: f64 = 8.0;
const LEAST_EVERY: usize = 3;
const CLIPPED_EVERY: usize = 1;

/// White this near to full scale, as a share of it, is clipped: its level is not known but by the sensor's
/// limit.
const CLIPPED: f64 = 0.01;
/// Of a ring under clipped white, what is brighter than this short of full scale is left out; and where its
/// white is looked for from, share of full scale.
const NEARLY_CLIPPED: f64 = 0.03;
const CLIPPED_WHITE: f64 = 1.6;
/// Black above this share of full scale under saturated white: too little of the edges is left. Where blur
/// joins them it brightens the darkest pixels beyond that, but wide edges show more of themselves: the share
/// that those may have.
const MAX_BLACK: f64 = 0.5;
const MAX_DARKEST: f64 = 0.75;

/// Blur of a sharp lens, px, as a start.
const FIRST_BLUR: f64 = 0.7;

/// Share of an edge's half width that is taken: beyond it a pixel carries less than a twenty-fifth of the
/// steepest one's information.
const BELT: f64 = 0.65;
/// What is taken beside that, px: so far the centre may still move.
const SLACK_PX: f64 = 0.1;
/// Where the middle between both edges is nearer to them than this share of the half width, pixels are
/// compared with both: beyond it, those that see the other edge too carry less than a twenty-fifth of the
/// steepest one's information.
const OVERLAP: f64 = 0.65;

/// A step of the centre below this, px, and below so many standard deviations, is the last: what the
/// profile's errors leave of it is a twentieth, of small rings with much blur a fifth.
const SMALL_STEP_PX: f64 = 0.05;
const SMALL_STEP_SIGMAS: f64 = 5.0;

/// Edges whose half width is more than this share of the ring's radius hide that dark leaks in from beyond
/// the white.
const LEAKY: f64 = 0.4;
/// Where dark leaks in, belts about a centre that moved by more than this, px, are taken anew: more of it on
/// one side moves the centre.
const STALE_PX: f64 = 0.01;

/// Most passes over all rows, and largest step of the last one, px: beyond it they did not converge.
const PASSES: usize = 3;
const LAST_STEP_PX: f64 = 0.1;

/// Bounds of a whole ring on what [`Fit`] holds, beyond what noise makes likely: coding artefacts and motion
/// within the exposure take up to 0.22 px, 0.12 px and 0.1, a hidden piece of edge that moves the centre by
/// 0.2 px takes more.
const MAX_APART_PX: f64 = 0.22;
const MAX_THIRD_PX: f64 = 0.12;
const MAX_RESIDUAL: f64 = 0.16;

/// Light that changes by more over a radius, as a share of the white, is no light: a ring covered in part
/// looks so.
const MAX_TILT: f64 = 0.06;

/// Standard deviations of noise that are let pass.
const SIGMAS: f64 = 4.0;

/// Working memory of the fit.
pub(crate) struct Workspace {
    patch: Patch,
    profile: Profile,
}

impl Workspace {
    pub(crate) const fn new() -> Self {
        Self { patch: Patch::new(), profile: Profile::new() }
    }
}

/// Fits the ring that `candidate` (in the picture) shows roughly.
pub(crate) fn measure(
    frame: &Frame,
    workspace: &mut Workspace,
    candidate: &Candidate,
    search: &Search,
    settings: &Settings,
) -> Result<(Ring, Light), Refusal> {
    let (rect, mut model) = rough(frame, candidate, search)?;
    let full = f64::from(full_scale(frame));
    let start = start(frame, workspace, rect, &mut model, (search.ratio, full))?;
    let radial = model.radial;
    if radial.contrast < settings.min_contrast * full {
        return Err(Refusal::LowContrast);
    }

    let belts = take_belts(frame, &mut workspace.patch, rect, &model, start.white_end);
    let taken_at = model.centre;
    let mut fit = converge(&workspace.patch, &belts, &mut model, &start)?;
    let moved = length(model.centre[0] - taken_at[0], model.centre[1] - taken_at[1]);
    if belts.leak && moved > STALE_PX {
        let belts = take_belts(frame, &mut workspace.patch, rect, &model, start.white_end);
        fit = converge(&workspace.patch, &belts, &mut model, &start)?;
    }
    fit.check(radial.contrast)?;
    let tilt = length(model.slope[0], model.slope[1]) - SIGMAS * libm::sqrt(fit.slope_square);
    let is_light = tilt * radial.outer <= MAX_TILT * radial.white;
    if !is_light {
        return Err(Refusal::Outline);
    }
    let by_slope = fit.pull * fit.pull * fit.slope_square;
    let ring = Ring {
        centre: Centre {
            at: model.centre,
            covariance: model.shape.map(|moment| moment * (fit.square + by_slope)),
        },
        diameter_px: 2.0 * radial.outer,
        white: (radial.white / full) as f32,
        black: ((radial.white - radial.contrast) / full) as f32,
        noise: (libm::sqrt(fit.variance) / full) as f32,
        blur_px: radial.blur as f32,
    };
    let light = Light {
        slope: model.gradient_out_of_circle(model.slope).map(|slope| slope / radial.white),
        variance: fit.slope_square / (radial.white * radial.white),
        pull: model.shape.map(|moment| moment * fit.pull * radial.white),
        by_slope: model.shape.map(|moment| moment * by_slope),
    };
    Ok((ring, light))
}

/// The model by what the binary window says, and the part of the picture that it needs.
fn rough(frame: &Frame, candidate: &Candidate, search: &Search) -> Result<(Rect, Model), Refusal> {
    let centre = candidate.centre;
    // Half the ellipse's extent is twice the standard deviation of its filled area.
    let half = [0, 2].map(|i| 2.0 * libm::sqrt(candidate.shape[i].max(0.0)) + MARGIN + 0.5);
    let low = [centre[0] - half[0], centre[1] - half[1]];
    let high = [centre[0] + half[0], centre[1] + half[1]];
    let (right, below) = (f64::from(frame.width()) - 1.0, f64::from(frame.height()) - 1.0);
    if !(low[0] >= 0.0 && low[1] >= 0.0 && high[0] <= right && high[1] <= below) {
        return Err(Refusal::CutByPicture);
    }
    let rect = Rect::clipped(frame, low, high).ok_or(Refusal::CutByPicture)?;
    // A pose knows the shape better than the pixels of one ring.
    let [uu, uv, vv] = if search.confident { search.shape } else { candidate.shape };
    let root = libm::sqrt(uu * vv - uv * uv);
    let (outer, inner) = if search.confident {
        (2.0 * libm::sqrt(root), 2.0 * libm::sqrt(root) / search.ratio)
    } else {
        (candidate.outer, candidate.inner)
    };
    // The profile will tell the levels.
    let radial = Radial { white: 1.0, contrast: 0.0, outer, inner, blur: FIRST_BLUR };
    let shape = [uu / root, uv / root, vv / root];
    let inner_bias = 1.0 / (search.ratio * search.ratio);
    let mut model = Model { centre, shape, radial, slope: [0.0; 2], bias: [0.0; 2], inner_bias };
    // The candidate's centre is that of its outer edge.
    model.centre = [0, 1].map(|i| centre[i] - search.bias[i]);
    model.bias = model.in_circle(search.bias);
    Ok((rect, model))
}

/// What the profile of some rows says beside the model.
struct Start {
    lean: Lean,
    /// Radius up to which it is white around the ring, px.
    white_end: f64,
    /// Level from which on the model is saturated.
    saturated: f64,
}

/// Levels, radii, blur, slope and a better centre by the radial profile of some rows.
fn start(
    frame: &Frame,
    workspace: &mut Workspace,
    rect: Rect,
    model: &mut Model,
    (ratio, full): (f64, f64),
) -> Result<Start, Refusal> {
    let Workspace { patch, profile } = workspace;
    let every = ((2.0 * model.radial.outer / PROFILE_ROWS) as usize).max(LEAST_EVERY);
    collect(frame, patch, profile, (rect, every), model);
    let (black, white) = profile.extremes(model.radial.outer + FITTED).ok_or(Refusal::Outline)?;
    (model.radial.white, model.radial.contrast) = (white, white - black);
    let clipped = white > (1.0 - CLIPPED) * full;
    let saturated = if clipped { (1.0 - NEARLY_CLIPPED) * full } else { f64::INFINITY };
    if clipped {
        if black > MAX_DARKEST * full {
            return Err(Refusal::Saturated);
        }
        model.radial.white = CLIPPED_WHITE * full;
        model.radial.contrast = model.radial.white - black;
        // About a better centre fewer cells mix clipped pixels with others.
        collect(frame, patch, profile, (rect, CLIPPED_EVERY), model);
        settle(profile, model, ratio, saturated)?;
        collect(frame, patch, profile, (rect, CLIPPED_EVERY), model);
    }
    let (lean, white_end) = settle(profile, model, ratio, saturated)?;
    let black = model.radial.white - model.radial.contrast;
    if clipped && black > MAX_BLACK * full && !overlap(&model.radial) {
        return Err(Refusal::Saturated);
    }
    model.slope = lean.white_slope;
    let saturated = if clipped { full } else { f64::INFINITY };
    Ok(Start { lean, white_end, saturated })
}

/// Fits the model to the profile; what its sides say beside that, and the radius up to which it is white, px.
fn settle(
    profile: &mut Profile,
    model: &mut Model,
    ratio: f64,
    saturated: f64,
) -> Result<(Lean, f64), Refusal> {
    let reach = (model.radial.outer + FITTED, saturated);
    let rough = profile.fit(&model.radial, ratio, reach, &ROUGH).ok_or(Refusal::Outline)?;
    let borne = NO_LONGER_WHITE * (LEAKS_FROM_PX / rough.outer).min(1.0);
    let white_end = profile.white_end(&rough, borne, saturated);
    let white_from = rough.outer + BELT * rough.half_width() + SLACK_PX;
    let around = white_from..white_end - DARKENED * rough.blur;
    let mut lean = profile.lean(&rough, &around, saturated);
    // It is weighed against pixels of the edges.
    lean.white_information *= WHITE_WEIGHT;
    // Written so that a NaN is refused too.
    if !(length(lean.step[0], lean.step[1]) < 2.0 && lean.white_information >= 0.0) {
        return Err(Refusal::Outline);
    }
    profile.centre(&rough, lean.step);
    let reach = (reach.0.min(white_end), saturated);
    let fine = profile.fit(&rough, ratio, reach, &FINE).ok_or(Refusal::Outline)?;
    // An edge's radius about another centre than its own varies by a sine: that much of the blur is none.
    let [x, y] = lean.step;
    model.radial = fine.less_blur(0.5 * (x * x + y * y) + model.apart());
    let [u, v] = model.out_of_circle(lean.step);
    model.centre = [model.centre[0] + u, model.centre[1] + v];
    Ok((lean, white_end))
}

/// The pixels near the outer and near the inner edge.
struct Belts {
    parts: [Part; 2],
    /// Whether the pixels of either see the other edge as well.
    overlap: bool,
    /// Whether dark from beyond the white leaks in.
    leak: bool,
}

/// Whether the pixels of either edge see the other one as well.
fn overlap(radial: &Radial) -> bool {
    radial.middle() - radial.inner < OVERLAP * radial.half_width()
}

/// Takes the pixels near either edge, up to `white_end` px from the centre.
fn take_belts(frame: &Frame, patch: &mut Patch, rect: Rect, model: &Model, white_end: f64) -> Belts {
    let radial = &model.radial;
    let width = BELT * radial.half_width() + SLACK_PX;
    // A pixel half way belongs to one of them.
    let middle = radial.middle();
    let outer = Belt { from: (radial.outer - width).max(middle), to: (radial.outer + width).min(white_end) };
    let inner = Belt { from: (radial.inner - width).max(0.0), to: (radial.inner + width).min(middle) };
    patch.clear(rect);
    let sides = [(outer, 1.0), (inner, model.inner_bias)];
    let parts = sides.map(|(belt, share)| patch.take(frame, model.centre_of(share), model.shape, &belt, 1));
    let overlap = overlap(radial);
    let leak = white_end < radial.outer + width || radial.half_width() > LEAKY * radial.outer;
    Belts { parts, overlap, leak }
}

/// Makes the profile of every so many rows.
fn collect(
    frame: &Frame,
    patch: &mut Patch,
    profile: &mut Profile,
    (rect, every): (Rect, usize),
    model: &Model,
) {
    let end = model.radial.outer + MARGIN;
    patch.clear(rect);
    let rows = patch.take(frame, model.middle(), model.shape, &Belt::whole(end), every);
    profile.clear(end);
    Kernel::new(model, patch.origin(), f64::INFINITY, false).collect(patch, rows, profile);
    profile.close();
}

/// What the last pass found.
struct Fit {
    /// What was last added to the centre, px.
    step: [f64; 2],
    /// Variance of the centre in the circle's plane, for a slope that is known, px^2.
    square: f64,
    /// How far the centre follows a slope that is thought too small by 1, px, and that slope's variance.
    pull: f64,
    slope_square: f64,
    /// Variance of the noise at the edges.
    variance: f64,
    /// Mean square residual there.
    residual: f64,
    /// Distance between the centres of the outer and the inner edge, px, and its standard deviation.
    apart: [f64; 2],
    /// Amplitude of the outer edge's third harmonic, px, and its standard deviation.
    third: [f64; 2],
}

impl Fit {
    /// Refuses what is not one whole ring: something that hides a part of an edge bends it there, and the
    /// outer edge more than the inner one.
    fn check(&self, contrast: f64) -> Result<(), Refusal> {
        let sigma = libm::sqrt(self.square);
        let step = length(self.step[0], self.step[1]);
        // Written so that a NaN is refused too.
        let whole = self.apart[0] <= MAX_APART_PX + SIGMAS * self.apart[1]
            && self.third[0] <= MAX_THIRD_PX + SIGMAS * self.third[1]
            && step <= LAST_STEP_PX + SIGMAS * sigma
            && self.residual <= MAX_RESIDUAL * MAX_RESIDUAL * contrast * contrast;
        if whole { Ok(()) } else { Err(Refusal::Outline) }
    }
}

/// Passes over all rows until the centre stays.
fn converge(patch: &Patch, belts: &Belts, model: &mut Model, start: &Start) -> Result<Fit, Refusal> {
    let mut fit = pass(patch, belts, model, start)?;
    for _ in 1..PASSES {
        let small = SMALL_STEP_PX.min(SMALL_STEP_SIGMAS * libm::sqrt(fit.square));
        if length(fit.step[0], fit.step[1]) < small {
            break;
        }
        fit = pass(patch, belts, model, start)?;
    }
    Ok(fit)
}

/// One pass: corrects centre, slope and radii.
fn pass(patch: &Patch, belts: &Belts, model: &mut Model, start: &Start) -> Result<Fit, Refusal> {
    let lean = &start.lean;
    let kernel = Kernel::new(model, patch.origin(), start.saturated, belts.overlap);
    let [outer, inner] = kernel.fit(patch, belts.parts);
    let square = outer.square + inner.square;
    if square < 1.0 {
        return Err(Refusal::Outline);
    }
    // An edge that moves outwards makes the outer edge's pixels darker, the inner one's brighter. In the
    // circle's plane both directions are alike: half the squares for each.
    let radial = &model.radial;
    let per_px = radial.peak();
    let scale = 2.0 / (square * per_px);
    // The slope is told by these pixels and by the white beyond them.
    let (information, cross) = (0.5 * square * per_px * per_px, 0.5 * (inner.cross - outer.cross) * per_px);
    let slope_information = 0.5 * (outer.slope_square + inner.slope_square) + lean.white_information;
    let determinant = information * slope_information - cross * cross;
    let is_determined = determinant > 0.0;
    if !is_determined {
        return Err(Refusal::Outline);
    }
    let side = [0, 1].map(|i| (inner.side[i] - outer.side[i]) * per_px);
    let slope_side = [0, 1].map(|i| {
        let beyond = lean.white_information * (lean.white_slope[i] - model.slope[i]);
        outer.slope_side[i] + inner.slope_side[i] + beyond
    });
    let step = [0, 1].map(|i| (slope_information * side[i] - cross * slope_side[i]) / determinant);
    let slope = [0, 1].map(|i| (information * slope_side[i] - cross * side[i]) / determinant);
    let moved = step[0] * step[0] + step[1] * step[1];
    let step = model.out_of_circle(step);
    let share = radial.outer_share();
    let outer_at = model.out_of_circle(outer.side.map(|side| -side * scale / share));
    // A disc has no inner edge, and its share is none.
    let other = (1.0 - share).max(f64::MIN_POSITIVE);
    let inner_at = model.out_of_circle(inner.side.map(|side| side * scale / other));
    let (residual, variance) = noise(model, [&outer, &inner], moved, belts.overlap);
    let circle = variance / information;
    model.slope = [model.slope[0] + slope[0], model.slope[1] + slope[1]];
    model.centre = [model.centre[0] + step[0], model.centre[1] + step[1]];
    let sigma = libm::sqrt(circle);
    // All pixels tell the radii better than some rows do. Where blur joins the edges they are told together.
    if !belts.overlap && !radial.is_disc() {
        model.radial.outer -= outer.even / (outer.square * per_px);
        model.radial.inner += inner.even / (inner.square * per_px);
    }
    Ok(Fit {
        step,
        square: circle,
        pull: cross / information,
        slope_square: variance * information / determinant,
        variance,
        residual,
        apart: [
            length(outer_at[0] - inner_at[0], outer_at[1] - inner_at[1]),
            sigma / libm::sqrt(share * (1.0 - share)),
        ],
        third: [
            length(outer.third[0], outer.third[1]) * libm::fabs(scale) / share,
            sigma / libm::sqrt(share),
        ],
    })
}
