//! The records, one struct a kind; `WIRE.md` is the specification. `Event` and `Markers` have files of their
//! own.
//!
//! The serde derives are the layout on the wire (standard deviations as two bytes, times as eight) and meant
//! for postcard only: whoever wants a record as text writes its fields.

use serde::{Deserialize, Serialize};

use crate::short;

/// Longest name of a box, bytes.
pub const MAX_NAME: usize = 32;
/// Longest firmware version, bytes.
pub const MAX_FIRMWARE: usize = 32;
/// Longest piece of the setup's text, bytes.
pub const MAX_SETUP_PIECE: usize = 192;
/// Longest text of a mark, bytes.
pub const MAX_MARK: usize = 64;

/// Who sends, and what its records mean.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello<'a> {
    /// Version of the wire, see [`crate::WIRE_VERSION`].
    pub wire_version: u16,
    /// Serial number of the box.
    #[serde(with = "postcard::fixint::le")]
    pub box_id: u64,
    /// Number of this boot.
    #[serde(with = "postcard::fixint::le")]
    pub boot_id: u64,
    /// Number of this session (one start of the frame loop).
    #[serde(with = "postcard::fixint::le")]
    pub session_id: u64,
    /// Name of the box, at most [`MAX_NAME`] bytes.
    pub name: &'a str,
    /// Version of the firmware, at most [`MAX_FIRMWARE`] bytes.
    pub firmware: &'a str,
    /// First 16 bytes of the SHA-256 of the setup's text.
    pub setup_digest: [u8; 16],
}

/// One piece of the setup's text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetupPiece<'a> {
    /// Digest of the whole text, as in `Hello`: pieces of two setups are never mixed.
    pub digest: [u8; 16],
    /// Number of this piece, from 0.
    pub index: u16,
    /// Pieces in all.
    pub count: u16,
    /// The text, at most [`MAX_SETUP_PIECE`] bytes a piece.
    pub text: &'a str,
}

/// The rest pose `[R0 | t0]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rest {
    /// First and last frame of the rest interval.
    pub first_frame: u32,
    /// Last frame of the rest interval.
    pub last_frame: u32,
    /// Frames that went into the mean.
    pub frames: u16,
    /// R0 as a unit quaternion w, x, y, z with w >= 0.
    pub rotation: [f64; 4],
    /// t0, mm.
    pub translation_mm: [f64; 3],
    /// Covariance of (x, y, z, roll, pitch, yaw) in the rest frame, mm and degrees: upper triangle by rows.
    pub covariance: [f32; 21],
}

/// The measured motion of one frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// The source's own frame number.
    pub frame: u32,
    /// Monotonic clock at mid-exposure, ns.
    #[serde(with = "postcard::fixint::le")]
    pub time_ns: u64,
    /// See [`PoseFlags`].
    pub flags: PoseFlags,
    /// Circles that went into the pose.
    pub markers: u8,
    /// The motion; `None` where the frame gave no pose.
    pub motion: Option<Motion>,
}

/// Relative motion with its standard deviations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// x, y, z in the rest frame, mm.
    pub displacement_mm: [f32; 3],
    /// Roll, pitch, yaw, degrees.
    pub rotation_deg: [f32; 3],
    /// Standard deviations of x, y, z (mm) and roll, pitch, yaw (degrees); 2 bytes each on the wire, to 0.2
    /// %.
    #[serde(with = "short::six")]
    pub sigma: [f32; 6],
    /// Root mean square reprojection error, px; 2 bytes on the wire, to 0.2 %.
    #[serde(with = "short::one")]
    pub residual_px: f32,
}

/// Bits that say how far a pose can be trusted. A host that meets an unknown bit keeps it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PoseFlags(pub u16);

impl PoseFlags {
    /// The rest pose is not known yet; no motion can be given.
    pub const WAITING: Self = Self(1);
    /// Too few circles were seen for a pose.
    pub const FEW_MARKERS: Self = Self(1 << 1);
    /// Enough circles, but the solver refused them (degenerate, no convergence).
    pub const NO_SOLUTION: Self = Self(1 << 2);
    /// A planar set whose second solution could be the right one, of this frame or of the rest pose.
    pub const AMBIGUOUS: Self = Self(1 << 3);
    /// At least one circle was seen but left out of the pose.
    pub const OUTLIERS: Self = Self(1 << 4);
    /// The motion is beyond the setup's limits.
    pub const BEYOND_LIMITS: Self = Self(1 << 5);
    /// Frames are missing between this one and the one before.
    pub const AFTER_GAP: Self = Self(1 << 6);
    /// The frame was torn, short or of another size.
    pub const CORRUPT: Self = Self(1 << 7);
    /// Fewer than 7 in 10 of the circles that should be in the picture went into the pose.
    pub const SPARSE: Self = Self(1 << 8);
    /// The lamps of lit targets were measured dark; their circles did not count.
    pub const DARK: Self = Self(1 << 9);
    /// The lamps were switched within the exposure, by what their circles show; these did not count.
    pub const SWITCHED: Self = Self(1 << 10);
    /// The camera may have moved on its carbody since rest, or turns as few trains do, and no reference
    /// targets tell: the motion may be its own.
    pub const CAMERA_MOVED: Self = Self(1 << 12);
    /// There are reference targets, and this frame does not show them: the motion is against the place where
    /// they were seen before, with what the camera has shaken about it in the standard deviations.
    pub const UNREFERENCED: Self = Self(1 << 13);

    /// Whether all bits of `other` are set.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl core::ops::BitOr for PoseFlags {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl core::ops::BitOrAssign for PoseFlags {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

/// Buckets of the loop time histogram.
pub const LOOP_TIME_BUCKETS: usize = 16;

/// How the box is doing, once a second of frame time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Health {
    /// Monotonic clock, ns.
    #[serde(with = "postcard::fixint::le")]
    pub time_ns: u64,
    /// Frames since start.
    pub frames: u32,
    /// Frames missed since start.
    pub frames_missed: u32,
    /// Records lost to a full outbox since start.
    pub records_lost: u32,
    /// Most records that ever waited in the outbox.
    pub queue_high_water: u16,
    /// Loop times since the last `Health`: bucket `i` counts those from 2^(i+9) up to 2^(i+10) ns; the first
    /// and the last bucket take what is below and above.
    pub loop_time: [u16; LOOP_TIME_BUCKETS],
    /// Longest loop time since the last `Health`, ns.
    pub loop_time_max_ns: u32,
    /// Temperature, 1/100 degree Celsius.
    pub temperature_centi_c: Option<i16>,
    /// Free space for the log, bytes.
    pub free_bytes: Option<u64>,
    /// Latencies since the last `Health`; `None` in records of a box that did not count them yet.
    #[serde(skip)]
    pub latency: Option<Latency>,
}

/// Where the time of a frame goes outside the loop. These fields came behind the first ones of `Health`: they
/// are on the line all or not at all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Latency {
    /// From the end of a frame's readout, where the camera tells it, to the frame loop: buckets from
    /// 2^[`WAKE_UP_BITS`] ns on.
    pub wake_up: Histogram,
    /// From mid-exposure to the last byte of the frame's `Pose` handed to the line: buckets from
    /// 2^[`EXPOSURE_TO_LINE_BITS`] ns on.
    pub exposure_to_line: Histogram,
}

/// Bucket 0 of the wake-up latency begins at 2^9 ns = 0.5 us, bucket 15 at 16.8 ms, as for loop times.
pub const WAKE_UP_BITS: u32 = 9;
/// Bucket 0 of the time from exposure to line begins at 2^16 ns = 66 us, bucket 15 at 2.1 s.
pub const EXPOSURE_TO_LINE_BITS: u32 = 16;

/// How often a time was how long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Histogram {
    /// Bucket `i` counts times from 2^(i + bits) up to 2^(i + bits + 1) ns, with the `bits` of the first
    /// bucket; the first and the last bucket take what is below and above.
    pub counts: [u16; LOOP_TIME_BUCKETS],
    /// Longest time, ns; more than 4.29 s are not told apart.
    pub longest_ns: u32,
}

impl Histogram {
    /// Counts a time, ns. The first bucket begins at 2^`bits` ns.
    pub fn note(&mut self, ns: u64, bits: u32) {
        let ns = u32::try_from(ns).unwrap_or(u32::MAX);
        self.longest_ns = self.longest_ns.max(ns);
        let bucket = (ns | 1).ilog2().saturating_sub(bits) as usize;
        if let Some(count) = self.counts.get_mut(bucket.min(LOOP_TIME_BUCKETS - 1)) {
            *count = count.saturating_add(1);
        }
    }

    /// Counts what another one has counted.
    pub fn merge(&mut self, other: &Self) {
        for (count, more) in self.counts.iter_mut().zip(other.counts) {
            *count = count.saturating_add(more);
        }
        self.longest_ns = self.longest_ns.max(other.longest_ns);
    }

    /// Times counted; a bucket counts no more than 65,535.
    pub fn total(&self) -> u32 {
        self.counts.iter().map(|count| u32::from(*count)).sum()
    }
}

/// How the box's monotonic clock stands to UTC.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimeSync {
    /// Monotonic clock, ns.
    #[serde(with = "postcard::fixint::le")]
    pub time_ns: u64,
    /// UTC minus monotonic clock, ns since 1970; `None` where the box knows no UTC.
    pub utc_offset_ns: Option<i64>,
    /// Uncertainty of the offset, ns.
    pub uncertainty_ns: u64,
}

/// Answer to a `Ping`, with both clocks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pong {
    /// Number of the ping.
    pub number: u32,
    /// The host's clock, as the ping carried it, ns.
    #[serde(with = "postcard::fixint::le")]
    pub host_time_ns: u64,
    /// The box's monotonic clock when it answered, ns.
    #[serde(with = "postcard::fixint::le")]
    pub time_ns: u64,
}

/// Host to box: the host asks for the box's clock.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ping {
    /// Any number.
    pub number: u32,
    /// The host's clock, ns.
    #[serde(with = "postcard::fixint::le")]
    pub host_time_ns: u64,
}

/// Host to box: a mark in the records.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark<'a> {
    /// Its text, at most [`MAX_MARK`] bytes.
    pub text: &'a str,
}
