//! The pixels about a ring at full depth, one after the other: read once for each pass of the sub-pixel step.

use gangway_device::Frame;

use crate::MAX_SIDE;
use crate::lanes::BLOCK;
use crate::loader::{CHUNK, Rect, Row};

/// A whole window, and what the last span writes beyond it.
const MAX_PIXELS: usize = MAX_SIDE * MAX_SIDE + BLOCK;

/// A gap in a row that is narrower, px, costs less than two spans.
const WORTHWHILE_PX: f64 = 3.0;

/// Columns of a chunk's pixels from its first one.
const COLUMNS: [u8; CHUNK] = {
    let mut columns = [0; CHUNK];
    let mut i = 0;
    while i < CHUNK {
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
    /// Pixels taken.
    count: usize,
    rect: Rect,
}

/// Which pixels are taken, by their radius in the circle's plane, px: from `from` to `to` and from `again` to `end`,
/// and what lies between where that is little.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Belts {
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) again: f64,
    pub(crate) end: f64,
}

impl Belts {
    /// All pixels up to a radius.
    pub(crate) fn whole(end: f64) -> Self {
        Self { from: 0.0, to: end, again: end, end }
    }
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

    /// Takes every `every`th row of `rect`, as far as it lies in the belts about the ellipses of this shape (of
    /// determinant 1) and `centre` (in the picture), to the nearest pixel.
    pub(crate) fn take(
        &mut self,
        frame: &Frame,
        rect: Rect,
        centre: [f64; 2],
        shape: [f64; 3],
        belts: &Belts,
        every: usize,
    ) {
        (self.rect, self.count) = (rect, 0);
        let own = [centre[0] - f64::from(rect.x), centre[1] - f64::from(rect.y)];
        // q0 x^2 + 2 q1 x y + q2 y^2 = radius^2 with q the inverse of the shape.
        let (q0, lean) = (shape[2], shape[1] / shape[2]);
        let squares = [belts.from, belts.to, belts.again, belts.end].map(|radius| radius * radius * q0);
        let per_q0 = 1.0 / q0;
        let (split, hollow) = (belts.again > belts.to, 2.0 * belts.from > WORTHWHILE_PX);
        for row in (0..rect.height).step_by(every) {
            let dy = row as f64 - own[1];
            // Half the chord that the row cuts out of each ellipse; none where it passes by.
            let half = |i: usize| libm::sqrt((squares[i] - dy * dy).max(0.0)) * per_q0;
            let end = half(3);
            if end <= 0.0 {
                continue;
            }
            let middle = own[0] + lean * dy;
            let line = Line {
                samples: Row::of(frame, rect.y + row as u16, rect.x),
                row: row as u8,
                width: rect.width,
            };
            let (again, to) = if split { (half(2), half(1)) } else { (0.0, 0.0) };
            if to > 0.0 && again - to > WORTHWHILE_PX {
                self.take_span(&line, middle - end, middle - again);
                self.take_about(&line, middle, half(0), to);
                self.take_span(&line, middle + again, middle + end);
            } else if split && to <= 0.0 {
                self.take_about(&line, middle, again, end);
            } else if hollow {
                self.take_about(&line, middle, half(0), end);
            } else {
                self.take_span(&line, middle - end, middle + end);
            }
        }
    }

    /// Takes the pixels of a row from `from` to `to` on either side of `middle`, and those between where they are few.
    #[inline(always)]
    fn take_about(&mut self, line: &Line, middle: f64, from: f64, to: f64) {
        if 2.0 * from > WORTHWHILE_PX {
            self.take_span(line, middle - to, middle - from);
            self.take_span(line, middle + from, middle + to);
        } else {
            self.take_span(line, middle - to, middle + to);
        }
    }

    /// Takes the pixels of a row from `low` to `high`.
    #[inline(always)]
    fn take_span(&mut self, line: &Line, low: f64, high: f64) {
        // Rounded up and down: what lies nearer to a belt's edge than a pixel hardly counts.
        let (start, end) = (rounded(low + 0.5), rounded(high + 0.5).min(line.width));
        // Written in whole chunks: what is too much is overwritten by the next span.
        let mut first = start;
        while first < end {
            let at = (self.count + first - start).min(MAX_PIXELS - CHUNK);
            let (Some(x), Some(y), Some(values)) =
                (chunk(&mut self.x, at), chunk(&mut self.y, at), chunk(&mut self.values, at))
            else {
                return;
            };
            *x = COLUMNS.map(|column| column + first as u8);
            *y = [line.row; CHUNK];
            line.samples.load(first, (end - first).min(CHUNK), values);
            first += CHUNK;
        }
        self.count += end.saturating_sub(start);
    }

    /// What was taken, and how many pixels of each block; the others of the last one mean nothing.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = (Block<'_>, usize)> {
        let places = self.x.as_chunks().0.iter().zip(self.y.as_chunks().0);
        let blocks = places.zip(self.values.as_chunks().0).map(|((x, y), values)| (x, y, values));
        let counts = (0..self.count).step_by(BLOCK).map(|first| (self.count - first).min(BLOCK));
        blocks.zip(counts)
    }
}

/// A row of the part of the picture.
struct Line<'a> {
    samples: Row<'a>,
    row: u8,
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
