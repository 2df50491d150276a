//! Which components are a ring (thesis 3.2.5, the criteria of a CCC candidate): a dark and a bright one, the
//! bright within the dark, centroids together, size, area ratio; and an outline that is the expected ellipse.

use core::f64::consts::PI;

use crate::bits::Bits;
use crate::components::{Components, Part};
use crate::window::Window;
use crate::{Refusal, Search, Settings, length};

pub(crate) mod disc;

/// Least ratio of an outline's area to that of the ellipse with its second moments. A whole ellipse of pixels
/// has 0.99 or more from 12 px on, one with a tenth of its diameter cut off 0.985 and a smaller ring with it.
const MIN_ELLIPTICITY: f64 = 0.975;

/// Largest relative difference of the outline's second moments, brought to equal area, from the predicted
/// ones.
const SHAPE_TOLERANCE: f64 = 0.25;

/// Largest stretch of a cut ring's visible part over the predicted one.
const EVIDENCE_STRETCH: f64 = 1.2;

/// A dark and a bright component that are a ring, in samples of the window or in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Candidate {
    /// Centroid of the filled ring, px.
    pub(crate) centre: [f64; 2],
    /// Second central moments (uu, uv, vv) of the filled ring, px^2.
    pub(crate) shape: [f64; 3],
    /// Radius of the circle that has the area of the filled ring, px.
    pub(crate) outer: f64,
    /// Radius of the circle that has the area of the bright component, px.
    pub(crate) inner: f64,
}

impl Candidate {
    /// One in samples of `window` as one in the picture.
    pub(crate) fn in_picture(&self, window: &Window) -> Self {
        let every = window.every as f64;
        Self {
            centre: window.in_picture(self.centre),
            shape: self.shape.map(|moment| moment * every * every),
            outer: self.outer * every,
            inner: self.inner * every,
        }
    }
}

/// What a window without a whole ring still tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Miss {
    pub(crate) refusal: Refusal,
    /// Where the centre of a ring lies that the window's edge cuts, px.
    pub(crate) cut_at: Option<[f64; 2]>,
}

/// The candidate nearest to the predicted centre, or why there is none. All is in samples of the window, the
/// largest distance between centroids as well.
pub(crate) fn find(
    components: &mut Components,
    bits: &Bits,
    search: &Search,
    max_centroid_distance: f64,
    settings: &Settings,
) -> Result<Candidate, Miss> {
    let size = [bits.width(), bits.height()];
    let expected = Expected { search, settings, max_centroid_distance, size };
    // Rings do not overlap: the one that has the predicted centre in its hole is the nearest.
    if let Some((hole, filled)) = components.ring_at(bits, search.at)
        && let Ok(candidate) = expected.ring(&hole, &filled)
    {
        return Ok(candidate);
    }
    let mut best: Option<(f64, Candidate)> = None;
    let mut refusal = Refusal::NotFound;
    components.find(bits).map_err(|_| Miss { refusal, cut_at: None })?;
    // Clutter ends the search.
    while let Ok(Some((hole, filled))) = components.next_ring(bits, expected.least_hole()) {
        match expected.ring(&hole, &filled) {
            Ok(candidate) => {
                let off = distance(candidate.centre, search.at);
                if best.is_none_or(|(least, _)| off < least) {
                    best = Some((off, candidate));
                }
            }
            Err(Refusal::NotFound) => {}
            Err(other) => refusal = other,
        }
    }
    match best {
        Some((_, candidate)) => Ok(candidate),
        None => {
            let cut_at = evidence(components, bits, search);
            if refusal == Refusal::NotFound && cut_at.is_some() {
                refusal = Refusal::CutByWindow;
            }
            Err(Miss { refusal, cut_at })
        }
    }
}

/// What is known of the ring before it is seen.
struct Expected<'a> {
    search: &'a Search,
    settings: &'a Settings,
    max_centroid_distance: f64,
    /// Width and height of the window.
    size: [usize; 2],
}

impl Expected<'_> {
    /// Area of the filled ring, px^2.
    fn area(&self) -> f64 {
        PI * self.search.diameter_px() * self.search.diameter_px() / 4.0
    }

    /// Most that the area ratio of both circles may be too large, or too small.
    fn most(&self) -> f64 {
        1.0 + self.settings.ratio_tolerance
    }

    /// Pixels of a hole below which it is not worth comparing.
    fn least_hole(&self) -> f64 {
        0.5 * self.area() / (self.search.ratio * self.search.ratio * self.most())
    }

    /// The ring that a hole and the dark around it are, together; `NotFound` where there is nothing like one.
    fn ring(&self, hole: &Part, ring: &Part) -> Result<Candidate, Refusal> {
        let dark = ring.without(hole);
        if ring.touches_edge(self.size)
            || distance(dark.centroid(), hole.centroid()) > self.max_centroid_distance
        {
            return Err(Refusal::NotFound);
        }
        let (filled, area) = (f64::from(ring.area), f64::from(hole.area));
        let (centre, shape) = (ring.centroid(), ring.moments());
        let closed = filled / (area * self.search.ratio * self.search.ratio);
        if (filled / self.area() - 1.0).abs() > self.settings.area_tolerance
            || closed > self.most()
            || closed * self.most() < 1.0
            || !is_ellipse(shape, filled, &self.search.shape)
        {
            return Err(Refusal::Outline);
        }
        Ok(Candidate { centre, shape, outer: libm::sqrt(filled / PI), inner: libm::sqrt(area / PI) })
    }
}

/// Whether a region of `area` with these second moments is an ellipse, and the predicted one but for its
/// size.
fn is_ellipse(shape: [f64; 3], area: f64, predicted: &[f64; 3]) -> bool {
    let determinant = |m: &[f64; 3]| m[0] * m[2] - m[1] * m[1];
    let (own, other) = (determinant(&shape), determinant(predicted));
    // Written so that a NaN is refused too.
    if !(own > 0.0 && other > 0.0) {
        return false;
    }
    // The area of an ellipse is 4 pi sqrt(det M); of all regions with these moments it has the largest.
    // Pixels count with their centres, so small ellipses scatter about 1.
    let ellipticity = area / (4.0 * PI * libm::sqrt(own));
    let scale = libm::sqrt(other / own);
    let mean = 0.5 * (predicted[0] + predicted[2]);
    let off = (0..3).fold(0.0, |most: f64, i| most.max((shape[i] * scale - predicted[i]).abs()));
    (MIN_ELLIPTICITY..=1.0 / MIN_ELLIPTICITY).contains(&ellipticity) && off <= SHAPE_TOLERANCE * mean
}

/// Centre of the ring of which the largest plausible piece touches the window's edge.
fn evidence(components: &mut Components, bits: &Bits, search: &Search) -> Option<[f64; 2]> {
    let size = [bits.width(), bits.height()];
    // Half the predicted ellipse's extent along u and v.
    let half = [2.0 * libm::sqrt(search.shape[0].max(0.0)), 2.0 * libm::sqrt(search.shape[2].max(0.0))];
    let ring = PI * half[0] * half[1] * (1.0 - 1.0 / (search.ratio * search.ratio));
    let mut best: Option<(u32, [f64; 2])> = None;
    components.each_dark(bits, |part| {
        let cut = |i: usize| part.low[i] == 0 || part.high[i] as usize + 1 == size[i];
        let fits = |i: usize| {
            let extent = f64::from(part.high[i] - part.low[i]) + 1.0;
            extent < 2.0 * EVIDENCE_STRETCH * half[i] && extent > if cut(i) { 0.35 } else { 1.3 } * half[i]
        };
        if !(cut(0) || cut(1)) || !(fits(0) && fits(1)) || f64::from(part.area) > EVIDENCE_STRETCH * ring {
            return;
        }
        let centre = core::array::from_fn(|i| centre_of_cut(part, i, size[i], half[i]));
        if best.is_none_or(|(area, _)| part.area > area) {
            best = Some((part.area, centre));
        }
    });
    best.map(|(_, centre)| centre)
}

/// Where the centre is along axis `i` of a ring whose visible part is `part`.
fn centre_of_cut(part: &Part, i: usize, size: usize, half: f64) -> f64 {
    let (low, high) = (f64::from(part.low[i]), f64::from(part.high[i]));
    match (part.low[i] == 0, part.high[i] as usize + 1 == size) {
        (true, false) => high + 0.5 - half,
        (false, true) => low - 0.5 + half,
        _ => 0.5 * (low + high),
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    length(a[0] - b[0], a[1] - b[1])
}
