//! What looks like a ring in a row is one if it does along eight rays as well: black and white in turn, and
//! both edges on ellipses about one centre, of one shape.

use gangway_device::Frame;
use gangway_pose::Sighting;

use crate::acquire::row::Pattern;
use crate::loader::{self, Ray};

/// Directions of the lines through the centre, as steps of pixels.
pub(super) const LINES: [[i32; 2]; 4] = [[1, 0], [0, 1], [1, 1], [-1, 1]];
/// Largest relative difference of the squared sizes along the two pairs of lines across each other: on an
/// ellipse there is none.
const UNEVEN: f64 = 0.25;
/// The same for pixels that are small against nothing: edges are placed to about this, px.
const EDGE_PX: f64 = 0.35;
/// Largest ratio between the inner diameters of two lines, each over the outer one.
const RATIO_SPREAD: f64 = 1.5;
/// How much greater the ratio of the chords is where a line nearly misses the inner disc.
const OFF_MIDDLE: f64 = 2.5;
/// Rings wider than this many times their height, or the other way, are no target's.
const STRETCH: f64 = 3.0;

/// Along one line: middles and halves of the inner and of the outer chord, px.
#[derive(Clone, Copy, Default)]
struct Chords {
    middles: [f64; 2],
    halves: [f64; 2],
}

/// The ring about column `middle` of row `y`, which is `width` px wide there, if it is one. Its outer to
/// inner diameter must be from `ratios[0]` to `ratios[1]`.
pub(crate) fn ring(frame: &Frame, pattern: &Pattern, y: u16, ratios: [f64; 2]) -> Option<Sighting> {
    let reach = i32::from(pattern.width) * 7 / 8 + 4;
    let mut at = [i32::from(pattern.middle), i32::from(y)];
    let threshold = pattern.threshold;
    // The row may run well off the middle: up and down first, then along the row in the middle.
    for line in [LINES[1], LINES[0]] {
        let chords = chords(frame, at, line, threshold, reach, ratios)?;
        at = [0, 1].map(|i| at[i] + line[i] * libm::round(chords.middles[0]) as i32);
    }
    let mut all = [Chords::default(); LINES.len()];
    for (chords_of, line) in all.iter_mut().zip(LINES) {
        let length = libm::sqrt(f64::from(line[0] * line[0] + line[1] * line[1]));
        let found = chords(frame, at, line, threshold, reach, ratios)?;
        *chords_of =
            Chords { middles: found.middles.map(|m| m * length), halves: found.halves.map(|h| h * length) };
    }
    let (form, ratio) = ellipse(&all, ratios)?;
    let middles = all.map(|chords| 0.5 * (chords.middles[0] + chords.middles[1]));
    let centre = centre(&middles, &form)?;
    let determinant = form[0] * form[2] - form[1] * form[1];
    // The form is the inverse of four times the second moments.
    let shape = [form[2], -form[1], form[0]].map(|m| 0.25 * m / determinant);
    Some(Sighting { at: [0, 1].map(|i| f64::from(at[i]) + centre[i]), shape, ratio })
}

/// The chords of a ring along a line through a point of its inner disc, in steps of the line.
fn chords(
    frame: &Frame,
    at: [i32; 2],
    line: [i32; 2],
    threshold: u8,
    reach: i32,
    ratios: [f64; 2],
) -> Option<Chords> {
    let ahead = edges(frame, at, line, threshold, reach)?;
    // The point may lie at the edge of the inner disc, but its black is as wide on the other side.
    let [black, white] = [ahead[1] - ahead[0], ratios[1] / (ratios[0] - 1.0)];
    let reach = reach.min((ahead[1] + 1.5 * black * white) as i32 + 4);
    let back = edges(frame, at, line.map(|c| -c), threshold, reach)?;
    let chords = Chords {
        middles: [0, 1].map(|i| 0.5 * (ahead[i] - back[i])),
        halves: [0, 1].map(|i| 0.5 * (ahead[i] + back[i])),
    };
    let ratio = chords.halves[1] / chords.halves[0];
    // Middles that lie apart belong to no ring.
    let apart = (chords.middles[0] - chords.middles[1]).abs() > EDGE_PX + 0.25 * chords.halves[0];
    (ratio >= ratios[0] && ratio <= OFF_MIDDLE * ratios[1] && !apart).then_some(chords)
}

/// Steps to the inner and the outer edge of the ring, between the samples where they cross the threshold.
fn edges(frame: &Frame, at: [i32; 2], step: [i32; 2], threshold: u8, reach: i32) -> Option<[f64; 2]> {
    let mut ray = Ray::new(frame, at, step);
    let mut before = ray.next()?;
    let mut inner = None;
    if before < threshold {
        return None;
    }
    // What has not turned black half way is no ring.
    let mut last = reach * 3 / 4;
    let mut i = 0;
    while i < last {
        i += 1;
        let now = ray.next()?;
        if (now < threshold) != inner.is_some() {
            let [from, to, threshold] = [before, now, threshold].map(f64::from);
            let edge = f64::from(i) - (to - threshold) / (to - from);
            match inner {
                None => (inner, last) = (Some(edge), reach),
                Some(inner) => return Some([inner, edge]),
            }
        }
        before = now;
    }
    None
}

/// The quadratic form of the outer ellipse, (uu, uv, vv) in 1/px^2, and the ratio of the diameters.
fn ellipse(all: &[Chords; LINES.len()], allowed: [f64; 2]) -> Option<([f64; 3], f64)> {
    let ratios = all.map(|chords| chords.halves[1] / chords.halves[0]);
    let (least, most) =
        ratios.iter().fold((f64::INFINITY, 0.0), |(l, m): (f64, f64), r| (l.min(*r), m.max(*r)));
    if !(least >= allowed[0] && most <= allowed[1] && most <= RATIO_SPREAD * least) {
        return None;
    }
    let form = form_of(&all.map(|chords| chords.halves[1]))?;
    Some((form, 0.25 * ratios.iter().sum::<f64>()))
}

/// The quadratic form of the ellipse with these halves of chords through its middle along the lines, (uu, uv,
/// vv) in 1/px^2, if there is one.
pub(super) fn form_of(halves: &[f64; LINES.len()]) -> Option<[f64; 3]> {
    let [u, v, down, up] = halves.map(|half| 1.0 / (half * half));
    let (straight, diagonal) = (u + v, down + up);
    let size = libm::sqrt(straight);
    let allowed = UNEVEN.min(2.0 * EDGE_PX * size + 0.06);
    if !((straight - diagonal).abs() <= allowed * straight && u.max(v) < STRETCH * STRETCH * u.min(v)) {
        return None;
    }
    // The sum along any two lines at right angles is the trace.
    let scale = 0.5 * (straight + diagonal) / straight;
    let form = [scale * u, 0.5 * (down - up), scale * v];
    let positive = form[0] * form[2] > form[1] * form[1];
    positive.then_some(form)
}

/// The centre, relative to where the lines cross: on each line the middle of the chords is where it comes
/// nearest to it, as the ellipse measures. Least squares over the lines.
pub(super) fn centre(middles: &[f64; LINES.len()], form: &[f64; 3]) -> Option<[f64; 2]> {
    let (mut a, mut b) = ([0.0; 3], [0.0; 2]);
    for (middle, line) in middles.iter().zip(LINES) {
        let length = libm::sqrt(f64::from(line[0] * line[0] + line[1] * line[1]));
        let n = line.map(|c| f64::from(c) / length);
        let across = [form[0] * n[0] + form[1] * n[1], form[1] * n[0] + form[2] * n[1]];
        let scale = across[0] * n[0] + across[1] * n[1];
        let row = across.map(|c| c / scale);
        a = [a[0] + row[0] * row[0], a[1] + row[0] * row[1], a[2] + row[1] * row[1]];
        b = [b[0] + row[0] * middle, b[1] + row[1] * middle];
    }
    let determinant = a[0] * a[2] - a[1] * a[1];
    let centre = [(a[2] * b[0] - a[1] * b[1]) / determinant, (a[0] * b[1] - a[1] * b[0]) / determinant];
    centre.iter().all(|c| c.is_finite()).then_some(centre)
}

/// Top 8 bits of a sample; `None` outside the picture.
#[inline(always)]
pub(super) fn sample(frame: &Frame, [x, y]: [i32; 2]) -> Option<u8> {
    loader::top(frame, u16::try_from(x).ok()?, u16::try_from(y).ok()?)
}
