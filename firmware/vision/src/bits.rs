//! The binary window, one bit a pixel, and the filters on it (thesis 3.2.5): median and opening.
//!
//! The median commutes with a threshold, so the 3x3 median of the grey window, thresholded, is the majority
//! of nine bits: 64 pixels at a time, by adders of single bits.

use multiversion::multiversion;

use crate::MAX_SIDE;
use crate::loader::View;

/// Words of 64 pixels in the longest row.
pub(crate) const WORDS: usize = MAX_SIDE / 64;
const _: () = assert!(MAX_SIDE.is_multiple_of(64));

/// One row; bit `x % 64` of word `x / 64` is pixel `x`, set where it is dark. Bits beyond the width are
/// clear.
type Row = [u64; WORDS];

/// What a filter knows of the first `N` words of a row.
type Pair<const N: usize> = ([u64; N], [u64; N]);

/// A binary window.
pub(crate) struct Bits {
    rows: [Row; MAX_SIDE],
    width: usize,
    height: usize,
}

impl Bits {
    pub(crate) const fn new() -> Self {
        Self { rows: [[0; WORDS]; MAX_SIDE], width: 0, height: 0 }
    }

    pub(crate) fn width(&self) -> usize {
        self.width
    }

    pub(crate) fn height(&self) -> usize {
        self.height
    }

    /// All pixels of a row.
    pub(crate) fn row_mask(&self) -> [u64; WORDS] {
        row_mask(self.width)
    }

    /// The last pixel of a row.
    pub(crate) fn last_pixel(&self) -> [u64; WORDS] {
        last_pixel(self.width)
    }

    pub(crate) fn rows(&self) -> &[Row] {
        self.rows.get(..self.height).unwrap_or_default()
    }

    /// Sets the pixels of `view` that are below `threshold`.
    pub(crate) fn pack(&mut self, view: &View, threshold: u8) {
        (self.width, self.height) = (view.width(), view.height());
        match self.width.div_ceil(64) {
            0 | 1 => self.pack_words::<1>(view, threshold),
            2 => self.pack_words::<2>(view, threshold),
            _ => self.pack_words::<WORDS>(view, threshold),
        }
    }

    fn pack_words<const N: usize>(&mut self, view: &View, threshold: u8) {
        let mask = row_mask(self.width);
        for (bits, samples) in self.rows.iter_mut().zip(view.rows(1)) {
            let blocks = samples.as_chunks().0;
            *bits = core::array::from_fn(|i| if i < N { below(&blocks[i], threshold) & mask[i] } else { 0 });
        }
    }

    /// The 3x3 median; beyond the window's edge its own pixels go on.
    pub(crate) fn median(&mut self) {
        match self.width.div_ceil(64) {
            0 | 1 => self.filter(sums_of_three::<1>, majority),
            2 => self.filter(sums_of_three::<2>, majority),
            _ => self.filter(sums_of_three::<3>, majority),
        }
    }

    /// Opening by the 3x3 disk (the cross): islands and spikes thinner than it go. Beyond the window's edge
    /// nothing is eroded.
    pub(crate) fn open(&mut self) {
        match self.width.div_ceil(64) {
            0 | 1 => {
                self.filter(all_of_three::<1>, eroded);
                self.filter(any_of_three::<1>, dilated);
            }
            2 => {
                self.filter(all_of_three::<2>, eroded);
                self.filter(any_of_three::<2>, dilated);
            }
            _ => {
                self.filter(all_of_three::<3>, eroded);
                self.filter(any_of_three::<3>, dilated);
            }
        }
    }

    /// Makes every row of `N` words from what `along` makes of it and of the rows above and below it; the
    /// first and last stand in for those outside.
    #[inline(always)]
    fn filter<const N: usize>(
        &mut self,
        along: impl Fn(&[u64; N], &Row) -> Pair<N>,
        across: impl Fn(&Pair<N>, &Pair<N>, &Pair<N>, usize) -> u64,
    ) {
        let (mask, last) = (row_mask(self.width), last_pixel(self.width));
        let along = |row: &Row| along(&core::array::from_fn(|i| row[i]), &last);
        let rows = self.rows.get_mut(..self.height).unwrap_or_default();
        let Some(first) = rows.first() else { return };
        let mut above = along(first);
        let mut present = above;
        let mut put = |row: &mut Row, below: Option<Pair<N>>| {
            let below = below.unwrap_or(present);
            for i in 0..N {
                row[i] = across(&above, &present, &below, i) & mask[i];
            }
            (above, present) = (present, below);
        };
        for y in 1..rows.len() {
            let below = along(&rows[y]);
            put(&mut rows[y - 1], Some(below));
        }
        if let Some(row) = rows.last_mut() {
            put(row, None);
        }
    }

    /// A window made by hand.
    #[cfg(test)]
    pub(crate) fn of(width: usize, height: usize, is_dark: impl Fn(usize, usize) -> bool) -> Self {
        let mut bits = Self { width, height, ..Self::new() };
        for (y, row) in bits.rows.iter_mut().take(height).enumerate() {
            (0..width).for_each(|x| row[x / 64] |= u64::from(is_dark(x, y)) << (x % 64));
        }
        bits
    }

    /// Whether pixel (x, y) is dark.
    #[cfg(test)]
    pub(crate) fn get(&self, x: usize, y: usize) -> bool {
        self.rows[y][x / 64] >> (x % 64) & 1 == 1
    }
}

/// Bit `i` says whether byte `i` is below `threshold`.
#[inline(always)]
fn below(block: &[u8; 64], threshold: u8) -> u64 {
    let mut columns = [0; 16];
    compare(block, threshold, &mut columns);
    let [low, high] = [0, 8].map(|first| u64::from_le_bytes(core::array::from_fn(|j| columns[first + j])));
    transposed(low | high << 1)
}

/// Bit 2 k of column j says whether byte 16 k + j is below `threshold`. Not inlined: so the compiler compares
/// sixteen bytes at a time.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn compare(block: &[u8; 64], threshold: u8, columns: &mut [u8; 16]) {
    let (rows, _) = block.as_chunks::<16>();
    let below = |row: usize, j: usize| u8::from(rows[row][j] < threshold);
    for (j, column) in columns.iter_mut().enumerate() {
        *column = below(0, j) | below(1, j) << 2 | below(2, j) << 4 | below(3, j) << 6;
    }
}

/// Bit k of byte j for bit j of byte k: swaps single bits, then squares of 2 x 2, then of 4 x 4 (H. S.
/// Warren, Hacker's Delight, 7-3).
#[inline(always)]
pub(crate) fn transposed(mut x: u64) -> u64 {
    for (mask, shift) in
        [(0x00aa_00aa_00aa_00aa, 7), (0x0000_cccc_0000_cccc, 14), (0x0000_0000_f0f0_f0f0, 28)]
    {
        let swapped = (x ^ (x >> shift)) & mask;
        x ^= swapped ^ (swapped << shift);
    }
    x
}

/// All pixels of a row of `width`.
fn row_mask(width: usize) -> Row {
    core::array::from_fn(|word| match width.saturating_sub(64 * word) {
        0 => 0,
        n @ 1..64 => (1 << n) - 1,
        _ => u64::MAX,
    })
}

/// The last pixel of a row of `width`.
fn last_pixel(width: usize) -> Row {
    core::array::from_fn(|word| match width.wrapping_sub(1 + 64 * word) {
        bit @ 0..64 => 1 << bit,
        _ => 0,
    })
}

/// Every pixel's left neighbour; that of the first is `first`.
#[inline(always)]
fn left<const N: usize>(row: &[u64; N], first: u64) -> [u64; N] {
    core::array::from_fn(|i| row[i] << 1 | if i == 0 { first & 1 } else { row[i - 1] >> 63 })
}

/// Every pixel's right neighbour; that of the last is clear.
#[inline(always)]
fn right<const N: usize>(row: &[u64; N]) -> [u64; N] {
    core::array::from_fn(|i| row[i] >> 1 | if i + 1 < N { row[i + 1] << 63 } else { 0 })
}

/// At least two of three.
#[inline(always)]
fn two_of(a: u64, b: u64, c: u64) -> u64 {
    (a & b) | (c & (a | b))
}

/// How many of a pixel and its two neighbours in the row are set: ones and twos.
#[inline(always)]
fn sums_of_three<const N: usize>(row: &[u64; N], last: &Row) -> Pair<N> {
    let (l, r) = (left(row, row[0]), right(row));
    let r: [u64; N] = core::array::from_fn(|i| r[i] | (row[i] & last[i]));
    (core::array::from_fn(|i| l[i] ^ row[i] ^ r[i]), core::array::from_fn(|i| two_of(l[i], row[i], r[i])))
}

/// Whether at least five of nine are set, by the sums of three rows.
#[inline(always)]
fn majority<const N: usize>(above: &Pair<N>, row: &Pair<N>, below: &Pair<N>, i: usize) -> u64 {
    let ones = above.0[i] ^ row.0[i] ^ below.0[i];
    let carry = two_of(above.0[i], row.0[i], below.0[i]);
    // Of four twos: at least two, at least three. Nine bits make five or more if there are three twos, or two
    // twos and a one.
    let (ab_and, ab_or) = (above.1[i] & row.1[i], above.1[i] | row.1[i]);
    let (cd_and, cd_or) = (below.1[i] & carry, below.1[i] | carry);
    let two = ab_and | cd_and | (ab_or & cd_or);
    let three = (ab_and & cd_or) | (cd_and & ab_or);
    three | (two & ones)
}

/// A row, and its pixels whose neighbours in it are set as well.
#[inline(always)]
fn all_of_three<const N: usize>(row: &[u64; N], last: &Row) -> Pair<N> {
    let (l, r) = (left(row, 1), right(row));
    (*row, core::array::from_fn(|i| row[i] & l[i] & (r[i] | last[i])))
}

#[inline(always)]
fn eroded<const N: usize>(above: &Pair<N>, row: &Pair<N>, below: &Pair<N>, i: usize) -> u64 {
    above.0[i] & row.1[i] & below.0[i]
}

/// A row, and its pixels that are set or have a neighbour in it that is.
#[inline(always)]
fn any_of_three<const N: usize>(row: &[u64; N], _: &Row) -> Pair<N> {
    let (l, r) = (left(row, 0), right(row));
    (*row, core::array::from_fn(|i| row[i] | l[i] | r[i]))
}

#[inline(always)]
fn dilated<const N: usize>(above: &Pair<N>, row: &Pair<N>, below: &Pair<N>, i: usize) -> u64 {
    above.0[i] | row.1[i] | below.0[i]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loader::Plane;
    use crate::synthetic::Random;

    fn noise(width: usize, height: usize, seed: u64) -> std::vec::Vec<u8> {
        let mut random = Random::new(seed);
        (0..width * height).map(|_| random.next() as u8).collect()
    }

    const SIZES: [(usize, usize); 9] =
        [(1, 1), (1, 5), (5, 1), (17, 9), (63, 4), (64, 3), (65, 7), (129, 5), (192, 6)];

    fn clamped(x: usize, d: isize, n: usize) -> usize {
        x.saturating_add_signed(d).min(n - 1)
    }

    #[test]
    fn packing_is_comparing() {
        for (width, height) in SIZES {
            for threshold in [1, 2, 127, 128, 129, 254, 255] {
                let samples = noise(width, height, u64::from(threshold));
                let mut plane = std::boxed::Box::new(Plane::new());
                let mut bits = Bits::new();
                bits.pack(&plane.fill(width, height, |x, y| samples[y * width + x]), threshold);
                for y in 0..height {
                    for x in 0..MAX_SIDE {
                        assert_eq!(bits.get(x, y), x < width && samples[y * width + x] < threshold);
                    }
                }
            }
        }
    }

    #[test]
    fn the_majority_of_bits_is_the_threshold_of_the_median() {
        for (width, height) in SIZES {
            let samples = noise(width, height, 3);
            let mut bits = Bits::of(width, height, |x, y| samples[y * width + x] < 120);
            bits.median();
            for y in 0..height {
                for x in 0..width {
                    let mut nine: std::vec::Vec<u8> = (0..9)
                        .map(|i| {
                            samples[clamped(y, i / 3 - 1, height) * width + clamped(x, i % 3 - 1, width)]
                        })
                        .collect();
                    nine.sort_unstable();
                    assert_eq!(bits.get(x, y), nine[4] < 120, "{width} x {height} at {x}, {y}");
                }
            }
        }
    }

    #[test]
    fn opening_is_erosion_then_dilation_by_the_cross() {
        const CROSS: [(isize, isize); 5] = [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)];
        for (width, height) in SIZES {
            let samples = noise(width, height, 4);
            let mut bits = Bits::of(width, height, |x, y| samples[y * width + x] < 200);
            let dark = |x: isize, y: isize| {
                let inside = x >= 0 && y >= 0 && x < width as isize && y < height as isize;
                inside.then(|| samples[y as usize * width + x as usize] < 200)
            };
            let eroded = |x: isize, y: isize| {
                dark(x, y).is_some() && CROSS.iter().all(|(dx, dy)| dark(x + dx, y + dy) != Some(false))
            };
            bits.open();
            for y in 0..height {
                for x in 0..width {
                    let naive = CROSS.iter().any(|(dx, dy)| eroded(x as isize + dx, y as isize + dy));
                    assert_eq!(bits.get(x, y), naive, "{width} x {height} at {x}, {y}");
                }
            }
        }
    }
}
