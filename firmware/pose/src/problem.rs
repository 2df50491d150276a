//! The observations as the solvers want them: checked, with their weights, and with the shape of the set.

use heapless::Vec;

use crate::geometry::{Observation, Pose};
use crate::lens::Lens;
use crate::linear::Basis;
use crate::number::{Number, Pair};
use crate::{MAX_CIRCLES, PoseError, Settings};

/// Circles that a pose needs whatever the settings say.
pub(crate) const MIN_CIRCLES: usize = 4;

/// One observation on plain numbers, or several side by side.
#[derive(Clone, Copy)]
pub(crate) struct Row<N = f64> {
    /// mm.
    pub(crate) point: [N; 3],
    /// px.
    pub(crate) at: [N; 2],
    /// The inverse covariance as `weight_u e_u^2 + weight_v (e_v - slope e_u)^2`.
    pub(crate) weight_u: N,
    pub(crate) weight_v: N,
    pub(crate) slope: N,
}

impl Row<Pair> {
    /// Two observations side by side; where there is no second one its place counts nothing.
    #[inline(always)]
    fn of(first: &Row, second: Option<&Row>) -> Self {
        let two = [first, second.unwrap_or(first)];
        let counts = Pair([1.0, if second.is_some() { 1.0 } else { 0.0 }]);
        Self {
            point: [0, 1, 2].map(|i| Pair::each(two, |row| row.point[i])),
            at: [0, 1].map(|i| Pair::each(two, |row| row.at[i])),
            weight_u: counts * Pair::each(two, |row| row.weight_u),
            weight_v: counts * Pair::each(two, |row| row.weight_v),
            slope: Pair::each(two, |row| row.slope),
        }
    }
}

/// The normalised points `(x, y)` of the observations, undistorted.
pub(crate) type Rays = Vec<[f64; 2], MAX_CIRCLES>;

/// Everything a solver needs to know.
pub(crate) struct Problem<'a> {
    pub(crate) rows: Vec<Row, MAX_CIRCLES>,
    pub(crate) lens: &'a Lens,
    pub(crate) settings: &'a Settings,
    pub(crate) basis: Basis,
}

/// What one circle's reprojection error amounts to.
#[derive(Clone, Copy)]
pub(crate) struct Error {
    /// Squared, px^2.
    pub(crate) px2: f64,
    /// Squared, in standard deviations.
    pub(crate) chi2: f64,
}

impl<'a> Problem<'a> {
    pub(crate) fn new(
        observations: &[Observation],
        lens: &'a Lens,
        settings: &'a Settings,
    ) -> Result<Self, PoseError> {
        let needed = usize::from(settings.min_circles).max(MIN_CIRCLES);
        let too_few = |circles: usize| PoseError::TooFew {
            circles: circles.min(255) as u8,
            needed: needed.min(255) as u8,
        };
        if observations.len() > MAX_CIRCLES {
            return Err(PoseError::TooMany);
        }
        if observations.len() < needed {
            return Err(too_few(observations.len()));
        }
        if !lens.is_valid() {
            return Err(PoseError::Lens);
        }
        let mut rows = Vec::new();
        for (observation, circle) in observations.iter().zip(0..) {
            let row = checked(observation, circle)?;
            rows.push(row).map_err(|_| PoseError::TooMany)?;
        }
        let distinct = distinct(&rows, needed);
        if distinct < needed {
            return Err(too_few(distinct));
        }
        let basis = Basis::of(&rows).ok_or(PoseError::OnOneLine)?;
        Ok(Self { rows, lens, settings, basis })
    }

    /// The mask of all observations.
    pub(crate) fn all(&self) -> u64 {
        u64::MAX >> (MAX_CIRCLES - self.rows.len().clamp(1, MAX_CIRCLES))
    }

    /// The rows of a mask.
    pub(crate) fn masked(&self, mask: u64) -> impl Iterator<Item = (usize, &Row)> {
        self.rows.iter().enumerate().filter(move |(i, _)| mask >> i & 1 == 1)
    }

    /// The rows of a mask, two at a time.
    pub(crate) fn pairs(&self, mask: u64) -> impl Iterator<Item = Row<Pair>> {
        let mut rows = self.masked(mask).map(|(_, row)| row);
        core::iter::from_fn(move || {
            let first = rows.next()?;
            Some(Row::<Pair>::of(first, rows.next()))
        })
    }

    /// The ray of every observation.
    pub(crate) fn rays(&self) -> Result<Rays, PoseError> {
        let mut rays = Rays::new();
        for (row, circle) in self.rows.iter().zip(0..) {
            let ray = self.lens.pixel_to_ray(row.at).map_err(|reason| PoseError::NoRay { circle, reason })?;
            rays.push(ray).map_err(|_| PoseError::TooMany)?;
        }
        Ok(rays)
    }

    /// Reprojection error of one row; infinite where the pose puts the circle out of the camera's sight.
    pub(crate) fn error(&self, row: &Row, pose: &Pose) -> Error {
        match self.lens.linearise(camera_point(row.point, pose)) {
            Ok(l) => {
                let (eu, ev) = (row.at[0] - l.at[0], row.at[1] - l.at[1]);
                let across = ev - row.slope * eu;
                Error {
                    px2: eu * eu + ev * ev,
                    chi2: row.weight_u * eu * eu + row.weight_v * across * across,
                }
            }
            Err(_) => Error { px2: f64::INFINITY, chi2: f64::INFINITY },
        }
    }

    /// Whether a circle is beyond the gate: by its covariance and by pixels.
    pub(crate) fn is_beyond_gate(&self, error: &Error) -> bool {
        let Settings { gate_sigmas, gate_px, .. } = *self.settings;
        let within = error.px2 <= gate_px * gate_px || error.chi2 <= gate_sigmas * gate_sigmas;
        !(within && error.px2.is_finite())
    }
}

/// A point in camera coordinates, or several at once.
#[inline(always)]
pub(crate) fn camera_point<N: Number>([x, y, z]: [N; 3], pose: &Pose) -> [N; 3] {
    let (r, t) = (&pose.rotation, &pose.translation);
    let along = |[a, b, c]: [f64; 3], t: f64| N::of(a) * x + N::of(b) * y + N::of(c) * z + N::of(t);
    [along([r.m11, r.m12, r.m13], t.x), along([r.m21, r.m22, r.m23], t.y), along([r.m31, r.m32, r.m33], t.z)]
}

/// Coordinates above this overflow when they are squared and summed (mm, px).
const TOO_LARGE: f64 = 1e9;

fn checked(observation: &Observation, circle: u8) -> Result<Row, PoseError> {
    let point: [f64; 3] = observation.point.into();
    let at = observation.centre.at;
    let usable = |c: &f64| c.abs() < TOO_LARGE;
    if !(point.iter().all(usable) && at.iter().all(usable)) {
        return Err(PoseError::NotFinite { circle });
    }
    let [uu, uv, vv] = observation.centre.covariance;
    let slope = uv / uu;
    let rest = vv - slope * uv;
    let (weight_u, weight_v) = (1.0 / uu, 1.0 / rest);
    // Neither zero, negative, infinite nor NaN, and the weights can be summed.
    let in_range = |w: f64| w > 1e-30 && w < 1e30;
    if !(in_range(weight_u) && in_range(weight_v)) {
        return Err(PoseError::Covariance { circle });
    }
    Ok(Row { point, at, weight_u, weight_v, slope })
}

/// Number of distinct points, counted up to `enough`.
fn distinct(rows: &[Row], enough: usize) -> usize {
    let mut kept: Vec<[f64; 3], MAX_CIRCLES> = Vec::new();
    for row in rows {
        if kept.len() >= enough {
            break;
        }
        if kept.iter().all(|k| *k != row.point) && kept.push(row.point).is_err() {
            break;
        }
    }
    kept.len()
}
