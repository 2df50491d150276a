//! The sub-pixel centre of a bright disc on dark: the model ring without its inner edge, black and white the
//! other way round. All of the disc is taken: what lies within its edge tells how evenly it is lit.

use gangway_device::Frame;
use gangway_pose::Centre;

use super::{
    Belts, CLIPPED_WHITE, FIRST_BLUR, FITTED, Fit, MAX_BLACK, MAX_TILT, NEARLY_CLIPPED, SIGMAS, Start,
    Workspace, converge,
};
use crate::candidate::Candidate;
use crate::loader::{Rect, full_scale, top};
use crate::model::{Kernel, Model};
use crate::patch::{Belt, Part, Patch};
use crate::profile::{NO_EDGE, Profile, ROUGH, Radial};
use crate::{Refusal, Ring, Search, Settings, length};

/// The dark level is at least this share of what the disc has above it: the model's light is a share of the
/// dark.
const LEAST_DARK: f64 = 1.0 / 256.0;

/// Standard deviation of a disc's own unevenness from its middle to its edge, share of its level, before
/// anything of it was seen: of a diffuser before a light-emitting diode.
const UNEVEN: f64 = 0.002;

/// What is left of the model's faults where only the foot of the edge is seen, below the saturated rest:
/// standard deviation of the centre times the root of the diameter, px^3/2. Measured from 4 to 30 px.
const BY_FOOT: f64 = 0.08;

/// The ring's bound on the third harmonic, for an edge that has no other within it to be compared with.
const MAX_THIRD_PX: f64 = 0.06;

/// Bends of so many standard deviations of noise are noise.
const LIKELY: f64 = 3.0;

/// A sample whose top 8 bits are this or more is clipped.
const CLIPPED: u8 = 253;

/// Share of a disc's level that noise is taken for until it is measured.
const FIRST_NOISE: f64 = 0.01;

/// Fits the disc that `candidate` (in the window at `window`) shows roughly, from the window's dark and
/// bright level.
pub(crate) fn measure(
    frame: &Frame,
    workspace: &mut Workspace,
    window: Rect,
    candidate: &Candidate,
    (dark, bright): (f64, f64),
    search: &Search,
    settings: &Settings,
) -> Result<Ring, Refusal> {
    let Workspace { patch, profile } = workspace;
    let full = f64::from(full_scale(frame));
    let centre = [candidate.centre[0] + f64::from(window.x), candidate.centre[1] + f64::from(window.y)];
    let is_clipped = is_clipped(frame, centre, candidate.outer);
    if is_clipped && dark > MAX_BLACK * full {
        return Err(Refusal::Saturated);
    }
    let saturated = if is_clipped { (1.0 - NEARLY_CLIPPED) * full } else { f64::INFINITY };
    let bright = if is_clipped { CLIPPED_WHITE * full } else { bright };
    // A pose knows the shape better than the pixels of one disc.
    let [uu, uv, vv] = if search.confident { search.shape } else { candidate.shape };
    let root = libm::sqrt(uu * vv - uv * uv);
    let shape = [uu / root, uv / root, vv / root];
    let outer = if search.confident { 2.0 * libm::sqrt(root) } else { candidate.outer };
    let radial = Radial { white: dark, contrast: dark - bright, outer, inner: NO_EDGE, blur: FIRST_BLUR };
    let mut model = Model { centre, shape, radial, slope: [0.0; 2], bias: [0.0; 2], inner_bias: 0.0 };
    model.centre = [0, 1].map(|i| centre[i] - search.bias[i]);
    model.bias = model.in_circle(search.bias);

    let end = outer + FITTED;
    // The ellipse's extent.
    let reach = [shape[0], shape[2]].map(|moment| end * libm::sqrt(moment) + 1.0);
    let (low, high) = ([0, 1].map(|i| centre[i] - reach[i]), [0, 1].map(|i| centre[i] + reach[i]));
    let rect = Rect::clipped(frame, low, high).ok_or(Refusal::CutByPicture)?;
    let start = start(frame, (patch, profile), rect, &mut model, saturated)?;
    let radial = model.radial;
    let contrast = -radial.contrast;
    if contrast < settings.min_contrast * full {
        return Err(Refusal::LowContrast);
    }
    patch.clear(rect);
    let disc = patch.take(frame, model.centre, model.shape, &Belt::whole(end), 1);
    let belts = Belts { parts: [disc, Part::default()], overlap: false, leak: false };
    let fit = converge(patch, &belts, &mut model, &start)?;
    fit.check(contrast)?;
    if fit.third[0] > MAX_THIRD_PX + SIGMAS * fit.third[1] {
        return Err(Refusal::Outline);
    }
    let tilt = length(model.slope[0], model.slope[1]) - SIGMAS * libm::sqrt(fit.slope_square);
    if tilt * radial.outer > MAX_TILT * radial.white {
        return Err(Refusal::Outline);
    }
    let by_foot = if is_clipped { BY_FOOT * BY_FOOT / (2.0 * radial.outer) } else { 0.0 };
    // What bends the edge moves the centre by about as much; noise bends it too.
    let [bent, noise] = fit.third;
    let faults = by_foot + (bent * bent - LIKELY * LIKELY * noise * noise).max(0.0);
    Ok(ring(&model, &fit, full, faults))
}

/// Whether the disc reaches full scale along its middle row or column.
fn is_clipped(frame: &Frame, centre: [f64; 2], radius: f64) -> bool {
    let [x, y] = centre.map(|c| libm::round(c) as i32);
    let reach = libm::ceil(radius) as i32;
    let reaches = |x: i32, y: i32| {
        let at = u16::try_from(x).ok().zip(u16::try_from(y).ok());
        at.and_then(|(x, y)| top(frame, x, y)).is_some_and(|value| value >= CLIPPED)
    };
    (-reach..=reach).any(|i| reaches(x + i, y) || reaches(x, y + i))
}

/// Levels, radius, blur and a better centre by the radial profile.
fn start(
    frame: &Frame,
    (patch, profile): (&mut Patch, &mut Profile),
    rect: Rect,
    model: &mut Model,
    saturated: f64,
) -> Result<Start, Refusal> {
    let end = model.radial.outer + FITTED;
    patch.clear(rect);
    let disc = patch.take(frame, model.middle(), model.shape, &Belt::whole(end), 1);
    profile.clear(end);
    Kernel::new(model, patch.origin(), f64::INFINITY, false).collect(patch, disc, profile);
    profile.close();
    let mut radial =
        profile.fit(&model.radial, f64::INFINITY, (end, saturated), &ROUGH).ok_or(Refusal::Outline)?;
    let dark = radial.white.max(LEAST_DARK * -radial.contrast);
    radial.contrast += dark - radial.white;
    radial.white = dark;
    // The dark around says nothing of how evenly the disc is lit.
    let mut lean = profile.lean(&radial, &(f64::INFINITY..f64::INFINITY), saturated);
    // Written so that a NaN is refused too.
    let is_near = length(lean.step[0], lean.step[1]) < 2.0;
    if !is_near {
        return Err(Refusal::Outline);
    }
    let uneven = UNEVEN / radial.outer * radial.white;
    let noise = FIRST_NOISE * radial.contrast;
    lean.white_information = noise * noise / (uneven * uneven);
    lean.white_slope = [0.0; 2];
    let [u, v] = model.out_of_circle(lean.step);
    model.radial = radial;
    model.centre = [model.centre[0] + u, model.centre[1] + v];
    Ok(Start { lean, white_end: end, saturated })
}

fn ring(model: &Model, fit: &Fit, full: f64, faults: f64) -> Ring {
    let radial = &model.radial;
    let variance = fit.square + fit.pull * fit.pull * fit.slope_square + faults;
    Ring {
        centre: Centre { at: model.centre, covariance: model.shape.map(|moment| moment * variance) },
        diameter_px: 2.0 * radial.outer,
        white: ((radial.white - radial.contrast) / full) as f32,
        black: (radial.white / full) as f32,
        noise: (libm::sqrt(fit.variance) / full) as f32,
        blur_px: radial.blur as f32,
    }
}
