//! What passes in front of everything: upright posts that cross the picture and rectangles on a path.

use crate::coverage::Aperture;

/// A rectangle with its sides along the picture's, moving on straight lines between points.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Occluder {
    /// Width and height, px.
    pub(crate) size: [f64; 2],
    /// (seconds, u, v of its middle), times rising; it shows from the first to the last.
    pub(crate) path: Vec<[f64; 3]>,
    /// Reflectance.
    pub(crate) level: f64,
}

/// Where on a path (seconds, u, v) something is at a time, px; nothing before its first and after its last
/// point.
pub(crate) fn place(path: &[[f64; 3]], t: f64) -> Option<[f64; 2]> {
    let (first, last) = (path.first()?, path.last()?);
    if t < first[0] || t > last[0] {
        return None;
    }
    let after = path.partition_point(|point| point[0] <= t).clamp(1, path.len() - 1);
    let (a, b) = (&path[after - 1], &path[after]);
    let share = (t - a[0]) / (b[0] - a[0]);
    Some([a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])])
}

impl Occluder {
    /// Its middle at a time, px; nothing when it does not show.
    fn at(&self, t: f64) -> Option<[f64; 2]> {
        place(&self.path, t)
    }

    /// Whether it stands before any of the square of half side `half` about a place, px.
    pub(crate) fn covers(&self, t: f64, place: [f64; 2], half: f64) -> bool {
        let near = |middle: [f64; 2]| {
            (0..2).all(|axis| (middle[axis] - place[axis]).abs() < 0.5 * self.size[axis] + half)
        };
        self.at(t).is_some_and(near)
    }

    /// How far it moves between two times at most, px.
    pub(crate) fn travel_px(&self, from: f64, to: f64) -> f64 {
        match (self.at(from), self.at(to)) {
            (Some(a), Some(b)) => (a[0] - b[0]).hypot(a[1] - b[1]),
            _ => 0.0,
        }
    }

    /// Where it is at the moments of an exposure.
    pub(crate) fn view(&self, moments: &[f64], aperture: Aperture) -> OccluderView {
        let all = moments.len() as f64;
        let middles = moments.iter().filter_map(|t| self.at(*t)).collect();
        OccluderView { middles, half: self.size.map(|side| 0.5 * side), level: self.level, all, aperture }
    }
}

/// An occluder as one frame sees it.
pub(crate) struct OccluderView {
    middles: Vec<[f64; 2]>,
    half: [f64; 2],
    level: f64,
    all: f64,
    aperture: Aperture,
}

impl OccluderView {
    /// Hides what shines in one row; `glow` begins at column `left`.
    pub(crate) fn hide_row(&self, row: i32, left: i32, glow: &mut [f32]) {
        self.cover_row(row, left, glow, 0.0);
    }

    /// Draws one row; `canvas` begins at column `left`.
    pub(crate) fn draw_row(&self, row: i32, left: i32, canvas: &mut [f32]) {
        self.cover_row(row, left, canvas, self.level);
    }

    fn cover_row(&self, row: i32, left: i32, canvas: &mut [f32], level: f64) {
        let rows = |middle: &[f64; 2]| {
            let [from, to] = [middle[1] - self.half[1], middle[1] + self.half[1]];
            self.aperture.interval(f64::from(row), from, to) / self.all
        };
        let shown: Vec<(f64, f64)> =
            self.middles.iter().map(|m| (m[0], rows(m))).filter(|(_, share)| *share > 0.0).collect();
        let least = shown.iter().map(|s| s.0).fold(f64::INFINITY, f64::min) - self.half[0] - 1.0;
        let most = shown.iter().map(|s| s.0).fold(f64::NEG_INFINITY, f64::max) + self.half[0] + 1.0;
        if least > most {
            return;
        }
        let end = canvas.len() as f64;
        let first = (least.floor() - f64::from(left)).clamp(0.0, end) as usize;
        let past = (most.ceil() + 1.0 - f64::from(left)).clamp(0.0, end) as usize;
        for (i, pixel) in canvas.iter_mut().enumerate().take(past).skip(first) {
            let at = f64::from(left) + i as f64;
            let share: f64 = shown
                .iter()
                .map(|(x, rows)| rows * self.aperture.interval(at, x - self.half[0], x + self.half[0]))
                .sum();
            *pixel = (f64::from(*pixel) * (1.0 - share) + share * level) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_occluder_is_on_its_path_only_while_it_lasts() {
        let path = vec![[1.0, 0.0, 10.0], [2.0, 100.0, 10.0], [4.0, 100.0, 50.0]];
        let occluder = Occluder { size: [4.0, 4.0], path, level: 0.0 };
        assert_eq!(occluder.at(0.99), None);
        assert_eq!(occluder.at(1.0), Some([0.0, 10.0]));
        assert_eq!(occluder.at(1.5), Some([50.0, 10.0]));
        assert_eq!(occluder.at(3.0), Some([100.0, 30.0]));
        assert_eq!(occluder.at(4.0), Some([100.0, 50.0]));
        assert_eq!(occluder.at(4.01), None);
    }

    #[test]
    fn a_rectangle_covers_what_is_behind_it_and_half_of_the_pixels_at_its_edge() {
        let path = vec![[0.0, 5.0, 5.0], [1.0, 5.0, 5.0]];
        let occluder = Occluder { size: [4.0, 6.0], path, level: 0.25 };
        let mut row = vec![1.0; 11];
        occluder.view(&[0.5], Aperture::for_blur(0.0).0).draw_row(5, 0, &mut row);
        assert_eq!(row, [1.0, 1.0, 1.0, 0.625, 0.25, 0.25, 0.25, 0.625, 1.0, 1.0, 1.0]);
        let mut outside = vec![1.0; 11];
        occluder.view(&[0.5], Aperture::for_blur(0.0).0).draw_row(9, 0, &mut outside);
        assert_eq!(outside, [1.0; 11]);
    }
}
