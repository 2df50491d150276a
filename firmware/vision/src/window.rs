//! A window of the picture and how finely detection looks at it. Of a large ring every second sample either
//! way tells outline and levels; the sub-pixel step takes them all.

use crate::Search;
use crate::loader::Rect;

/// Diameter of a ring that is still told from other things, samples.
const ENOUGH: f64 = 14.0;

/// A part of the picture of which every `every`th sample is looked at, either way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    pub(crate) rect: Rect,
    pub(crate) every: usize,
}

impl Window {
    /// As fine as a ring of this diameter needs it, px.
    pub(crate) fn of(rect: Rect, diameter_px: f64) -> Self {
        Self { rect, every: if diameter_px < 2.0 * ENOUGH { 1 } else { 2 } }
    }

    /// A length in the picture as one in samples.
    pub(crate) fn scaled(&self, length_px: f64) -> f64 {
        length_px / self.every as f64
    }

    /// What to look for about `at` in the picture, in samples from the first one.
    pub(crate) fn search(&self, search: &Search, at: [f64; 2]) -> Search {
        let [x, y] = self.origin();
        let per_area = 1.0 / (self.every * self.every) as f64;
        Search {
            at: [self.scaled(at[0] - x), self.scaled(at[1] - y)],
            shape: search.shape.map(|moment| moment * per_area),
            ..*search
        }
    }

    /// A place in samples as one in the picture.
    pub(crate) fn in_picture(&self, at: [f64; 2]) -> [f64; 2] {
        let (origin, every) = (self.origin(), self.every as f64);
        [0, 1].map(|i| origin[i] + every * at[i])
    }

    fn origin(&self) -> [f64; 2] {
        [f64::from(self.rect.x), f64::from(self.rect.y)]
    }
}
