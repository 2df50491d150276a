//! P-tile thresholds (thesis 3.2.5, equation 3.2): between the two levels that the known ring share gives,
//! half way first.

use crate::loader::View;

/// Share of the window's samples that are brighter than its bright level. White paper fills at least this
/// much of a window of 2 to 3 diameters, even where a post hides part of it.
const BRIGHT_SHARE: f64 = 0.2;

/// Rows that are sampled at the least, where a window has as many: the levels are means over enough samples.
/// Of a disc that is hardly more than a point none may be missed.
const SAMPLED_ROWS: usize = 10;
const SAMPLED_DISC_ROWS: usize = 24;

/// Where between dark and bright a threshold lies first, and where else a small ring is looked for: blur
/// fills its hole.
pub(crate) const MIDDLE: f64 = 0.5;
const ELSEWHERE: [f64; 3] = [MIDDLE, 0.35, 0.2];

/// Rings up to this diameter are looked for elsewhere, px.
const SMALL_PX: f64 = 16.0;

/// White that is brighter than a window's bright level by this share of the contrast is a narrow margin on
/// something darker.
const NARROW: f64 = 0.2;

/// The levels of a window, 0 to 255: black, what a fifth of it exceeds, and what as much as the ring's hole
/// exceeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Levels {
    pub(crate) dark: f64,
    pub(crate) bright: f64,
    pub(crate) white: f64,
}

/// How a window is made binary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cut {
    /// Samples below this are dark.
    pub(crate) threshold: u8,
    /// Whether noise may be filtered out: of a small ring that blur fills a filter leaves nothing.
    pub(crate) filtered: bool,
}

impl Levels {
    /// The threshold a share of the way from the dark to the bright level.
    pub(crate) fn threshold(&self, share: f64) -> u8 {
        libm::ceil(self.dark + share * (self.bright - self.dark)).clamp(1.0, 255.0) as u8
    }

    /// How to look for a ring of a diameter, px, one after the other until it is found. A contrast of less
    /// than `least` shows none.
    pub(crate) fn cuts(&self, diameter_px: f64, least: f64) -> impl Iterator<Item = Cut> {
        let is_narrow = self.white - self.bright > NARROW * (self.white - self.dark);
        let is_small = diameter_px < SMALL_PX;
        let brights = [Some(self.bright), is_narrow.then_some(self.white)].into_iter().flatten();
        let levels = brights.map(|bright| Self { bright, ..*self });
        let levels = levels.filter(move |levels| levels.bright - levels.dark >= least);
        let cut = |levels: Self, share, filtered| Cut { threshold: levels.threshold(share), filtered };
        let first = levels.clone().map(move |levels| cut(levels, MIDDLE, true));
        let elsewhere = levels.filter(move |_| is_small);
        first.chain(elsewhere.flat_map(move |levels| ELSEWHERE.map(|share| cut(levels, share, false))))
    }
}

/// Levels that count as one: the centre is fitted to the grey levels themselves.
const BIN: u32 = 4;
const BINS: usize = 64;

/// Levels of a window of which `ring_share` is the ring's black and `hole_share` its hole: dark is the mean
/// of the darkest such share, bright the level that a fifth of the samples exceed, white that which the
/// hole's share does.
pub(crate) fn levels(view: &View, ring_share: f64, hole_share: f64) -> Levels {
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

    let limits = [BRIGHT_SHARE, hole_share].map(|share| (share * f64::from(count)) as u32);
    let mut above = 0u32;
    let mut white = None;
    for (&n, bin) in histogram.iter().rev().zip((0..BINS as u32).rev()) {
        above += u32::from(n);
        if above > limits[1] {
            white = white.or(Some(level(bin)));
        }
        if above > limits[0] {
            return Levels { dark, bright: level(bin), white: white.unwrap_or(level(bin)) };
        }
    }
    Levels { dark, bright: level(0), white: level(0) }
}

/// Share of a window's samples that are darker than its dark level, where a bright disc is looked for in it.
const DARK_SHARE: f64 = 0.5;

/// Levels of a window of which `disc_share` is a bright disc: bright is the mean of the brightest such share,
/// dark the level that half of the samples stay below.
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
            return Levels { dark: level(bin), bright, white: bright };
        }
    }
    Levels { dark: level(0), bright, white: bright }
}

/// Histogram of every second sample of a row, and of every second row or fewer where the window is large.
fn histogram(view: &View, rows: usize) -> [u16; BINS] {
    // Four tables, so that equal neighbours do not wait for one another. At most 192 * 192 / 4 samples: fits
    // u16.
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
