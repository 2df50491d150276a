//! From the scene file's tables to a validated scene: each number within its bounds, each table in itself
//! consistent. One file below for each kind of thing in a scene.

mod camera;
mod light;
mod motion;
mod occluder;
mod target;

use std::path::Path;

use gangway_setup::MAX_CIRCLES;

use self::camera::{Camera, camera};
use self::light::{glares, lamp, light, suns};
use self::motion::{motion, mount};
use self::occluder::occluders;
use self::target::plates;
use crate::background::Background;
use crate::error::Mistake;
use crate::file::SceneFile;
use crate::keys;
use crate::lamp::Lamp;
use crate::light::Light;
use crate::motion::{Motion, Motions};
use crate::mount::Mount;
use crate::occluder::Occluder;
use crate::optics::{Lens, Pose};
use crate::patch::{Glare, Sun};
use crate::plate::Plate;
use crate::sensor::Sensor;
use crate::tolerance::Tolerance;

/// Everything that a scene file says, checked.
#[derive(Clone, Debug)]
pub(crate) struct Parts {
    pub(crate) frames: u32,
    pub(crate) size: [u32; 2],
    pub(crate) rate_hz: f64,
    pub(crate) exposure_s: f64,
    /// From the exposure of one row to that of the next one below; the frame's time is the middle row's.
    pub(crate) line_time_s: f64,
    pub(crate) camera: CameraNumbers,
    pub(crate) lens: Lens,
    /// CB_02 in the camera at rest.
    pub(crate) rest: Pose,
    /// CB_01, the camera's own carbody, in the camera while that is in its place.
    pub(crate) own: Pose,
    /// How the camera leaves that place.
    pub(crate) mount: Mount,
    pub(crate) sensor: Sensor,
    pub(crate) light: Light,
    pub(crate) suns: Vec<Sun>,
    pub(crate) glares: Vec<Glare>,
    pub(crate) lamp: Lamp,
    pub(crate) background: Background,
    pub(crate) plates: Vec<Plate>,
    /// Sheets with rings on the carbody that are no targets.
    pub(crate) posters: Vec<Plate>,
    pub(crate) motion: Motion,
    pub(crate) occluders: Vec<Occluder>,
    pub(crate) tolerance: Tolerance,
}

/// The camera as the setup file tells it.
#[derive(Clone, Debug)]
pub(crate) struct CameraNumbers {
    pub(crate) focal: [f64; 2],
    pub(crate) principal: [f64; 2],
    pub(crate) skew: f64,
    pub(crate) distortion: [f64; 5],
    /// Its place in CB_02 at rest, mm, and roll, pitch, yaw, degrees, as far off as the scene says, if the
    /// setup tells it.
    pub(crate) place: Option<[[f64; 3]; 2]>,
}

/// Reads the table of motions that a scene names: the only thing outside its file.
pub(crate) type ReadTable<'a> = &'a dyn Fn(&Path) -> Result<Vec<Motions>, Mistake>;

/// Checks a scene file; its motion table is read by `read_table`.
pub(crate) fn build(file: &SceneFile, read_table: ReadTable<'_>) -> Result<Parts, Mistake> {
    if file.name.is_empty() || file.name.len() > 32 {
        return Err(Mistake::new("name", "allowed are 1 to 32 bytes"));
    }
    if file.target.is_empty() {
        return Err(Mistake::new("target", "allowed is at least one target"));
    }
    let circles: usize = file.target.iter().map(|target| target.circles_mm.len()).sum();
    if circles > MAX_CIRCLES {
        let message = format!("{circles} circles over all targets, allowed are at most {MAX_CIRCLES}");
        return Err(Mistake::new("target", message));
    }
    let table = match &file.motion.csv {
        Some(path) => read_table(Path::new(path))?,
        None => Vec::new(),
    };
    let frames = match (file.frames, table.len()) {
        (None, rows) if rows > 0 => keys::FRAMES.take_whole("", Some(rows as i64))?,
        (frames, _) => keys::FRAMES.take_whole("", frames)?,
    };
    let Camera { size, rate_hz, exposure_s, line_time_s, numbers, rest, own } = camera(file)?;
    Ok(Parts {
        frames,
        size,
        rate_hz,
        exposure_s,
        line_time_s,
        lens: Lens::new(numbers.focal, numbers.principal, numbers.skew, numbers.distortion),
        camera: numbers,
        rest,
        own,
        mount: mount(file)?,
        sensor: sensor(file)?,
        light: light(file)?,
        suns: suns(file)?,
        glares: glares(file)?,
        lamp: lamp(file, rate_hz)?,
        background: background(file)?,
        plates: plates(&file.target, "target")?,
        posters: plates(&file.poster, "poster")?,
        motion: motion(file, table, rate_hz)?,
        occluders: occluders(file, size)?,
        tolerance: tolerance(file)?,
    })
}

fn sensor(file: &SceneFile) -> Result<Sensor, Mistake> {
    let table = &file.sensor;
    Ok(Sensor {
        bits: keys::BITS.take_whole("sensor", table.bits)?,
        blur_px: keys::BLUR.take("sensor", table.blur_px)?,
        full_well_e: keys::FULL_WELL.take("sensor", table.full_well_e)?,
        read_noise_e: keys::READ_NOISE.take("sensor", table.read_noise_e)?,
        shot_noise: table.shot_noise.unwrap_or(true),
        gain: keys::GAIN.take("sensor", table.gain)?,
        black_level: keys::BLACK_LEVEL.take("sensor", table.black_level)?,
    })
}

fn background(file: &SceneFile) -> Result<Background, Mistake> {
    let table = &file.background;
    Ok(Background {
        level: keys::BACKGROUND.take("background", table.level)?,
        texture: keys::TEXTURE.take("background", table.texture)?,
        grain_px: keys::GRAIN.take("background", table.grain_px)?,
        shapes: keys::SHAPES.take_whole("background", table.shapes)?,
        wheels: keys::WHEELS.take_whole("background", table.wheels)?,
        loudspeakers: keys::LOUDSPEAKERS.take_whole("background", table.loudspeakers)?,
    })
}

fn tolerance(file: &SceneFile) -> Result<Tolerance, Mistake> {
    let table = &file.tolerance;
    let at = "tolerance";
    Ok(Tolerance {
        print_mm: keys::PRINT.take(at, table.print_mm)?,
        print_scale: 0.01 * keys::PRINT_SCALE.take(at, table.print_scale_percent)?,
        mounting_mm: keys::MOUNTING.take(at, table.mounting_mm)?,
        mounting_deg: keys::MOUNTING_TURN.take(at, table.mounting_deg)?,
        focal: 0.01 * keys::FOCAL_ERROR.take(at, table.focal_percent)?,
        principal: 0.01 * keys::PRINCIPAL_ERROR.take(at, table.principal_percent)?,
        distortion: 0.01 * keys::DISTORTION_ERROR.take(at, table.distortion_percent)?,
    })
}

/// Refuses times that do not rise.
fn rising(times: impl Iterator<Item = f64>, key: &str) -> Result<(), Mistake> {
    let mut last = f64::NEG_INFINITY;
    for time in times {
        if !time.is_finite() || time <= last {
            return Err(Mistake::new(
                key,
                format!("time {time} follows {last}, allowed are times that rise"),
            ));
        }
        last = time;
    }
    Ok(())
}
