//! The picture of one printed ring by its own projection: a camera that sees a tilted circle, edges by area,
//! blur of the lens, light that slopes, noise of photons and of reading, whole grey levels. And what its
//! pixels can tell at best.

use gangway_device::{Frame, Layout};
use gangway_pose::{Circle, Lens, Pose, Projected, project_circle};
use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::random::Random;

/// Focal length of the camera, px.
const FOCAL_PX: f64 = 1470.0;

/// Outer diameter of the ring, mm, and how many times it is the inner one.
const OUTER_MM: f64 = 60.0;
const RATIO: f64 = 2.0;

/// Diameters over a target: the light changes by its `uneven` from one side of it to the other.
const TARGET_DIAMETERS: f64 = 7.0;

/// Parts of a pixel either way that are drawn.
const FINE: usize = 8;

/// Electrons of full scale, and of reading.
const FULL_WELL_E: f64 = 12_000.0;
const READ_NOISE_E: f64 = 20.0;

/// What a picture is like.
#[derive(Clone, Copy, Debug)]
pub struct Conditions {
    /// Diameter in the picture, px.
    pub diameter_px: f64,
    /// Angle between the ring's normal and the line of sight, degrees.
    pub angle_deg: f64,
    /// Standard deviation of the lens' blur, px.
    pub blur_px: f64,
    /// Change of the light over the target, share.
    pub uneven: f64,
    /// Bits of a sample.
    pub bits: u8,
    /// Level of the white, share of full scale; above 1 it is clipped.
    pub white: f64,
    /// White around the ring, px where the tilt leaves least of it; beyond it all is dark.
    pub margin_px: f64,
}

impl Default for Conditions {
    fn default() -> Self {
        Self {
            diameter_px: 24.0,
            angle_deg: 10.0,
            blur_px: 0.7,
            uneven: 0.1,
            bits: 8,
            white: 0.8,
            margin_px: 4.0,
        }
    }
}

/// A ring before a camera.
pub struct Scene {
    conditions: Conditions,
    circle: Circle,
    pose: Pose,
    lens: Lens,
    size: usize,
    /// Direction of the light's slope.
    slope: [f64; 2],
}

/// What varies from picture to picture, and what a fit has to find: by these the information is counted.
const UNKNOWNS: usize = 9;

/// Levels, edges and place of a drawn ring, as changes from the scene's own.
#[derive(Clone, Copy, Default)]
struct Change {
    at: [f64; 2],
    white: f64,
    black: f64,
    slope: [f64; 2],
    outer: f64,
    inner: f64,
    blur: f64,
}

impl Scene {
    /// A ring at a random place between the pixels, tilted about a random axis, off the camera's axis.
    pub fn new(conditions: Conditions, random: &mut Random) -> Self {
        let reach = 0.5 * conditions.diameter_px * 1.1 + 1.25 * conditions.margin_px + 6.0;
        let size = 2 * (1.3 * reach).ceil() as usize + 9;
        let middle = 0.5 * (size - 1) as f64;
        let distance = FOCAL_PX * OUTER_MM / conditions.diameter_px;
        let [u, v] = [0, 1].map(|_| middle + random.within(0.5));
        // The picture is a part of a larger one.
        let off = [random.within(600.0), random.within(300.0)];
        let lens = Lens {
            focal: [FOCAL_PX; 2],
            skew: 0.0,
            principal: [middle + off[0], middle + off[1]],
            distortion: [0.0; 5],
        };
        let ray = Vector3::new((u - lens.principal[0]) / FOCAL_PX, (v - lens.principal[1]) / FOCAL_PX, 1.0);
        let sight = -ray.normalize();
        let about = random.within(std::f64::consts::PI);
        let across = sight.cross(&Vector3::x()).normalize();
        let across = across * about.cos() + sight.cross(&across) * about.sin();
        let tilt = conditions.angle_deg.to_radians();
        let normal = sight * tilt.cos() + across * tilt.sin();
        let circle = Circle {
            point: ray * distance,
            normal,
            outer_mm: OUTER_MM,
            inner_mm: OUTER_MM / RATIO,
            target: 0,
        };
        let pose = Pose { rotation: Matrix3::identity(), translation: Vector3::zeros() };
        let turn = random.within(std::f64::consts::PI);
        let share = conditions.uneven / (TARGET_DIAMETERS * conditions.diameter_px);
        Self { conditions, circle, pose, lens, size, slope: [share * turn.cos(), share * turn.sin()] }
    }

    /// Where the circle is seen and how, as a pose tells it.
    pub fn projected(&self) -> Projected {
        project_circle(&self.circle, &self.pose, &self.lens).expect("a circle before the camera")
    }

    /// Distance of a ray's point in the ring's plane from the ring's centre, mm.
    fn radius(&self, u: f64, v: f64) -> f64 {
        let [x, y] = [(u - self.lens.principal[0]) / FOCAL_PX, (v - self.lens.principal[1]) / FOCAL_PX];
        let ray = Vector3::new(x, y, 1.0);
        let Circle { point, normal, .. } = self.circle;
        let hit = ray * (normal.dot(&point) / normal.dot(&ray));
        (hit - point).norm()
    }

    /// The light on every pixel, share of full scale, not clipped: by parts of pixels, each by the share that
    /// the ring covers of it, blurred.
    pub fn light(&self) -> Vec<f64> {
        let Conditions { blur_px, margin_px, diameter_px, .. } = self.conditions;
        let (size, fine) = (self.size, self.size * FINE);
        let step = 1.0 / FINE as f64;
        let black = 0.12 / 0.8;
        let mm_per_px = OUTER_MM / diameter_px;
        let margin_mm = margin_px * mm_per_px / self.conditions.angle_deg.to_radians().cos();
        let radii = [0.5 * OUTER_MM + margin_mm, 0.5 * OUTER_MM, 0.5 * OUTER_MM / RATIO];
        let mut parts = vec![0.0; fine * fine];
        for (row, line) in parts.chunks_exact_mut(fine).enumerate() {
            for (column, part) in line.iter_mut().enumerate() {
                let at = |i: usize| (i as f64 + 0.5) * step - 0.5;
                let (u, v) = (at(column), at(row));
                let radius = self.radius(u, v);
                // How much of the part lies within each edge, by its distance: radii grow by a few mm a
                // pixel.
                let [sheet, outer, inner] =
                    radii.map(|edge| ((edge - radius) / (mm_per_px * step) + 0.5).clamp(0.0, 1.0));
                *part = 0.3 + 0.7 * sheet - (1.0 - black) * (outer - inner);
            }
        }
        blur(&mut parts, fine, blur_px * FINE as f64);
        let middle = 0.5 * (size - 1) as f64;
        (0..size * size)
            .map(|i| {
                let (x, y) = (i % size, i / size);
                let sum: f64 = (0..FINE)
                    .map(|k| {
                        let from = (y * FINE + k) * fine + x * FINE;
                        parts[from..from + FINE].iter().sum::<f64>()
                    })
                    .sum();
                let slope = self.slope[0] * (x as f64 - middle) + self.slope[1] * (y as f64 - middle);
                self.conditions.white * (1.0 + slope) * sum * step * step
            })
            .collect()
    }

    /// Variance of a pixel under this light, shares of full scale: photons, reading, rounding.
    fn variance(&self, light: f64) -> f64 {
        let rounding = 1.0 / (12.0 * self.full().powi(2));
        light.max(0.0) / FULL_WELL_E + (READ_NOISE_E / FULL_WELL_E).powi(2) + rounding
    }

    fn full(&self) -> f64 {
        f64::from((1u32 << self.conditions.bits) - 1)
    }

    /// How the samples lie.
    fn layout(&self) -> Layout {
        match self.conditions.bits {
            8 => Layout::GREY,
            bits => Layout::Word { bits },
        }
    }

    /// The samples of one exposure.
    pub fn expose(&self, light: &[f64], random: &mut Random) -> Vec<u8> {
        let full = self.full();
        let levels = light.iter().map(|light| {
            let noise = (light.max(0.0) / FULL_WELL_E + (READ_NOISE_E / FULL_WELL_E).powi(2)).sqrt();
            ((light + noise * random.normal()) * full).round().clamp(0.0, full) as u16
        });
        match self.layout() {
            Layout::Byte { .. } => levels.map(|level| level as u8).collect(),
            _ => levels.flat_map(u16::to_le_bytes).collect(),
        }
    }

    /// The samples of an exposure without noise, as exactly as the bits tell.
    pub fn exact(&self, light: &[f64]) -> Vec<u8> {
        let full = self.full();
        light
            .iter()
            .flat_map(|light| ((light * full).round().clamp(0.0, full) as u16).to_le_bytes())
            .collect()
    }

    /// A frame over such samples.
    pub fn frame<'a>(&self, bytes: &'a [u8]) -> Frame<'a> {
        let size = (self.size as u16, self.size as u16);
        Frame::new(bytes, size, bytes.len() / self.size, self.layout(), 0, 0).expect("whole rows")
    }

    /// The least standard deviation per axis that any unbiased centre can have, px: Cramer and Rao's bound
    /// for the centre beside eight unknowns - levels of white and black, both slopes of the light, both radii
    /// and the blur - from all pixels that are not clipped, up to so many px of white around the ring.
    pub fn bound_px(&self, white_px: f64) -> f64 {
        let projected = self.projected();
        let mut information = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
        let step = 1e-4;
        let change = |k: usize, by: f64| {
            let mut change = Change::default();
            match k {
                0 | 1 => change.at[k] = by,
                2 => change.white = by,
                3 => change.black = by,
                4 | 5 => change.slope[k - 4] = by,
                6 => change.outer = by,
                7 => change.inner = by,
                _ => change.blur = by,
            }
            change
        };
        for i in 0..self.size * self.size {
            let at = [(i % self.size) as f64, (i / self.size) as f64];
            if self.is_beyond(&projected, at, white_px) {
                continue;
            }
            let level = self.model(&projected, at, &Change::default());
            let variance = self.variance(level);
            if level + 2.0 * variance.sqrt() > 1.0 {
                continue;
            }
            let of = |k: usize, by: f64| self.model(&projected, at, &change(k, by));
            let rates =
                SMatrix::<f64, UNKNOWNS, 1>::from_fn(|k, _| (of(k, step) - of(k, -step)) / (2.0 * step));
            information += rates * rates.transpose() / variance;
        }
        let scaled = information.map_with_location(|row, column, entry| {
            entry / (information[(row, row)] * information[(column, column)]).sqrt()
        });
        let inverse = scaled.try_inverse().expect("a ring determines its centre");
        let variance = |k: usize| inverse[(k, k)] / information[(k, k)];
        (0.5 * (variance(0) + variance(1))).sqrt()
    }

    /// A place in the picture in the plane where the outer edge is a circle about the origin, and that circle's
    /// radius, px.
    fn in_circle(&self, projected: &Projected, at: [f64; 2]) -> ([f64; 2], f64, f64) {
        let [uu, uv, vv] = projected.shape;
        let root = (uu * vv - uv * uv).sqrt();
        let [u, v] = [0, 1].map(|i| at[i] - projected.centre[i]);
        let radius = ((vv * u * u - 2.0 * uv * u * v + uu * v * v) / root).sqrt();
        ([u, v], radius, 2.0 * root.sqrt())
    }

    /// Whether a pixel sees the dark beyond the sheet, or is further from the ring than white is counted.
    fn is_beyond(&self, projected: &Projected, at: [f64; 2], white_px: f64) -> bool {
        let (_, radius, outer) = self.in_circle(projected, at);
        // In the circle's plane the tilt stretches what is across it.
        let stretch = self.conditions.angle_deg.to_radians().cos().sqrt().recip();
        let white = (self.conditions.margin_px - 2.0 * self.conditions.blur_px).min(white_px);
        radius > outer + stretch * white
    }

    /// The level of a pixel by blurred edges along ellipses.
    fn model(&self, projected: &Projected, at: [f64; 2], change: &Change) -> f64 {
        let at = [0, 1].map(|i| at[i] - change.at[i]);
        let ([u, v], radius, outer) = self.in_circle(projected, at);
        let blur = (self.conditions.blur_px.powi(2) + 1.0 / 12.0).sqrt() + change.blur;
        let within = |edge: f64| normal_share((edge - radius) / blur);
        let white = (self.conditions.white + change.white)
            * (1.0 + (self.slope[0] + change.slope[0]) * u + (self.slope[1] + change.slope[1]) * v);
        let depth = 1.0 - 0.12 / 0.8 + change.black;
        white * (1.0 - depth * (within(outer + change.outer) - within(outer / RATIO + change.inner)))
    }
}

/// Share of a normal distribution below `z` (Abramowitz and Stegun 7.1.26, to 2e-7).
fn normal_share(z: f64) -> f64 {
    let x = z.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let series = t
        * (0.254_829_592
            + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let tail = 0.5 * series * (-x * x).exp();
    if z > 0.0 { 1.0 - tail } else { tail }
}

/// Gaussian blur of a square picture.
fn blur(parts: &mut [f64], side: usize, sigma: f64) {
    let reach = (4.5 * sigma).ceil() as usize;
    let half: Vec<f64> = (0..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let sum = 2.0 * half.iter().sum::<f64>() - half[0];
    let mut line = vec![0.0; side];
    for (step, stride) in [(1, side), (side, 1)] {
        for start in (0..side).map(|i| i * stride) {
            line.iter_mut().enumerate().for_each(|(i, value)| *value = parts[start + i * step]);
            for i in 0..side {
                let at = |k: usize| line[i.saturating_sub(k)] + line[(i + k).min(side - 1)];
                let total: f64 = half.iter().enumerate().skip(1).map(|(k, weight)| weight * at(k)).sum();
                parts[start + i * step] = (total + half[0] * line[i]) / sum;
            }
        }
    }
}
