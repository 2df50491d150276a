//! A first solver, so that the frame loop can run.
#![allow(missing_docs)]
use crate::*;
use nalgebra::{Matrix3, Matrix6, Rotation3, SMatrix, Vector3, Vector6};
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    pub point: Vector3<f64>,
    pub centre: Centre,
}
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PoseError {
    TooFew,
    Degenerate,
    NoConvergence,
}
#[derive(Clone, Debug, PartialEq)]
pub struct Alternative {
    pub pose: Pose,
    pub ratio: f64,
}
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    pub pose: Pose,
    pub covariance: Matrix6<f64>,
    pub residual_px: f64,
    pub used: u64,
    pub alternative: Option<Alternative>,
}
#[derive(Clone, Debug, PartialEq)]
pub struct RestPose {
    pub pose: Pose,
    pub covariance: Matrix6<f64>,
}
pub struct Motion {
    pub displacement_mm: [f64; 3],
    pub rotation_deg: [f64; 3],
    pub covariance: Matrix6<f64>,
}
pub struct Projected {
    pub centre: [f64; 2],
    pub shape: [f64; 3],
    pub bias: [f64; 2],
    pub diameter_px: f64,
}
impl Lens {
    fn jac(&self, x: f64, y: f64) -> ([f64; 2], [[f64; 2]; 2]) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let rad = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let dr = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
        let xd = x * rad + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let yd = y * rad + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        let a = rad + 2.0 * x * x * dr + 2.0 * p1 * y + 6.0 * p2 * x;
        let b = 2.0 * x * y * dr + 2.0 * p1 * x + 2.0 * p2 * y;
        let d = rad + 2.0 * y * y * dr + 6.0 * p1 * y + 2.0 * p2 * x;
        let (fx, fy, s) = (self.focal[0], self.focal[1], self.skew);
        (
            [fx * xd + s * yd + self.principal[0], fy * yd + self.principal[1]],
            [[fx * a + s * b, fx * b + s * d], [fy * b, fy * d]],
        )
    }
    pub fn project(&self, p: &Vector3<f64>) -> Result<[f64; 2], LensError> {
        if p.z <= 0.0 {
            return Err(LensError::Behind);
        }
        Ok(self.jac(p.x / p.z, p.y / p.z).0)
    }
    pub fn ray(&self, px: [f64; 2]) -> Result<[f64; 2], LensError> {
        let y = (px[1] - self.principal[1]) / self.focal[1];
        let mut v = [(px[0] - self.principal[0] - self.skew * y) / self.focal[0], y];
        for _ in 0..20 {
            let (q, j) = self.jac(v[0], v[1]);
            let e = [px[0] - q[0], px[1] - q[1]];
            let det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
            v[0] += (j[1][1] * e[0] - j[0][1] * e[1]) / det;
            v[1] += (-j[1][0] * e[0] + j[0][0] * e[1]) / det;
        }
        Ok(v)
    }
}
fn expso3(w: Vector3<f64>) -> Matrix3<f64> {
    Rotation3::from_scaled_axis(w).into_inner()
}
fn refine(
    obs: &[Observation],
    mask: u64,
    lens: &Lens,
    start: &Pose,
) -> Result<(Pose, Matrix6<f64>, f64, f64), PoseError> {
    let mut pose = *start;
    let mut lambda = 0.0;
    let mut last = f64::INFINITY;
    for _ in 0..30 {
        let mut h = Matrix6::zeros();
        let mut g = Vector6::zeros();
        let (mut cost, mut sq, mut n) = (0.0, 0.0, 0.0);
        for (i, o) in obs.iter().enumerate() {
            if mask >> i & 1 == 0 {
                continue;
            }
            let rp = pose.rotation * o.point;
            let p = rp + pose.translation;
            if p.z <= 1.0 {
                return Err(PoseError::NoConvergence);
            }
            let (x, y) = (p.x / p.z, p.y / p.z);
            let (px, j) = lens.jac(x, y);
            let e = [o.centre.at[0] - px[0], o.centre.at[1] - px[1]];
            let [a, b, d] = o.centre.covariance;
            let det = a * d - b * b;
            let w = [[d / det, -b / det], [-b / det, a / det]];
            let iz = 1.0 / p.z;
            let mut jp = [[0.0; 6]; 2];
            for r in 0..2 {
                let t = [j[r][0] * iz, j[r][1] * iz, -(j[r][0] * x + j[r][1] * y) * iz];
                jp[r][0] = rp.y * t[2] - rp.z * t[1];
                jp[r][1] = rp.z * t[0] - rp.x * t[2];
                jp[r][2] = rp.x * t[1] - rp.y * t[0];
                jp[r][3] = t[0];
                jp[r][4] = t[1];
                jp[r][5] = t[2];
            }
            let we = [w[0][0] * e[0] + w[0][1] * e[1], w[1][0] * e[0] + w[1][1] * e[1]];
            cost += e[0] * we[0] + e[1] * we[1];
            sq += e[0] * e[0] + e[1] * e[1];
            n += 1.0;
            for r in 0..6 {
                g[r] += jp[0][r] * we[0] + jp[1][r] * we[1];
                let wr = [w[0][0] * jp[0][r] + w[0][1] * jp[1][r], w[1][0] * jp[0][r] + w[1][1] * jp[1][r]];
                for c in 0..6 {
                    h[(r, c)] += wr[0] * jp[0][c] + wr[1] * jp[1][c];
                }
            }
        }
        if !cost.is_finite() {
            return Err(PoseError::NoConvergence);
        }
        let mut hl = h;
        for r in 0..6 {
            hl[(r, r)] *= 1.0 + lambda;
        }
        let Some(ch) = hl.cholesky() else { return Err(PoseError::Degenerate) };
        let step = ch.solve(&g);
        let done = (last - cost).abs() < 1e-9 * (1.0 + cost);
        if done {
            let inv = h.cholesky().ok_or(PoseError::Degenerate)?.inverse();
            return Ok((pose, inv, libm::sqrt(sq / n), cost));
        }
        last = cost;
        lambda = 0.0;
        pose = Pose {
            rotation: expso3(step.fixed_rows::<3>(0).into_owned()) * pose.rotation,
            translation: pose.translation + step.fixed_rows::<3>(3),
        };
    }
    Err(PoseError::NoConvergence)
}
fn dlt(obs: &[Observation], lens: &Lens) -> Result<Pose, PoseError> {
    let mut m = SMatrix::<f64, 12, 12>::zeros();
    let mut mean = Vector3::zeros();
    for o in obs {
        mean += o.point;
    }
    mean /= obs.len() as f64;
    let scale = 1.0 / 300.0;
    for o in obs {
        let [u, v] = lens.ray(o.centre.at).map_err(|_| PoseError::Degenerate)?;
        let q = (o.point - mean) * scale;
        let x = [q.x, q.y, q.z, 1.0];
        let mut r1 = [0.0; 12];
        let mut r2 = [0.0; 12];
        for k in 0..4 {
            r1[k] = x[k];
            r1[8 + k] = -u * x[k];
            r2[4 + k] = x[k];
            r2[8 + k] = -v * x[k];
        }
        for a in 0..12 {
            for b in 0..12 {
                m[(a, b)] += r1[a] * r1[b] + r2[a] * r2[b];
            }
        }
    }
    let eig = m.symmetric_eigen();
    let k = eig.eigenvalues.imin();
    let p = eig.eigenvectors.column(k);
    let mut a = Matrix3::new(p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]) * scale;
    let mut t = Vector3::new(p[3], p[7], p[11]);
    let det = a.determinant();
    let s = libm::cbrt(det);
    a /= s;
    t /= s;
    let svd = a.svd(true, true);
    let (Some(uu), Some(vt)) = (svd.u, svd.v_t) else { return Err(PoseError::Degenerate) };
    let r = uu * vt;
    Ok(Pose { rotation: r, translation: t - r * mean })
}
pub fn solve(
    obs: &[Observation],
    lens: &Lens,
    settings: &Settings,
    prior: Option<&Pose>,
) -> Result<Solution, PoseError> {
    if obs.len() < usize::from(settings.min_circles).max(4) {
        return Err(PoseError::TooFew);
    }
    let start = match prior {
        Some(p) => *p,
        None => dlt(obs, lens)?,
    };
    let mut mask = if obs.len() == 64 { u64::MAX } else { (1 << obs.len()) - 1 };
    loop {
        let (pose, covariance, residual_px, _) = refine(obs, mask, lens, &start)?;
        let mut worst = (0.0, 0);
        for (i, o) in obs.iter().enumerate() {
            if mask >> i & 1 == 0 {
                continue;
            }
            let p = lens.project(&pose.transform(&o.point)).map_err(|_| PoseError::NoConvergence)?;
            let e = libm::hypot(p[0] - o.centre.at[0], p[1] - o.centre.at[1]);
            if e > worst.0 {
                worst = (e, i);
            }
        }
        if worst.0 < settings.gate_px {
            return Ok(Solution { pose, covariance, residual_px, used: mask, alternative: None });
        }
        mask &= !(1 << worst.1);
        if mask.count_ones() < u32::from(settings.min_circles) {
            return Err(PoseError::TooFew);
        }
    }
}
pub fn rest_mean(s: &[Solution]) -> Result<RestPose, PoseError> {
    let mut w = Vector3::zeros();
    let mut t = Vector3::zeros();
    let r0 = s[0].pose.rotation;
    let mut c = Matrix6::zeros();
    for x in s {
        w += Rotation3::from_matrix_unchecked(x.pose.rotation * r0.transpose()).scaled_axis();
        t += x.pose.translation;
        c += x.covariance;
    }
    let n = s.len() as f64;
    Ok(RestPose { pose: Pose { rotation: expso3(w / n) * r0, translation: t / n }, covariance: c / (n * n) })
}
pub fn relative_motion(rest: &RestPose, s: &Solution) -> Motion {
    let r0t = rest.pose.rotation.transpose();
    let d = r0t * s.pose.rotation;
    let t = r0t * (s.pose.translation - rest.pose.translation);
    let yaw = libm::atan2(d[(1, 0)], d[(0, 0)]);
    let (sy, cy) = (libm::sin(yaw), libm::cos(yaw));
    let pitch = libm::atan2(-d[(2, 0)], cy * d[(0, 0)] + sy * d[(1, 0)]);
    let roll = libm::atan2(sy * d[(0, 2)] - cy * d[(1, 2)], -sy * d[(0, 1)] + cy * d[(1, 1)]);
    let deg = 180.0 / core::f64::consts::PI;
    let mut j = Matrix6::zeros();
    j.fixed_view_mut::<3, 3>(0, 3).copy_from(&r0t);
    j.fixed_view_mut::<3, 3>(3, 0).copy_from(&(r0t * deg));
    Motion {
        displacement_mm: [t.x, t.y, t.z],
        rotation_deg: [roll * deg, pitch * deg, yaw * deg],
        covariance: j * (s.covariance + rest.covariance) * j.transpose(),
    }
}
pub fn project_circle(c: &Circle, pose: &Pose, lens: &Lens) -> Result<Projected, LensError> {
    let p = pose.transform(&c.point);
    let n = pose.rotation * c.normal;
    if p.z <= 0.0 {
        return Err(LensError::Behind);
    }
    let r2 = 0.25 * c.outer_mm * c.outer_mm;
    // dual conic r^2 (I - n n^T) - p p^T
    let q = (Matrix3::identity() - n * n.transpose()) * r2 - p * p.transpose();
    let ce = [q[(0, 2)] / q[(2, 2)], q[(1, 2)] / q[(2, 2)]];
    let e = [
        ce[0] * ce[0] - q[(0, 0)] / q[(2, 2)],
        ce[0] * ce[1] - q[(0, 1)] / q[(2, 2)],
        ce[1] * ce[1] - q[(1, 1)] / q[(2, 2)],
    ];
    let (centre, j) = lens.jac(p.x / p.z, p.y / p.z);
    let off = [ce[0] - p.x / p.z, ce[1] - p.y / p.z];
    let bias = [j[0][0] * off[0] + j[0][1] * off[1], j[1][0] * off[0] + j[1][1] * off[1]];
    let m = |a: [f64; 2], b: [f64; 2]| {
        0.25 * (a[0] * (e[0] * b[0] + e[1] * b[1]) + a[1] * (e[1] * b[0] + e[2] * b[1]))
    };
    let shape = [m(j[0], j[0]), m(j[0], j[1]), m(j[1], j[1])];
    let d = 4.0 * libm::sqrt(libm::sqrt((shape[0] * shape[2] - shape[1] * shape[1]).max(0.0)));
    Ok(Projected { centre, shape, bias, diameter_px: d })
}
