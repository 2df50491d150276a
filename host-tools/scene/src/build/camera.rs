//! The camera: its picture, its numbers and its place, from their tables.

use super::CameraNumbers;
use crate::error::Mistake;
use crate::file::SceneFile;
use crate::keys;
use crate::optics::Pose;

/// What the scene file says of the camera.
pub(super) struct Camera {
    pub(super) size: [u32; 2],
    pub(super) rate_hz: f64,
    pub(super) exposure_s: f64,
    pub(super) line_time_s: f64,
    pub(super) numbers: CameraNumbers,
    /// CB_02 in the camera at rest.
    pub(super) rest: Pose,
    /// CB_01 in the camera.
    pub(super) own: Pose,
}

pub(super) fn camera(file: &SceneFile) -> Result<Camera, Mistake> {
    let table = &file.camera;
    let size = [
        keys::WIDTH.take_whole("camera", table.width_px)?,
        keys::HEIGHT.take_whole("camera", table.height_px)?,
    ];
    let rate_hz = keys::RATE.take("camera", table.rate_hz)?;
    let exposure_ms = keys::EXPOSURE.take("camera", table.exposure_ms)?;
    let period_ms = 1000.0 / rate_hz;
    if exposure_ms > period_ms {
        let message =
            format!("is {exposure_ms}, longer than a frame at {rate_hz} Hz; allowed is 0 to {period_ms} ms");
        return Err(Mistake::new("camera.exposure_ms", message));
    }
    let position = keys::POSITION.take_all("camera", table.position_mm)?;
    let turned = [
        keys::CAMERA_ROLL.take("camera", table.roll_deg)?,
        keys::CAMERA_PITCH.take("camera", table.pitch_deg)?,
        keys::CAMERA_YAW.take("camera", table.yaw_deg)?,
    ];
    // Without a place of its own the ends of the two carbodies touch at rest.
    let own_position = match table.own_position_mm {
        Some(position) => keys::OWN_POSITION.take_all("camera", position)?,
        None => position,
    };
    let [roll, pitch, yaw] = turned;
    Ok(Camera {
        size,
        rate_hz,
        exposure_s: exposure_ms / 1000.0,
        line_time_s: 1e-6 * keys::LINE_TIME.take("camera", table.line_time_us)?,
        numbers: numbers(file, position, turned)?,
        rest: Pose::of_camera(&position, roll, pitch, yaw),
        own: Pose::of_camera(&own_position, roll, pitch, yaw),
    })
}

/// What the setup is told: the calibration, and the camera's place as far off as the scene says.
fn numbers(file: &SceneFile, position: [f64; 3], turned: [f64; 3]) -> Result<CameraNumbers, Mistake> {
    let (table, told) = (&file.camera, &file.setup);
    let off_mm = keys::PLACE_OFF.take("setup", told.place_off_mm)?;
    let off_deg = keys::PLACE_TURNED.take("setup", told.place_off_deg)?;
    let is_told = told.place_off_mm.is_some() || told.place_off_deg.is_some();
    Ok(CameraNumbers {
        place: is_told.then(|| [position.map(|at| at + off_mm), turned.map(|angle| angle + off_deg)]),
        focal: keys::FOCAL.take_all("camera", table.focal_px)?,
        principal: keys::PRINCIPAL.take_all("camera", table.principal_px)?,
        skew: keys::SKEW.take("camera", table.skew_px)?,
        distortion: keys::DISTORTION.take_all("camera", table.distortion)?,
    })
}
