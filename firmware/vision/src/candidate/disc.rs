//! Which bright component of a window is the disc of an active target: one that the window shows wholly, of
//! the expected size and outline (the criteria of thesis 3.2.5 without those of the inner disc).

use core::f64::consts::PI;

use super::{Candidate, Miss, distance, is_ellipse};
use crate::bits::Bits;
use crate::components::Components;
use crate::{Refusal, Search, Settings};

/// Standard deviation of a sharp lens' blur, px: a point shows at half its height as wide as 2.35 of it.
const BLUR_PX: f64 = 0.7;

/// Discs below this diameter are too few pixels for the outline's moments, px.
const NO_OUTLINE_PX: f64 = 10.0;

/// Allowed deviation, as a factor less one, of the area of discs as small.
const SMALL_TOLERANCE: f64 = 1.0;

/// The disc nearest to `predicted` (in the window), or why there is none.
pub(crate) fn find(
    components: &mut Components,
    bits: &Bits,
    search: &Search,
    predicted: [f64; 2],
    settings: &Settings,
) -> Result<Candidate, Miss> {
    let diameter = search.diameter_px();
    let is_small = diameter < NO_OUTLINE_PX;
    // Half the height lies at the disc's edge if that is straight, and further out about a point.
    let expected = PI * (0.25 * diameter * diameter + if is_small { BLUR_PX * BLUR_PX } else { 0.0 });
    let most =
        1.0 + if is_small { SMALL_TOLERANCE.max(settings.area_tolerance) } else { settings.area_tolerance };
    let mut best: Option<(f64, Candidate)> = None;
    let mut refusal = Refusal::NotFound;
    let missed = |refusal| Miss { refusal, cut_at: None };
    components.find(bits).map_err(|_| missed(refusal))?;
    while let Ok(Some((disc, _))) = components.next_ring(bits, (0.5 * expected / most).max(1.0)) {
        let area = f64::from(disc.area);
        let (centre, shape) = (disc.centroid(), disc.moments());
        let fits = area <= most * expected && area * most >= expected;
        if !fits || !(is_small || is_ellipse(shape, area, &search.shape)) {
            refusal = Refusal::Outline;
            continue;
        }
        let candidate = Candidate { centre, shape, outer: libm::sqrt(area / PI), inner: 0.0 };
        let off = distance(centre, predicted);
        if best.is_none_or(|(least, _)| off < least) {
            best = Some((off, candidate));
        }
    }
    best.map(|(_, candidate)| candidate).ok_or(missed(refusal))
}
