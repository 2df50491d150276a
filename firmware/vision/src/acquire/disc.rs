//! What looks like a bright disc in a row is one if it does along eight rays as well: its edges on an
//! ellipse, and dark beyond them.

use gangway_device::Frame;
use gangway_pose::Sighting;

use super::probe::{LINES, centre, form_of, sample};
use crate::acquire::row::Pattern;
use crate::loader::Ray;

/// Least diameter, px.
pub(super) const LEAST_PX: f64 = 5.0;

/// Beyond a disc it is dark up to this share of its radius, and where there are rings too, further: the white
/// in the middle of a ring is followed by the white around it.
const DARK_TO: f64 = 1.5;
const DARK_BESIDE_RINGS_TO: f64 = 2.4;

/// The disc about column `middle` of row `y`, which is `width` px wide there, if it is one.
pub(super) fn disc(frame: &Frame, pattern: &Pattern, y: u16, beside_rings: bool) -> Option<Sighting> {
    let reach = i32::from(pattern.width) * 5 / 2 + 4;
    let mut at = [i32::from(pattern.middle), i32::from(y)];
    let edges = |at: [i32; 2], line: [i32; 2]| -> Option<[f64; 2]> {
        let ahead = edge(frame, at, line, pattern.threshold, reach)?;
        let back = edge(frame, at, line.map(|c| -c), pattern.threshold, reach)?;
        // Middle and half of the chord, in steps of the line.
        Some([0.5 * (ahead - back), 0.5 * (ahead + back)])
    };
    // Whether it is dark so many halves of a chord from its middle. Beyond the picture's edge anything may be.
    let is_dark_at = |at: [i32; 2], line: [i32; 2], [middle, half]: [f64; 2], halves: f64| {
        [-1.0, 1.0].iter().all(|way| {
            let length = libm::sqrt(f64::from(line[0] * line[0] + line[1] * line[1]));
            let steps = libm::round(middle + way * (halves * half + 1.0 / length)) as i32;
            let value = sample(frame, [0, 1].map(|i| at[i] + steps * line[i]));
            value.is_none_or(|value| value < pattern.threshold)
        })
    };
    // The row may run well off the middle: up and down first, then along the row in the middle.
    for line in [LINES[1], LINES[0]] {
        let chord = edges(at, line)?;
        if !is_dark_at(at, line, chord, DARK_TO) {
            return None;
        }
        at = [0, 1].map(|i| at[i] + line[i] * libm::round(chord[0]) as i32);
    }
    let beyond = if beside_rings { DARK_BESIDE_RINGS_TO } else { DARK_TO };
    let (mut middles, mut halves) = ([0.0; LINES.len()], [0.0; LINES.len()]);
    for ((middle, half), line) in middles.iter_mut().zip(&mut halves).zip(LINES) {
        let length = libm::sqrt(f64::from(line[0] * line[0] + line[1] * line[1]));
        let chord = edges(at, line)?;
        if !is_dark_at(at, line, chord, beyond) {
            return None;
        }
        [*middle, *half] = chord.map(|steps| steps * length);
    }
    let form = form_of(&halves)?;
    let centre = centre(&middles, &form)?;
    let determinant = form[0] * form[2] - form[1] * form[1];
    // The form is the inverse of four times the second moments.
    let shape = [form[2], -form[1], form[0]].map(|m| 0.25 * m / determinant);
    Some(Sighting { at: [0, 1].map(|i| f64::from(at[i]) + centre[i]), shape, ratio: f64::INFINITY })
}

/// Steps from a bright pixel to where it turns dark.
fn edge(frame: &Frame, at: [i32; 2], step: [i32; 2], threshold: u8, reach: i32) -> Option<f64> {
    let mut ray = Ray::new(frame, at, step);
    let mut before = ray.next().filter(|value| *value >= threshold)?;
    for i in 1..=reach {
        let now = ray.next()?;
        if now < threshold {
            let [from, to, threshold] = [before, now, threshold].map(f64::from);
            return Some(f64::from(i) - (threshold - to) / (from - to));
        }
        before = now;
    }
    None
}
