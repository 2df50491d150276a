//! The pixels about a ring at full depth, one after the other: read once for the passes of the sub-pixel step.

use gangway_device::Frame;

use crate::MAX_SIDE;
use crate::loader::{Rect, load_row};

/// Pixels that are worked on together.
pub(crate) const BLOCK: usize = 32;

/// A whole window; the last block is filled up.
const MAX_PIXELS: usize = MAX_SIDE * MAX_SIDE;
const _: () = assert!(MAX_PIXELS.is_multiple_of(BLOCK));

/// Column and row of pixels that fill up a block: nowhere near a ring in a patch.
const FAR: u8 = u8::MAX;
const _: () = assert!(MAX_SIDE + 32 < FAR as usize);

/// The columns of a patch: a row's are copied from here.
const COLUMNS: [u8; MAX_SIDE] = {
    let mut columns = [0; MAX_SIDE];
    let mut column = 0;
    while column < MAX_SIDE {
        columns[column] = column as u8;
        column += 1;
    }
    columns
};

/// Pixels of a part of the picture: column and row from its corner, value.
pub(crate) struct Patch {
    x: [u8; MAX_PIXELS],
    y: [u8; MAX_PIXELS],
    values: [f32; MAX_PIXELS],
    count: usize,
    rect: Rect,
}

/// Columns, rows and values of pixels.
pub(crate) type Block<'a> = (&'a [u8; BLOCK], &'a [u8; BLOCK], &'a [f32; BLOCK]);

impl Patch {
    pub(crate) const fn new() -> Self {
        Self {
            x: [0; MAX_PIXELS],
            y: [0; MAX_PIXELS],
            values: [0.0; MAX_PIXELS],
            count: 0,
            rect: Rect { x: 0, y: 0, width: 0, height: 0 },
        }
    }

    /// Where in the picture the pixels are counted from.
    pub(crate) fn origin(&self) -> [f64; 2] {
        [f64::from(self.rect.x), f64::from(self.rect.y)]
    }

    /// Takes every `every`th row of `rect`, as far as it lies within the ellipse d^T q d <= 1 about `centre` (in the
    /// picture), and a pixel or two beside it.
    pub(crate) fn take(&mut self, frame: &Frame, rect: Rect, centre: [f64; 2], q: [f64; 3], every: usize) {
        (self.rect, self.count) = (rect, 0);
        let own = [centre[0] - f64::from(rect.x), centre[1] - f64::from(rect.y)];
        let (lean, per_q) = (q[1] / q[0], 1.0 / q[0]);
        let bend = q[1] * q[1] - q[0] * q[2];
        let last = rect.width as f64 - 1.0;
        for row in (0..rect.height).step_by(every) {
            let dy = row as f64 - own[1];
            // q0 x^2 + 2 q1 x dy + q2 dy^2 = 1
            let square = bend * dy * dy + q[0];
            if square <= 0.0 {
                continue;
            }
            let middle = own[0] - lean * dy;
            let half = libm::sqrt(square) * per_q;
            // From the sample at or left of the ellipse to that at or right of it.
            let (low, high) = ((middle - half).max(0.0), (middle + half + 1.0).min(last));
            if low <= high {
                self.take_span(frame, row, low as u32 as usize, high as u32 as usize + 1);
            }
        }
        let end = self.count.next_multiple_of(BLOCK);
        for column in [&mut self.x, &mut self.y] {
            column.get_mut(self.count..end).unwrap_or_default().fill(FAR);
        }
    }

    /// Takes the pixels of a row from `start` up to `end`, that one excluded.
    fn take_span(&mut self, frame: &Frame, row: usize, start: usize, end: usize) {
        let span = self.count..self.count + end - start;
        let (Some(x), Some(y), Some(values), Some(columns)) = (
            self.x.get_mut(span.clone()),
            self.y.get_mut(span.clone()),
            self.values.get_mut(span.clone()),
            COLUMNS.get(start..end),
        ) else {
            return;
        };
        self.count = span.end;
        x.copy_from_slice(columns);
        y.fill(row as u8);
        load_row(frame, self.rect.x + start as u16, self.rect.y + row as u16, values);
    }

    /// What was taken.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = Block<'_>> {
        let places = self.x.as_chunks().0.iter().zip(self.y.as_chunks().0);
        let blocks = places.zip(self.values.as_chunks().0).map(|((x, y), values)| (x, y, values));
        blocks.take(self.count.div_ceil(BLOCK))
    }
}
