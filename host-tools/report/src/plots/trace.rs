//! Points to paths: broken where there is a gap, and reduced to the smallest and largest value a column of
//! pixels where there are more points than columns.

use std::fmt::Write;

/// Columns are reduced only where a series has more points than this, for each column of pixels.
const POINTS_PER_COLUMN: f64 = 2.0;

/// One point in pixels; `joined` where a line comes to it from the one before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) joined: bool,
}

/// The points as they are drawn: all of them, or for each column of a pixel its smallest and largest, in the
/// order in which they came. Between columns a gap stays a gap.
pub(crate) fn reduce(points: &[Point], width_px: f64) -> Vec<Point> {
    if points.len() as f64 <= width_px * POINTS_PER_COLUMN {
        return points.to_vec();
    }
    let mut out = Vec::new();
    let column = |p: &Point| p.x.floor();
    for group in points.chunk_by(|a, b| column(a) == column(b)) {
        let smallest = (0..group.len()).min_by(|a, b| group[*a].y.total_cmp(&group[*b].y)).unwrap_or(0);
        let largest = (0..group.len()).max_by(|a, b| group[*a].y.total_cmp(&group[*b].y)).unwrap_or(0);
        let (one, two) = (smallest.min(largest), smallest.max(largest));
        out.push(Point { joined: group[0].joined, ..group[one] });
        if two != one {
            // A gap within a column is narrower than a pixel.
            out.push(Point { joined: true, ..group[two] });
        }
    }
    out
}

/// A line through the points. A point alone gives a line of no length, which round caps show as a dot.
pub(crate) fn line(points: &[Point]) -> String {
    let mut path = Path::default();
    for run in points.chunk_by(|_, next| next.joined) {
        path.to(run[0], true);
        for point in &run[1..] {
            path.to(*point, false);
        }
        if run.len() == 1 {
            path.text.push_str("h0");
        }
    }
    path.text
}

/// The area between the points and their mirror images about `y`. A point alone gives a bar of one pixel.
pub(crate) fn band(points: &[Point], y: f64) -> String {
    let mut path = Path::default();
    for run in points.chunk_by(|_, next| next.joined) {
        let lone = [Point { x: run[0].x - 0.5, ..run[0] }, Point { x: run[0].x + 0.5, ..run[0] }];
        let run = if run.len() == 1 { &lone[..] } else { run };
        for (i, point) in run.iter().enumerate() {
            path.to(*point, i == 0);
        }
        for point in run.iter().rev() {
            path.to(Point { y: 2.0 * y - point.y, ..*point }, false);
        }
        path.text.push('z');
    }
    path.text
}

/// Path data in steps of a tenth of a pixel, relative, which takes half the bytes of absolute numbers.
#[derive(Default)]
struct Path {
    text: String,
    at: [i64; 2],
}

impl Path {
    fn to(&mut self, point: Point, begins: bool) {
        let to = [point.x, point.y].map(|v| (v * 10.0).round() as i64);
        let tenths = |v: i64| {
            let (sign, v) = (if v < 0 { "-" } else { "" }, v.unsigned_abs());
            if v % 10 == 0 { format!("{sign}{}", v / 10) } else { format!("{sign}{}.{}", v / 10, v % 10) }
        };
        let _ = if begins {
            write!(self.text, "M{} {}", tenths(to[0]), tenths(to[1]))
        } else {
            write!(self.text, "l{} {}", tenths(to[0] - self.at[0]), tenths(to[1] - self.at[1]))
        };
        self.at = to;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64, joined: bool) -> Point {
        Point { x, y, joined }
    }

    #[test]
    fn a_gap_is_not_joined_and_a_lone_point_is_a_dot() {
        let points = [point(0.0, 1.0, false), point(1.0, 2.5, true), point(3.0, 2.0, false)];
        assert_eq!(line(&points), "M0 1l1 1.5M3 2h0");
    }

    #[test]
    fn rounding_does_not_add_up_along_a_line() {
        let points: Vec<Point> = (0..1000).map(|i| point(f64::from(i) * 0.33, 0.0, i > 0)).collect();
        let path = line(&points);
        let sum: f64 = path.split('l').skip(1).filter_map(|s| s.split(' ').next()?.parse::<f64>().ok()).sum();
        // Each point is rounded to a tenth by itself, so the last is off by half of that at most.
        assert!((sum - 999.0 * 0.33).abs() <= 0.0501, "{sum}");
    }

    #[test]
    fn a_peak_of_one_frame_in_hours_is_kept() {
        let mut points: Vec<Point> = (0..100_000).map(|i| point(f64::from(i) * 0.01, 50.0, i > 0)).collect();
        points[61_234].y = 7.0;
        points[73_456].y = 93.0;
        let reduced = reduce(&points, 1000.0);
        assert!(reduced.len() <= 2_000, "{}", reduced.len());
        assert_eq!(reduced.iter().filter(|p| p.y == 7.0).count(), 1);
        assert_eq!(reduced.iter().filter(|p| p.y == 93.0).count(), 1);
        assert_eq!(reduced.iter().filter(|p| !p.joined).count(), 1);
    }

    #[test]
    fn a_gap_wider_than_a_pixel_stays_when_points_are_reduced() {
        let mut points: Vec<Point> = (0..10_000).map(|i| point(f64::from(i) * 0.01, 50.0, i > 0)).collect();
        points.drain(5_000..5_500);
        points[5_000].joined = false;
        assert_eq!(line(&reduce(&points, 100.0)).matches('M').count(), 2);
    }

    #[test]
    fn a_band_goes_out_above_and_back_below() {
        let points = [point(0.0, 8.0, false), point(2.0, 9.0, true)];
        assert_eq!(band(&points, 10.0), "M0 8l2 1l0 2l-2 1z");
    }
}
