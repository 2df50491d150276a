//! The setup file and the firmware's validated settings.
//!
//! SETUP.md describes the file. One table (`table.rs`) describes every setting; reading, checking, showing,
//! writing and the reference in SETUP.md follow it.
#![forbid(unsafe_code)]

mod check;
mod document;
mod error;
mod fit;
mod geometry;
mod parts;
mod show;
mod slot;
mod table;
#[cfg(test)]
mod tests;
mod write;

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::Path;

use crate::document::Document;
use gangway_engine::{MAX_SETUP_TEXT, Settings};
use gangway_pose::{Circle, Lens, Pose, Shutter};
use sha2::{Digest as _, Sha256};

pub use error::{Mistake, SetupError};
pub use gangway_engine::{AutoExposure, LampMode, Limits, RestSettings};
pub use gangway_pose::{MAX_CIRCLES, Method, Settings as SolverSettings};
pub use gangway_vision::Settings as TrackerSettings;
pub use parts::{Board, Camera, Capture, ExposureMode, Kind, Parts, SampleFormat, Target};
pub use show::{Allowed, Row, reference};
pub use slot::Value;

/// A setup that was read and checked: whatever it holds, the firmware can run with.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    text: String,
    parts: Parts,
    lines: BTreeMap<String, usize>,
}

impl Setup {
    /// Reads and checks a setup file.
    ///
    /// # Errors
    /// The file cannot be read, or all the mistakes in it.
    pub fn read(path: &Path) -> Result<Self, SetupError> {
        let name = path.display().to_string();
        let mut bytes = Vec::new();
        // One byte more than allowed is enough to know that a file is too long, whatever it is.
        let read = std::fs::File::open(path)
            .and_then(|file| file.take(MAX_SETUP_TEXT as u64 + 1).read_to_end(&mut bytes));
        if let Err(cause) = read {
            return Err(SetupError::Read { name, cause });
        }
        if bytes.len() > MAX_SETUP_TEXT {
            return Err(too_long(&name));
        }
        match str::from_utf8(&bytes) {
            Ok(text) => Self::parse(text, &name),
            Err(error) => {
                let good = &bytes[..error.valid_up_to()];
                let line = 1 + good.iter().filter(|byte| **byte == b'\n').count();
                let byte = bytes.get(error.valid_up_to()).copied().unwrap_or(0);
                Err(one(
                    &name,
                    Some(line),
                    format!(
                        "byte 0x{byte:02x} is not UTF-8; save the file as \
                    UTF-8"
                    ),
                ))
            }
        }
    }

    /// Checks the text of a setup, from a file or as a box announced it; `name` is what mistakes call it.
    ///
    /// # Errors
    /// All the mistakes in it, each with line, key and what is allowed.
    pub fn parse(text: &str, name: &str) -> Result<Self, SetupError> {
        if text.len() > MAX_SETUP_TEXT {
            return Err(too_long(name));
        }
        if text.trim().is_empty() {
            let sentence = "is empty; a setup says at least name, [camera] and one [[target]]";
            return Err(one(name, None, sentence.to_owned()));
        }
        let mut document = Document::new(text);
        let parts = document.read();
        if let Some(parts) = &parts {
            document.check(parts);
        }
        let (mut mistakes, lines) = (document.mistakes, document.lines);
        if let Some(parts) = parts.filter(|_| mistakes.is_empty()) {
            return Ok(Self { text: text.to_owned(), parts, lines });
        }
        mistakes.sort_by_key(|mistake| mistake.line);
        Err(SetupError::Mistakes { name: name.to_owned(), mistakes })
    }

    /// The text as it was read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// First 16 bytes of the SHA-256 of the text, as `Hello` carries it.
    pub fn digest(&self) -> [u8; 16] {
        digest(&self.text)
    }

    /// What the file says, with the defaults of what it does not say.
    pub fn parts(&self) -> &Parts {
        &self.parts
    }

    /// The line of the file that says a setting, given its path such as `target[0].origin_mm`.
    pub fn line(&self, path: &str) -> Option<usize> {
        self.lines.get(path).copied()
    }

    /// The frame loop's settings.
    pub fn settings(&self) -> Settings {
        let parts = &self.parts;
        let camera = &parts.camera;
        let mut settings = Settings {
            name: Default::default(),
            picture: (camera.width_px, camera.height_px),
            rate_hz: camera.rate_hz,
            shutter: shutter(camera),
            lens: lens(camera),
            circles: Default::default(),
            own: 0,
            seeds: Default::default(),
            reference: coarse_place(camera),
            vision: parts.tracker,
            solver: parts.solver,
            rest: parts.rest,
            limits: parts.limits,
            exposure: (parts.capture.exposure == ExposureMode::Auto).then(|| AutoExposure {
                longest_s: camera.exposure_ms / 1e3,
                most_gain: parts.capture.most_gain,
            }),
            lamps: parts.board.lamps,
            text: Default::default(),
            digest: self.digest(),
        };
        // Lengths and numbers were checked against what these hold: nothing is ever left over.
        let _ = settings.name.push_str(&parts.name);
        let _ = settings.text.push_str(&self.text);
        for (i, target) in parts.targets.iter().enumerate() {
            for (k, circle) in circles(i, target).into_iter().enumerate() {
                settings.own |= u64::from(target.carbody == 1) << settings.circles.len().min(63);
                let _ = settings.circles.push(circle);
                let _ = settings.seeds.push(target.seeds_px.get(k).copied());
            }
        }
        settings
    }
}

/// First 16 bytes of the SHA-256 of a setup's text.
pub fn digest(text: &str) -> [u8; 16] {
    let hash = Sha256::digest(text.as_bytes());
    let mut digest = [0; 16];
    digest.copy_from_slice(&hash[..16]);
    digest
}

/// The circles of the target with this number.
fn circles(number: usize, target: &Target) -> Vec<Circle> {
    let normal = geometry::axes(target)[2].into();
    let circle = |point: geometry::Vector| Circle {
        point: point.into(),
        normal,
        outer_mm: target.outer_diameter_mm,
        // None of a disc: its ratio is infinite.
        inner_mm: if target.kind == Kind::Led { 0.0 } else { target.inner_diameter_mm },
        target: number as u8,
    };
    geometry::points(target).into_iter().map(circle).collect()
}

fn shutter(camera: &Camera) -> Shutter {
    Shutter {
        line_time_s: camera.line_time_us / 1e6,
        exposure_s: camera.exposure_ms / 1e3,
        middle_row: 0.5 * (f64::from(camera.height_px) - 1.0),
    }
}

fn lens(camera: &Camera) -> Lens {
    Lens {
        focal: camera.focal_px,
        skew: camera.skew_px,
        principal: camera.principal_px,
        distortion: camera.distortion,
    }
}

/// The carbody as a camera in this place sees it; nothing where the place is not known.
fn coarse_place(camera: &Camera) -> Option<Pose> {
    let turned = [camera.roll_deg, camera.pitch_deg, camera.yaw_deg];
    (camera.position_mm != [0.0; 3]).then(|| Pose::of_camera(camera.position_mm, turned))
}

fn too_long(name: &str) -> SetupError {
    one(
        name,
        None,
        format!("is longer than {MAX_SETUP_TEXT} bytes, the most that a box carries; shorten its comments"),
    )
}

fn one(name: &str, line: Option<usize>, sentence: String) -> SetupError {
    SetupError::Mistakes { name: name.to_owned(), mistakes: vec![Mistake { line, sentence }] }
}
