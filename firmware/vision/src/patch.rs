//! The pixels about a ring at full depth, one after the other: read once for each pass of the sub-pixel step.

use gangway_device::Frame;

use crate::MAX_SIDE;
use crate::lanes::BLOCK;
use crate::loader::{CHUNK, Rect, Row};

/// Belts of a patch at the most.
const MAX_BELTS: usize = 2;

/// A whole window, and what lies between belts and beyond the last one.
const MAX_PIXELS: usize = MAX_SIDE * MAX_SIDE + MAX_BELTS * BLOCK;

/// A gap in a row that is narrower, px, costs less than two spans.
const WORTHWHILE_PX: f64 = 3.0;

/// Columns from any one on, as many as a chunk has.
const COLUMNS: [u8; 256 + CHUNK] = {
    let mut columns = [0; 256 + CHUNK];
    let mut i = 0;
    while i < columns.len() {
        columns[i] = i as u8;
        i += 1;
    }
    columns
};

/// Pixels of a part of the picture.
pub(crate) struct Patch {
    /// Column and row from the corner of the part.
    x: [u8; MAX_PIXELS],
    y: [u8; MAX_PIXELS],
    values: [u16; MAX_PIXELS],
    /// Pixels taken, with those between the belts.
    count: usize,
    rect: Rect,
}

/// Which pixels are taken, by their radius in the circle's plane, px; more where a gap in a row is narrow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Belt {
    pub(crate) from: f64,
    pub(crate) to: f64,
}

impl Belt {
    /// All pixels up to a radius.
    pub(crate) fn whole(to: f64) -> Self {
        Self { from: 0.0, to }
    }
}

/// The pixels of a belt in a patch: the first one's block, and how many they are.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Part {
    block: usize,
    count: usize,
}

/// Columns, rows and values of pixels.
pub(crate) type Block<'a> = (&'a [u8; BLOCK], &'a [u8; BLOCK], &'a [u16; BLOCK]);

impl Patch {
    pub(crate) const fn new() -> Self {
        Self {
            x: [0; MAX_PIXELS],
            y: [0; MAX_PIXELS],
            values: [0; MAX_PIXELS],
            count: 0,
            rect: Rect { x: 0, y: 0, width: 0, height: 0 },
        }
    }

    /// Where in the picture the pixels are counted from.
    pub(crate) fn origin(&self) -> [f64; 2] {
        [f64::from(self.rect.x), f64::from(self.rect.y)]
    }

    /// Starts over, in another part of the picture.
    pub(crate) fn clear(&mut self, rect: Rect) {
        (self.rect, self.count) = (rect, 0);
    }

    /// Takes every `every`th row, as far as it lies in the belt about the ellipses of this shape (of determinant 1) and
    /// `centre` (in the picture), to the nearest pixel.
    pub(crate) fn take(
        &mut self,
        frame: &Frame,
        centre: [f64; 2],
        shape: [f64; 3],
        belt: &Belt,
        every: usize,
    ) -> Part {
        let rect = self.rect;
        let block = self.count.div_ceil(BLOCK);
        self.count = block * BLOCK;
        let own = [centre[0] - f64::from(rect.x), centre[1] - f64::from(rect.y)];
        // q0 x^2 + 2 q1 x y + q2 y^2 = radius^2 with q the inverse of the shape.
        let (q0, lean) = (shape[2], shape[1] / shape[2]);
        let squares = [belt.from, belt.to].map(|radius| radius * radius * q0);
        let per_q0 = 1.0 / q0;
        // Rows that the belt reaches.
        let reach = libm::sqrt(squares[1]);
        let (first, last) = (rounded(own[1] - reach + 0.5), rounded(own[1] + reach + 0.5).min(rect.height));
        for row in (first.next_multiple_of(every)..last).step_by(every) {
            let dy = row as f64 - own[1];
            // Half the chord that the row cuts out of each ellipse; none where it passes by.
            let [from, to] = squares.map(|square| libm::sqrt((square - dy * dy).max(0.0)) * per_q0);
            let middle = own[0] + lean * dy;
            let line = Line {
                samples: Row::of(frame, rect.y + row as u16, rect.x),
                row: [row as u8; CHUNK],
                width: rect.width,
            };
            if 2.0 * from > WORTHWHILE_PX {
                self.take_span(&line, middle - to, middle - from);
                self.take_span(&line, middle + from, middle + to);
            } else {
                self.take_span(&line, middle - to, middle + to);
            }
        }
        Part { block, count: self.count - block * BLOCK }
    }

    /// Takes the pixels of a row from `low` to `high`.
    #[inline(always)]
    fn take_span(&mut self, line: &Line, low: f64, high: f64) {
        // Rounded up and down: what lies nearer to a belt's edge than a pixel hardly counts.
        let (start, end) = (rounded(low + 0.5), rounded(high + 0.5).min(line.width));
        // Written in whole chunks: what is too much is overwritten by the next span.
        let (mut first, mut at) = (start, self.count);
        while first < end {
            let from = at.min(MAX_PIXELS - CHUNK);
            let (Some(x), Some(y), Some(values), Some(columns)) = (
                chunk(&mut self.x, from),
                chunk(&mut self.y, from),
                chunk(&mut self.values, from),
                COLUMNS.get(first & 0xff..).and_then(|columns| columns.first_chunk()),
            ) else {
                return;
            };
            (*x, *y) = (*columns, line.row);
            line.samples.load(first, (end - first).min(CHUNK), values);
            (first, at) = (first + CHUNK, at + CHUNK);
        }
        self.count += end.saturating_sub(start);
    }

    /// What was taken, and how many pixels of each block; the others of the last one mean nothing.
    pub(crate) fn blocks(&self, part: Part) -> impl Iterator<Item = (Block<'_>, usize)> {
        let places = self.x.as_chunks().0.iter().zip(self.y.as_chunks().0);
        let blocks = places.zip(self.values.as_chunks().0).map(|((x, y), values)| (x, y, values));
        let counts = (0..part.count).step_by(BLOCK).map(move |first| (part.count - first).min(BLOCK));
        blocks.skip(part.block).zip(counts)
    }
}

/// A row of the part of the picture.
struct Line<'a> {
    samples: Row<'a>,
    /// Its number, for every pixel of a chunk.
    row: [u8; CHUNK],
    width: usize,
}

/// The nearest whole number, 0 for less; for numbers that are no more than a picture's size, in fewer instructions than
/// `as` takes, which minds all others.
#[inline(always)]
fn rounded(x: f64) -> usize {
    /// Adding this leaves the number in the last bits.
    const TO_BITS: f64 = 6_755_399_441_055_744.0;
    ((x + TO_BITS).to_bits() as i32).max(0) as usize
}

fn chunk<T>(column: &mut [T; MAX_PIXELS], at: usize) -> Option<&mut [T; CHUNK]> {
    column.get_mut(at..at + CHUNK)?.first_chunk_mut()
}
