//! The ring's surroundings at full depth, in floats, read once for the sub-pixel step.

use gangway_device::Frame;

use crate::MAX_SIDE;
use crate::lanes::LANES;
use crate::loader::{Rect, load_row};

/// The samples of a rectangle of the picture.
pub(crate) struct Patch {
    rows: [[f32; MAX_SIDE]; MAX_SIDE],
    rect: Rect,
}

impl Patch {
    pub(crate) const fn new() -> Self {
        Self { rows: [[0.0; MAX_SIDE]; MAX_SIDE], rect: Rect { x: 0, y: 0, width: 0, height: 0 } }
    }

    /// Takes the samples of `rect`.
    pub(crate) fn load(&mut self, frame: &Frame, rect: Rect) {
        self.rect = rect;
        for (row, y) in self.rows.iter_mut().take(rect.height).zip(rect.y..) {
            if let Some(into) = row.get_mut(..rect.width) {
                load_row(frame, rect.x, y, into);
            }
        }
    }

    /// Visits every `every`th row from `first` on, as far as it lies within the ellipse (d^T q d <= 1, `centre` in
    /// the picture): the row's and its first sample's distance from the centre, and the samples in fours, up to
    /// three of them outside. A visitor must not count those; beyond the patch they are finite, no more.
    #[inline(always)]
    pub(crate) fn visit(
        &self,
        centre: [f64; 2],
        q: [f64; 3],
        (first, every): (usize, usize),
        mut row: impl FnMut(f32, f32, &[[f32; LANES]]),
    ) {
        let own = [centre[0] - f64::from(self.rect.x), centre[1] - f64::from(self.rect.y)];
        let (lean, per_q) = (q[1] / q[0], 1.0 / q[0]);
        let bend = q[1] * q[1] - q[0] * q[2];
        let last = self.rect.width as f64 - 1.0;
        for (y, samples) in self.rows.iter().enumerate().take(self.rect.height).skip(first).step_by(every) {
            let dy = y as f64 - own[1];
            // q0 x^2 + 2 q1 x dy + q2 dy^2 = 1
            let square = bend * dy * dy + q[0];
            if square <= 0.0 {
                continue;
            }
            let middle = own[0] - lean * dy;
            let half = libm::sqrt(square) * per_q;
            // From the sample at or left of the ellipse to that at or right of it.
            let (low, high) = ((middle - half).max(0.0), (middle + half + 1.0).min(last));
            if high < low {
                continue;
            }
            let (start, end) = (low as u32 as usize, high as u32 as usize + 1);
            let (span, _) = samples.get(start..).unwrap_or_default().as_chunks::<LANES>();
            let fours = (end - start).div_ceil(LANES);
            row(dy as f32, (start as f64 - own[0]) as f32, span.get(..fours).unwrap_or(span));
        }
    }
}
