//! Everything the frame loop is told before it starts, validated by whoever makes it (the setup file).

use gangway_pose::{Circle, Lens, MAX_CIRCLES, Pose, Shutter};
use heapless::{String, Vec};

use crate::{AutoExposure, LampMode, MAX_NAME, MAX_SETUP_TEXT};

/// How rest is recognised and measured (thesis 5.3.2: a poor first frame biases every later one).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestSettings {
    /// Frames of the rest interval; 10 to 250, default 10.
    pub frames: u16,
    /// Largest excursion of any circle from its mean over the interval, px; 0.02 to 5, default 0.5.
    pub excursion_px: f64,
    /// Largest common drift of the circles between the interval's halves, px; 0.01 to 2, default 0.1.
    pub drift_px: f64,
    /// How far a circle may lie from where the layout says, mm; 0 to 50, default 5: what a tape measures. The
    /// rest interval shows where it is. With 0 the layout is taken as exact.
    pub layout_mm: f64,
}

impl Default for RestSettings {
    fn default() -> Self {
        Self { frames: 10, excursion_px: 0.5, drift_px: 0.1, layout_mm: 5.0 }
    }
}

/// Limits of the motion (thesis 1.2): beyond them a record is flagged, not changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Least x, y, z displacement, mm.
    pub min_mm: [f64; 3],
    /// Greatest x, y, z displacement, mm.
    pub max_mm: [f64; 3],
    /// Greatest roll, pitch, yaw to either side, degrees.
    pub max_deg: [f64; 3],
    /// Greatest acceleration of one carbody's end against the other's, mm/s^2; 100 to 10^9. Beyond it the
    /// camera may have moved, where no reference targets tell.
    pub shock_mm_s2: f64,
    /// Greatest angular acceleration of one carbody against the other, degrees/s^2; 1 to 10^7.
    pub shock_deg_s2: f64,
    /// A train that stands again this far from its rest pose may have a moved camera, mm; 0.1 to 5000.
    pub standing_mm: f64,
    /// Or turned this far from it, degrees; 0.01 to 89.
    pub standing_deg: f64,
}

impl Default for Limits {
    /// Velaro D (thesis 1.2). Shocks: 5 g of either carbody (EN 61373, category 1, along the track), and as
    /// much at the ends of two carbodies of 23 m that turn against each other. Standing: couplers stop a
    /// train anywhere in their slack, so more than half of the travel along the track.
    fn default() -> Self {
        Self {
            min_mm: [-70.0, -900.0, -350.0],
            max_mm: [60.0, 900.0, 350.0],
            max_deg: [5.0, 4.0, 15.0],
            shock_mm_s2: 1e5,
            shock_deg_s2: 500.0,
            standing_mm: 40.0,
            standing_deg: 0.2,
        }
    }
}

/// Settings of the whole frame loop.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Name of the box.
    pub name: String<MAX_NAME>,
    /// Width and height of the pictures, samples.
    pub picture: (u16, u16),
    /// Frames a second, nominal.
    pub rate_hz: f64,
    /// When the rows of a frame are exposed.
    pub shutter: Shutter,
    /// The camera model.
    pub lens: Lens,
    /// The circles of all targets.
    pub circles: Vec<Circle, MAX_CIRCLES>,
    /// Bit i: circle i is on the camera's own carbody.
    pub own: u64,
    /// Where each circle is at rest, px, as far as the setup says: one entry a circle.
    pub seeds: Vec<Option<[f64; 2]>, MAX_CIRCLES>,
    /// About where the carbody is at rest in the camera, where the setup says it: of two poses that show the
    /// same, the one within the limits of the motion from here is taken.
    pub reference: Option<Pose>,
    /// The tracker.
    pub vision: gangway_vision::Settings,
    /// The pose solver.
    pub solver: gangway_pose::Settings,
    /// Rest.
    pub rest: RestSettings,
    /// Limits of the motion.
    pub limits: Limits,
    /// Within what bounds the camera's exposure is driven; `None`: it is left alone.
    pub exposure: Option<AutoExposure>,
    /// How the lamps of lit targets are driven.
    pub lamps: LampMode,
    /// The setup file's text as it is announced.
    pub text: String<MAX_SETUP_TEXT>,
    /// First 16 bytes of the text's SHA-256.
    pub digest: [u8; 16],
}
