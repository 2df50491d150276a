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
/// Edges that are written down at once: more than that are rare in as many pixels as a word has bits.
const AT_ONCE: usize = 8;
/// Least contrast as a share of the white: noise in an even white is not a pattern.
const LEAST_SHARE: u16 = 4;

/// Least thickness of a run, px.
const THINNEST: u32 = 2;

/// Widths of a ring in a row, off the middle too, px.
const WIDTHS_PX: [u32; 2] = [(0.8 * DIAMETERS_PX[0]) as u32, (1.3 * DIAMETERS_PX[1]) as u32];

/// Widths of a disc in a row, off the middle too, px.
const DISC_WIDTHS_PX: [usize; 2] = [4, WIDTHS_PX[1] as usize];

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
    /// Columns in which it turns black and white, in turn; it begins white.
    edges: [u16; MAX_WIDTH + AT_ONCE],
}

impl Row {
    pub(crate) const fn new() -> Self {
        Self { samples: [0; MAX_WIDTH], extremes: [(0, 0); BLOCKS + 1], edges: [0; MAX_WIDTH + AT_ONCE] }
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

        let count = self.find_edges(blocks, least);
        let (samples, edges) = (&self.samples, self.edges.get(..count).unwrap_or_default());
        // From white to black first: every second edge is the end of a ring, if it is one.
        for four in edges.windows(4).step_by(2) {
            if let &[a, b, c, d] = four
                && limits.allow([a, b, c, d].map(u32::from))
                && let Some(pattern) = pattern(samples, [a, b, c, d].map(usize::from))
                && pattern.contrast >= limits.contrast
            {
                found(pattern);
            }
        }
        if limits.discs {
            // The end of a disc is where it turns black again.
            for two in edges.get(1..).unwrap_or_default().as_chunks::<2>().0 {
                if let Some(pattern) = disc_pattern(samples, two.map(usize::from))
                    && pattern.contrast >= limits.contrast
                {
                    found(pattern);
                }
            }
        }
        count as u32
    }

    /// Writes down where so many blocks turn black and white, and gives how often they do.
    fn find_edges(&mut self, blocks: usize, least: u8) -> usize {
        let mut thresholds = [0u8; BLOCKS_A_WORD];
        let mut threshold = 0;
        // Extremes of the block before, of this one and of the next.
        let (mut before, mut here) = ((u8::MAX, 0), self.extremes.first().copied().unwrap_or((u8::MAX, 0)));
        let (mut count, mut carry) = (0, 0);
        let (words, _) = self.samples.as_chunks::<64>();
        for (word, first) in words.iter().take(blocks.div_ceil(BLOCKS_A_WORD)).zip((0u16..).step_by(64)) {
            let mut dark = 0;
            let mut is_mixed = false;
            let next = usize::from(first) / BLOCK + 1;
            let next = self.extremes.get(next..).unwrap_or_default();
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
            let changes = dark ^ (dark << 1 | carry);
            carry = dark >> 63;
            if changes != 0 {
                count = write_down(&mut self.edges, count, first, changes);
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

/// Writes down the places of all ones of a word, as columns from `first` on, behind the `count` edges that
/// are known, and gives how many there are then. The first ones without asking how many there are: their
/// number changes from word to word, and a branch on it is not foreseen.
#[inline(always)]
fn write_down(edges: &mut [u16], count: usize, first: u16, mut changes: u64) -> usize {
    let end = count + changes.count_ones() as usize;
    let mut at = count;
    loop {
        let Some(into) = edges.get_mut(at..at + AT_ONCE) else { return end.min(at) };
        for into in into {
            *into = first + changes.trailing_zeros() as u16;
            changes &= changes.wrapping_sub(1);
        }
        at += AT_ONCE;
        if changes == 0 {
            return end;
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
fn pattern(samples: &[u8; MAX_WIDTH], [a, b, c, d]: [usize; 4]) -> Option<Pattern> {
    let (left, middle, right) = ((a + b - 1) / 2, (b + c - 1) / 2, (c + d - 1) / 2);
    let black = *samples.get(left)?.max(samples.get(right)?);
    let white = *samples.get(middle)?;
    let contrast = white.saturating_sub(black);
    let threshold = black.midpoint(white).saturating_add(1);
    Some(Pattern { shape: Shape::Ring, middle: middle as u16, width: (d - a) as u16, contrast, threshold })
}

/// The white run between two edges, with as much dark on either side as half its width.
fn disc_pattern(samples: &[u8; MAX_WIDTH], [from, to]: [usize; 2]) -> Option<Pattern> {
    let width = to.checked_sub(from)?;
    if !(DISC_WIDTHS_PX[0]..=DISC_WIDTHS_PX[1]).contains(&width) {
        return None;
    }
    let beyond = width / 2 + 2;
    let middle = (from + to - 1) / 2;
    let white = *samples.get(middle)?;
    let left = *samples.get(from.checked_sub(beyond)?)?;
    let black = left.max(*samples.get(to + beyond)?);
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
    fn allow(&self, [a, b, c, d]: [u32; 4]) -> bool {
        let (left, middle, right) = (b - a, c - b, d - c);
        let black = left + right;
        let [least, most] = self.middle;
        // All at once: what a pattern fails in is not foreseen. Within an eighth and the rounding of edges.
        (left.abs_diff(right) * 8 <= black + 8)
            & (WIDTHS_PX[0]..=WIDTHS_PX[1]).contains(&(d - a))
            & (left.min(right).min(middle) >= THINNEST)
            // A pixel more or less of white is rounding.
            & ((middle + 1) * 64 >= least * black)
            & ((middle - 1) * 64 <= most * black)
    }
}

#[cfg(test)]
mod tests {
    use std::boxed::Box;
    use std::vec::Vec;

    use gangway_device::Layout;

    use super::*;
    use crate::synthetic::Random;

    #[test]
    fn every_change_between_black_and_white_is_written_down_however_dense_they_are() {
        let mut random = Random::new(5);
        let mut row = Box::new(Row::new());
        // Up to one pixel each: 64 changes in a word of 64 pixels.
        for longest in [1.0, 2.0, 6.0, 40.0] {
            let (mut line, mut expected) = (Vec::new(), Vec::new());
            while line.len() < 1000 {
                let value = if expected.len() % 2 == 0 { 200 } else { 40 };
                line.resize(line.len() + random.between(1.0, longest + 0.99) as usize, value);
                expected.push(line.len() as u16);
            }
            line.truncate(1000);
            expected.retain(|edge| *edge < 1000);
            let frame = Frame::new(&line, (1000, 1), 1000, Layout::GREY, 0, 0).unwrap();
            let limits = Limits::new(0.1, [2.0; 2]);
            let count = row.patterns(&frame, &(0..1000), 0, &limits, |_| {});
            assert_eq!(count as usize, expected.len(), "runs of up to {longest}");
            assert_eq!(row.edges[..expected.len()], expected, "runs of up to {longest}");
        }
    }
}
