//! Which pixels of a row lie in a belt about an ellipse, for a block of rows at once.

use multiversion::multiversion;

use crate::lanes::inverse_sqrt;
use crate::patch::Belt;

/// Rows of a block.
pub(crate) const ROWS: usize = 16;

/// A gap in a row that is narrower, px, costs less than two spans.
const WORTHWHILE_PX: f32 = 3.0;

/// Adding this to a float of less leaves the rounded number in its last bits.
const TO_BITS: f32 = 8_388_608.0;

/// A belt between two ellipses of one shape, made ready for rows.
pub(crate) struct Chords {
    /// Centre, px.
    centre: [f32; 2],
    /// q0 x^2 + 2 q1 x y + q2 y^2 = radius^2 with q the inverse of the shape: q0 times the radii's squares, 1
    /// / q0, and q1 / q0.
    squares: [f32; 2],
    per_q0: f32,
    lean: f32,
    /// Columns of the part of the picture.
    width: f32,
}

/// The pixels of a block of rows: columns from the first up to the second number, that one excluded, and from
/// the third up to the fourth.
pub(crate) struct Spans([[u32; ROWS]; 4]);

impl Spans {
    pub(crate) const EMPTY: Self = Self([[0; ROWS]; 4]);

    /// Both spans of row `i` of the block.
    #[inline(always)]
    pub(crate) fn of(&self, i: usize) -> [(usize, usize); 2] {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| self.0[k][i % ROWS] as usize);
        [(a, b), (c, d)]
    }
}

impl Chords {
    /// Of ellipses of this shape (of determinant 1) about `centre`, in a part of the picture of this width,
    /// px.
    pub(crate) fn new(centre: [f64; 2], shape: [f64; 3], belt: &Belt, width: usize) -> Self {
        let q0 = shape[2];
        Self {
            centre: centre.map(|x| x as f32),
            squares: [belt.from, belt.to].map(|radius| (radius * radius * q0) as f32),
            per_q0: (1.0 / q0) as f32,
            lean: (shape[1] / q0) as f32,
            width: width as f32,
        }
    }

    /// The rows of a part of the picture that the belt reaches: from the first up to the second, that one
    /// excluded.
    pub(crate) fn rows(&self, height: usize) -> (usize, usize) {
        let reach = self.squares[1] * inverse_sqrt(self.squares[1]);
        let row = |y: f32| rounded(if y > 0.0 { y } else { 0.0 }) as usize;
        (row(self.centre[1] - reach + 0.5), row(self.centre[1] + reach + 0.5).min(height))
    }
}

/// The pixels of rows `first`, `first + every` and so on. Not inlined: so the compiler makes one loop
/// over whole vectors of it.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
pub(crate) fn cross(chords: &Chords, first: usize, every: usize, spans: &mut Spans) {
    let (first, every) = (first as i32 as f32 - chords.centre[1], every as i32 as f32);
    for i in 0..ROWS {
        let dy = first + every * (i as i32 as f32);
        // Half the chord that the row cuts out of each ellipse; none where it passes by.
        let half = |square: f32| {
            let rest = square - dy * dy;
            let rest = if rest > 0.0 { rest } else { 0.0 };
            rest * inverse_sqrt(rest) * chords.per_q0
        };
        let (from, to) = (half(chords.squares[0]), half(chords.squares[1]));
        let middle = chords.centre[0] + chords.lean * dy + 0.5;
        let column = |x: f32| {
            let x = if x > 0.0 { x } else { 0.0 };
            rounded(if x < chords.width { x } else { chords.width })
        };
        let is_gap = 2.0 * from > WORTHWHILE_PX;
        let end = middle + to;
        // Rounded up and down: what lies nearer to a belt's edge than a pixel hardly counts.
        spans.0[0][i] = column(middle - to);
        spans.0[1][i] = column(if is_gap { middle - from } else { end });
        spans.0[2][i] = column(if is_gap { middle + from } else { end });
        spans.0[3][i] = column(end);
    }
}

/// The nearest whole number to one of 0 to 2^23, in fewer instructions than `as` takes, which minds all
/// others.
#[inline(always)]
fn rounded(x: f32) -> u32 {
    (x + TO_BITS).to_bits() & ((1 << 23) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_the_pixels_between_the_ellipses() {
        let (centre, shape) = ([30.3, 28.9], [1.25, 0.3, (1.0 + 0.09) / 1.25]);
        for (from, to) in [(0.0, 9.4), (5.0, 8.2), (14.5, 18.0)] {
            let chords = Chords::new(centre, shape, &Belt { from, to }, 60);
            let mut spans = Spans::EMPTY;
            let (first, last) = chords.rows(60);
            for row in (0..60).step_by(2) {
                if row / 2 % ROWS == 0 {
                    cross(&chords, row, 2, &mut spans);
                }
                for column in 0..60 {
                    let [(a, b), (c, d)] = spans.of(row / 2 % ROWS);
                    let taken = (a..b).contains(&column) || (c..d).contains(&column);
                    let [x, y] = [column as f64 - centre[0], row as f64 - centre[1]];
                    let radius = (shape[2] * x * x - 2.0 * shape[1] * x * y + shape[0] * y * y).sqrt();
                    // Half a pixel along the row is up to 0.6 px of radius.
                    if radius > from + 0.6 && radius < to - 0.6 {
                        assert!(taken, "{from}-{to}: {column}, {row}");
                    }
                    let gap = from > 4.0 && radius < from - 0.6 - f64::from(WORTHWHILE_PX);
                    if radius > to + 0.6 || gap {
                        assert!(!taken, "{from}-{to}: {column}, {row}");
                    }
                    assert!(!taken || (first..last).contains(&row));
                }
            }
        }
    }

    #[test]
    fn spans_end_where_the_picture_does() {
        let chords = Chords::new([2.0, 50.0], [1.0, 0.0, 1.0], &Belt::whole(8.0), 7);
        let mut spans = Spans::EMPTY;
        cross(&chords, 50, 1, &mut spans);
        assert_eq!(spans.of(0), [(0, 7), (7, 7)]);
        assert_eq!(spans.of(ROWS - 1).map(|(from, to)| to - from), [0, 0]);
        assert_eq!(chords.rows(53), (42, 53));
    }
}
