//! Targets: a white sheet with black rings, or a black one with discs that shine (thesis 3.2), drawn by
//! taking every pixel's ray back to the sheet's plane. Pixels that an edge cuts get the exact share of their
//! light (see `coverage`).

use crate::coverage::Aperture;
use crate::optics::{Lens, Mat3, NEAREST_MM, Pose, Ray, Vec3, add, apply, inverse, scale, transpose};

/// Room around a projected outline, px: the aperture's reach, and the outline's own polygon.
const MARGIN_PX: f64 = 2.0;
/// Points along each side of a sheet and around each ring from which their boxes are made.
const OUTLINE: usize = 16;

/// A target with its rings.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plate {
    /// Its name in the setup.
    pub(crate) name: String,
    /// The carbody that carries it: 2, or 1, the camera's own.
    pub(crate) carbody: u8,
    /// Origin in its carbody, mm.
    pub(crate) origin: Vec3,
    /// Axes u, v, w in its carbody.
    pub(crate) axes: [Vec3; 3],
    /// Ring centres (u, v), mm.
    pub(crate) circles: Vec<[f64; 2]>,
    /// Outer and inner radius, mm.
    pub(crate) radii: [f64; 2],
    /// The sheet: least and greatest u, least and greatest v, mm.
    pub(crate) sheet: [[f64; 2]; 2],
    /// Reflectance of the sheet and of what is on it.
    pub(crate) reflectance: [f64; 2],
    /// Its circles are discs that shine; the inner radius is 0.
    pub(crate) is_lit: bool,
}

impl Plate {
    /// A point of the sheet's plane in its carbody, mm.
    pub(crate) fn point(&self, [u, v]: [f64; 2]) -> Vec3 {
        add(&self.origin, &add(&scale(&self.axes[0], u), &scale(&self.axes[1], v)))
    }
}

/// A box of pixels: first and one past the last column, first and one past the last row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PixelBox {
    /// Columns.
    pub(crate) x: [i32; 2],
    /// Rows.
    pub(crate) y: [i32; 2],
}

impl PixelBox {
    fn around(points: &[[f64; 2]]) -> Self {
        let ends = |axis: usize| {
            let least = points.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
            let most = points.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
            // The cast saturates: a box far outside stays outside.
            [(least - MARGIN_PX).floor() as i32, (most + MARGIN_PX).ceil() as i32]
        };
        Self { x: ends(0), y: ends(1) }
    }

    fn cut(&self, to: &Self) -> Self {
        let cut = |a: [i32; 2], b: [i32; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        Self { x: cut(self.x, to.x), y: cut(self.y, to.y) }
    }

    fn has_row(&self, row: i32) -> bool {
        self.y[0] <= row && row < self.y[1] && self.x[0] < self.x[1]
    }
}

/// A plate as one frame sees it: where it may be and, for each moment of the exposure, the way from a ray to
/// its plane.
pub(crate) struct View<'a> {
    plate: &'a Plate,
    to_plane: Vec<Mat3>,
    /// Share of each moment in which its discs shine.
    lit: Vec<f64>,
    sheet: PixelBox,
    rings: Vec<PixelBox>,
    aperture: Aperture,
    /// Depth of its origin, mm: the farthest is drawn first.
    pub(crate) depth: f64,
}

impl<'a> View<'a> {
    /// The plate seen from the poses of one exposure; nothing if it shows its back or is not in front.
    pub(crate) fn new(
        plate: &'a Plate,
        poses: &[Pose],
        lit: &[f64],
        lens: &Lens,
        canvas: &PixelBox,
        aperture: Aperture,
    ) -> Option<Self> {
        let mut to_plane = Vec::with_capacity(poses.len());
        let mut outline = Vec::new();
        let mut rings = vec![Vec::new(); plate.circles.len()];
        let mut depth = 0.0;
        let [[u0, u1], [v0, v1]] = plate.sheet;
        for pose in poses {
            let origin = pose.transform(&plate.origin);
            let [u, v, w] = plate.axes.map(|axis| apply(&pose.rotation, &axis));
            if crate::optics::dot(&w, &origin) >= 0.0 {
                return None;
            }
            to_plane.push(inverse(&transpose(&[u, v, origin]))?);
            depth = origin[2];
            for i in 0..=OUTLINE {
                let share = i as f64 / OUTLINE as f64;
                let (u, v) = (u0 + share * (u1 - u0), v0 + share * (v1 - v0));
                for point in [[u, v0], [u, v1], [u0, v], [u1, v]] {
                    let seen = pose.transform(&plate.point(point));
                    if seen[2] < NEAREST_MM {
                        return None;
                    }
                    // Beyond the lens' reach the outline is anywhere: draw wherever the rays say.
                    match lens.project(&seen) {
                        Some(pixel) => outline.push(pixel),
                        None => outline.extend([
                            [f64::from(canvas.x[0]), f64::from(canvas.y[0])],
                            [f64::from(canvas.x[1]), f64::from(canvas.y[1])],
                        ]),
                    }
                }
            }
            for (ring, centre) in rings.iter_mut().zip(&plate.circles) {
                ring.extend((0..OUTLINE).filter_map(|i| {
                    let (sin, cos) = (std::f64::consts::TAU * i as f64 / OUTLINE as f64).sin_cos();
                    // The polygon around a circle of 16 corners lies 2 % outside it.
                    let radius = 1.02 * plate.radii[0];
                    let at = [centre[0] + radius * cos, centre[1] + radius * sin];
                    lens.project(&pose.transform(&plate.point(at)))
                }));
            }
        }
        let sheet = PixelBox::around(&outline).cut(canvas);
        let rings = rings.iter().map(|points| PixelBox::around(points).cut(&sheet)).collect();
        let lit = if plate.is_lit { lit.to_vec() } else { vec![0.0; poses.len()] };
        Some(Self { plate, to_plane, lit, sheet, rings, aperture, depth })
    }

    /// Draws one row of pixels: `row` is the picture's row, `canvas` its reflectances from column `left` on,
    /// and `glow`, where there is one, the share in which a lit disc shines.
    pub(crate) fn draw_row(
        &self,
        row: i32,
        left: i32,
        (canvas, glow): (&mut [f32], Option<&mut [f32]>),
        lens: &Lens,
        scratch: &mut Scratch,
    ) {
        if !self.sheet.has_row(row) {
            return;
        }
        let [first, end] = self.sheet.x;
        let width = (end - first) as usize;
        scratch.reset(width);
        let mut near = [0.0, 0.0];
        for (ray, column) in scratch.rays.iter_mut().zip(first..end) {
            *ray = lens.ray([f64::from(column), f64::from(row)], near);
            near = ray.map_or([0.0, 0.0], |ray| ray.at);
        }
        let moments = 1.0 / self.to_plane.len() as f64;
        for (to_plane, lit) in self.to_plane.iter().zip(&self.lit) {
            for (ray, paper) in scratch.rays.iter().zip(&mut scratch.paper) {
                if let Some(spot) = Spot::of(ray, to_plane) {
                    *paper += moments * self.paper_share(&spot);
                }
            }
            for (centre, ring) in self.plate.circles.iter().zip(&self.rings) {
                if !ring.has_row(row) {
                    continue;
                }
                let columns = (ring.x[0] - first) as usize..(ring.x[1] - first) as usize;
                let rays = &scratch.rays[columns.clone()];
                let shares = scratch.ink[columns.clone()].iter_mut().zip(&mut scratch.shine[columns]);
                for (ray, (ink, shine)) in rays.iter().zip(shares) {
                    if let Some(spot) = Spot::of(ray, to_plane) {
                        let share = moments * self.ink_share(&spot, centre);
                        *ink += share;
                        *shine += lit * share;
                    }
                }
            }
        }
        let [white, black] = self.plate.reflectance;
        let from = (first - left) as usize;
        if let Some(glow) = glow {
            let shares = scratch.paper.iter().zip(&scratch.shine);
            for (pixel, (&paper, &shine)) in glow[from..from + width].iter_mut().zip(shares) {
                *pixel = (f64::from(*pixel) * (1.0 - paper) + shine) as f32;
            }
        }
        let shares = scratch.paper.iter().zip(&scratch.ink);
        for (pixel, (&paper, &ink)) in canvas[from..from + width].iter_mut().zip(shares) {
            let plate = paper * white + ink * (black - white);
            *pixel = (f64::from(*pixel) * (1.0 - paper) + plate) as f32;
        }
    }

    /// Share of the pixel that the sheet covers.
    fn paper_share(&self, spot: &Spot) -> f64 {
        let mut share = 1.0;
        for axis in 0..2 {
            let [a, b] = spot.per_px[axis];
            let reach = self.aperture.reach() * (a.abs() + b.abs());
            let [least, most] = self.plate.sheet[axis];
            let (from, to) = (spot.at[axis] - least, most - spot.at[axis]);
            if from < -reach || to < -reach {
                return 0.0;
            }
            if from < reach {
                share *= self.aperture.edge(from, a, b);
            }
            if to < reach {
                share *= self.aperture.edge(to, -a, -b);
            }
        }
        share
    }

    /// Share of the pixel that a ring's ink covers.
    fn ink_share(&self, spot: &Spot, centre: &[f64; 2]) -> f64 {
        let from_centre = [spot.at[0] - centre[0], spot.at[1] - centre[1]];
        let [[a, b], [c, d]] = spot.per_px;
        // The corner of the aperture that is farthest from its middle.
        let reach = self.aperture.reach() * (a.abs() + b.abs()).hypot(c.abs() + d.abs());
        let distance = (from_centre[0] * from_centre[0] + from_centre[1] * from_centre[1]).sqrt();
        let inside = |radius: f64| {
            if distance > radius + reach {
                0.0
            } else if distance < radius - reach {
                1.0
            } else {
                self.aperture.disc(from_centre, &spot.per_px, radius)
            }
        };
        let outer = inside(self.plate.radii[0]);
        let has_hole = outer > 0.0 && self.plate.radii[1] > 0.0;
        if has_hole { outer - inside(self.plate.radii[1]) } else { outer }
    }
}

/// Where a pixel meets a plane (u, v in mm) and how that moves with the pixel.
struct Spot {
    at: [f64; 2],
    per_px: [[f64; 2]; 2],
}

impl Spot {
    fn of(ray: &Option<Ray>, to_plane: &Mat3) -> Option<Self> {
        let ray = ray.as_ref()?;
        let [x, y] = ray.at;
        // The ray (x, y, 1) meets the plane at 1/s times its length, in front of the camera for s > 0.
        let [a, b, s] = to_plane.map(|row| row[0] * x + row[1] * y + row[2]);
        if s <= 0.0 {
            return None;
        }
        let depth = 1.0 / s;
        let at = [a * depth, b * depth];
        let per_ray: [[f64; 2]; 2] = std::array::from_fn(|i| {
            std::array::from_fn(|j| (to_plane[i][j] - at[i] * to_plane[2][j]) * depth)
        });
        let per_px = per_ray
            .map(|[by_x, by_y]| std::array::from_fn(|j| by_x * ray.per_px[0][j] + by_y * ray.per_px[1][j]));
        Some(Self { at, per_px })
    }
}

/// Row buffers, kept from row to row.
#[derive(Default)]
pub(crate) struct Scratch {
    rays: Vec<Option<Ray>>,
    paper: Vec<f64>,
    ink: Vec<f64>,
    shine: Vec<f64>,
}

impl Scratch {
    fn reset(&mut self, width: usize) {
        self.rays.clear();
        self.rays.resize(width, None);
        for shares in [&mut self.paper, &mut self.ink, &mut self.shine] {
            shares.clear();
            shares.resize(width, 0.0);
        }
    }
}
