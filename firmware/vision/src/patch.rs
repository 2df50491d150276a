//! The ring's surroundings at full depth, in floats, read once for the sub-pixel step.

use gangway_device::Frame;

use crate::MAX_SIDE;
use crate::lanes::{LANES, Lanes};
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
    /// the picture), four samples at a time and up to three beyond it: what `begin` makes of the row's
    /// distance from the centre, the samples' distances along the row, and their values. A visitor must not count what lies outside; beyond the patch the values are finite, no more.
    #[inline(always)]
    pub(crate) fn visit<R>(
        &self,
        centre: [f64; 2],
        q: [f64; 3],
        (first, every): (usize, usize),
        begin: impl Fn(Lanes) -> R,
        mut four: impl FnMut(&R, Lanes, Lanes),
    ) {
        let own = [centre[0] - f64::from(self.rect.x), centre[1] - f64::from(self.rect.y)];
        let height = self.rect.height.min(MAX_SIDE);
        let mut y = first;
        while y < height {
            let row = &self.rows[y];
            let dy = y as f64 - own[1];
            y += every;
            // q0 x^2 + 2 q1 x dy + q2 dy^2 = 1
            let square = (q[1] * q[1] - q[0] * q[2]) * dy * dy + q[0];
            if square <= 0.0 {
                continue;
            }
            let mid = own[0] - q[1] * dy / q[0];
            let half = libm::sqrt(square) / q[0];
            let start = libm::ceil(mid - half).max(0.0) as usize;
            let end = (libm::floor(mid + half).max(0.0) as usize + 1).min(self.rect.width);
            let fours = end.saturating_sub(start).div_ceil(LANES);
            let (span, _) = row.get(start..).unwrap_or_default().as_chunks::<LANES>();
            let begun = begin(Lanes::splat(dy as f32));
            let mut dx = Lanes::count_from((start as f64 - own[0]) as f32);
            for values in span.iter().take(fours) {
                four(&begun, dx, Lanes::of(*values));
                dx += Lanes::splat(LANES as f32);
            }
        }
    }
}
