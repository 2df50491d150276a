//! The camera model of thesis 3.3.1 and 4.2.3: K and the five distortion coefficients, forward with its
//! derivative and backward by Newton's method.

use core::fmt;

use nalgebra::{Matrix2, Matrix2x3, Vector3};

use crate::number::Number;

/// K and distortion, in the order and direction of OpenCV and the Caltech toolbox: the polynomial takes the
/// ideal normalised point to the distorted one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Focal lengths, px.
    pub focal: [f64; 2],
    /// Skew, px.
    pub skew: f64,
    /// Principal point, px.
    pub principal: [f64; 2],
    /// k1, k2, p1, p2, k3.
    pub distortion: [f64; 5],
}

/// Why a point has no place in the picture, or a pixel no ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LensError {
    /// The point lies in or behind the plane of the camera.
    Behind,
    /// The distortion polynomial is not invertible there.
    NotInvertible,
    /// A coordinate is not a finite number.
    NotFinite,
}

impl fmt::Display for LensError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Behind => "the point is not before the camera",
            Self::NotInvertible => "the distortion cannot be undone there",
            Self::NotFinite => "a coordinate is not a number",
        })
    }
}

impl core::error::Error for LensError {}

/// A step of Newton's method below this ends it (normalised units).
const CONVERGED_STEP: f64 = 1e-12;
/// Distorting an undistorted point must give the pixel back to this many pixels.
const ROUND_TRIP_PX: f64 = 5e-10;
/// Points of the way from the axis at which the polynomial is looked at where the quick bound does not
/// decide, and to which a pixel is followed that Newton's method alone does not bring back.
const WAY_POINTS: u32 = 32;

/// What is left of an area at these points at the least: so it does not vanish between two of them, and the
/// inverse is a lens' and not a rounding's.
const ROOM: f64 = 0.01;

/// The distorted point and the derivative of the distortion, which is symmetric.
#[derive(Clone, Copy)]
struct Distorted<N = f64> {
    x: N,
    y: N,
    xx: N,
    xy: N,
    yy: N,
}

impl Distorted {
    fn is_positive_definite(&self) -> bool {
        self.xx + self.yy > 0.0 && self.xx * self.yy - self.xy * self.xy > 0.0
    }
}

/// A pixel with its derivative by the point in camera coordinates.
#[derive(Clone, Copy)]
pub(crate) struct Linearised<N = f64> {
    pub(crate) at: [N; 2],
    /// Rows: by X, Y, Z; px/mm.
    pub(crate) du: [N; 3],
    pub(crate) dv: [N; 3],
}

impl Lens {
    /// Whether every number is finite and the focal lengths are positive.
    pub fn is_valid(&self) -> bool {
        let finite = self.skew.is_finite()
            && self.principal.iter().all(|c| c.is_finite())
            && self.distortion.iter().all(|c| c.is_finite());
        finite && self.focal.iter().all(|f| f.is_finite() && *f > 0.0)
    }

    /// The pixel of a point in camera coordinates (mm).
    ///
    /// # Errors
    /// The point is behind the camera, not finite, or where the distortion is not invertible.
    pub fn project(&self, point: &Vector3<f64>) -> Result<[f64; 2], LensError> {
        self.linearise([point.x, point.y, point.z]).map(|l| l.at)
    }

    /// The pixel of a point in camera coordinates (mm) with its derivative by that point, px/mm.
    ///
    /// # Errors
    /// As [`Lens::project`].
    pub fn project_with_jacobian(
        &self,
        point: &Vector3<f64>,
    ) -> Result<([f64; 2], Matrix2x3<f64>), LensError> {
        let l = self.linearise([point.x, point.y, point.z])?;
        let [a, b, c] = l.du;
        let [d, e, f] = l.dv;
        Ok((l.at, Matrix2x3::new(a, b, c, d, e, f)))
    }

    /// The ideal normalised point `(X/Z, Y/Z)` that is seen at a pixel.
    ///
    /// Newton's method, each step shortened until it leads nearer, and where that fails along the way from
    /// the axis; the answer is distorted again and compared with the pixel before it is given.
    ///
    /// # Errors
    /// The pixel is not finite, or no point in the invertible part is seen there.
    pub fn pixel_to_ray(&self, pixel: [f64; 2]) -> Result<[f64; 2], LensError> {
        let [u, v] = pixel;
        let target_y = (v - self.principal[1]) / self.focal[1];
        let target_x = (u - self.principal[0] - self.skew * target_y) / self.focal[0];
        if !(target_x.is_finite() && target_y.is_finite()) {
            return Err(LensError::NotFinite);
        }
        let target = [target_x, target_y];
        let ray = self.undistorted(target, target).or_else(|| self.undistorted_by_steps(target));
        ray.filter(|[x, y]| self.is_invertible(*x, *y)).ok_or(LensError::NotInvertible)
    }

    /// The ideal point whose distorted one is `target`, by Newton's method from `start`; `None` where that
    /// does not lead there.
    fn undistorted(&self, target: [f64; 2], [mut x, mut y]: [f64; 2]) -> Option<[f64; 2]> {
        let off = |here: &Distorted| [target[0] - here.x, target[1] - here.y];
        let square = |[x, y]: [f64; 2]| x * x + y * y;
        let mut here = self.distort(x, y);
        let mut error = square(off(&here));
        for _ in 0..64 {
            if !here.is_positive_definite() {
                return None;
            }
            let determinant = here.xx * here.yy - here.xy * here.xy;
            let [ex, ey] = off(&here);
            let dx = (here.yy * ex - here.xy * ey) / determinant;
            let dy = (here.xx * ey - here.xy * ex) / determinant;
            let mut share = 1.0;
            loop {
                let next = self.distort(x + share * dx, y + share * dy);
                let next_error = square(off(&next));
                if next.is_positive_definite() && next_error <= error {
                    (x, y) = (x + share * dx, y + share * dy);
                    (here, error) = (next, next_error);
                    break;
                }
                share *= 0.5;
                if share < 1e-3 {
                    break;
                }
            }
            if share < 1e-3 || square([dx, dy]) < CONVERGED_STEP * CONVERGED_STEP {
                break;
            }
        }
        let tolerance = ROUND_TRIP_PX / self.focal[0].max(self.focal[1]);
        // NaN fails the comparison.
        (error <= tolerance * tolerance).then_some([x, y])
    }

    /// The same from the axis on: near the edge of the invertible part Newton's method starts too far away,
    /// or where the derivative is nearly singular.
    #[cold]
    fn undistorted_by_steps(&self, target: [f64; 2]) -> Option<[f64; 2]> {
        (1..=WAY_POINTS).try_fold([0.0; 2], |at, step| {
            let share = f64::from(step) / f64::from(WAY_POINTS);
            self.undistorted(target.map(|coordinate| share * coordinate), at)
        })
    }

    /// The pixel of a camera point, or of several, with its derivative: the inner loop of the refinement.
    #[inline(always)]
    pub(crate) fn linearise<N: Number>(&self, [px, py, pz]: [N; 3]) -> Result<Linearised<N>, LensError> {
        // A sum is finite where all of it is.
        if !(px + py + pz).are_finite() {
            return Err(LensError::NotFinite);
        }
        if !pz.are_above(0.0) {
            return Err(LensError::Behind);
        }
        let w = N::of(1.0) / pz;
        let (x, y) = (px * w, py * w);
        let d = self.distort(x, y);
        if !self.is_invertible(x, y) {
            return Err(LensError::NotInvertible);
        }
        let ([fx, fy], skew) = (self.focal.map(N::of), N::of(self.skew));
        let ux = fx * d.xx + skew * d.xy;
        let uy = fx * d.xy + skew * d.yy;
        let vx = fy * d.xy;
        let vy = fy * d.yy;
        let principal = self.principal.map(N::of);
        Ok(Linearised {
            at: [fx * d.x + skew * d.y + principal[0], fy * d.y + principal[1]],
            du: [ux * w, uy * w, -(ux * x + uy * y) * w],
            dv: [vx * w, vy * w, -(vx * x + vy * y) * w],
        })
    }

    /// The centroid, px, of a patch whose centroid before the distortion is the ray (x, y), with second
    /// moments `moments` there: four points stand for the patch, each with the area that the distortion gives
    /// it.
    pub(crate) fn centroid(&self, [x, y]: [f64; 2], moments: &Matrix2<f64>) -> [f64; 2] {
        // Two steps whose squares, doubled and averaged over the four points, add up to the moments.
        let two = core::f64::consts::SQRT_2;
        let along = libm::sqrt(moments.m11.max(0.0));
        let (ax, ay) = (two * along, if along > 0.0 { two * moments.m12 / along } else { 0.0 });
        let by = libm::sqrt((2.0 * moments.m22 - ay * ay).max(0.0));
        let (mut sum_x, mut sum_y, mut areas) = (0.0, 0.0, 0.0);
        for (dx, dy) in [(ax, ay), (-ax, -ay), (0.0, by), (0.0, -by)] {
            let d = self.distort(x + dx, y + dy);
            let area = d.xx * d.yy - d.xy * d.xy;
            sum_x += area * d.x;
            sum_y += area * d.y;
            areas += area;
        }
        let (x, y) = (sum_x / areas, sum_y / areas);
        [self.focal[0] * x + self.skew * y + self.principal[0], self.focal[1] * y + self.principal[1]]
    }

    #[inline(always)]
    fn distort<N: Number>(&self, x: N, y: N) -> Distorted<N> {
        let [k1, k2, p1, p2, k3] = self.distortion.map(N::of);
        let [one, two, three, six] = [1.0, 2.0, 3.0, 6.0].map(N::of);
        let (x2, y2, xy) = (x * x, y * y, x * y);
        let r2 = x2 + y2;
        let radial = one + r2 * (k1 + r2 * (k2 + r2 * k3));
        // Twice the derivative of `radial` by r2.
        let slope = two * (k1 + r2 * (two * k2 + r2 * (three * k3)));
        Distorted {
            x: x * radial + two * p1 * xy + p2 * (r2 + two * x2),
            y: y * radial + p1 * (r2 + two * y2) + two * p2 * xy,
            xx: radial + slope * x2 + two * p1 * y + six * p2 * x,
            xy: slope * xy + two * (p1 * x + p2 * y),
            yy: radial + slope * y2 + six * p1 * y + two * p2 * x,
        }
    }

    /// Whether the distortion is invertible all the way from the axis to the point. Its derivative is
    /// symmetric, so it is one-to-one wherever that is positive definite.
    #[inline(always)]
    fn is_invertible<N: Number>(&self, x: N, y: N) -> bool {
        let [k1, k2, p1, p2, k3] = self.distortion.map(f64::abs);
        let (one, r2) = (N::of(1.0), x * x + y * y);
        // The smaller eigenvalue is above this, here and everywhere nearer to the axis (r <= (1 + r^2) / 2).
        let bound = one
            - r2 * (N::of(3.0 * k1) + r2 * (N::of(5.0 * k2) + r2 * N::of(7.0 * k3)))
            - N::of(3.0 * (p1 + p2)) * (one + r2);
        bound.are_above(0.0) || N::hold(x, y, |x, y| self.way_is_invertible(x, y))
    }

    #[cold]
    fn way_is_invertible(&self, x: f64, y: f64) -> bool {
        (1..=WAY_POINTS).all(|i| {
            let share = f64::from(i) / f64::from(WAY_POINTS);
            let d = self.distort(share * x, share * y);
            d.xx + d.yy > 0.0 && d.xx * d.yy - d.xy * d.xy > ROOM
        })
    }
}
