//! What an evaluation takes: one sample a frame, and the six degrees of freedom with their limits (thesis
//! 1.3).

use gangway_wire::{Pose, PoseFlags};

/// One of the six: its name, its unit and how far it may deviate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DegreeOfFreedom {
    /// Its name, as in columns and keys.
    pub name: &'static str,
    /// `mm` or `deg`, as in columns and keys.
    pub unit: &'static str,
    /// The unit as a person reads it.
    pub unit_sign: &'static str,
    /// Largest deviation that requirement R(a) allows, in the unit.
    pub limit: f64,
    /// Whether it is an angle.
    pub is_angle: bool,
}

const fn displacement(name: &'static str) -> DegreeOfFreedom {
    DegreeOfFreedom { name, unit: "mm", unit_sign: "mm", limit: 10.0, is_angle: false }
}

const fn rotation(name: &'static str) -> DegreeOfFreedom {
    DegreeOfFreedom { name, unit: "deg", unit_sign: "°", limit: 0.6, is_angle: true }
}

/// x, y, z, roll, pitch, yaw: the order of every array of six in this crate.
pub const DEGREES_OF_FREEDOM: [DegreeOfFreedom; 6] = [
    displacement("x"),
    displacement("y"),
    displacement("z"),
    rotation("roll"),
    rotation("pitch"),
    rotation("yaw"),
];

/// Lowest frame rate that requirement R(a) allows, Hz.
pub const RATE_LIMIT_HZ: f64 = 25.0;

/// One frame as the box measured it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The source's own frame number.
    pub frame: u32,
    /// Monotonic clock at mid-exposure, ns.
    pub time_ns: u64,
    /// The motion; `None` where the frame gave no pose.
    pub measured: Option<Measured>,
    /// Circles that went into the pose.
    pub markers: u8,
    /// How far the pose can be trusted.
    pub flags: PoseFlags,
}

/// The motion of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// x, y, z (mm), roll, pitch, yaw (degrees).
    pub values: [f64; 6],
    /// Their stated standard deviations, in the same units.
    pub sigmas: [f64; 6],
    /// Root mean square reprojection error, px.
    pub residual_px: f64,
}

impl From<&Pose> for Sample {
    fn from(pose: &Pose) -> Self {
        let measured = pose.motion.map(|motion| {
            let [x, y, z] = motion.displacement_mm.map(f64::from);
            let [roll, pitch, yaw] = motion.rotation_deg.map(f64::from);
            Measured {
                values: [x, y, z, roll, pitch, yaw],
                sigmas: motion.sigma.map(f64::from),
                residual_px: f64::from(motion.residual_px),
            }
        });
        Self { frame: pose.frame, time_ns: pose.time_ns, measured, markers: pose.markers, flags: pose.flags }
    }
}

impl Sample {
    /// Whether the frame came before the rest pose was known.
    pub fn is_waiting(&self) -> bool {
        self.flags.contains(PoseFlags::WAITING)
    }

    /// The motion, where there is one and all of it is a number.
    pub(crate) fn pose(&self) -> Option<&Measured> {
        self.measured.as_ref().filter(|m| m.values.iter().all(|v| v.is_finite()))
    }
}
