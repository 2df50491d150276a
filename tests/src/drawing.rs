//! A frame as the loop saw it: windows, centres and refusals drawn into the picture, written as PNG.

use std::io::Write;
use std::path::Path;

use gangway_engine::Look;
use gangway_wire::LostReason;

use crate::{Keeping, Ride};

const GREEN: [u8; 3] = [60, 230, 60];
const ORANGE: [u8; 3] = [255, 150, 30];
const RED: [u8; 3] = [255, 40, 40];
const BLUE: [u8; 3] = [70, 150, 255];

/// Plays a seed of a scene up to a frame and writes what its windows showed: green a ring and its centre,
/// orange a window in which a ring was refused, red one without a ring, blue crosses where the rings truly
/// are.
///
/// # Errors
/// The file cannot be written.
pub fn draw(keeping: &Keeping, seed: u64, frame: usize, into: &Path) -> std::io::Result<()> {
    let scene = keeping.scene(seed);
    let scene = scene.with_frames(frame as u32 + 1);
    let mut ride = Ride::of(&scene);
    ride.settings.lamps = keeping.lamps;
    let mut frame_loop = ride.start();
    for number in 0..=frame {
        frame_loop.step(number, number as u32, |_| {});
    }
    let mut picture = Picture::new(&ride, frame);
    for at in scene.centres(frame as u32).into_iter().flatten().flatten() {
        picture.cross(at, 3, BLUE);
    }
    for Look { at, side_px, seen, .. } in frame_loop.engine.looks() {
        let colour = match seen {
            Ok(_) => GREEN,
            Err(LostReason::NotFound | LostReason::OutsidePicture) => RED,
            Err(_) => ORANGE,
        };
        picture.square(at, side_px, colour);
        if let Ok(centre) = seen {
            picture.cross(centre, 6, GREEN);
        }
    }
    picture.write(into)
}

struct Picture {
    width: i64,
    height: i64,
    samples: Vec<u8>,
}

impl Picture {
    fn new(ride: &Ride, frame: usize) -> Self {
        let (width, height) = ride.settings.picture;
        let samples = ride.frames[frame].iter().flat_map(|grey| [*grey; 3]).collect();
        Self { width: width.into(), height: height.into(), samples }
    }

    fn put(&mut self, x: i64, y: i64, colour: [u8; 3]) {
        if (0..self.width).contains(&x) && (0..self.height).contains(&y) {
            let at = 3 * (y * self.width + x) as usize;
            self.samples[at..at + 3].copy_from_slice(&colour);
        }
    }

    fn cross(&mut self, at: [f64; 2], arm: i64, colour: [u8; 3]) {
        // The cast saturates: what is far outside stays outside, what is no number is at zero.
        let [x, y] = at.map(|c| c.round() as i64);
        for i in -arm..=arm {
            self.put(x + i, y, colour);
            self.put(x, y + i, colour);
        }
    }

    fn square(&mut self, at: [f64; 2], side: f64, colour: [u8; 3]) {
        if !at.iter().chain([&side]).all(|c| c.is_finite() && c.abs() < 1e4) {
            return;
        }
        let [x, y] = at.map(|c| (c - 0.5 * side).round() as i64);
        let side = side as i64;
        for i in 0..=side {
            for (u, v) in [(x + i, y), (x + i, y + side), (x, y + i), (x + side, y + i)] {
                self.put(u, v, colour);
            }
        }
    }

    fn write(&self, into: &Path) -> std::io::Result<()> {
        let mut file = std::io::BufWriter::new(std::fs::File::create(into)?);
        let mut encoder = png::Encoder::new(&mut file, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.samples)?;
        writer.finish()?;
        file.flush()
    }
}
