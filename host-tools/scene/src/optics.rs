//! The simulator's own camera: K, distortion and rigid poses (thesis 3.3.1, 4.2.3; conventions of the carbody
//! and camera frames). It shares no line with the firmware's lens, so that each can judge the other.

/// A vector; mm unless said otherwise.
pub(crate) type Vec3 = [f64; 3];
/// A 3x3 matrix, row by row.
pub(crate) type Mat3 = [[f64; 3]; 3];

/// Carbody axes seen by a camera that looks straight ahead: x right, y down, z forward.
const STRAIGHT_AHEAD: Mat3 = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]];

/// Nearest depth at which a point is still in front of the camera, mm.
pub(crate) const NEAREST_MM: f64 = 1.0;

/// Matrix times vector.
pub(crate) fn apply(m: &Mat3, v: &Vec3) -> Vec3 {
    m.map(|row| dot(&row, v))
}

/// Matrix times matrix.
pub(crate) fn multiply(a: &Mat3, b: &Mat3) -> Mat3 {
    let columns = transpose(b);
    a.map(|row| columns.map(|column| dot(&row, &column)))
}

/// The transposed matrix.
pub(crate) fn transpose(m: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// Scalar product.
pub(crate) fn dot(a: &Vec3, b: &Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub(crate) fn cross(a: &Vec3, b: &Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Sum of two vectors.
pub(crate) fn add(a: &Vec3, b: &Vec3) -> Vec3 {
    std::array::from_fn(|i| a[i] + b[i])
}

/// A vector times a number.
pub(crate) fn scale(a: &Vec3, by: f64) -> Vec3 {
    a.map(|value| value * by)
}

/// The inverse of a matrix, or nothing where it has none.
pub(crate) fn inverse(m: &Mat3) -> Option<Mat3> {
    let [a, b, c] = transpose(m);
    let rows = [cross(&b, &c), cross(&c, &a), cross(&a, &b)];
    let determinant = dot(&a, &rows[0]);
    (determinant.abs() > f64::MIN_POSITIVE).then(|| rows.map(|row| scale(&row, 1.0 / determinant)))
}

/// `Rz(yaw) Ry(pitch) Rx(roll)`, degrees.
pub(crate) fn rotation(roll_deg: f64, pitch_deg: f64, yaw_deg: f64) -> Mat3 {
    let (sr, cr) = roll_deg.to_radians().sin_cos();
    let (sp, cp) = pitch_deg.to_radians().sin_cos();
    let (sy, cy) = yaw_deg.to_radians().sin_cos();
    let rz = [[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]];
    let ry = [[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]];
    let rx = [[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]];
    multiply(&rz, &multiply(&ry, &rx))
}

/// `X_c = R X + t`: carbody to camera, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose {
    /// R, row by row.
    pub(crate) rotation: Mat3,
    /// t, mm.
    pub(crate) translation: Vec3,
}

impl Pose {
    /// The pose of a camera at `position` (mm, in the carbody) that looks along the carbody's x axis and is
    /// then turned by yaw (to the left), pitch (downwards) and roll, degrees.
    pub(crate) fn of_camera(position: &Vec3, roll_deg: f64, pitch_deg: f64, yaw_deg: f64) -> Self {
        let mount = rotation(roll_deg, pitch_deg, yaw_deg);
        let rotation = multiply(&STRAIGHT_AHEAD, &transpose(&mount));
        Self { rotation, translation: scale(&apply(&rotation, position), -1.0) }
    }

    /// This rest pose after a motion of the carbody by `displacement` (mm) and `turn`, both in the rest
    /// frame: `R_t = R0 dR`, `t_t = t0 + R0 d` (thesis 3.22 solved for the moved pose).
    pub(crate) fn moved(&self, displacement: &Vec3, turn: &Mat3) -> Self {
        Self {
            rotation: multiply(&self.rotation, turn),
            translation: add(&self.translation, &apply(&self.rotation, displacement)),
        }
    }

    /// A carbody point in camera coordinates, mm.
    pub(crate) fn transform(&self, point: &Vec3) -> Vec3 {
        add(&apply(&self.rotation, point), &self.translation)
    }
}

/// K and the distortion k1 k2 p1 p2 k3, which takes the ideal normalised point to the distorted one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lens {
    focal: [f64; 2],
    principal: [f64; 2],
    skew: f64,
    distortion: [f64; 5],
    /// Square of the normalised radius up to which the radial polynomial grows.
    reach: f64,
}

/// The ray of a pixel: the ideal point at depth 1 and how it moves with the pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Ray {
    /// Ideal normalised point.
    pub(crate) at: [f64; 2],
    /// Its derivative by u (first column) and v (second column), per px.
    pub(crate) per_px: [[f64; 2]; 2],
}

impl Lens {
    /// A lens; focal lengths, principal point and skew in px.
    pub(crate) fn new(focal: [f64; 2], principal: [f64; 2], skew: f64, distortion: [f64; 5]) -> Self {
        let [k1, k2, _, _, k3] = distortion;
        // d(r g(r^2))/dr in steps of 1/1000 of the radius, up to a half angle of 76 degrees.
        let grows = |r2: f64| 1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3)) > 0.0;
        let radius = (0..=4000).map(|i| f64::from(i) / 1000.0).take_while(|r| grows(r * r)).last();
        Self { focal, principal, skew, distortion, reach: radius.map_or(0.0, |r| r * r) }
    }

    /// The distorted point of an ideal one, and its Jacobian.
    fn distort(&self, [x, y]: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
        let at = [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ];
        let mixed = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        let jacobian = [
            [radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, mixed],
            [mixed, radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x],
        ];
        (at, jacobian)
    }

    /// The pixel of a point in camera coordinates; nothing if it is not in front of the camera or so far off
    /// the axis that the distortion folds back.
    pub(crate) fn project(&self, point: &Vec3) -> Option<[f64; 2]> {
        let [x, y, z] = *point;
        if z.is_nan() || z < NEAREST_MM {
            return None;
        }
        let ideal = [x / z, y / z];
        if ideal[0] * ideal[0] + ideal[1] * ideal[1] > self.reach {
            return None;
        }
        let ([xd, yd], _) = self.distort(ideal);
        Some([
            self.focal[0] * xd + self.skew * yd + self.principal[0],
            self.focal[1] * yd + self.principal[1],
        ])
    }

    /// The ray of a pixel by Newton's method from `start` (an ideal point nearby).
    pub(crate) fn ray(&self, [u, v]: [f64; 2], start: [f64; 2]) -> Option<Ray> {
        let yd = (v - self.principal[1]) / self.focal[1];
        let xd = (u - self.principal[0] - self.skew * yd) / self.focal[0];
        let mut at = start;
        for _ in 0..20 {
            let ([x, y], [[a, b], [c, d]]) = self.distort(at);
            let determinant = a * d - b * c;
            if determinant <= 1e-6 {
                return None;
            }
            let (ex, ey) = (xd - x, yd - y);
            let step = [(d * ex - b * ey) / determinant, (a * ey - c * ex) / determinant];
            at = [at[0] + step[0], at[1] + step[1]];
            if step[0].abs() + step[1].abs() < 1e-13 {
                // The pixel's own axes in normalised coordinates: inverse of K's upper left part.
                let (ux, vy) = (1.0 / self.focal[0], 1.0 / self.focal[1]);
                let vx = -self.skew * ux * vy;
                let (i, j) = (1.0 / determinant, [[d, -b], [-c, a]]);
                let per_px = [
                    [i * j[0][0] * ux, i * (j[0][0] * vx + j[0][1] * vy)],
                    [i * j[1][0] * ux, i * (j[1][0] * vx + j[1][1] * vy)],
                ];
                return (at[0] * at[0] + at[1] * at[1] <= self.reach).then_some(Ray { at, per_px });
            }
        }
        None
    }
}

#[cfg(test)]
#[path = "optics/tests.rs"]
mod tests;
