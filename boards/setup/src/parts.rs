//! What a setup file says, part by part, as plain numbers: what the reader fills, what a program that writes
//! a setup (the simulator) starts from.

use crate::slot::Word;

/// All that a setup file says. [`Parts::to_toml`](crate::Parts::to_toml) writes it, `Setup::parse` reads it
/// back without any difference.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parts {
    /// Name of the box, 1 to 32 bytes.
    pub name: String,
    /// Camera, picture and lens.
    pub camera: Camera,
    /// The targets, in the order in which their circles are numbered.
    pub targets: Vec<Target>,
    /// The tracker.
    pub tracker: gangway_vision::Settings,
    /// The pose solver.
    pub solver: gangway_pose::Settings,
    /// Rest.
    pub rest: gangway_engine::RestSettings,
    /// Limits of the motion.
    pub limits: gangway_engine::Limits,
    /// The camera device of a Linux board.
    pub capture: Capture,
    /// Pins and scheduling of a Linux board.
    pub board: Board,
}

/// Camera, picture and lens (thesis 3.3.1, 4.2.3).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Camera {
    /// Width of the picture, px.
    pub width_px: u16,
    /// Height of the picture, px.
    pub height_px: u16,
    /// Frames a second, nominal.
    pub rate_hz: f64,
    /// From the exposure of one row to that of the next, us; 0 for a global shutter.
    pub line_time_us: f64,
    /// Exposure of each row, ms, the longest one where the loop drives it; 0 where it is not known.
    pub exposure_ms: f64,
    /// Focal lengths fx, fy, px.
    pub focal_px: [f64; 2],
    /// Principal point cx, cy, px; the centre of the top-left pixel is (0, 0).
    pub principal_px: [f64; 2],
    /// Skew s, px.
    pub skew_px: f64,
    /// k1, k2, p1, p2, k3, in the order and direction of OpenCV.
    pub distortion: [f64; 5],
    /// About where it is in CB_02 at rest, mm; zeros where that is not known.
    pub position_mm: [f64; 3],
    /// About how far it is turned there: about its line of sight.
    pub roll_deg: f64,
    /// Downwards.
    pub pitch_deg: f64,
    /// To the left.
    pub yaw_deg: f64,
}

/// A plate with circles (thesis 3.2.2).
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Its name, 1 to 32 bytes, no two alike.
    pub name: String,
    /// The carbody that carries it.
    pub carbody: u8,
    /// How its circles show.
    pub kind: Kind,
    /// Its origin in its carbody, mm.
    pub origin_mm: [f64; 3],
    /// Its u axis in its carbody: to the right as the camera sees it.
    pub u: [f64; 3],
    /// Its v axis in its carbody: up as the camera sees it. u x v points towards the camera.
    pub v: [f64; 3],
    /// Diameter of the rings' outer edge, mm.
    pub outer_diameter_mm: f64,
    /// Diameter of the rings' inner edge, mm.
    pub inner_diameter_mm: f64,
    /// Centres of its circles on the target (u, v), mm.
    pub circles_mm: Vec<[f64; 2]>,
    /// Where each circle shows at rest, px; one a circle, or none at all.
    pub seeds_px: Vec<[f64; 2]>,
}

impl Default for Target {
    /// Straight across the track, facing the camera; no circles yet.
    fn default() -> Self {
        Self {
            name: String::new(),
            carbody: 2,
            kind: Kind::Printed,
            origin_mm: [0.0; 3],
            u: [0.0, -1.0, 0.0],
            v: [0.0, 0.0, 1.0],
            outer_diameter_mm: 0.0,
            inner_diameter_mm: 0.0,
            circles_mm: Vec::new(),
            seeds_px: Vec::new(),
        }
    }
}

/// How a target's circles show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// Printed black rings on white.
    #[default]
    Printed,
    /// Bright discs or points, lit by the box.
    Led,
}

impl Word for Kind {
    fn words(&self) -> &'static [&'static str] {
        &["printed", "led"]
    }
    fn index(&self) -> usize {
        match self {
            Kind::Printed => 0,
            Kind::Led => 1,
        }
    }
    fn choose(&mut self, index: usize) {
        *self = if index == 0 { Kind::Printed } else { Kind::Led };
    }
}

/// The camera device of a Linux board: what to ask of it and what of its timing is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    /// A path, or `serial:` and the serial number of the device.
    pub device: String,
    /// Sample format.
    pub format: SampleFormat,
    /// Whether the exposure is driven by the loop.
    pub exposure: ExposureMode,
    /// Most amplification where it is.
    pub most_gain: f64,
    /// Gain in the driver's units; -1 leaves it as it is.
    pub gain: f64,
    /// Focus in the driver's units; -1 leaves it as it is.
    pub focus: f64,
    /// Pictures that the kernel may hold.
    pub buffers: u8,
}

impl Default for Capture {
    fn default() -> Self {
        Self {
            device: "/dev/video0".to_owned(),
            format: SampleFormat::Auto,
            exposure: ExposureMode::Fixed,
            most_gain: 8.0,
            gain: -1.0,
            focus: -1.0,
            buffers: 4,
        }
    }
}

/// Who says how long a camera exposes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExposureMode {
    /// The setup, once.
    #[default]
    Fixed,
    /// The loop, by the targets' own level.
    Auto,
}

impl Word for ExposureMode {
    fn words(&self) -> &'static [&'static str] {
        &["fixed", "auto"]
    }
    fn index(&self) -> usize {
        match self {
            ExposureMode::Fixed => 0,
            ExposureMode::Auto => 1,
        }
    }
    fn choose(&mut self, index: usize) {
        *self = if index == 0 { ExposureMode::Fixed } else { ExposureMode::Auto };
    }
}

/// How a camera shall deliver its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleFormat {
    /// The best that the camera has.
    #[default]
    Auto,
    /// 8-bit grey.
    Grey,
    /// 10-bit grey in two bytes.
    Y10,
    /// 12-bit grey in two bytes.
    Y12,
    /// 16-bit grey.
    Y16,
    /// 10-bit grey, four samples in five bytes.
    Y10p,
    /// 12-bit grey, two samples in three bytes.
    Y12p,
    /// The luma of 4:2:2, luma first.
    Yuyv,
    /// The luma of 4:2:2, chroma first.
    Uyvy,
    /// The luma plane of 4:2:0.
    Nv12,
    /// An 8-bit Bayer mosaic, taken as grey.
    Bayer,
}

impl SampleFormat {
    const ALL: [Self; 11] = [
        Self::Auto,
        Self::Grey,
        Self::Y10,
        Self::Y12,
        Self::Y16,
        Self::Y10p,
        Self::Y12p,
        Self::Yuyv,
        Self::Uyvy,
        Self::Nv12,
        Self::Bayer,
    ];
}

impl Word for SampleFormat {
    fn words(&self) -> &'static [&'static str] {
        &["auto", "grey", "y10", "y12", "y16", "y10p", "y12p", "yuyv", "uyvy", "nv12", "bayer"]
    }
    fn index(&self) -> usize {
        Self::ALL.iter().position(|format| format == self).unwrap_or(0)
    }
    fn choose(&mut self, index: usize) {
        *self = Self::ALL.get(index).copied().unwrap_or_default();
    }
}

/// Pins and scheduling of a Linux board.
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    /// Pins of the lamps of lit targets.
    pub lamp_pins: Vec<u8>,
    /// How they are driven.
    pub lamps: gangway_engine::LampMode,
    /// Pin of the status lamp; 0 for none.
    pub status_pin: u8,
    /// Pin of the push button; 0 for none.
    pub button_pin: u8,
    /// Pin of the sync input; 0 for none.
    pub sync_pin: u8,
    /// SCHED_FIFO priority of the frame thread; 0 for the ordinary scheduler.
    pub realtime_priority: u8,
    /// Core of the frame thread; -1 for any.
    pub core: f64,
    /// Folder in which every ride is kept on the board itself; empty for none.
    pub log_dir: String,
}

impl Default for Board {
    fn default() -> Self {
        Self {
            lamp_pins: Vec::new(),
            lamps: gangway_engine::LampMode::On,
            status_pin: 0,
            button_pin: 0,
            sync_pin: 0,
            realtime_priority: 50,
            core: -1.0,
            log_dir: String::new(),
        }
    }
}
