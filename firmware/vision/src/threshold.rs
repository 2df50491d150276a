//! P-tile threshold (thesis 3.2.5, equation 3.2), half way between the two levels that the known ring share gives.

use crate::loader::Plane;

/// Share of the window's samples that are brighter than its bright level. White paper fills at least this
/// much of a window of 2 to 3 diameters, even where a post hides part of it.
const BRIGHT_SHARE: f64 = 0.2;

/// Rows that are sampled at the least, where a window has as many: the levels are means over enough samples.
const SAMPLED_ROWS: usize = 20;

/// The two levels of a window, 0 to 255.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Levels {
    pub(crate) dark: f64,
    pub(crate) bright: f64,
}

impl Levels {
    /// Samples below this are dark.
    pub(crate) fn threshold(&self) -> u8 {
        libm::ceil(0.5 * (self.dark + self.bright)).clamp(1.0, 255.0) as u8
    }
}

/// Levels of a window of which `ring_share` is the ring's black: dark is the mean of the darkest such share,
/// bright the level that a fifth of the samples exceed.
pub(crate) fn levels(plane: &Plane, ring_share: f64) -> Levels {
    let histogram = histogram(plane);
    let count: u32 = histogram.iter().map(|&n| u32::from(n)).sum();

    let wanted = (ring_share * f64::from(count)).max(1.0) as u32;
    let (mut taken, mut sum) = (0u32, 0u32);
    for (&n, level) in histogram.iter().zip(0u32..) {
        // Of the bin in which the share ends, only what is missing.
        let part = u32::from(n).min(wanted - taken);
        taken += part;
        sum += part * level;
        if taken >= wanted {
            break;
        }
    }

    let limit = (BRIGHT_SHARE * f64::from(count)) as u32;
    let (mut above, mut bright) = (0u32, 0u32);
    for (&n, level) in histogram.iter().rev().zip((0..=255u32).rev()) {
        above += u32::from(n);
        bright = level;
        if above > limit {
            break;
        }
    }
    Levels { dark: f64::from(sum) / f64::from(taken.max(1)), bright: f64::from(bright) }
}

/// Histogram of every second sample of a row, and of every second row or fewer where the window is large.
fn histogram(plane: &Plane) -> [u16; 256] {
    // Two tables, so that equal neighbours do not wait for one another. At most 192 * 192 / 4 samples: fits u16.
    let (mut even, mut odd) = ([0u16; 256], [0u16; 256]);
    let every = (plane.height() / SAMPLED_ROWS).max(1);
    for row in plane.rows().iter().step_by(every) {
        let row = row.get(..plane.width()).unwrap_or_default();
        let mut quads = row.chunks_exact(4);
        for quad in &mut quads {
            even[quad[0] as usize] += 1;
            odd[quad[2] as usize] += 1;
        }
        if let Some(&sample) = quads.remainder().first() {
            even[sample as usize] += 1;
        }
    }
    even.iter_mut().zip(odd).for_each(|(sum, n)| *sum += n);
    even
}
