//! The sub-pixel centre: a model ring with blurred edges fitted to the grey levels.
//!
//! Gauss-Newton on the squared residuals, as the Cramer-Rao bound asks for it: a pixel counts by how much it changes
//! when the ring moves. The radial profile of some rows settles levels, radii and blur, and centre and slope roughly;
//! all pixels near the edges and in the white around then give centre and slope of the light together. Levels, radii
//! and blur are even about the centre and do not move it, so they need not be known as well.

use core::f64::consts::TAU;

use gangway_device::Frame;
use gangway_pose::Centre;

use crate::candidate::Candidate;
use crate::edge::{FOURTH, SQUARE};
use crate::lanes::Lanes;
use crate::light::Light;
use crate::loader::{Rect, full_scale};
use crate::model::{Kernel, Model, SUMS};
use crate::patch::{Belts, Patch};
use crate::profile::{Lean, Profile, Radial};
use crate::{Refusal, Ring, Search, Settings};

/// White that is looked at around a ring, px: the layout of an A3 7-CCC at 5 m leaves 4. Less is taken where less is
/// white.
const MARGIN: f64 = 4.0;

/// A bin of the profile that is darker than the white by more than this share of the contrast is no longer white.
const NO_LONGER_WHITE: f64 = 0.02;

/// Rows through a ring that make its profile at the least, out of every second one.
const PROFILE_ROWS: f64 = 12.0;

/// White this near to full scale, as a share of it, is clipped: its level is not known but by the sensor's limit.
const CLIPPED: f64 = 0.01;
/// Black above this share of full scale under saturated white: too little of the edges is left.
const MAX_BLACK: f64 = 0.5;

/// Blur of a sharp lens, px, as a start.
const FIRST_BLUR: f64 = 0.7;

/// Share of an edge's half width that is taken: beyond it a pixel counts less than a thirtieth of the steepest.
const BELT: f64 = 0.85;
/// What is taken beside that, px: so far the centre may still move.
const SLACK_PX: f64 = 0.1;

/// A step of the centre below this, px, is the last: what the profile's errors make of it is a twentieth or less.
const SMALL_STEP_PX: f64 = 0.1;

/// Most passes over all rows, and largest step of the last one, px: beyond it they did not converge.
const PASSES: usize = 3;
const LAST_STEP_PX: f64 = 0.1;

/// Bounds of a whole ring on what [`Fit`] holds, beyond what noise makes likely: coding artefacts and motion within the
/// exposure take up to 0.25 px, 0.12 px and 0.1, a hidden piece of edge that moves the centre by 0.2 px takes more.
const MAX_APART_PX: f64 = 0.25;
const MAX_THIRD_PX: f64 = 0.12;
const MAX_RESIDUAL: f64 = 0.2;

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

/// Fits the ring that `candidate` (in the window at `window`) shows roughly, from the window's dark and bright level.
pub(crate) fn measure(
    frame: &Frame,
    workspace: &mut Workspace,
    window: Rect,
    candidate: &Candidate,
    levels: (f64, f64),
    search: &Search,
    settings: &Settings,
) -> Result<(Ring, Light), Refusal> {
    let (rect, mut model) = rough(frame, window, candidate, levels, search)?;
    let full = f64::from(full_scale(frame));
    let lean = start(frame, workspace, rect, &mut model, full)?;
    let radial = model.radial;
    if radial.contrast < settings.min_contrast * full {
        return Err(Refusal::LowContrast);
    }

    let width = BELT * radial.half_width() + SLACK_PX;
    let belts = Belts {
        from: (radial.inner - width).max(0.0),
        to: radial.inner + width,
        again: radial.outer - width,
        end: radial.outer + width,
    };
    workspace.patch.take(frame, rect, model.centre, model.shape, &belts, 1);
    let fit = converge(&workspace.patch, &mut model, full, &lean)?;
    fit.check(radial.contrast)?;
    // The projective bias of an edge grows with its radius squared; the two count by their information.
    let inner_bias = 1.0 / (search.ratio * search.ratio);
    let share = radial.outer_share();
    let bias = search.bias.map(|bias| bias * (share + inner_bias * (1.0 - share)));
    let by_slope = lean.pull * lean.pull * lean.variance * fit.variance;
    let ring = Ring {
        centre: Centre {
            at: [0, 1].map(|i| model.centre[i] - bias[i]),
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
        variance: lean.variance * fit.variance / (radial.white * radial.white),
        pull: model.shape.map(|moment| moment * lean.pull * radial.white),
        by_slope: model.shape.map(|moment| moment * by_slope),
    };
    Ok((ring, light))
}

/// The model by what the binary window says, and the part of the picture that it needs.
fn rough(
    frame: &Frame,
    window: Rect,
    candidate: &Candidate,
    (dark, bright): (f64, f64),
    search: &Search,
) -> Result<(Rect, Model), Refusal> {
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
    // A pose knows the shape better than the pixels of one ring.
    let [uu, uv, vv] = if search.confident { search.shape } else { candidate.shape };
    let root = libm::sqrt(uu * vv - uv * uv);
    let radial = Radial {
        white: bright,
        contrast: bright - dark,
        outer: candidate.outer,
        inner: candidate.inner,
        blur: FIRST_BLUR,
    };
    let shape = [uu / root, uv / root, vv / root];
    Ok((rect, Model { centre, shape, radial, slope: [0.0; 2] }))
}

/// Levels, radii, blur, slope and a better centre by the radial profile of some rows.
fn start(
    frame: &Frame,
    workspace: &mut Workspace,
    rect: Rect,
    model: &mut Model,
    full: f64,
) -> Result<Lean, Refusal> {
    let Workspace { patch, profile } = workspace;
    let end = model.radial.outer + MARGIN;
    let every = ((2.0 * model.radial.outer / PROFILE_ROWS) as usize).max(2);
    patch.take(frame, rect, model.centre, model.shape, &Belts::whole(end), every);
    profile.clear(end);
    Kernel::new(model, patch.origin(), full).collect(patch, profile);
    profile.close();
    // A fifth of the window is as bright as this: its white is clipped.
    let clipped = model.radial.white > (1.0 - CLIPPED) * full;
    if clipped {
        model.radial.white = full;
        if model.radial.white - model.radial.contrast > MAX_BLACK * full {
            return Err(Refusal::Saturated);
        }
    }
    model.radial = profile.fit(&model.radial, clipped).ok_or(Refusal::Outline)?;
    profile.end_at_dark(&model.radial, NO_LONGER_WHITE);
    let mut lean = profile.lean(&model.radial);
    if clipped {
        lean.slope = [0.0; 2];
    }
    // Written so that a NaN is refused too.
    if !(libm::hypot(lean.step[0], lean.step[1]) < 2.0 && lean.variance >= 0.0) {
        return Err(Refusal::Outline);
    }
    let step = model.out_of_circle(lean.step);
    model.centre = [model.centre[0] + step[0], model.centre[1] + step[1]];
    model.slope = lean.slope;
    Ok(lean)
}

/// What the last pass found.
struct Fit {
    /// What was last added to the centre, px.
    step: [f64; 2],
    /// Variance of the centre in the circle's plane, for a slope that is known, px^2.
    square: f64,
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
    /// Refuses what is not one whole ring: something that hides a part of an edge bends it there, and the outer edge
    /// more than the inner one.
    fn check(&self, contrast: f64) -> Result<(), Refusal> {
        let sigma = libm::sqrt(self.square);
        let step = libm::hypot(self.step[0], self.step[1]);
        // Written so that a NaN is refused too.
        let whole = self.apart[0] <= MAX_APART_PX + SIGMAS * self.apart[1]
            && self.third[0] <= MAX_THIRD_PX + SIGMAS * self.third[1]
            && step <= LAST_STEP_PX + SIGMAS * sigma
            && self.residual <= MAX_RESIDUAL * MAX_RESIDUAL * contrast * contrast;
        if whole { Ok(()) } else { Err(Refusal::Outline) }
    }
}

/// Passes over all rows until the centre stays.
fn converge(patch: &Patch, model: &mut Model, full: f64, lean: &Lean) -> Result<Fit, Refusal> {
    let mut fit = pass(patch, model, full, lean)?;
    for _ in 1..PASSES {
        if libm::hypot(fit.step[0], fit.step[1]) < SMALL_STEP_PX {
            break;
        }
        fit = pass(patch, model, full, lean)?;
    }
    Ok(fit)
}

/// One pass: corrects the centre, for a slope that is known.
fn pass(patch: &Patch, model: &mut Model, full: f64, lean: &Lean) -> Result<Fit, Refusal> {
    let mut sum = [Lanes::ZERO; SUMS];
    Kernel::new(model, patch.origin(), full).fit(patch, &mut sum);
    let [outer_x, outer_y, inner_x, inner_y, square, noise, cosine, sine] = sum.map(Lanes::sum);
    if square < 1.0 {
        return Err(Refusal::Outline);
    }
    // An edge that moves outwards makes the outer edge's pixels darker, the inner one's brighter. In the circle's plane
    // both directions are alike: half the squares for each.
    let radial = &model.radial;
    let per_px = radial.peak();
    let scale = 2.0 / (square * per_px);
    let step = model.out_of_circle([(inner_x - outer_x) * scale, (inner_y - outer_y) * scale]);
    let share = radial.outer_share();
    let outer = model.out_of_circle([-outer_x * scale / share, -outer_y * scale / share]);
    let inner = model.out_of_circle([inner_x * scale / (1.0 - share), inner_y * scale / (1.0 - share)]);
    // Every pixel's own residual counts by how much it moves the centre, so noise may differ from white to black. The
    // fit follows the noise of two in as many pixels as carry the information.
    let carrying = TAU * (radial.outer + radial.inner) * radial.half_width() * (SQUARE * SQUARE / FOURTH);
    let residual = noise / square / (1.0 - 2.0 / carrying.max(8.0));
    // Rounding to whole grey levels is noise too.
    let variance = lean.misfit.noise(residual).max(1.0 / 12.0);
    let circle = 2.0 * variance / (square * per_px * per_px);
    model.centre = [model.centre[0] + step[0], model.centre[1] + step[1]];
    let sigma = libm::sqrt(circle);
    Ok(Fit {
        step,
        square: circle,
        variance,
        residual,
        apart: [
            libm::hypot(outer[0] - inner[0], outer[1] - inner[1]),
            sigma / libm::sqrt(share * (1.0 - share)),
        ],
        third: [libm::hypot(cosine, sine) * scale / share, sigma / libm::sqrt(share)],
    })
}
