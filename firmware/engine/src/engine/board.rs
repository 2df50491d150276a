//! What a step works on and what it comes to.

use gangway_device::CameraErrorKind;
use gangway_wire as wire;

/// Who this box is.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    /// Serial number of the box.
    pub box_id: u64,
    /// Number of this boot.
    pub boot_id: u64,
    /// Number of this session.
    pub session_id: u64,
    /// Version of the firmware, at most 32 bytes.
    pub firmware: &'static str,
}

/// The hardware that a step works on; all of it is passed in.
pub struct Board<'b, C, K, V, L> {
    /// Where frames come from.
    pub camera: &'b mut C,
    /// Monotonic time and UTC.
    pub clock: &'b K,
    /// Temperature and free space.
    pub vitals: &'b mut V,
    /// The lamps of active targets.
    pub lamps: &'b mut [L],
}

/// What a step came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A frame was measured and has its motion.
    Measured,
    /// A frame was worked through but gave no motion; its record says why.
    Unmeasured,
    /// A frame came again; it has no record of its own.
    Repeated,
    /// The camera gave no frame.
    NoFrame(CameraErrorKind),
}

/// One window of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Number of the circle.
    pub circle: u8,
    /// Its middle, px; not numbers for a circle that no window can be put on.
    pub at: [f64; 2],
    /// Its side, px.
    pub side_px: f64,
    /// Where the ring's centre was seen, px, or why not.
    pub seen: Result<[f64; 2], wire::LostReason>,
}
