//! One frame: the moments of its exposure, then bands of rows, each drawn, blurred, lit, made noisy and
//! rounded by one core. A band's samples depend on nothing but the scene and the row.

use rayon::prelude::*;

use crate::build::Parts;
use crate::coverage::Aperture;
use crate::occluder::OccluderView;
use crate::optics::Pose;
use crate::patch::Patches;
use crate::plate::{PixelBox, Scratch, View};
use crate::sensor::{blur_row, mix};

/// Rows of a band: few enough to stay in a core's cache, many against the rows that the blur adds.
const BAND: usize = 64;
/// Moments of an exposure for each pixel of motion, and their bounds while something moves.
const MOMENTS_PER_PX: f64 = 3.0;
const MOMENTS: [f64; 2] = [4.0, 48.0];
/// Motion during an exposure below which it is one moment, px.
const STILL_PX: f64 = 1e-6;

/// What stays the same for all frames.
pub(crate) struct Studio<'a> {
    /// The scene.
    pub(crate) parts: &'a Parts,
    /// Reflectances of the background on the canvas.
    pub(crate) background: &'a [f32],
    /// Half of the blur's kernel; the canvas is larger than the picture by its reach on every side.
    pub(crate) kernel: &'a [f32],
    /// How a pixel gathers light.
    pub(crate) aperture: Aperture,
    /// Seed of the noise.
    pub(crate) seed: u64,
}

/// Width and height of the canvas: the picture with the reach of the blur on every side.
pub(crate) fn canvas_size(parts: &Parts, kernel: &[f32]) -> [usize; 2] {
    parts.size.map(|side| side as usize + 2 * (kernel.len() - 1))
}

/// What one frame's rows have in common.
struct Shot<'a> {
    views: Vec<View<'a>>,
    occluders: Vec<OccluderView>,
    level: f64,
    patches: Patches<'a>,
    frame: u32,
}

impl<'a> Studio<'a> {
    /// The samples of a frame.
    pub(crate) fn samples(&self, frame: u32, samples: &mut Vec<u8>) {
        let sensor = &self.parts.sensor;
        let row_bytes = self.parts.size[0] as usize * sensor.bytes();
        samples.resize(row_bytes * self.parts.size[1] as usize, 0);
        let shot = self.shoot(frame);
        samples.par_chunks_mut(BAND * row_bytes).enumerate().for_each(|(band, samples)| {
            let mut rows = samples.chunks_exact_mut(row_bytes);
            self.band(&shot, band * BAND, rows.len(), |row, light| {
                sensor.add_noise(light, mix(&[self.seed, u64::from(frame), row as u64]));
                sensor.amplify(light);
                if let Some(samples) = rows.next() {
                    sensor.quantise(light, samples);
                }
            });
        });
    }

    /// The same frame before noise and rounding: shares of full scale, not clipped.
    pub(crate) fn shares(&self, frame: u32, shares: &mut Vec<f32>) {
        let width = self.parts.size[0] as usize;
        shares.resize(width * self.parts.size[1] as usize, 0.0);
        let shot = self.shoot(frame);
        shares.par_chunks_mut(BAND * width).enumerate().for_each(|(band, shares)| {
            let mut rows = shares.chunks_exact_mut(width);
            self.band(&shot, band * BAND, rows.len(), |_, light| {
                self.parts.sensor.amplify(light);
                if let Some(shares) = rows.next() {
                    shares.copy_from_slice(light);
                }
            });
        });
    }

    /// What a global shutter sees: all rows at the frame's time.
    fn shoot(&self, frame: u32) -> Shot<'a> {
        self.shoot_at(f64::from(frame) / self.parts.rate_hz, frame)
    }

    /// What a row of a rolling shutter sees, at its own time. The blur spreads rows as they are, each of its
    /// time: over the few rows of its reach nothing moves that could be seen.
    fn shoot_row(&self, frame: u32, row: i32) -> Shot<'a> {
        let later = f64::from(row) - 0.5 * (f64::from(self.parts.size[1]) - 1.0);
        self.shoot_at(f64::from(frame) / self.parts.rate_hz + later * self.parts.line_time_s, frame)
    }

    fn shoot_at(&self, middle: f64, frame: u32) -> Shot<'a> {
        let parts = self.parts;
        let half = 0.5 * parts.exposure_s;
        let travel = self.travel_px(middle - half, middle, middle + half);
        let count = if travel < STILL_PX {
            1
        } else {
            (MOMENTS_PER_PX * travel).ceil().clamp(MOMENTS[0], MOMENTS[1]) as usize
        };
        let moments: Vec<f64> =
            (0..count).map(|i| middle + half * ((2 * i + 1) as f64 / count as f64 - 1.0)).collect();
        // Of each moment's part of the exposure.
        let part = half / count as f64;
        let lit: Vec<f64> = moments.iter().map(|t| parts.lamp.lit_share(t - part, t + part)).collect();
        let poses = [1, 2]
            .map(|carbody| -> Vec<Pose> { moments.iter().map(|t| pose_at(parts, carbody, *t)).collect() });
        let reach = (self.kernel.len() - 1) as i32;
        let canvas =
            PixelBox { x: [-reach, parts.size[0] as i32 + reach], y: [-reach, parts.size[1] as i32 + reach] };
        let mut views: Vec<View<'a>> = parts
            .plates
            .iter()
            .chain(&parts.posters)
            .filter_map(|plate| {
                let poses = &poses[usize::from(plate.carbody == 2)];
                View::new(plate, poses, &lit, &parts.lens, &canvas, self.aperture)
            })
            .collect();
        views.sort_by(|a, b| b.depth.total_cmp(&a.depth));
        let occluders =
            parts.occluders.iter().map(|occluder| occluder.view(&moments, self.aperture)).collect();
        let level = parts.light.over(middle - half, middle + half);
        let patches = Patches::new(&parts.suns, &parts.glares, middle);
        Shot { views, occluders, level, patches, frame }
    }

    /// How far anything moves in the picture over an exposure, px.
    fn travel_px(&self, from: f64, middle: f64, to: f64) -> f64 {
        let parts = self.parts;
        let mut most: f64 = 0.0;
        for carbody in [1, 2] {
            let poses = [from, middle, to].map(|t| pose_at(parts, carbody, t));
            if poses[0] == poses[1] && poses[1] == poses[2] {
                continue;
            }
            for plate in parts.plates.iter().filter(|plate| plate.carbody == carbody) {
                for circle in &plate.circles {
                    let point = plate.point(*circle);
                    let pixels = poses.map(|pose| parts.lens.project(&pose.transform(&point)));
                    for (a, b) in pixels.iter().flatten().zip(pixels.iter().flatten().skip(1)) {
                        most = most.max(2.0 * (a[0] - b[0]).hypot(a[1] - b[1]));
                    }
                }
            }
        }
        parts.occluders.iter().fold(most, |most, occluder| most.max(occluder.travel_px(from, to)))
    }

    /// Draws a band of rows and hands each, lit, to `finish` with its number.
    fn band(&self, shot: &Shot<'_>, first: usize, rows: usize, mut finish: impl FnMut(usize, &mut [f32])) {
        let parts = self.parts;
        let reach = self.kernel.len() - 1;
        let width = parts.size[0] as usize;
        let canvas_width = width + 2 * reach;
        let left = -(reach as i32);
        let mut scratch = Scratch::default();
        let mut line = vec![0.0; canvas_width];
        let mut blurred = vec![0.0; width * (rows + 2 * reach)];
        let glows = parts.plates.iter().any(|plate| plate.is_lit);
        let mut glow = vec![0.0; if glows { canvas_width } else { 0 }];
        let mut blurred_glow = vec![0.0; if glows { blurred.len() } else { 0 }];
        let mut levels = vec![shot.level; rows + 2 * reach];
        for (i, blurred) in blurred.chunks_exact_mut(width).enumerate() {
            // The canvas begins `reach` rows above the picture.
            let on_canvas = (first + i) * canvas_width;
            line.copy_from_slice(&self.background[on_canvas..on_canvas + canvas_width]);
            let row = (first + i) as i32 + left;
            let own = (parts.line_time_s != 0.0).then(|| self.shoot_row(shot.frame, row));
            let seen = own.as_ref().unwrap_or(shot);
            levels[i] = seen.level;
            glow.fill(0.0);
            for view in &seen.views {
                let glow = glows.then_some(glow.as_mut_slice());
                view.draw_row(row, left, (&mut line, glow), &parts.lens, &mut scratch);
            }
            for occluder in &seen.occluders {
                occluder.draw_row(row, left, &mut line);
                occluder.hide_row(row, left, &mut glow);
            }
            blur_row(self.kernel, &line, blurred);
            if glows {
                blur_row(self.kernel, &glow, &mut blurred_glow[i * width..(i + 1) * width]);
            }
        }
        let size = parts.size.map(f64::from);
        let mut light = vec![0.0; width];
        let mut shine = vec![0.0; if glows { width } else { 0 }];
        for i in 0..rows {
            blur_column(self.kernel, &blurred, i, &mut light);
            let v = (first + i) as f64;
            let level = levels[i + reach];
            for (column, light) in light.iter_mut().enumerate() {
                let pixel = [column as f64, v];
                let across = level * parts.light.across(pixel, size);
                if shot.patches.is_empty() {
                    *light *= across as f32;
                } else {
                    let [on, beside] = shot.patches.at(pixel);
                    *light = *light * (across + on) as f32 + beside as f32;
                }
            }
            if glows {
                blur_column(self.kernel, &blurred_glow, i, &mut shine);
                let lamp = parts.lamp.level as f32;
                light.iter_mut().zip(&shine).for_each(|(light, shine)| *light += lamp * shine);
            }
            finish(first + i, &mut light);
        }
    }
}

/// Sum of a kernel's terms down the columns about row `i` of a band whose first row is the kernel's reach
/// above it.
fn blur_column(kernel: &[f32], rows: &[f32], i: usize, out: &mut [f32]) {
    let (reach, width) = (kernel.len() - 1, out.len());
    let at = |row: usize| &rows[row * width..(row + 1) * width];
    for (out, value) in out.iter_mut().zip(at(i + reach)) {
        *out = kernel[0] * value;
    }
    for (j, weight) in kernel.iter().enumerate().skip(1) {
        let pairs = at(i + reach - j).iter().zip(at(i + reach + j));
        for (out, (above, below)) in out.iter_mut().zip(pairs) {
            *out += weight * (above + below);
        }
    }
}

/// Pose of a carbody in the camera at a time, seconds.
pub(crate) fn pose_at(parts: &Parts, carbody: u8, t: f64) -> Pose {
    let from_its_place = if carbody == 1 {
        parts.own
    } else {
        let [x, y, z, roll, pitch, yaw] = parts.motion.at(t);
        parts.rest.moved(&[x, y, z], &crate::optics::rotation(roll, pitch, yaw))
    };
    parts.mount.seen(&from_its_place, &parts.own, t)
}
