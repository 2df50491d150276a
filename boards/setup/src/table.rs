//! The one table of everything that a person can set: key, unit, bounds, meaning, source and place.
//!
//! Reading, checking, showing, writing and the reference in SETUP.md all follow it. A default is what the
//! place holds before a file is read.

use crate::parts::{Parts, Target};
use crate::slot::{Slot, Value};

/// One setting of `T`.
pub(crate) struct Key<T> {
    /// Its key within its section.
    pub(crate) name: &'static str,
    /// Its unit; empty where it has none.
    pub(crate) unit: &'static str,
    /// Least value (of each number; of a text: its length in bytes).
    pub(crate) least: f64,
    /// Greatest value, as `least`.
    pub(crate) greatest: f64,
    /// Whether the file must say it.
    pub(crate) required: bool,
    /// What it means, in one line.
    pub(crate) meaning: &'static str,
    /// The thesis section that it comes from; empty where it comes from none.
    pub(crate) source: &'static str,
    /// Where it lives.
    pub(crate) slot: for<'a> fn(&'a mut T) -> Slot<'a>,
}

/// A table of the file with its keys; the first, without a name, is the file's head.
pub(crate) struct Section {
    /// Its name in the file.
    pub(crate) name: &'static str,
    /// Whether the file must have it.
    pub(crate) required: bool,
    /// Its keys.
    pub(crate) keys: &'static [Key<Parts>],
}

impl<T> Key<T> {
    /// The path of this key in a section.
    pub(crate) fn path(&self, section: &str) -> String {
        if section.is_empty() { self.name.to_owned() } else { format!("{section}.{}", self.name) }
    }

    /// What `of` holds for this key.
    pub(crate) fn value(&self, of: &T) -> Value
    where
        T: Clone,
    {
        (self.slot)(&mut of.clone()).value()
    }

    /// Whether a number is in the bounds.
    pub(crate) fn within(&self, number: f64) -> bool {
        number >= self.least && number <= self.greatest
    }

    /// The bounds of a number, to follow "it must be".
    pub(crate) fn between(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        format!("between {} and {}{unit}", self.least, self.greatest)
    }

    /// What is allowed, to follow "it must be".
    pub(crate) fn allowed(&self, slot: &Slot) -> String {
        let between = self.between();
        match slot {
            Slot::Text(_) => {
                format!("a text of {} to {} bytes without control characters", self.least, self.greatest)
            }
            Slot::Word(word) => {
                word.words().iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>().join(" or ")
            }
            Slot::Flag(_) => "true or false".to_owned(),
            Slot::Byte(_) | Slot::Whole(_) => format!("a whole number {between}"),
            Slot::Number(_) => format!("a number {between}"),
            Slot::Numbers(numbers) => format!("a list of {} numbers, each {between}", numbers.len()),
            Slot::Range(..) => {
                format!("[least, greatest], two numbers {between}, the least below the greatest")
            }
            Slot::Pairs(_) => format!("a list of pairs of numbers [u, v], each {between}"),
            Slot::Bytes(_) => format!("a list of whole numbers, each {between}"),
        }
    }
}

/// A key of the whole file, not of a target.
type FileKey = Key<Parts>;

/// Least and greatest value of a unit vector's component, with what [`crate::check`] lets pass.
const AXIS: f64 = 1.001;

/// The sections, in the order in which they are written and shown.
pub(crate) const SECTIONS: &[Section] = &[
    Section { name: "", required: true, keys: HEAD },
    Section { name: "camera", required: true, keys: CAMERA },
    Section { name: "tracker", required: false, keys: TRACKER },
    Section { name: "solver", required: false, keys: SOLVER },
    Section { name: "rest", required: false, keys: REST },
    Section { name: "limits", required: false, keys: LIMITS },
    Section { name: "capture", required: false, keys: CAPTURE },
    Section { name: "board", required: false, keys: BOARD },
];

const HEAD: &[FileKey] = &[Key {
    name: "name",
    unit: "",
    least: 1.0,
    greatest: gangway_engine::MAX_NAME as f64,
    required: true,
    meaning: "Name of the box, as records and sessions carry it.",
    source: "",
    slot: |p| Slot::Text(&mut p.name),
}];

const CAMERA: &[FileKey] = &[
    Key {
        name: "width_px",
        unit: "px",
        least: 64.0,
        greatest: 4096.0,
        required: true,
        meaning: "Width of the picture (a record carries centres up to 4,095 px).",
        source: "4.1.1",
        slot: |p| Slot::Whole(&mut p.camera.width_px),
    },
    Key {
        name: "height_px",
        unit: "px",
        least: 48.0,
        greatest: 4096.0,
        required: true,
        meaning: "Height of the picture.",
        source: "4.1.1",
        slot: |p| Slot::Whole(&mut p.camera.height_px),
    },
    Key {
        name: "rate_hz",
        unit: "Hz",
        least: 1.0,
        greatest: 1000.0,
        required: true,
        meaning: "Frames a second, nominal.",
        source: "1.3",
        slot: |p| Slot::Number(&mut p.camera.rate_hz),
    },
    Key {
        name: "line_time_us",
        unit: "us",
        least: -200.0,
        greatest: 200.0,
        required: false,
        meaning: "From the exposure of one row to that of the next; 0: global shutter, below 0: lowest row first.",
        source: "4.1.1",
        slot: |p| Slot::Number(&mut p.camera.line_time_us),
    },
    Key {
        name: "exposure_ms",
        unit: "ms",
        least: 0.0,
        greatest: 1000.0,
        required: false,
        meaning: "Exposure of each row: a box's camera is told it, the motion within it is corrected; 0: as the camera has it.",
        source: "4.1.1",
        slot: |p| Slot::Number(&mut p.camera.exposure_ms),
    },
    Key {
        name: "focal_px",
        unit: "px",
        least: 10.0,
        greatest: 200_000.0,
        required: true,
        meaning: "Focal lengths fx and fy.",
        source: "3.3.1",
        slot: |p| Slot::Numbers(&mut p.camera.focal_px),
    },
    Key {
        name: "principal_px",
        unit: "px",
        least: -4096.0,
        greatest: 8192.0,
        required: true,
        meaning: "Principal point cx and cy; the centre of the top-left pixel is (0, 0).",
        source: "3.3.1",
        slot: |p| Slot::Numbers(&mut p.camera.principal_px),
    },
    Key {
        name: "skew_px",
        unit: "px",
        least: -1000.0,
        greatest: 1000.0,
        required: false,
        meaning: "Skew of the picture's axes, the s of K.",
        source: "3.3.1",
        slot: |p| Slot::Number(&mut p.camera.skew_px),
    },
    Key {
        name: "distortion",
        unit: "",
        least: -1000.0,
        greatest: 1000.0,
        required: false,
        meaning: "k1, k2, p1, p2, k3 in the order and direction of OpenCV; invertible in the whole picture.",
        source: "4.2.3",
        slot: |p| Slot::Numbers(&mut p.camera.distortion),
    },
    Key {
        name: "position_mm",
        unit: "mm",
        least: -100_000.0,
        greatest: 100_000.0,
        required: false,
        meaning: "About where the camera is in the carbody CB_02 at rest, where seeds are not given; zeros: not known.",
        source: "3.4.2",
        slot: |p| Slot::Numbers(&mut p.camera.position_mm),
    },
    Key {
        name: "roll_deg",
        unit: "deg",
        least: -180.0,
        greatest: 180.0,
        required: false,
        meaning: "About how far it is turned about its line of sight there, clockwise.",
        source: "3.4.2",
        slot: |p| Slot::Number(&mut p.camera.roll_deg),
    },
    Key {
        name: "pitch_deg",
        unit: "deg",
        least: -89.0,
        greatest: 89.0,
        required: false,
        meaning: "About how far it looks down there.",
        source: "3.4.2",
        slot: |p| Slot::Number(&mut p.camera.pitch_deg),
    },
    Key {
        name: "yaw_deg",
        unit: "deg",
        least: -180.0,
        greatest: 180.0,
        required: false,
        meaning: "About how far it looks to the left there.",
        source: "3.4.2",
        slot: |p| Slot::Number(&mut p.camera.yaw_deg),
    },
];

/// The keys of each `[[target]]`.
pub(crate) const TARGET: &[Key<Target>] = &[
    Key {
        name: "name",
        unit: "",
        least: 1.0,
        greatest: 32.0,
        required: true,
        meaning: "Name of the target; no two alike.",
        source: "",
        slot: |t| Slot::Text(&mut t.name),
    },
    Key {
        name: "carbody",
        unit: "",
        least: 1.0,
        greatest: 2.0,
        required: false,
        meaning: "The carbody that carries it: 2, or 1, the camera's own, for reference targets.",
        source: "3.4.1",
        slot: |t| Slot::Byte(&mut t.carbody),
    },
    Key {
        name: "kind",
        unit: "",
        least: 0.0,
        greatest: 0.0,
        required: false,
        meaning: "How its circles show: black rings on white, or, \"led\", bright discs or points on dark, lit by the box.",
        source: "3.2.1",
        slot: |t| Slot::Word(&mut t.kind),
    },
    Key {
        name: "origin_mm",
        unit: "mm",
        least: -20_000.0,
        greatest: 20_000.0,
        required: true,
        meaning: "Its origin in its carbody: x forward, y left, z up.",
        source: "3.4.2",
        slot: |t| Slot::Numbers(&mut t.origin_mm),
    },
    Key {
        name: "u",
        unit: "",
        least: -AXIS,
        greatest: AXIS,
        required: false,
        meaning: "Its u axis in its carbody, to the right as the camera sees it; a unit vector.",
        source: "3.4.2",
        slot: |t| Slot::Numbers(&mut t.u),
    },
    Key {
        name: "v",
        unit: "",
        least: -AXIS,
        greatest: AXIS,
        required: false,
        meaning: "Its v axis, up as the camera sees it; a unit vector; u x v points to the camera.",
        source: "3.4.2",
        slot: |t| Slot::Numbers(&mut t.v),
    },
    Key {
        name: "outer_diameter_mm",
        unit: "mm",
        least: 1.0,
        greatest: 1000.0,
        required: true,
        meaning: "Diameter of the rings' outer edge, or of the bright discs.",
        source: "3.2.1",
        slot: |t| Slot::Number(&mut t.outer_diameter_mm),
    },
    Key {
        name: "inner_diameter_mm",
        unit: "mm",
        least: 0.0,
        greatest: 999.0,
        required: false,
        meaning: "Diameter of the rings' inner edge, 0.5 or more and below the outer one; half of it is usual. Discs have none.",
        source: "3.2.1",
        slot: |t| Slot::Number(&mut t.inner_diameter_mm),
    },
    Key {
        name: "circles_mm",
        unit: "mm",
        least: -10_000.0,
        greatest: 10_000.0,
        required: true,
        meaning: "Centres (u, v) of its circles on the target; 64 circles at most over all targets.",
        source: "3.2.2",
        slot: |t| Slot::Pairs(&mut t.circles_mm),
    },
    Key {
        name: "seeds_px",
        unit: "px",
        least: -0.5,
        greatest: 4095.5,
        required: false,
        meaning: "Where each circle shows at rest; one a circle, or left out for this target.",
        source: "3.2.3",
        slot: |t| Slot::Pairs(&mut t.seeds_px),
    },
];

const TRACKER: &[FileKey] = &[
    Key {
        name: "window_diameters",
        unit: "diameters",
        least: 2.0,
        greatest: 3.0,
        required: false,
        meaning: "Side of the search window in diameters of the ring.",
        source: "3.2.5",
        slot: |p| Slot::Number(&mut p.tracker.window_diameters),
    },
    Key {
        name: "median",
        unit: "",
        least: 0.0,
        greatest: 1.0,
        required: false,
        meaning: "Median 3x3 before the threshold, for compressed video.",
        source: "3.2.3",
        slot: |p| Slot::Flag(&mut p.tracker.median),
    },
    Key {
        name: "opening",
        unit: "",
        least: 0.0,
        greatest: 1.0,
        required: false,
        meaning: "Opening with a disk after the threshold.",
        source: "3.2.3",
        slot: |p| Slot::Flag(&mut p.tracker.opening),
    },
    Key {
        name: "min_contrast",
        unit: "full scale",
        least: 0.01,
        greatest: 0.5,
        required: false,
        meaning: "Least difference between the bright and the dark level of a window.",
        source: "3.2.3",
        slot: |p| Slot::Number(&mut p.tracker.min_contrast),
    },
    Key {
        name: "max_centroid_distance_px",
        unit: "px",
        least: 0.5,
        greatest: 5.0,
        required: false,
        meaning: "Largest distance between the centroids of a ring's dark and bright component.",
        source: "3.2.3",
        slot: |p| Slot::Number(&mut p.tracker.max_centroid_distance_px),
    },
    Key {
        name: "area_tolerance",
        unit: "",
        least: 0.05,
        greatest: 0.8,
        required: false,
        meaning: "Allowed relative deviation of a ring's area from the expected one.",
        source: "3.2.3",
        slot: |p| Slot::Number(&mut p.tracker.area_tolerance),
    },
    Key {
        name: "ratio_tolerance",
        unit: "",
        least: 0.05,
        greatest: 2.0,
        required: false,
        meaning: "How far filled:inner area may be off the diameters' ratio squared, as a factor less one.",
        source: "3.2.3",
        slot: |p| Slot::Number(&mut p.tracker.ratio_tolerance),
    },
];

const SOLVER: &[FileKey] = &[
    Key {
        name: "method",
        unit: "",
        least: 0.0,
        greatest: 0.0,
        required: false,
        meaning: "Solver of the first pose; \"auto\" takes DLT or homography up to 15 circles, EPnP above.",
        source: "5.4.7",
        slot: |p| Slot::Word(&mut p.solver.method),
    },
    Key {
        name: "min_circles",
        unit: "",
        least: 4.0,
        greatest: gangway_pose::MAX_CIRCLES as f64,
        required: false,
        meaning: "Fewest circles that make a pose.",
        source: "3.3.5",
        slot: |p| Slot::Byte(&mut p.solver.min_circles),
    },
    Key {
        name: "gate_sigmas",
        unit: "sigmas",
        least: 2.0,
        greatest: 100.0,
        required: false,
        meaning: "A circle further off than this, in its standard deviations, and than gate_px is left out.",
        source: "",
        slot: |p| Slot::Number(&mut p.solver.gate_sigmas),
    },
    Key {
        name: "gate_px",
        unit: "px",
        least: 0.05,
        greatest: 10.0,
        required: false,
        meaning: "No circle is left out below this reprojection error.",
        source: "",
        slot: |p| Slot::Number(&mut p.solver.gate_px),
    },
];

const REST: &[FileKey] = &[
    Key {
        name: "frames",
        unit: "frames",
        least: 10.0,
        greatest: 250.0,
        required: false,
        meaning: "Frames of the rest interval.",
        source: "5.3.2",
        slot: |p| Slot::Whole(&mut p.rest.frames),
    },
    Key {
        name: "excursion_px",
        unit: "px",
        least: 0.02,
        greatest: 5.0,
        required: false,
        meaning: "Largest excursion of any circle from its mean over the interval.",
        source: "5.3.2",
        slot: |p| Slot::Number(&mut p.rest.excursion_px),
    },
    Key {
        name: "drift_px",
        unit: "px",
        least: 0.01,
        greatest: 2.0,
        required: false,
        meaning: "Largest common drift of the circles between the interval's halves.",
        source: "5.3.2",
        slot: |p| Slot::Number(&mut p.rest.drift_px),
    },
];

const LIMITS: &[FileKey] = &[
    Key {
        name: "x_mm",
        unit: "mm",
        least: -5000.0,
        greatest: 5000.0,
        required: false,
        meaning: "Least and greatest x; beyond it a pose is flagged, not changed.",
        source: "1.2",
        slot: |p| Slot::Range(&mut p.limits.min_mm[0], &mut p.limits.max_mm[0]),
    },
    Key {
        name: "y_mm",
        unit: "mm",
        least: -5000.0,
        greatest: 5000.0,
        required: false,
        meaning: "Least and greatest y.",
        source: "1.2",
        slot: |p| Slot::Range(&mut p.limits.min_mm[1], &mut p.limits.max_mm[1]),
    },
    Key {
        name: "z_mm",
        unit: "mm",
        least: -5000.0,
        greatest: 5000.0,
        required: false,
        meaning: "Least and greatest z.",
        source: "1.2",
        slot: |p| Slot::Range(&mut p.limits.min_mm[2], &mut p.limits.max_mm[2]),
    },
    Key {
        name: "roll_deg",
        unit: "deg",
        least: 0.01,
        greatest: 89.0,
        required: false,
        meaning: "Greatest roll to either side.",
        source: "1.2",
        slot: |p| Slot::Number(&mut p.limits.max_deg[0]),
    },
    Key {
        name: "pitch_deg",
        unit: "deg",
        least: 0.01,
        greatest: 89.0,
        required: false,
        meaning: "Greatest pitch to either side.",
        source: "1.2",
        slot: |p| Slot::Number(&mut p.limits.max_deg[1]),
    },
    Key {
        name: "yaw_deg",
        unit: "deg",
        least: 0.01,
        greatest: 89.0,
        required: false,
        meaning: "Greatest yaw to either side.",
        source: "1.2",
        slot: |p| Slot::Number(&mut p.limits.max_deg[2]),
    },
    Key {
        name: "shock_mm_s2",
        unit: "mm/s^2",
        least: 100.0,
        greatest: 1e9,
        required: false,
        meaning: "Greatest acceleration between the carbodies; beyond it, without reference targets, the camera may have moved.",
        source: "",
        slot: |p| Slot::Number(&mut p.limits.shock_mm_s2),
    },
    Key {
        name: "shock_deg_s2",
        unit: "deg/s^2",
        least: 1.0,
        greatest: 1e7,
        required: false,
        meaning: "Greatest angular acceleration between them, likewise.",
        source: "",
        slot: |p| Slot::Number(&mut p.limits.shock_deg_s2),
    },
    Key {
        name: "standing_mm",
        unit: "mm",
        least: 0.1,
        greatest: 5000.0,
        required: false,
        meaning: "A train that stands again so far from its rest pose may have a moved camera, likewise.",
        source: "",
        slot: |p| Slot::Number(&mut p.limits.standing_mm),
    },
    Key {
        name: "standing_deg",
        unit: "deg",
        least: 0.01,
        greatest: 89.0,
        required: false,
        meaning: "Or turned so far from it.",
        source: "",
        slot: |p| Slot::Number(&mut p.limits.standing_deg),
    },
];

const CAPTURE: &[FileKey] = &[
    Key {
        name: "device",
        unit: "",
        least: 1.0,
        greatest: 255.0,
        required: false,
        meaning: "Camera of a Linux board: a stable path such as /dev/v4l/by-id/..., serial:NUMBER, or libcamera:NAME.",
        source: "",
        slot: |p| Slot::Text(&mut p.capture.device),
    },
    Key {
        name: "format",
        unit: "",
        least: 0.0,
        greatest: 0.0,
        required: false,
        meaning: "Sample format; \"auto\" takes the deepest that the camera gives in this size and rate.",
        source: "",
        slot: |p| Slot::Word(&mut p.capture.format),
    },
    Key {
        name: "exposure",
        unit: "",
        least: 0.0,
        greatest: 0.0,
        required: false,
        meaning: "camera.exposure_ms once and for all, or, \"auto\", up to that by the targets' own level.",
        source: "4.1.1",
        slot: |p| Slot::Word(&mut p.capture.exposure),
    },
    Key {
        name: "most_gain",
        unit: "",
        least: 1.0,
        greatest: 64.0,
        required: false,
        meaning: "Most amplification, as a factor, where the longest exposure is not enough for \"auto\".",
        source: "",
        slot: |p| Slot::Number(&mut p.capture.most_gain),
    },
    Key {
        name: "gain",
        unit: "driver units",
        least: -1.0,
        greatest: 65_535.0,
        required: false,
        meaning: "Gain, fixed; -1 leaves it as the camera has it.",
        source: "",
        slot: |p| Slot::Number(&mut p.capture.gain),
    },
    Key {
        name: "focus",
        unit: "driver units",
        least: -1.0,
        greatest: 65_535.0,
        required: false,
        meaning: "Focus, fixed; -1 leaves it as the camera has it.",
        source: "",
        slot: |p| Slot::Number(&mut p.capture.focus),
    },
    Key {
        name: "buffers",
        unit: "",
        least: 2.0,
        greatest: 32.0,
        required: false,
        meaning: "Pictures that the kernel may hold.",
        source: "",
        slot: |p| Slot::Byte(&mut p.capture.buffers),
    },
];

const BOARD: &[FileKey] = &[
    Key {
        name: "lamp_pins",
        unit: "",
        least: 1.0,
        greatest: 27.0,
        required: false,
        meaning: "GPIO pins (BCM numbers) of the lamps of lit targets.",
        source: "",
        slot: |p| Slot::Bytes(&mut p.board.lamp_pins),
    },
    Key {
        name: "lamps",
        unit: "",
        least: 0.0,
        greatest: 0.0,
        required: false,
        meaning: "How lit targets are driven: always lit, never, or in every other frame.",
        source: "3.2.1",
        slot: |p| Slot::Word(&mut p.board.lamps),
    },
    Key {
        name: "status_pin",
        unit: "",
        least: 0.0,
        greatest: 27.0,
        required: false,
        meaning: "GPIO pin of a status lamp; 0 for none.",
        source: "",
        slot: |p| Slot::Byte(&mut p.board.status_pin),
    },
    Key {
        name: "button_pin",
        unit: "",
        least: 0.0,
        greatest: 27.0,
        required: false,
        meaning: "GPIO pin of a push button to ground; 0 for none.",
        source: "",
        slot: |p| Slot::Byte(&mut p.board.button_pin),
    },
    Key {
        name: "sync_pin",
        unit: "",
        least: 0.0,
        greatest: 27.0,
        required: false,
        meaning: "GPIO pin of a sync input whose edges are recorded; 0 for none.",
        source: "",
        slot: |p| Slot::Byte(&mut p.board.sync_pin),
    },
    Key {
        name: "realtime_priority",
        unit: "",
        least: 0.0,
        greatest: 99.0,
        required: false,
        meaning: "SCHED_FIFO priority of the frame thread; 0 for the ordinary scheduler.",
        source: "",
        slot: |p| Slot::Byte(&mut p.board.realtime_priority),
    },
    Key {
        name: "core",
        unit: "",
        least: -1.0,
        greatest: 255.0,
        required: false,
        meaning: "Processor core of the frame thread; -1 for any.",
        source: "",
        slot: |p| Slot::Number(&mut p.board.core),
    },
    Key {
        name: "log_dir",
        unit: "",
        least: 0.0,
        greatest: 255.0,
        required: false,
        meaning: "Folder on the board's own disk in which every ride is kept; empty for none.",
        source: "",
        slot: |p| Slot::Text(&mut p.board.log_dir),
    },
];
