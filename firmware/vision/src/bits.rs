//! The binary window, one bit a pixel, and the filters on it (thesis 3.2.5): median and opening.
//!
//! The median commutes with a threshold, so the 3x3 median of the grey window, thresholded, is the majority
//! of nine bits: 64 pixels at a time, by adders of single bits.

use crate::MAX_SIDE;
use crate::loader::Plane;

/// Words of 64 pixels in the longest row.
pub(crate) const WORDS: usize = MAX_SIDE / 64;
const _: () = assert!(MAX_SIDE.is_multiple_of(64));

/// One row; bit `x % 64` of word `x / 64` is pixel `x`, set where it is dark. Bits beyond the width are clear.
type Row = [u64; WORDS];

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

    pub(crate) fn rows(&self) -> &[Row] {
        self.rows.get(..self.height).unwrap_or_default()
    }

    /// Sets the pixels of `plane` that are below `threshold`.
    pub(crate) fn pack(&mut self, plane: &Plane, threshold: u8) {
        (self.width, self.height) = (plane.width(), plane.height());
        let mask = row_mask(self.width);
        let words = self.width.div_ceil(64);
        for (bits, samples) in self.rows.iter_mut().zip(plane.rows()) {
            *bits = [0; WORDS];
            let (blocks, _) = samples.as_chunks::<64>();
            for ((word, block), mask) in bits.iter_mut().zip(blocks).zip(mask).take(words) {
                *word = below(block, threshold) & mask;
            }
        }
    }

    /// The 3x3 median; beyond the window's edge its own pixels go on.
    pub(crate) fn median(&mut self) {
        match self.width.div_ceil(64) {
            0 | 1 => self.filter(median_row::<1>),
            2 => self.filter(median_row::<2>),
            _ => self.filter(median_row::<3>),
        }
    }

    /// Opening by the 3x3 disk (the cross): islands and spikes thinner than it go. Beyond the window's edge
    /// nothing is eroded.
    pub(crate) fn open(&mut self) {
        match self.width.div_ceil(64) {
            0 | 1 => {
                self.filter(erode_row::<1>);
                self.filter(dilate_row::<1>);
            }
            2 => {
                self.filter(erode_row::<2>);
                self.filter(dilate_row::<2>);
            }
            _ => {
                self.filter(erode_row::<3>);
                self.filter(dilate_row::<3>);
            }
        }
    }

    /// Makes every row from itself and the rows above and below it; the first and last stand in for those
    /// outside.
    #[inline(always)]
    fn filter(&mut self, row: impl Fn(&Row, &Row, &Row, &Row, &Row) -> Row) {
        let (mask, last) = (row_mask(self.width), last_pixel(self.width));
        let rows = self.rows.get_mut(..self.height).unwrap_or_default();
        let Some(&first) = rows.first() else { return };
        let mut above = first;
        for y in 0..rows.len() {
            let present = rows[y];
            let below = rows.get(y + 1).copied().unwrap_or(present);
            rows[y] = row(&above, &present, &below, &mask, &last);
            above = present;
        }
    }

    /// Whether pixel (x, y) is dark.
    #[cfg(test)]
    pub(crate) fn get(&self, x: usize, y: usize) -> bool {
        self.rows[y][x / 64] >> (x % 64) & 1 == 1
    }
}

/// Bit `i` says whether byte `i` is below `threshold` (1 to 255), eight bytes at a time in one register.
#[inline(always)]
fn below(block: &[u8; 64], threshold: u8) -> u64 {
    const HIGH: u64 = 0x8080_8080_8080_8080;
    // Byte i of a product with this lands its lowest bit on bit 56 + i, and no two of them meet.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let low = u64::from(threshold & 0x7f) * 0x0101_0101_0101_0101;
    // A threshold of 128 or more: at least it only if the high bit is set as well; else, already if it is.
    let either = if threshold & 0x80 == 0 { u64::MAX } else { 0 };
    let (eights, _) = block.as_chunks::<8>();
    let mut word = 0;
    for (eight, i) in eights.iter().zip(0u32..) {
        let x = u64::from_le_bytes(*eight);
        // The high bit of a byte: whether its low seven bits reach the threshold's.
        let reaches = (x | HIGH) - low;
        let at_least = (x & reaches) | (either & (x | reaches));
        let below = !at_least & HIGH;
        word |= ((below >> 7).wrapping_mul(GATHER) >> 56) << (8 * i);
    }
    word
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
fn left<const N: usize>(row: &Row, first: u64) -> Row {
    let mut out = [0; WORDS];
    let mut carry = first & 1;
    for i in 0..N {
        out[i] = row[i] << 1 | carry;
        carry = row[i] >> 63;
    }
    out
}

/// Every pixel's right neighbour; that of the last is clear.
#[inline(always)]
fn right<const N: usize>(row: &Row) -> Row {
    let mut out = [0; WORDS];
    let mut carry = 0;
    for i in (0..N).rev() {
        out[i] = row[i] >> 1 | carry << 63;
        carry = row[i] & 1;
    }
    out
}

/// At least two of three.
#[inline(always)]
fn two_of(a: u64, b: u64, c: u64) -> u64 {
    (a & b) | (c & (a | b))
}

/// Sum of a pixel and its two neighbours in the row: ones and twos.
#[inline(always)]
fn three<const N: usize>(row: &Row, last: &Row) -> (Row, Row) {
    let (l, r) = (left::<N>(row, row[0]), right::<N>(row));
    let (mut ones, mut twos) = ([0; WORDS], [0; WORDS]);
    for i in 0..N {
        let r = r[i] | (row[i] & last[i]);
        ones[i] = l[i] ^ row[i] ^ r;
        twos[i] = two_of(l[i], row[i], r);
    }
    (ones, twos)
}

#[inline(always)]
fn median_row<const N: usize>(above: &Row, row: &Row, below: &Row, mask: &Row, last: &Row) -> Row {
    let (a1, a2) = three::<N>(above, last);
    let (b1, b2) = three::<N>(row, last);
    let (c1, c2) = three::<N>(below, last);
    let mut out = [0; WORDS];
    for i in 0..N {
        let ones = a1[i] ^ b1[i] ^ c1[i];
        let carry = two_of(a1[i], b1[i], c1[i]);
        // Of the four twos a2, b2, c2, carry: at least two, at least three. Nine bits make five or more if
        // there are three twos, or two twos and a one.
        let (ab_and, ab_or) = (a2[i] & b2[i], a2[i] | b2[i]);
        let (cd_and, cd_or) = (c2[i] & carry, c2[i] | carry);
        let two = ab_and | cd_and | (ab_or & cd_or);
        let three = (ab_and & cd_or) | (cd_and & ab_or);
        out[i] = (three | (two & ones)) & mask[i];
    }
    out
}

#[inline(always)]
fn erode_row<const N: usize>(above: &Row, row: &Row, below: &Row, _: &Row, last: &Row) -> Row {
    let (l, r) = (left::<N>(row, 1), right::<N>(row));
    let mut out = [0; WORDS];
    for i in 0..N {
        out[i] = row[i] & l[i] & (r[i] | last[i]) & above[i] & below[i];
    }
    out
}

#[inline(always)]
fn dilate_row<const N: usize>(above: &Row, row: &Row, below: &Row, mask: &Row, _: &Row) -> Row {
    let (l, r) = (left::<N>(row, 0), right::<N>(row));
    let mut out = [0; WORDS];
    for i in 0..N {
        out[i] = (row[i] | l[i] | r[i] | above[i] | below[i]) & mask[i];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::Random;

    fn noise(width: usize, height: usize, seed: u64) -> std::boxed::Box<Plane> {
        let mut random = Random::new(seed);
        let samples: std::vec::Vec<u8> = (0..width * height).map(|_| random.next() as u8).collect();
        Plane::from_fn(width, height, |x, y| samples[y * width + x])
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
                let plane = noise(width, height, u64::from(threshold));
                let mut bits = Bits::new();
                bits.pack(&plane, threshold);
                for y in 0..height {
                    for x in 0..MAX_SIDE {
                        assert_eq!(bits.get(x, y), x < width && plane.rows()[y][x] < threshold);
                    }
                }
            }
        }
    }

    #[test]
    fn the_majority_of_bits_is_the_threshold_of_the_median() {
        for (width, height) in SIZES {
            let plane = noise(width, height, 3);
            let mut bits = Bits::new();
            bits.pack(&plane, 120);
            bits.median();
            for y in 0..height {
                for x in 0..width {
                    let mut nine: std::vec::Vec<u8> = (0..9)
                        .map(|i| plane.rows()[clamped(y, i / 3 - 1, height)][clamped(x, i % 3 - 1, width)])
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
            let plane = noise(width, height, 4);
            let mut bits = Bits::new();
            bits.pack(&plane, 200);
            let dark = |x: isize, y: isize| {
                let inside = x >= 0 && y >= 0 && x < width as isize && y < height as isize;
                inside.then(|| plane.rows()[y as usize][x as usize] < 200)
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
