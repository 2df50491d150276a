//! P-tile threshold (thesis 3.2.5, equation 3.2), half way between the two levels that the known ring share gives.

use crate::loader::View;

/// Share of the window's samples that are brighter than its bright level. White paper fills at least this
/// much of a window of 2 to 3 diameters, even where a post hides part of it.
const BRIGHT_SHARE: f64 = 0.2;

/// Rows that are sampled at the least, where a window has as many: the levels are means over enough samples. Of a disc
/// that is hardly more than a point none may be missed.
const SAMPLED_ROWS: usize = 10;
const SAMPLED_DISC_ROWS: usize = 24;

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

/// Levels that count as one: the centre is fitted to the grey levels themselves.
const BIN: u32 = 4;
const BINS: usize = 64;

/// Levels of a window of which `ring_share` is the ring's black: dark is the mean of the darkest such share,
/// bright the level that a fifth of the samples exceed.
pub(crate) fn levels(view: &View, ring_share: f64) -> Levels {
    let histogram = histogram(view, SAMPLED_ROWS);
    let count: u32 = histogram.iter().map(|&n| u32::from(n)).sum();
    // The middle of a bin.
    let level = |bin: u32| f64::from(BIN * bin) + 0.5 * f64::from(BIN - 1);

    let wanted = (ring_share * f64::from(count)).max(1.0) as u32;
    let (mut taken, mut sum) = (0u32, 0u32);
    for (&n, bin) in histogram.iter().zip(0u32..) {
        // Of the bin in which the share ends, only what is missing.
        let part = u32::from(n).min(wanted - taken);
        taken += part;
        sum += part * bin;
        if taken >= wanted {
            break;
        }
    }
    let dark = level(0) + f64::from(BIN * sum) / f64::from(taken.max(1));

    let limit = (BRIGHT_SHARE * f64::from(count)) as u32;
    let mut above = 0u32;
    for (&n, bin) in histogram.iter().rev().zip((0..BINS as u32).rev()) {
        above += u32::from(n);
        if above > limit {
            return Levels { dark, bright: level(bin) };
        }
    }
    Levels { dark, bright: level(0) }
}

/// Share of a window's samples that are darker than its dark level, where a bright disc is looked for in it.
const DARK_SHARE: f64 = 0.5;

/// Levels of a window of which `disc_share` is a bright disc: bright is the mean of the brightest such share, dark the
/// level that half of the samples stay below.
pub(crate) fn disc_levels(view: &View, disc_share: f64) -> Levels {
    let histogram = histogram(view, SAMPLED_DISC_ROWS);
    let count: u32 = histogram.iter().map(|&n| u32::from(n)).sum();
    let level = |bin: u32| f64::from(BIN * bin) + 0.5 * f64::from(BIN - 1);
    let wanted = (disc_share * f64::from(count)).max(1.0) as u32;
    let (mut taken, mut sum) = (0u32, 0u32);
    for (&n, bin) in histogram.iter().zip(0..BINS as u32).rev() {
        let part = u32::from(n).min(wanted - taken);
        taken += part;
        sum += part * bin;
        if taken >= wanted {
            break;
        }
    }
    let bright = level(0) + f64::from(BIN * sum) / f64::from(taken.max(1));
    let limit = (DARK_SHARE * f64::from(count)) as u32;
    let mut below = 0u32;
    for (&n, bin) in histogram.iter().zip(0..BINS as u32) {
        below += u32::from(n);
        if below > limit {
            return Levels { dark: level(bin), bright };
        }
    }
    Levels { dark: level(0), bright }
}

/// Histogram of every second sample of a row, and of every second row or fewer where the window is large.
fn histogram(view: &View, rows: usize) -> [u16; BINS] {
    // Four tables, so that equal neighbours do not wait for one another. At most 192 * 192 / 4 samples: fits u16.
    let mut tables = [[0u16; BINS]; 4];
    for row in view.rows((view.height() / rows).max(1)) {
        let row = row.get(..view.width()).unwrap_or_default();
        let (eights, rest) = row.as_chunks::<8>();
        for eight in eights {
            for (table, &sample) in tables.iter_mut().zip(eight.iter().step_by(2)) {
                table[sample as usize / BIN as usize] += 1;
            }
        }
        for (table, &sample) in tables.iter_mut().zip(rest.iter().step_by(2)) {
            table[sample as usize / BIN as usize] += 1;
        }
    }
    core::array::from_fn(|bin| tables.iter().map(|table| table[bin]).sum())
}
