//! Connected components of the binary window (thesis 3.2.5): dark 8-connected, bright 4-connected, with area,
//! centroid and second moments of each.
//!
//! A ring is a dark component about a bright one that does not touch the window's edge: a hole. So the
//! outside is flooded first, a row of bits at a time; what it leaves are the holes, and the dark around each
//! is flooded in turn.

use core::ops::Range;

use crate::MAX_SIDE;
use crate::bits::{Bits, WORDS};

/// One row; bit `x % 64` of word `x / 64` is pixel `x`.
type Row = [u64; WORDS];

/// Most times that a flood goes down and up again. What winds more often is no ring.
const MAX_SWEEPS: usize = 16;

/// Most holes of a window that are looked at. A window full of rings and clutter has a few dozen.
const MAX_HOLES: usize = 256;

/// A window has too many holes or winds too much: noise, not a picture of rings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Clutter;

/// Area, moments and bounding box of a component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    /// Pixels.
    pub(crate) area: u32,
    /// First moments.
    sums: [u32; 2],
    /// Second moments about the window's corner: xx, xy, yy.
    squares: [u32; 3],
    /// First column and row.
    pub(crate) low: [u8; 2],
    /// Last column and row.
    pub(crate) high: [u8; 2],
}

impl Part {
    const EMPTY: Self = Self { area: 0, sums: [0; 2], squares: [0; 3], low: [0; 2], high: [0; 2] };

    /// Adds pixels `start` up to `end`, that one excluded, of row `y`, but for the bounding box.
    #[inline(always)]
    fn add_run(&mut self, y: u32, start: u32, end: u32) {
        let length = end - start;
        let [sums, squares] =
            [&SUMS, &SQUARES].map(|table| table[end as u8 as usize] - table[start as u8 as usize]);
        self.area += length;
        self.sums = [self.sums[0] + sums, self.sums[1] + length * y];
        let [xx, xy, yy] = self.squares;
        self.squares = [xx + squares, xy + sums * y, yy + length * y * y];
    }

    /// Centroid in the window.
    pub(crate) fn centroid(&self) -> [f64; 2] {
        let area = f64::from(self.area.max(1));
        self.sums.map(|sum| f64::from(sum) / area)
    }

    /// What is left of this without another one that lies within it and reaches its bounding box nowhere.
    pub(crate) fn without(&self, other: &Self) -> Self {
        Self {
            area: self.area - other.area,
            sums: [0, 1].map(|i| self.sums[i] - other.sums[i]),
            squares: [0, 1, 2].map(|i| self.squares[i] - other.squares[i]),
            ..*self
        }
    }

    /// Second central moments (uu, uv, vv) over the area.
    pub(crate) fn moments(&self) -> [f64; 3] {
        let [x, y] = self.centroid();
        let area = f64::from(self.area.max(1));
        let [xx, xy, yy] = self.squares.map(|square| f64::from(square) / area);
        [xx - x * x, xy - x * y, yy - y * y]
    }

    /// Whether it touches the edge of a window of this width and height.
    pub(crate) fn touches_edge(&self, size: [usize; 2]) -> bool {
        (0..2).any(|i| self.low[i] == 0 || self.high[i] as usize + 1 >= size[i])
    }
}

/// Sums of the numbers, and of their squares, below the index.
const SUMS: [u32; 256] = below(1);
const SQUARES: [u32; 256] = below(2);
const _: () = assert!(MAX_SIDE < 256);

const fn below(power: u32) -> [u32; 256] {
    let mut sums = [0; 256];
    let mut n = 1;
    while n < 256 {
        sums[n] = sums[n - 1] + (n as u32 - 1).pow(power);
        n += 1;
    }
    sums
}

/// Which pixels belong together: those side by side (bright), or diagonal neighbours as well (dark).
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reach {
    Sides,
    Diagonals,
}

/// The components of a window, with the memory to find them.
pub(crate) struct Components {
    /// Bright pixels that are not outside; those looked at are taken out.
    holes: [Row; MAX_SIDE],
    /// The component that was flooded, and the dark around it.
    region: [Row; MAX_SIDE],
    ring: [Row; MAX_SIDE],
    width: usize,
    height: usize,
}

impl Components {
    pub(crate) const fn new() -> Self {
        let rows = [[0; WORDS]; MAX_SIDE];
        Self { holes: rows, region: rows, ring: rows, width: 0, height: 0 }
    }

    /// Floods the outside of the bright pixels of `bits`: all that reach the window's edge.
    pub(crate) fn find(&mut self, bits: &Bits) -> Result<(), Clutter> {
        (self.width, self.height) = (bits.width(), bits.height());
        match self.words() {
            1 => self.find_in::<1>(bits),
            2 => self.find_in::<2>(bits),
            _ => self.find_in::<WORDS>(bits),
        }
    }

    fn words(&self) -> usize {
        self.width.div_ceil(64)
    }

    fn find_in<const N: usize>(&mut self, bits: &Bits) -> Result<(), Clutter> {
        let inside: [u64; N] = words(&bits.row_mask());
        let mut sides: [u64; N] = words(&bits.last_pixel());
        sides[0] |= 1;
        let last = self.height.saturating_sub(1);
        let rows = self.holes.iter_mut().zip(&mut self.region).zip(bits.rows());
        for (y, ((hole, outside), dark)) in rows.enumerate() {
            let dark: [u64; N] = words(dark);
            let bright: [u64; N] = core::array::from_fn(|i| !dark[i] & inside[i]);
            let edge =
                if y == 0 || y == last { bright } else { core::array::from_fn(|i| sides[i] & bright[i]) };
            put(hole, &bright);
            put(outside, &fill(&edge, &bright));
        }
        self.flood_outside::<N>()?;
        for (hole, outside) in self.holes.iter_mut().zip(&self.region).take(self.height) {
            for i in 0..N {
                hole[i] &= !outside[i];
            }
        }
        Ok(())
    }

    /// Grows what is outside down and up until a way changes nothing.
    fn flood_outside<const N: usize>(&mut self) -> Result<(), Clutter> {
        let height = self.height.min(MAX_SIDE);
        let (region, holes) = (&mut self.region[..height], &self.holes[..height]);
        for sweep in 0..MAX_SWEEPS {
            let mut front = Front::<N>::new(Reach::Sides);
            for (outside, bright) in region.iter_mut().zip(holes) {
                front.grow(outside, &words(bright));
            }
            if sweep > 0 && !front.is_wanted_back {
                return Ok(());
            }
            let mut front = Front::<N>::new(Reach::Sides);
            for (outside, bright) in region.iter_mut().zip(holes).rev() {
                front.grow(outside, &words(bright));
            }
            if !front.is_wanted_back {
                return Ok(());
            }
        }
        Err(Clutter)
    }

    /// The hole that has this pixel, or that is in the middle of the dark component that has it, and the hole
    /// together with the dark component around it; `None` where what is there is none or reaches the edge.
    pub(crate) fn ring_at(&mut self, bits: &Bits, at: [f64; 2]) -> Option<(Part, Part)> {
        (self.width, self.height) = (bits.width(), bits.height());
        // What is outside the window is outside its rows too.
        let [x, y] = at.map(|at| libm::round(at.max(0.0)) as usize);
        match self.words() {
            1 => self.ring_at_in::<1>(bits, (x, y)),
            2 => self.ring_at_in::<2>(bits, (x, y)),
            _ => self.ring_at_in::<WORDS>(bits, (x, y)),
        }
    }

    fn ring_at_in<const N: usize>(&mut self, bits: &Bits, (x, y): (usize, usize)) -> Option<(Part, Part)> {
        let (bright, dark) = (Mask::<N>::bright(bits), Mask::<N>::set(bits.rows()));
        let mut at = (x, y);
        if dark.has(at) {
            let rows = flood(&dark, &mut self.region, at, Reach::Diagonals).ok()?;
            at = part::<N>(&self.region, &rows).centroid().map(|at| libm::round(at) as usize).into();
        }
        if !bright.has(at) {
            return None;
        }
        let rows = flood(&bright, &mut self.region, at, Reach::Sides).ok()?;
        let hole = part::<N>(&self.region, &rows);
        if hole.touches_edge([self.width, self.height]) {
            return None;
        }
        let (x, y) = first_pixel::<N>(self.region.get(rows.clone())?)?;
        let filled = self.filled::<N>(bits, &rows, (x, rows.start + y)).ok()??;
        Some((hole, filled))
    }

    /// The hole that was flooded last, which lies in these rows and has this first pixel, together with the
    /// dark component around it.
    fn filled<const N: usize>(
        &mut self,
        bits: &Bits,
        hole: &Range<usize>,
        (x, y): (usize, usize),
    ) -> Result<Option<Part>, Clutter> {
        // The pixel to the left of a hole's first one is dark and around the hole.
        let Some(left) = x.checked_sub(1) else { return Ok(None) };
        let rows = flood(&Mask::<N>::set(bits.rows()), &mut self.ring, (left, y), Reach::Diagonals)?;
        let both = self.ring.iter_mut().zip(&self.region).take(hole.end).skip(hole.start);
        both.for_each(|(ring, hole)| put(ring, &core::array::from_fn::<u64, N, _>(|i| ring[i] | hole[i])));
        Ok(Some(part::<N>(&self.ring, &rows)))
    }

    /// The next hole of at least `least` pixels, from the top, and it together with the dark component around
    /// it.
    pub(crate) fn next_ring(&mut self, bits: &Bits, least: f64) -> Result<Option<(Part, Part)>, Clutter> {
        match self.words() {
            1 => self.next_ring_in::<1>(bits, least),
            2 => self.next_ring_in::<2>(bits, least),
            _ => self.next_ring_in::<WORDS>(bits, least),
        }
    }

    fn next_ring_in<const N: usize>(
        &mut self,
        bits: &Bits,
        least: f64,
    ) -> Result<Option<(Part, Part)>, Clutter> {
        for _ in 0..MAX_HOLES {
            let Some(first) = first_pixel::<N>(self.holes.get(..self.height).unwrap_or_default()) else {
                return Ok(None);
            };
            let (hole, rows) = self.take_part::<N>(first, Reach::Sides)?;
            if f64::from(hole.area) < least {
                continue;
            }
            let Some(filled) = self.filled::<N>(bits, &rows, first)? else { continue };
            return Ok(Some((hole, filled)));
        }
        Err(Clutter)
    }

    /// Shows every dark component to `visit`. Uses the memory of the holes.
    pub(crate) fn each_dark(&mut self, bits: &Bits, mut visit: impl FnMut(&Part)) {
        self.holes.iter_mut().zip(bits.rows()).for_each(|(row, dark)| *row = *dark);
        for _ in 0..MAX_HOLES {
            let holes = self.holes.get(..self.height).unwrap_or_default();
            let Some(seed) = first_pixel::<WORDS>(holes) else { return };
            let Ok((part, _)) = self.take_part::<WORDS>(seed, Reach::Diagonals) else { return };
            visit(&part);
        }
    }

    /// The component of the holes that has this pixel, which is taken out of them, and its rows.
    fn take_part<const N: usize>(
        &mut self,
        seed: (usize, usize),
        reach: Reach,
    ) -> Result<(Part, Range<usize>), Clutter> {
        let holes = self.holes.get(..self.height).unwrap_or_default();
        let rows = flood(&Mask::<N>::set(holes), &mut self.region, seed, reach)?;
        for (hole, region) in self.holes.iter_mut().zip(&self.region).take(rows.end).skip(rows.start) {
            for i in 0..N {
                hole[i] &= !region[i];
            }
        }
        Ok((part::<N>(&self.region, &rows), rows))
    }
}

/// The words of a row that are in use.
#[inline(always)]
fn words<const N: usize>(row: &Row) -> [u64; N] {
    core::array::from_fn(|i| row[i])
}

#[inline(always)]
fn put<const N: usize>(row: &mut Row, words: &[u64; N]) {
    row[..N].copy_from_slice(words);
}

/// The first set pixel of `rows`, by rows.
fn first_pixel<const N: usize>(rows: &[Row]) -> Option<(usize, usize)> {
    for (y, row) in rows.iter().enumerate() {
        for i in 0..N {
            if row[i] != 0 {
                return Some((64 * i + row[i].trailing_zeros() as usize, y));
            }
        }
    }
    None
}

/// The pixels that are flooded: those of `rows`, or all others of the window.
struct Mask<'a, const N: usize> {
    rows: &'a [Row],
    others: u64,
    inside: [u64; N],
}

impl<'a, const N: usize> Mask<'a, N> {
    fn set(rows: &'a [Row]) -> Self {
        Self { rows, others: 0, inside: [u64::MAX; N] }
    }

    /// The bright pixels of a window.
    fn bright(bits: &'a Bits) -> Self {
        Self { rows: bits.rows(), others: u64::MAX, inside: words(&bits.row_mask()) }
    }

    fn has(&self, (x, y): (usize, usize)) -> bool {
        self.row(y).and_then(|row| row.get(x / 64).copied()).is_some_and(|word| word >> (x % 64) & 1 == 1)
    }

    #[inline(always)]
    fn row(&self, y: usize) -> Option<[u64; N]> {
        let row = self.rows.get(y)?;
        Some(core::array::from_fn(|i| (row[i] ^ self.others) & self.inside[i]))
    }
}

/// Floods the component of `mask` that has this pixel into `region`, and says in which rows it lies. Other
/// rows of `region` mean nothing.
fn flood<const N: usize>(
    mask: &Mask<N>,
    region: &mut [Row; MAX_SIDE],
    (x, y): (usize, usize),
    reach: Reach,
) -> Result<Range<usize>, Clutter> {
    let (mut from, mut to) = (y, y + 1);
    let mut seed = [0; N];
    *seed.get_mut(x / 64).ok_or(Clutter)? = 1 << (x % 64);
    let (Some(first), Some(own)) = (region.get_mut(y), mask.row(y)) else { return Err(Clutter) };
    put(first, &fill(&seed, &own));
    for sweep in 0..MAX_SWEEPS {
        // Down through the rows that have some of it and beyond, then up, until a way leaves nothing to the
        // other.
        let mut front = Front::new(reach);
        let mut row = from;
        while let (Some(into), Some(own)) = (region.get_mut(row), mask.row(row)) {
            if row == to {
                *into = [0; WORDS];
                if !front.grow(into, &own) {
                    break;
                }
                to = row + 1;
            } else {
                front.grow(into, &own);
            }
            row += 1;
        }
        if sweep > 0 && !front.is_wanted_back {
            return Ok(from..to);
        }
        let mut front = Front::new(reach);
        let mut rows = (0..to).rev();
        while let Some(row) = rows.next()
            && let (Some(into), Some(own)) = (region.get_mut(row), mask.row(row))
        {
            if row + 1 == from {
                *into = [0; WORDS];
                if !front.grow(into, &own) {
                    break;
                }
                from = row;
            } else {
                front.grow(into, &own);
            }
        }
        if !front.is_wanted_back {
            return Ok(from..to);
        }
    }
    Err(Clutter)
}

/// A flood on its way up or down.
struct Front<const N: usize> {
    reach: Reach,
    /// What is flooded of the row before, and what is not but could be.
    flooded: [u64; N],
    dry: [u64; N],
    /// Whether a row grew so that it reaches what is dry of the row before: that is for the way back.
    is_wanted_back: bool,
}

impl<const N: usize> Front<N> {
    fn new(reach: Reach) -> Self {
        Self { reach, flooded: [0; N], dry: [0; N], is_wanted_back: false }
    }

    /// Goes on to a row with what is flooded of it already, and grows that by what it shares with the row
    /// before. Says whether it grew.
    #[inline(always)]
    fn grow(&mut self, row: &mut Row, mask: &[u64; N]) -> bool {
        let present: [u64; N] = words(row);
        let spread = self.reach.spread(&self.flooded);
        let mut fresh = 0;
        let seed = core::array::from_fn(|i| {
            let seed = spread[i] & mask[i];
            fresh |= seed & !present[i];
            present[i] | seed
        });
        let grew = fresh != 0;
        if grew {
            self.flooded = fill(&seed, mask);
            put(row, &self.flooded);
            let back = self.reach.spread(&self.flooded);
            self.is_wanted_back |= (0..N).any(|i| back[i] & self.dry[i] != 0);
        } else {
            self.flooded = present;
        }
        self.dry = core::array::from_fn(|i| mask[i] & !self.flooded[i]);
        grew
    }
}

impl Reach {
    /// What pixels of a row touch in the next one.
    #[inline(always)]
    fn spread<const N: usize>(self, row: &[u64; N]) -> [u64; N] {
        core::array::from_fn(|i| match self {
            Self::Sides => row[i],
            Self::Diagonals => {
                let left = row[i] << 1 | if i > 0 { row[i - 1] >> 63 } else { 0 };
                let right = row[i] >> 1 | if i + 1 < N { row[i + 1] << 63 } else { 0 };
                row[i] | left | right
            }
        })
    }
}

/// All runs of `mask` that have a pixel of `seed`, which lies within it.
#[inline(always)]
fn fill<const N: usize>(seed: &[u64; N], mask: &[u64; N]) -> [u64; N] {
    // Adding a seed to its run carries through to the run's end, and leaves nothing set from the seed on but
    // seeds.
    let mut filled = [0; N];
    let mut carry = false;
    for i in 0..N {
        let (sum, over) = mask[i].overflowing_add(seed[i]);
        let (sum, over_again) = sum.overflowing_add(u64::from(carry));
        carry = over | over_again;
        filled[i] = mask[i] & (!sum | seed[i]);
    }
    // What is left of each run lies before its first seed.
    let mut enters = 0;
    for i in (0..N).rev() {
        let rest = mask[i] & !filled[i];
        let mut ends = rest & (filled[i] >> 1 | enters << 63);
        while ends != 0 {
            let end = 63 - ends.leading_zeros();
            ends &= !(1 << end);
            // The run of ones that ends here starts after the last zero before it.
            let zeros = !rest & (u64::MAX >> (63 - end));
            let start = 64 - zeros.leading_zeros();
            filled[i] |= (u64::MAX >> (63 - end)) & (u64::MAX << (start & 63));
        }
        enters = filled[i] & 1;
    }
    filled
}

/// Area, moments and bounding box of a region that has pixels in each of these rows.
fn part<const N: usize>(region: &[Row; MAX_SIDE], rows: &Range<usize>) -> Part {
    let mut part = Part::EMPTY;
    let mut columns = [0; N];
    for (y, row) in (rows.start as u32..).zip(region.get(rows.clone()).unwrap_or_default()) {
        for i in 0..N {
            columns[i] |= row[i];
            // Runs that cross from word to word count as two: the sums are the same.
            let mut rest = row[i];
            while rest != 0 {
                let start = rest.trailing_zeros();
                let ones = (!(rest >> start)).trailing_zeros();
                let end = start + ones;
                rest &= u64::MAX.checked_shl(end).unwrap_or(0);
                part.add_run(y, 64 * i as u32 + start, 64 * i as u32 + end);
            }
        }
    }
    let (first, last) =
        (columns.iter().position(|word| *word != 0), columns.iter().rposition(|word| *word != 0));
    let first = first.map_or(0, |i| 64 * i as u32 + columns[i].trailing_zeros());
    let last = last.map_or(0, |i| 64 * i as u32 + 63 - columns[i].leading_zeros());
    part.low = [first as u8, rows.start as u8];
    part.high = [last as u8, rows.end.max(1) as u8 - 1];
    part
}

#[cfg(test)]
mod tests;
