//! What is behind the targets: a level with a texture of smooth noise and shapes that could be mistaken for
//! something (filled and empty rectangles, discs). It stays where it is in the picture.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Background of a scene.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Background {
    /// Mean reflectance.
    pub(crate) level: f64,
    /// Standard deviation of the texture's reflectance, about.
    pub(crate) texture: f64,
    /// Size of the texture's grains, px.
    pub(crate) grain_px: f64,
    /// Number of shapes.
    pub(crate) shapes: u32,
    /// Number of wheels: a dark tyre, a bright rim, a dark hub.
    pub(crate) wheels: u32,
    /// Number of loudspeakers: rings in turn dark and bright on a box.
    pub(crate) loudspeakers: u32,
}

/// One shape: its box, the width of its line (none: filled), whether it is round, its reflectance.
struct Shape {
    middle: [f64; 2],
    half: [f64; 2],
    line: Option<f64>,
    round: bool,
    level: f32,
}

impl Background {
    /// The reflectances of `width` x `height` pixels, row by row.
    pub(crate) fn paint(&self, width: usize, height: usize, seed: u64) -> Vec<f32> {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let octaves: Vec<Lattice> = [(1.0, 1.0), (0.45, 0.5)]
            .iter()
            .map(|&(size, weight)| {
                Lattice::new(width, height, (self.grain_px * size).max(1.0), weight, &mut random)
            })
            .collect();
        let mut shapes: Vec<Shape> = (0..self.shapes)
            .map(|_| {
                let round = random.random_bool(0.25);
                let half = [random.random_range(6.0..80.0), random.random_range(6.0..80.0)];
                Shape {
                    middle: [random.random_range(0.0..width as f64), random.random_range(0.0..height as f64)],
                    half: if round { [0.4 * half[0]; 2] } else { half },
                    line: random.random_bool(0.5).then(|| random.random_range(2.0..6.0)),
                    round,
                    level: random.random_range(0.05f32..0.7),
                }
            })
            .collect();
        // Drawn last: a scene without them looks as it did.
        for _ in 0..self.wheels {
            let (middle, radius) = place(width, height, &mut random);
            let tyre = random.random_range(0.5..0.75);
            shapes.extend(discs(middle, radius, &[(1.0, 0.06), (tyre, 0.55), (0.3 * tyre, 0.12)]));
        }
        for _ in 0..self.loudspeakers {
            let (middle, radius) = place(width, height, &mut random);
            let box_level = random.random_range(0.3f32..0.8);
            let half = [1.3 * radius, random.random_range(1.3..2.6) * radius];
            shapes.push(Shape { middle, half, line: None, round: false, level: box_level });
            shapes.extend(discs(
                middle,
                radius,
                &[(1.0, 0.08), (0.82, 0.5), (0.72, 0.1), (0.36, 0.6), (0.2, 0.15)],
            ));
        }
        let mut picture = vec![0.0; width * height];
        picture.par_chunks_mut(width).enumerate().for_each(|(row, line)| {
            for (column, pixel) in line.iter_mut().enumerate() {
                let noise: f64 = octaves.iter().map(|octave| octave.at(column, row)).sum();
                *pixel = (self.level + self.texture * noise).clamp(0.0, 1.0) as f32;
            }
            for shape in &shapes {
                shape.draw_row(row as f64, line);
            }
        });
        picture
    }
}

/// Where a ring-like thing is, and its radius, px.
fn place(width: usize, height: usize, random: &mut Pcg64Mcg) -> ([f64; 2], f64) {
    let middle = [random.random_range(0.0..width as f64), random.random_range(0.0..height as f64)];
    (middle, random.random_range(7.0..45.0))
}

/// Discs about one middle, the largest first: share of the radius and level of each.
fn discs(middle: [f64; 2], radius: f64, all: &[(f64, f32)]) -> impl Iterator<Item = Shape> {
    all.iter().map(move |&(share, level)| Shape {
        middle,
        half: [share * radius; 2],
        line: None,
        round: true,
        level,
    })
}

impl Shape {
    fn draw_row(&self, row: f64, line: &mut [f32]) {
        let y = row - self.middle[1];
        if y.abs() > self.half[1] {
            return;
        }
        let first = (self.middle[0] - self.half[0]).ceil().max(0.0) as usize;
        let past = ((self.middle[0] + self.half[0]).floor() + 1.0).clamp(0.0, line.len() as f64) as usize;
        for (i, pixel) in line.iter_mut().enumerate().take(past).skip(first) {
            let x = i as f64 - self.middle[0];
            // Distance to the shape's edge, positive inside.
            let depth = if self.round {
                self.half[0] - x.hypot(y)
            } else {
                (self.half[0] - x.abs()).min(self.half[1] - y.abs())
            };
            if depth >= 0.0 && self.line.is_none_or(|width| depth < width) {
                *pixel = self.level;
            }
        }
    }
}

/// Random values on a grid, smooth between.
struct Lattice {
    values: Vec<f64>,
    columns: usize,
    grain: f64,
}

impl Lattice {
    fn new(width: usize, height: usize, grain: f64, weight: f64, random: &mut Pcg64Mcg) -> Self {
        let (columns, rows) = ((width as f64 / grain) as usize + 2, (height as f64 / grain) as usize + 2);
        // Uniform values of this half width come out with a deviation near 1 after the smoothing.
        let values = (0..columns * rows).map(|_| weight * random.random_range(-2.3..2.3)).collect();
        Self { values, columns, grain }
    }

    fn at(&self, column: usize, row: usize) -> f64 {
        let smooth = |at: f64| {
            let share = at.fract();
            (at as usize, share * share * (3.0 - 2.0 * share))
        };
        let (i, x) = smooth(column as f64 / self.grain);
        let (j, y) = smooth(row as f64 / self.grain);
        let corner = j * self.columns + i;
        let at = |k: usize| self.values.get(k).copied().unwrap_or(0.0);
        let above = at(corner) + x * (at(corner + 1) - at(corner));
        let below =
            at(corner + self.columns) + x * (at(corner + self.columns + 1) - at(corner + self.columns));
        above + y * (below - above)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTHING: Background =
        Background { level: 0.0, texture: 0.0, grain_px: 1.0, shapes: 0, wheels: 0, loudspeakers: 0 };

    #[test]
    fn wheels_and_loudspeakers_are_rings_each_of_its_own() {
        let plain = Background { level: 0.3, ..NOTHING };
        for ringed in
            [Background { wheels: 3, ..plain.clone() }, Background { loudspeakers: 3, ..plain.clone() }]
        {
            let picture = ringed.paint(400, 400, 7);
            let share = |test: fn(&f32) -> bool| picture.iter().filter(|p| test(p)).count();
            assert!(share(|p| *p < 0.1) > 100 && share(|p| *p > 0.45) > 20, "black and bright rings");
        }
    }

    #[test]
    fn the_background_has_its_level_its_texture_and_follows_its_seed() {
        let background = Background { level: 0.4, texture: 0.05, grain_px: 6.0, ..NOTHING };
        let picture = background.paint(300, 200, 7);
        let mean = picture.iter().sum::<f32>() / picture.len() as f32;
        let variance = picture.iter().map(|p| (p - mean).powi(2)).sum::<f32>() / picture.len() as f32;
        // 1,700 grains: the mean is good to 0.05 / sqrt(1700), taken threefold; the texture's scale is rough.
        assert!((mean - 0.4).abs() < 0.004, "{mean}");
        assert!((variance.sqrt() / 0.05 - 1.0).abs() < 0.25, "{}", variance.sqrt());
        assert_eq!(picture, background.paint(300, 200, 7));
        assert_ne!(picture, background.paint(300, 200, 8));
    }

    #[test]
    fn shapes_change_the_picture() {
        let plain = Background { level: 0.4, texture: 0.0, grain_px: 6.0, ..NOTHING };
        assert!(plain.paint(64, 64, 7).iter().all(|p| *p == 0.4));
        let shaped = Background { shapes: 5, ..plain };
        assert!(shaped.paint(64, 64, 7).iter().any(|p| *p != 0.4));
    }
}
