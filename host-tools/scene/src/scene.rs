//! A scene: what it is told at the start, and its frames, truth and setup on request.

use std::path::Path;
use std::sync::OnceLock;

use crate::BUILTIN;
use crate::build::{Parts, build};
use crate::coverage::Aperture;
use crate::error::{Mistake, SceneError};
use crate::file::{SceneFile, SetupTables, locate};
use crate::render::{Studio, canvas_size};
use crate::sensor::mix;
use crate::{setup, table};

/// Exact motion at a frame's mid-exposure, relative to rest (thesis 3.22, 3.24 by section 1.2's names).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Number of the frame, from 0.
    pub frame: u32,
    /// Displacement x, y, z, mm.
    pub displacement_mm: [f64; 3],
    /// Roll, pitch, yaw, degrees.
    pub rotation_deg: [f64; 3],
}

/// A scene that can be rendered, frame by frame and in any order.
pub struct Scene {
    name: String,
    /// As the scene file has it, and as the setup tells it.
    nominal: Parts,
    /// As it is rendered: the tolerances put in.
    parts: Parts,
    tables: SetupTables,
    seed: u64,
    kernel: Vec<f32>,
    aperture: Aperture,
    background: OnceLock<Vec<f32>>,
}

impl Scene {
    /// Reads a scene's text. `name` is its file: it stands in messages, and a motion table is looked for
    /// beside it.
    ///
    /// # Errors
    /// A mistake in the scene or in its motion table.
    pub fn parse(text: &str, name: &str) -> Result<Self, SceneError> {
        let file = SceneFile::parse(text, name)?;
        // An error in the motion table has its own file and line and goes past `Mistake`.
        let in_table = OnceLock::new();
        let read_table = |path: &Path| {
            let path = Path::new(name).parent().unwrap_or(Path::new("")).join(path);
            let text = std::fs::read_to_string(&path).map_err(|error| {
                Mistake::new("motion.csv", format!("{} cannot be read: {error}", path.display()))
            })?;
            match table::parse(&text, &path) {
                Ok(rows) => table::some_rows(rows, &path),
                Err(error) => {
                    let mistake = Mistake::new("motion.csv", error.to_string());
                    // Set once: a scene names one table.
                    let _ = in_table.set(error);
                    Err(mistake)
                }
            }
        };
        let parts = match build(&file, &read_table) {
            Ok(parts) => parts,
            Err(mistake) => return Err(in_table.into_inner().unwrap_or_else(|| locate(mistake, text, name))),
        };
        let nominal = parts;
        let parts = nominal.tolerance.applied(&nominal, file.seed);
        let seen: usize = parts
            .plates
            .iter()
            .filter_map(|plate| setup::seeds(&parts, plate))
            .map(|seeds| seeds.len())
            .sum();
        if seen < setup::FEWEST_SEEDS {
            let message = format!(
                "{seen} circles of targets that show as a whole at rest, allowed are {} or more: move or turn the camera",
                setup::FEWEST_SEEDS
            );
            return Err(locate(Mistake::new("camera.position_mm", message), text, name));
        }
        let (aperture, kernel) = parts.sensor.optics();
        // What the scene passes on to the setup is checked by the setup's own rules.
        let written = setup::text(&file.name, &nominal, &parts, &file.setup, &|_, _| true);
        if let Err(error) = gangway_setup::Setup::parse(&written, "setup.toml") {
            let message =
                format!("the setup file it results in would be refused: {error}").replace('\n', "; ");
            return Err(locate(Mistake::new("setup", message), text, name));
        }
        let SceneFile { name, seed, setup, .. } = file;
        Ok(Self { name, nominal, parts, tables: setup, seed, kernel, aperture, background: OnceLock::new() })
    }

    /// Reads a scene file.
    ///
    /// # Errors
    /// The file cannot be read, and as [`Scene::parse`].
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let text =
            std::fs::read_to_string(path).map_err(|why| SceneError::Read { file: path.to_owned(), why })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// One of the scenes of [`BUILTIN`].
    ///
    /// # Errors
    /// There is no scene of that name.
    pub fn builtin(name: &str) -> Result<Self, SceneError> {
        match BUILTIN.iter().find(|(known, _)| *known == name) {
            Some((name, text)) => Self::parse(text, &format!("{name}.toml")),
            None => Err(SceneError::Unknown { name: name.to_owned() }),
        }
    }

    /// The same scene with another number of frames (at least one).
    pub fn with_frames(mut self, frames: u32) -> Self {
        self.nominal.frames = frames.max(1);
        self.parts.frames = frames.max(1);
        self
    }

    /// The same scene with another seed of background, noise and tolerances.
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self.parts = self.nominal.tolerance.applied(&self.nominal, seed);
        self.background = OnceLock::new();
        self
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of frames.
    pub fn frames(&self) -> u32 {
        self.parts.frames
    }

    /// Width and height, px.
    pub fn size(&self) -> (u32, u32) {
        (self.parts.size[0], self.parts.size[1])
    }

    /// Frames a second.
    pub fn rate_hz(&self) -> f64 {
        self.parts.rate_hz
    }

    /// Significant bits of a sample.
    pub fn bits(&self) -> u32 {
        self.parts.sensor.bits
    }

    /// Renders a frame into `samples`, row by row without padding: a byte a sample up to 8 bits, else two,
    /// little-endian. The bytes are the same on any number of threads.
    pub fn render(&self, frame: u32, samples: &mut Vec<u8>) -> Truth {
        self.studio().samples(frame, samples);
        self.truth(frame)
    }

    /// The same frame before noise and rounding, as shares of full scale, not clipped.
    pub fn render_ideal(&self, frame: u32, shares: &mut Vec<f32>) -> Truth {
        self.studio().shares(frame, shares);
        self.truth(frame)
    }

    /// Where the centre of each target's each circle is in a frame, px, at mid-exposure; nothing for one that
    /// has no place in the picture's plane.
    pub fn centres(&self, frame: u32) -> Vec<Vec<Option<[f64; 2]>>> {
        let poses = [1, 2].map(|carbody| crate::render::pose_at(&self.parts, carbody, self.time_s(frame)));
        let plates = self.parts.plates.iter();
        let of_plate = |plate: &crate::plate::Plate| {
            let pose = &poses[usize::from(plate.carbody == 2)];
            let centre = |c: &[f64; 2]| self.parts.lens.project(&pose.transform(&plate.point(*c)));
            plate.circles.iter().map(centre).collect()
        };
        plates.map(of_plate).collect()
    }

    /// Whether something stands before any of the square of half side `half_px` about a place, px, at
    /// mid-exposure.
    pub fn is_covered(&self, frame: u32, place: [f64; 2], half_px: f64) -> bool {
        let t = self.time_s(frame);
        self.parts.occluders.iter().any(|occluder| occluder.covers(t, place, half_px))
    }

    /// The motion at a frame's mid-exposure.
    pub fn truth(&self, frame: u32) -> Truth {
        let [x, y, z, roll, pitch, yaw] = self.parts.motion.at(self.time_s(frame));
        Truth { frame, displacement_mm: [x, y, z], rotation_deg: [roll, pitch, yaw] }
    }

    /// The truth of all frames as the CSV that `evaluate` reads.
    pub fn truth_text(&self) -> String {
        let mut text = String::from("frame,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n");
        for frame in 0..self.frames() {
            let truth = self.truth(frame);
            text.push_str(&frame.to_string());
            for value in truth.displacement_mm.iter().chain(&truth.rotation_deg) {
                // A nanometre: no minus sign at zero.
                let rounded = (value * 1e9).round() / 1e9 + 0.0;
                text.push_str(&format!(",{rounded}"));
            }
            text.push('\n');
        }
        text
    }

    /// The setup file for a box that watches this scene: camera and targets as the scene file has them, seeds
    /// as they show. What was rendered differs from it by the scene's tolerances.
    pub fn setup_text(&self) -> String {
        self.setup_text_of(&|_, _| true)
    }

    /// The same for a box that knows only the circles chosen by target and circle on it, both from 0; the
    /// others show, but are not looked for.
    pub fn setup_text_of(&self, chosen: &dyn Fn(usize, usize) -> bool) -> String {
        setup::text(&self.name, &self.nominal, &self.parts, &self.tables, chosen)
    }

    /// What keeps a measurement of this scene from being perfect, with sizes, one line each.
    pub fn error_sources(&self) -> Vec<String> {
        let sensor = &self.nominal.sensor;
        let mut lines = self.nominal.tolerance.lines(&self.nominal);
        let shot = if sensor.shot_noise { "photon noise of" } else { "no photon noise, with" };
        lines.push(format!(
            "sensor: {shot} {} electrons at full scale, {} electrons of read noise, {} bit, blur {} px",
            sensor.full_well_e, sensor.read_noise_e, sensor.bits, sensor.blur_px
        ));
        let light = &self.nominal.light;
        lines.push(format!(
            "light: {:+.0} % from left to right, {:+.0} % from top to bottom, {:.0} % less in the corners",
            100.0 * light.gradient[0],
            100.0 * light.gradient[1],
            100.0 * light.vignetting
        ));
        lines
    }

    fn time_s(&self, frame: u32) -> f64 {
        f64::from(frame) / self.parts.rate_hz
    }

    fn studio(&self) -> Studio<'_> {
        let background = self.background.get_or_init(|| {
            let [width, height] = canvas_size(&self.parts, &self.kernel);
            self.parts.background.paint(width, height, mix(&[self.seed, u64::MAX]))
        });
        let (kernel, aperture) = (&self.kernel, self.aperture);
        Studio { parts: &self.parts, background, kernel, aperture, seed: self.seed }
    }
}
