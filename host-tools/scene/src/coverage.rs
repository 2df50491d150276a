//! How much of a small square lies on one side of an edge: exact for a straight edge, so that a curved one,
//! taken as its tangent in each of a pixel's cells, is exact to the third order of the cell's side.

/// How a pixel gathers light: cells along each of its axes (middle in px from the pixel's, weight) and their
/// side.
///
/// Areas of a pixel's own square alias: the centroid of a sharp ring is up to 0.001 px off on any grid of
/// pixels. A lens blurs before the pixels sample; where there is blur enough, its first part is taken here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Aperture {
    cells: [(f64, f64); 4],
    side: f64,
}

impl Aperture {
    /// The pixel's square alone.
    const SQUARE: Self =
        Self { cells: [(-0.375, 0.25), (-0.125, 0.25), (0.125, 0.25), (0.375, 0.25)], side: 0.25 };
    /// The square after a blur of 1/4, 1/2, 1/4 at distances of half a pixel: its spectrum has a double zero
    /// where the pixels' grid has its frequency.
    const SOFT: Self =
        Self { cells: [(-0.75, 0.125), (-0.25, 0.375), (0.25, 0.375), (0.75, 0.125)], side: 0.5 };
    /// Variance of the soft aperture's blur, px^2.
    const SOFT_VARIANCE: f64 = 0.125;

    /// The aperture for a lens' blur (standard deviation, px), and what blur is left for later.
    pub(crate) fn for_blur(sigma: f64) -> (Self, f64) {
        let left = sigma * sigma - Self::SOFT_VARIANCE;
        if left >= 0.0 { (Self::SOFT, left.sqrt()) } else { (Self::SQUARE, sigma) }
    }

    /// How far it reaches from the pixel's middle along an axis, px.
    pub(crate) fn reach(&self) -> f64 {
        self.cells[3].0 + 0.5 * self.side
    }

    /// Share of the light of a pixel at `at` that comes from `[from, to]`, along one axis.
    pub(crate) fn interval(&self, at: f64, from: f64, to: f64) -> f64 {
        let half = 0.5 * self.side;
        let cell = |x: f64| ((x + half).min(to) - (x - half).max(from)).clamp(0.0, self.side) / self.side;
        self.cells.iter().map(|(offset, weight)| weight * cell(at + offset)).sum()
    }

    /// Share of the light that comes from the inner side of a straight edge. `inside` is the distance of the
    /// pixel's middle from it (positive: inside), `a` and `b` how that grows to the right and down, per px.
    pub(crate) fn edge(&self, inside: f64, a: f64, b: f64) -> f64 {
        self.sum(|right, down| half_plane(inside + a * right + b * down, self.side * a, self.side * b))
    }

    /// Share of the light that comes from inside a circle. `from_centre` is the pixel's middle relative to
    /// the circle's, `per_px` how that changes with the pixel (columns: right, down); `radius` in the same
    /// unit.
    pub(crate) fn disc(&self, from_centre: [f64; 2], per_px: &[[f64; 2]; 2], radius: f64) -> f64 {
        self.sum(|right, down| {
            let x = from_centre[0] + per_px[0][0] * right + per_px[0][1] * down;
            let y = from_centre[1] + per_px[1][0] * right + per_px[1][1] * down;
            let r = (x * x + y * y).sqrt().max(f64::MIN_POSITIVE);
            let across_right = (x * per_px[0][0] + y * per_px[1][0]) / r;
            let across_down = (x * per_px[0][1] + y * per_px[1][1]) / r;
            half_plane(radius - r, self.side * across_right, self.side * across_down)
        })
    }

    fn sum(&self, share: impl Fn(f64, f64) -> f64) -> f64 {
        let row =
            |down: f64| self.cells.iter().map(|(right, weight)| weight * share(*right, down)).sum::<f64>();
        self.cells.iter().map(|(down, weight)| weight * row(*down)).sum()
    }
}

/// Share of a parallelogram on the inner side of a straight edge.
///
/// `inside` is the distance from the middle to the edge (positive: the middle is inside); `a` and `b` are the
/// distances by which it changes from one side of the parallelogram to the other, along its two axes.
fn half_plane(inside: f64, a: f64, b: f64) -> f64 {
    let (a, b) = (a.abs().max(b.abs()), a.abs().min(b.abs()));
    let x = inside.abs();
    let more = if x >= 0.5 * (a + b) {
        1.0
    } else if x <= 0.5 * (a - b) {
        0.5 + x / a
    } else {
        let left = 0.5 * (a + b) - x;
        1.0 - left * left / (2.0 * a * b)
    };
    if inside >= 0.0 { more } else { 1.0 - more }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_edge_cuts_off_the_area_worked_out_by_hand() {
        assert_eq!(half_plane(0.0, 1.0, 0.3), 0.5);
        assert_eq!(half_plane(0.25, 1.0, 0.0), 0.75);
        assert_eq!(half_plane(-0.25, 0.0, -1.0), 0.25);
        // The diagonal x + y = 0.5 from the lower left corner of the unit square cuts off 1/8: its middle
        // lies half way out.
        assert!((half_plane(-0.5, 1.0, 1.0) - 0.125).abs() < 1e-15);
        assert_eq!(half_plane(2.0, 1.0, 0.5), 1.0);
        assert_eq!(half_plane(-2.0, 1.0, 0.5), 0.0);
    }

    #[test]
    fn the_pixels_of_a_disc_add_up_to_its_area_and_centre() {
        // Tangent instead of arc in cells of 1/4 or 1/2 px: 1e-4 and 4e-4 of the area. The centroid of the
        // square's own areas aliases by 0.001 px, that of the soft aperture's by a third of it.
        for (aperture, of_area, of_centre) in [(Aperture::SQUARE, 1e-4, 1e-3), (Aperture::SOFT, 4e-4, 4e-4)] {
            let (area, x, y) = sums(&aperture);
            assert!((area / (std::f64::consts::PI * 8.2 * 8.2) - 1.0).abs() < of_area, "{area}");
            assert!((x / area - 12.31).abs() < of_centre && (y / area - 11.87).abs() < of_centre);
        }
    }

    fn sums(aperture: &Aperture) -> (f64, f64, f64) {
        let (cx, cy, radius) = (12.31, 11.87, 8.2);
        let unit = [[1.0, 0.0], [0.0, 1.0]];
        let (mut area, mut x, mut y) = (0.0, 0.0, 0.0);
        for j in 0..25 {
            for i in 0..25 {
                let (u, v) = (f64::from(i), f64::from(j));
                let share = aperture.disc([u - cx, v - cy], &unit, radius);
                area += share;
                x += share * u;
                y += share * v;
            }
        }
        (area, x, y)
    }

    #[test]
    fn the_parts_of_a_blur_add_up() {
        let (aperture, left) = Aperture::for_blur(0.7);
        let variance = |aperture: &Aperture| -> f64 {
            aperture.cells.iter().map(|(x, w)| w * (x * x + aperture.side * aperture.side / 12.0)).sum()
        };
        assert!((variance(&aperture) - 1.0 / 12.0 + left * left - 0.49).abs() < 1e-12);
        assert_eq!(Aperture::for_blur(0.2), (Aperture::SQUARE, 0.2));
        assert!((variance(&Aperture::SQUARE) - 1.0 / 12.0).abs() < 1e-12);
    }

    #[test]
    fn an_interval_is_cut_at_both_ends() {
        let square = Aperture::SQUARE;
        assert_eq!(square.interval(3.0, 0.0, 10.0), 1.0);
        assert_eq!(square.interval(0.0, 0.25, 10.0), 0.25);
        assert_eq!(square.interval(0.0, -0.1, 0.1), 0.2);
        assert_eq!(square.interval(20.0, 0.0, 10.0), 0.0);
    }
}
