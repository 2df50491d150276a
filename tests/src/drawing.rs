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
/// orange a window in which a ring was refused, red one without a ring, each with the reason beside it, and
/// blue crosses where the rings truly are. The picture says so below.
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
        match seen {
            Ok(centre) => picture.cross(centre, 6, GREEN),
            // Below the window, for others are beside it.
            Err(reason) => {
                let [x, y] = [at[0] - 0.5 * side_px, at[1] + 0.5 * side_px + 3.0].map(|c| c.round() as i64);
                picture.word(word(reason), [x, y], colour);
            }
        }
    }
    picture.legend(&format!("{} SEED {seed} FRAME {frame}", keeping.name));
    picture.write(into)
}

/// The wire's name of a reason, in short.
fn word(reason: LostReason) -> &'static str {
    match reason {
        LostReason::OutsidePicture => "OUTSIDE",
        LostReason::LowContrast => "CONTRAST",
        LostReason::NotFound => "NOT FOUND",
        LostReason::CutByPicture => "CUT BY PICTURE",
        LostReason::CutByWindow => "CUT BY WINDOW",
        LostReason::Saturated => "SATURATED",
        LostReason::Outline => "OUTLINE",
        LostReason::Neighbour => "NEIGHBOUR",
        LostReason::Residual => "RESIDUAL",
        LostReason::Unlit => "UNLIT",
        LostReason::Other => "OTHER",
    }
}

/// Rows of the legend below the picture, px.
const LEGEND: i64 = 18;
/// From one letter to the next, px; each is 3 by 5 dots of 2 px.
const LETTER: i64 = 8;
const DOT: i64 = 2;
/// Digits and letters: five rows of three dots, an octal digit a row.
const DIGITS: [u16; 10] =
    [0o75557, 0o26227, 0o71747, 0o71717, 0o55711, 0o74717, 0o74757, 0o71244, 0o75757, 0o75717];
const LETTERS: [u16; 26] = [
    0o25755, 0o65656, 0o34443, 0o65556, 0o74647, 0o74644, 0o34553, 0o55755, 0o72227, 0o11152, 0o55655,
    0o44447, 0o57755, 0o57775, 0o25552, 0o65644, 0o25563, 0o65655, 0o34216, 0o72222, 0o55557, 0o55522,
    0o55775, 0o55255, 0o55222, 0o71247,
];

struct Picture {
    width: i64,
    height: i64,
    samples: Vec<u8>,
}

impl Picture {
    fn new(ride: &Ride, frame: usize) -> Self {
        let (width, height) = ride.settings.picture;
        let (width, height) = (i64::from(width), i64::from(height) + LEGEND);
        let mut samples: Vec<u8> = ride.frames[frame].iter().flat_map(|grey| [*grey; 3]).collect();
        samples.resize(3 * (width * height) as usize, 0);
        Self { width, height, samples }
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

    /// Writes in capitals from the upper left corner on; what else is in the text stays empty.
    fn word(&mut self, text: &str, [x, y]: [i64; 2], colour: [u8; 3]) {
        for (letter, left) in text.bytes().zip((x..).step_by(LETTER as usize)) {
            let dots = match letter.to_ascii_uppercase() {
                digit @ b'0'..=b'9' => DIGITS[usize::from(digit - b'0')],
                letter @ b'A'..=b'Z' => LETTERS[usize::from(letter - b'A')],
                b'-' => 0o00700,
                _ => 0,
            };
            for dot in (0..15).filter(|dot| dots >> (14 - dot) & 1 == 1) {
                for i in 0..DOT * DOT {
                    let [u, v] = [dot % 3 * DOT + i % DOT, dot / 3 * DOT + i / DOT];
                    self.put(left + u, y + v, colour);
                }
            }
        }
    }

    /// What is drawn how, below the picture.
    fn legend(&mut self, title: &str) {
        let words = [
            (title, [255; 3]),
            ("RING FOUND", GREEN),
            ("REFUSED - WHY", ORANGE),
            ("NO RING", RED),
            ("TRUE CENTRE", BLUE),
        ];
        let mut left = 4;
        for (text, colour) in words {
            self.word(text, [left, self.height - LEGEND + 4], colour);
            left += LETTER * (text.len() as i64 + 2);
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
