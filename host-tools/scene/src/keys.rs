//! Every number that a scene file can set: its key, unit, default and bounds. The file's structure is in
//! `file`; what the numbers do is told in the modules that use them.

use crate::error::Mistake;

/// A number with its bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Number {
    /// Key in its table.
    key: &'static str,
    /// Unit as it is printed.
    unit: &'static str,
    /// Value when the key is absent; without one the key is required.
    default: Option<f64>,
    /// Least allowed value.
    least: f64,
    /// Greatest allowed value.
    most: f64,
}

const fn required(key: &'static str, unit: &'static str, least: f64, most: f64) -> Number {
    Number { key, unit, default: None, least, most }
}

const fn optional(key: &'static str, unit: &'static str, default: f64, least: f64, most: f64) -> Number {
    Number { key, unit, default: Some(default), least, most }
}

pub(crate) const FRAMES: Number = optional("frames", "", 250.0, 1.0, 1_000_000.0);

// [camera]
pub(crate) const WIDTH: Number = required("width_px", "px", 32.0, 4096.0);
pub(crate) const HEIGHT: Number = required("height_px", "px", 32.0, 4096.0);
pub(crate) const RATE: Number = required("rate_hz", "Hz", 0.1, 1000.0);
pub(crate) const FOCAL: Number = required("focal_px", "px", 10.0, 100_000.0);
pub(crate) const PRINCIPAL: Number = required("principal_px", "px", -10_000.0, 10_000.0);
pub(crate) const SKEW: Number = optional("skew_px", "px", 0.0, -100.0, 100.0);
pub(crate) const DISTORTION: Number = optional("distortion", "", 0.0, -10.0, 10.0);
pub(crate) const EXPOSURE: Number = optional("exposure_ms", "ms", 0.0, 0.0, 10_000.0);
pub(crate) const LINE_TIME: Number = optional("line_time_us", "us", 0.0, -200.0, 200.0);
pub(crate) const POSITION: Number = required("position_mm", "mm", -100_000.0, 100_000.0);
pub(crate) const OWN_POSITION: Number = required("own_position_mm", "mm", -100_000.0, 100_000.0);
pub(crate) const CAMERA_ROLL: Number = optional("roll_deg", "degrees", 0.0, -180.0, 180.0);
pub(crate) const CAMERA_PITCH: Number = optional("pitch_deg", "degrees", 0.0, -89.0, 89.0);
pub(crate) const CAMERA_YAW: Number = optional("yaw_deg", "degrees", 0.0, -180.0, 180.0);

// [sensor]
pub(crate) const BITS: Number = optional("bits", "bits", 8.0, 8.0, 16.0);
pub(crate) const BLUR: Number = optional("blur_px", "px", 0.6, 0.0, 10.0);
pub(crate) const FULL_WELL: Number = optional("full_well_e", "electrons", 12_000.0, 100.0, 1e7);
pub(crate) const READ_NOISE: Number = optional("read_noise_e", "electrons", 15.0, 0.0, 1e5);
pub(crate) const GAIN: Number = optional("gain", "", 1.0, 0.01, 100.0);
pub(crate) const BLACK_LEVEL: Number = optional("black_level", "of full scale", 0.01, 0.0, 0.5);

// [light]
pub(crate) const LIGHT: Number = optional("level", "", 0.9, 0.0, 10.0);
pub(crate) const GRADIENT: Number = optional("gradient", "", 0.0, -2.0, 2.0);
pub(crate) const VIGNETTING: Number = optional("vignetting", "", 0.0, 0.0, 1.0);
pub(crate) const CURVE_LEVEL: Number = required("curve", "", 0.0, 10.0);
pub(crate) const FLICKER_DEPTH: Number = optional("flicker_depth", "", 0.0, 0.0, 1.0);
pub(crate) const FLICKER: Number = optional("flicker_hz", "Hz", 100.0, 0.1, 10_000.0);
pub(crate) const FLICKER_PHASE: Number = optional("flicker_phase_deg", "degrees", 0.0, -360.0, 360.0);
pub(crate) const FALL_START: Number = required("start_s", "s", 0.0, 1e6);
pub(crate) const FALL_TAKES: Number = optional("fall_s", "s", 0.0, 0.0, 1e6);
pub(crate) const FALL_END: Number = required("end_s", "s", 0.0, 1e6);
pub(crate) const FALL_RETURNS: Number = optional("rise_s", "s", 0.0, 0.0, 1e6);
pub(crate) const FALL_LEVEL: Number = required("level", "", 0.0, 1.0);

// [[sun]] and [[glare]]
pub(crate) const PATCH_SIZE: Number = required("size_px", "px", 0.0, 20_000.0);
pub(crate) const PATCH_PATH: Number = required("path", "s and px", -1e6, 1e6);
pub(crate) const SUN_EDGE: Number = optional("edge_px", "px", 2.0, 0.0, 1000.0);
pub(crate) const SUN_LEVEL: Number = required("level", "", 0.0, 100.0);
pub(crate) const GLARE_RADIUS: Number = required("radius_px", "px", 0.5, 5000.0);
pub(crate) const GLARE_LEVEL: Number = required("level", "of full scale", 0.0, 100.0);

// [lamp]
pub(crate) const LAMP_LEVEL: Number = optional("level", "of full scale", 0.7, 0.0, 100.0);
pub(crate) const LAMP_DELAY: Number = optional("delay_ms", "ms", 0.0, -1000.0, 1000.0);
pub(crate) const LAMP_SWITCHES: Number = required("switches_s", "s", 0.0, 1e6);

// [background]
pub(crate) const BACKGROUND: Number = optional("level", "", 0.3, 0.0, 1.0);
pub(crate) const TEXTURE: Number = optional("texture", "", 0.06, 0.0, 1.0);
pub(crate) const GRAIN: Number = optional("grain_px", "px", 24.0, 1.0, 1000.0);
pub(crate) const SHAPES: Number = optional("shapes", "", 40.0, 0.0, 1000.0);
pub(crate) const WHEELS: Number = optional("wheels", "", 0.0, 0.0, 200.0);
pub(crate) const LOUDSPEAKERS: Number = optional("loudspeakers", "", 0.0, 0.0, 200.0);

// [[target]] and [[poster]]
pub(crate) const CARBODY: Number = optional("carbody", "", 2.0, 1.0, 2.0);
pub(crate) const ORIGIN: Number = required("origin_mm", "mm", -100_000.0, 100_000.0);
pub(crate) const OUTER: Number = required("outer_diameter_mm", "mm", 1.0, 10_000.0);
pub(crate) const INNER: Number = required("inner_diameter_mm", "mm", 0.5, 10_000.0);
pub(crate) const CIRCLE: Number = required("circles_mm", "mm", -10_000.0, 10_000.0);
pub(crate) const SHEET: Number = required("sheet_mm", "mm", 1.0, 20_000.0);
pub(crate) const WHITE: Number = optional("white", "", 0.85, 0.0, 1.0);
pub(crate) const BLACK: Number = optional("black", "", 0.06, 0.0, 1.0);
/// Of a disc that is not lit.
pub(crate) const UNLIT: Number = optional("white", "", 0.15, 0.0, 1.0);

// [tolerance]
pub(crate) const PRINT: Number = optional("print_mm", "mm", 0.0, 0.0, 10.0);
pub(crate) const PRINT_SCALE: Number = optional("print_scale_percent", "%", 0.0, 0.0, 5.0);
pub(crate) const MOUNTING: Number = optional("mounting_mm", "mm", 0.0, 0.0, 100.0);
pub(crate) const MOUNTING_TURN: Number = optional("mounting_deg", "degrees", 0.0, 0.0, 10.0);
pub(crate) const FOCAL_ERROR: Number = optional("focal_percent", "%", 0.0, 0.0, 5.0);
pub(crate) const PRINCIPAL_ERROR: Number = optional("principal_percent", "% of the width", 0.0, 0.0, 5.0);
pub(crate) const DISTORTION_ERROR: Number = optional("distortion_percent", "%", 0.0, 0.0, 50.0);

// [motion]
pub(crate) const REST: Number = optional("rest_s", "s", 0.4, 0.0, 1e6);
pub(crate) const AMPLITUDE: Number = required("amplitude", "mm or degrees", -2000.0, 2000.0);
pub(crate) const FREQUENCY: Number = required("frequency_hz", "Hz", 0.0, 500.0);
pub(crate) const PHASE: Number = optional("phase_deg", "degrees", 0.0, -360.0, 360.0);
pub(crate) const FADE: Number = optional("fade_s", "s", 0.0, 0.0, 1e6);
pub(crate) const SIZE: Number = required("size", "mm or degrees", -2000.0, 2000.0);
pub(crate) const RISE: Number = optional("rise_s", "s", 0.0, 0.0, 1e6);
pub(crate) const TERM_AT: Number = required("at_s", "s", 0.0, 1e6);
pub(crate) const TERM_START: Number = required("start_s", "s", 0.0, 1e6);
pub(crate) const TERM_END: Number = required("end_s", "s", 0.0, 1e6);
pub(crate) const STEPS: Number = required("steps", "", 1.0, 100_000.0);
pub(crate) const EVERY: Number = required("every_s", "s", 0.001, 1e6);

// [[knock]] and [[shake]]: terms of a motion, with sizes of their own
pub(crate) const CAMERA_SHIFT: Number = required("shift_mm", "mm", -1000.0, 1000.0);
pub(crate) const CAMERA_TURN: Number = required("turn_deg", "degrees", -45.0, 45.0);
pub(crate) const KNOCK_TAKES: Number = optional("takes_s", "s", 0.0, 0.0, 1e6);
pub(crate) const SHAKE_START: Number = optional("start_s", "s", 0.0, 0.0, 1e6);

// [[occluder]] and [[post]]
pub(crate) const OCCLUDER_SIZE: Number = required("size_px", "px", 0.0, 20_000.0);
pub(crate) const OCCLUDER_PATH: Number = required("path", "s and px", -1e6, 1e6);
pub(crate) const OCCLUDER_LEVEL: Number = optional("level", "", 0.1, 0.0, 1.0);
pub(crate) const POST_WIDTH: Number = required("width_px", "px", 0.0, 20_000.0);
pub(crate) const POST_ENTERS: Number = required("enters_s", "s", 0.0, 1e6);
pub(crate) const POST_LEAVES: Number = required("leaves_s", "s", 0.0, 1e6);

// [[person]]
pub(crate) const PERSON_WIDTH: Number = optional("width_px", "px", 420.0, 1.0, 20_000.0);
pub(crate) const PERSON_HEIGHT: Number = optional("height_px", "px", 1400.0, 1.0, 20_000.0);
pub(crate) const PERSON_AT: Number = required("at_px", "px", -1e4, 1e4);
pub(crate) const PERSON_ENTERS: Number = required("enters_s", "s", 0.0, 1e6);
pub(crate) const PERSON_STANDS: Number = required("stands_s", "s", 0.0, 1e6);
pub(crate) const PERSON_GOES: Number = required("goes_s", "s", 0.0, 1e6);
pub(crate) const PERSON_LEAVES: Number = required("leaves_s", "s", 0.0, 1e6);

// [setup]
pub(crate) const PLACE_OFF: Number = optional("place_off_mm", "mm", 0.0, -10_000.0, 10_000.0);
pub(crate) const PLACE_TURNED: Number = optional("place_off_deg", "degrees", 0.0, -45.0, 45.0);

impl Number {
    /// The value in the table called `table`, or the default.
    pub(crate) fn take(&self, table: &str, value: Option<f64>) -> Result<f64, Mistake> {
        let key = join(table, self.key);
        match value.or(self.default) {
            None => Err(Mistake::new(key, format!("is missing, allowed is {}", self.bounds()))),
            Some(value) if (self.least..=self.most).contains(&value) => Ok(value),
            // Hundreds of digits are no sentence.
            Some(value) if value.abs() >= 1e15 => {
                Err(Mistake::new(key, format!("is {value:e}, allowed is {}", self.bounds())))
            }
            Some(value) => Err(Mistake::new(key, format!("is {value}, allowed is {}", self.bounds()))),
        }
    }

    /// A whole number in the table called `table`, or the default.
    pub(crate) fn take_whole(&self, table: &str, value: Option<i64>) -> Result<u32, Mistake> {
        // Bounds of whole numbers are below 2^32.
        self.take(table, value.map(|value| value as f64)).map(|value| value as u32)
    }

    /// Numbers that share these bounds.
    pub(crate) fn take_all<const N: usize>(
        &self,
        table: &str,
        values: [f64; N],
    ) -> Result<[f64; N], Mistake> {
        values.iter().try_for_each(|value| self.take(table, Some(*value)).map(drop))?;
        Ok(values)
    }

    fn bounds(&self) -> String {
        let space = if self.unit.is_empty() { "" } else { " " };
        format!("{} to {}{space}{}", self.least, self.most, self.unit)
    }
}

/// `table.key`, or the key alone at the top.
pub(crate) fn join(table: &str, key: &str) -> String {
    if table.is_empty() { key.to_owned() } else { format!("{table}.{key}") }
}
