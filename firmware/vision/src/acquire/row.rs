//! One row of the picture, black and white by a threshold of its surroundings, and where it runs as through a
//! ring.

use core::ops::Range;

use gangway_device::Frame;
use multiversion::multiversion;

use crate::acquire::DIAMETERS_PX;
use crate::bits::transposed;
use crate::loader;

/// Longest row.
const MAX_WIDTH: usize = 4096;
/// Pixels that share a threshold; it is midway between the extremes of three such blocks.
const BLOCK: usize = 32;
const BLOCKS: usize = MAX_WIDTH / BLOCK;
const BLOCKS_A_WORD: usize = 64 / BLOCK;
const BLOCK_OF_ONES: u64 = u64::MAX >> (64 - BLOCK);
/// Least contrast as a share of the white: noise in an even white is not a pattern.
const LEAST_SHARE: u16 = 4;

/// Least thickness of a run, px.
const THINNEST: u32 = 2;

/// Widths of a ring in a row, off the middle too, px.
const WIDTHS_PX: [u32; 2] = [(0.8 * DIAMETERS_PX[0]) as u32, (1.3 * DIAMETERS_PX[1]) as u32];

/// Widths of a disc in a row, off the middle too, px.
const DISC_WIDTHS_PX: [u32; 2] = [4, WIDTHS_PX[1]];

/// What a pattern could be of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    Ring,
    Disc,
}

/// What is asked of a pattern.
pub(crate) struct Limits {
    /// Bright runs on dark are looked at as well.
    discs: bool,
    /// Least difference between black and white.
    contrast: u8,
    /// Least and greatest white between the blacks, over both of them, in 64ths.
    middle: [u32; 2],
}

/// Black, white and black as through a ring, or white as through a disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pattern {
    pub(crate) shape: Shape,
    /// Column of its middle.
    pub(crate) middle: u16,
    /// From its first black to its last, or the width of its white, px.
    pub(crate) width: u16,
    /// White minus black.
    contrast: u8,
    /// Midway between black and white.
    pub(crate) threshold: u8,
}

/// A row with the extremes of its blocks.
pub(crate) struct Row {
    samples: [u8; MAX_WIDTH],
    /// Least and greatest sample of every block, and an empty one behind the last.
    extremes: [(u8, u8); BLOCKS + 1],
}

impl Row {
    pub(crate) const fn new() -> Self {
        Self { samples: [0; MAX_WIDTH], extremes: [(0, 0); BLOCKS + 1] }
    }

    /// Calls `found` with every run black, white, black in these columns of row `y` that could be a ring's;
    /// gives the number of changes between black and white. Pixels beyond the longest row are not looked at.
    pub(crate) fn patterns(
        &mut self,
        frame: &Frame,
        columns: &Range<u16>,
        y: u16,
        limits: &Limits,
        mut found: impl FnMut(Pattern),
    ) -> u32 {
        let least = limits.contrast;
        let first = columns.start;
        let width = usize::from(columns.end.min(frame.width()).saturating_sub(first)).min(MAX_WIDTH);
        let mut found = |pattern: Pattern| found(Pattern { middle: first + pattern.middle, ..pattern });
        let blocks = width.div_ceil(BLOCK);
        let Some(line) = self.samples.get_mut(..width) else { return 0 };
        loader::load_top(frame, (first, y), line);
        let last = line.last().copied().unwrap_or(0);
        if let Some(beyond) = self.samples.get_mut(width..blocks.next_multiple_of(BLOCKS_A_WORD) * BLOCK) {
            beyond.fill(last);
        }
        self.find_extremes(blocks);

        let mut thresholds = [0u8; BLOCKS_A_WORD];
        let mut threshold = 0;
        // Extremes of the block before, of this one and of the next.
        let (mut before, mut here) = ((u8::MAX, 0), self.extremes.first().copied().unwrap_or((u8::MAX, 0)));
        let (mut edges, mut count) = ([0u32; 4], 0);
        let mut carry = 0;
        let (words, _) = self.samples.as_chunks::<64>();
        for (k, word) in words.iter().take(blocks.div_ceil(BLOCKS_A_WORD)).enumerate() {
            let mut dark = 0;
            let mut is_mixed = false;
            let next = self.extremes.get(BLOCKS_A_WORD * k + 1..).unwrap_or_default();
            for (i, (into, next)) in thresholds.iter_mut().zip(next).enumerate() {
                let low = before.0.min(here.0).min(next.0);
                let high = before.1.max(here.1).max(next.1);
                if is_pattern(low, high, least) {
                    threshold = low.midpoint(high).saturating_add(1);
                }
                *into = threshold;
                // Most blocks are all white or all black.
                if here.1 < threshold {
                    dark |= BLOCK_OF_ONES << (BLOCK * i);
                } else {
                    is_mixed |= here.0 < threshold;
                }
                (before, here) = (here, *next);
            }
            if is_mixed {
                dark = below(word, &thresholds);
            }
            let mut changes = dark ^ (dark << 1 | carry);
            carry = dark >> 63;
            while changes != 0 {
                let bit = changes.trailing_zeros();
                changes &= changes - 1;
                count += 1;
                edges = [edges[1], edges[2], edges[3], 64 * k as u32 + bit];
                // From black to white: the end of a ring, if it is one.
                if dark >> bit & 1 == 0
                    && limits.allow(&edges)
                    && let Some(pattern) = pattern(&self.samples, &edges)
                    && pattern.contrast >= limits.contrast
                {
                    found(pattern);
                }
                // From white to black: the end of a disc.
                if limits.discs
                    && dark >> bit & 1 == 1
                    && let Some(pattern) = disc_pattern(&self.samples, &edges)
                    && pattern.contrast >= limits.contrast
                {
                    found(pattern);
                }
            }
        }
        count
    }

    fn find_extremes(&mut self, blocks: usize) {
        let (chunks, _) = self.samples.as_chunks::<BLOCK>();
        for (chunk, into) in chunks.iter().zip(&mut self.extremes).take(blocks) {
            *into = (least(chunk), most(chunk));
        }
        // Beyond the last block there is nothing.
        if let Some(beyond) = self.extremes.get_mut(blocks) {
            *beyond = (u8::MAX, 0);
        }
    }
}

/// Whether the difference between black and white is more than noise.
#[inline(always)]
fn is_pattern(low: u8, high: u8, least: u8) -> bool {
    let contrast = u16::from(high.saturating_sub(low));
    contrast > u16::from(least) && contrast * LEAST_SHARE > u16::from(high)
}

/// Least sample of a block. Not inlined, as `most`: so the compiler takes sixteen bytes at a time.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn least(block: &[u8; BLOCK]) -> u8 {
    block.iter().fold(u8::MAX, |least, sample| least.min(*sample))
}

/// Greatest sample of a block.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn most(block: &[u8; BLOCK]) -> u8 {
    block.iter().fold(0, |most, sample| most.max(*sample))
}

/// Bit `i` says whether byte `i` is below the threshold of its block.
#[inline(always)]
fn below(word: &[u8; 64], thresholds: &[u8; BLOCKS_A_WORD]) -> u64 {
    let mut columns = [0; 16];
    compare(word, thresholds, &mut columns);
    let [low, high] = [0, 8].map(|first| u64::from_le_bytes(core::array::from_fn(|j| columns[first + j])));
    transposed(low | high << 1)
}

/// Bit 2 k of column j says whether byte 16 k + j is below its threshold. Not inlined: so the compiler
/// compares sixteen bytes at a time.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn compare(word: &[u8; 64], thresholds: &[u8; BLOCKS_A_WORD], columns: &mut [u8; 16]) {
    let (rows, _) = word.as_chunks::<16>();
    let below = |row: usize, j: usize| u8::from(rows[row][j] < thresholds[row * 16 / BLOCK]);
    for (j, column) in columns.iter_mut().enumerate() {
        *column = below(0, j) | below(1, j) << 2 | below(2, j) << 4 | below(3, j) << 6;
    }
}

/// The pattern between four edges: where its middle is and what black and white are there.
fn pattern(samples: &[u8; MAX_WIDTH], edges: &[u32; 4]) -> Option<Pattern> {
    let [a, b, c, d] = edges.map(|edge| edge as usize);
    let (left, middle, right) = ((a + b - 1) / 2, (b + c - 1) / 2, (c + d - 1) / 2);
    let black = *samples.get(left)?.max(samples.get(right)?);
    let white = *samples.get(middle)?;
    let contrast = white.saturating_sub(black);
    let threshold = black.midpoint(white).saturating_add(1);
    Some(Pattern { shape: Shape::Ring, middle: middle as u16, width: (d - a) as u16, contrast, threshold })
}

/// The white run that has just ended, with as much dark on either side as half its width.
fn disc_pattern(samples: &[u8; MAX_WIDTH], edges: &[u32; 4]) -> Option<Pattern> {
    let [from, to] = [edges[2], edges[3]];
    let width = to.checked_sub(from)?;
    if !(DISC_WIDTHS_PX[0]..=DISC_WIDTHS_PX[1]).contains(&width) {
        return None;
    }
    let beyond = width / 2 + 2;
    let middle = (from + to - 1) / 2;
    let white = *samples.get(middle as usize)?;
    let left = *samples.get(from.checked_sub(beyond)? as usize)?;
    let black = left.max(*samples.get((to + beyond) as usize)?);
    let contrast = white.saturating_sub(black);
    let threshold = black.midpoint(white).saturating_add(1);
    Some(Pattern { shape: Shape::Disc, middle: middle as u16, width: width as u16, contrast, threshold })
}

impl Limits {
    /// Lets discs pass as well.
    pub(crate) fn take_discs(&mut self) {
        self.discs = true;
    }

    /// Limits for rings whose outer to inner diameter is from `ratios[0]` to `ratios[1]`, contrast as a share
    /// of full scale.
    pub(crate) fn new(min_contrast: f64, ratios: [f64; 2]) -> Self {
        // White between the blacks over both of them: 1 / (ratio - 1) in the middle, down to about a third of
        // it where the row nearly misses the inner disc.
        let middle = [0.35 / (ratios[1] - 1.0), 1.35 / (ratios[0] - 1.0)];
        Self {
            discs: false,
            contrast: (min_contrast * 255.0).min(255.0) as u8,
            middle: middle.map(|m| (m * 64.0) as u32),
        }
    }

    /// Whether a row that changes at these four places, from white to black first, can run through a ring.
    /// Ellipses about one centre and of one shape cut any line about the same middle: both runs of black are
    /// equally long.
    #[inline(always)]
    fn allow(&self, &[a, b, c, d]: &[u32; 4]) -> bool {
        let (left, middle, right) = (b - a, c - b, d - c);
        let black = left + right;
        // Within an eighth and the rounding of edges. Asked first: it is what most patterns fail in.
        if left.abs_diff(right) * 8 > black + 8 || d - a < WIDTHS_PX[0] || d - a > WIDTHS_PX[1] {
            return false;
        }
        // A pixel more or less of white is rounding.
        let [least, most] = self.middle;
        left.min(right).min(middle) >= THINNEST
            && (middle + 1) * 64 >= least * black
            && (middle - 1) * 64 <= most * black
    }
}
