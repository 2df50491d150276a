//! What an export writes: one row a frame, or one row a circle seen; names, units and words in one place.

use gangway_wire::{Markers, Pose, PoseFlags};

/// One row a frame: the `Pose` record itself.
pub type PoseRow = Pose;

/// One circle as it was seen in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerRow {
    /// The source's own frame number.
    pub frame: u32,
    /// Index of the circle.
    pub circle: u8,
    /// u right, v down, px.
    pub at_px: [f64; 2],
    /// Covariance uu, uv, vv, px^2.
    pub covariance_px2: [f64; 3],
    /// Whether it went into the pose.
    pub used: bool,
}

impl MarkerRow {
    /// The rows of one record.
    pub fn of(markers: &Markers<'_>) -> impl Iterator<Item = Self> {
        markers.iter().map(|(circle, marker)| {
            let [u, v] = marker.sigma_px.map(f64::from);
            Self {
                frame: markers.frame,
                circle,
                at_px: marker.at_px.map(f64::from),
                covariance_px2: [u * u, u * v * f64::from(marker.correlation), v * v],
                used: markers.is_used(circle),
            }
        })
    }
}

/// Columns of an export of poses.
pub const POSE_COLUMNS: [&str; 17] = [
    "frame",
    "time_ns",
    "x_mm",
    "y_mm",
    "z_mm",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
    "x_sigma_mm",
    "y_sigma_mm",
    "z_sigma_mm",
    "roll_sigma_deg",
    "pitch_sigma_deg",
    "yaw_sigma_deg",
    "residual_px",
    "markers",
    "flags",
];

/// Columns of an export of centres.
pub const MARKER_COLUMNS: [&str; 8] = [
    "frame",
    "circle",
    "u_px",
    "v_px",
    "covariance_uu_px2",
    "covariance_uv_px2",
    "covariance_vv_px2",
    "used",
];

/// The 13 numbers of a motion in the order of [`POSE_COLUMNS`]; `None` where the frame gave no pose.
pub fn numbers(pose: &Pose) -> Option<[f32; 13]> {
    let motion = pose.motion?;
    let mut all = [0.0; 13];
    all[..3].copy_from_slice(&motion.displacement_mm);
    all[3..6].copy_from_slice(&motion.rotation_deg);
    all[6..12].copy_from_slice(&motion.sigma);
    all[12] = motion.residual_px;
    Some(all)
}

/// Words of the flags, joined by `|`; bits that this version does not know as `bit9`.
pub fn flag_words(flags: PoseFlags) -> String {
    const WORDS: [(PoseFlags, &str); 13] = [
        (PoseFlags::WAITING, "waiting"),
        (PoseFlags::FEW_MARKERS, "few-markers"),
        (PoseFlags::NO_SOLUTION, "no-solution"),
        (PoseFlags::AMBIGUOUS, "ambiguous"),
        (PoseFlags::OUTLIERS, "outliers"),
        (PoseFlags::BEYOND_LIMITS, "beyond-limits"),
        (PoseFlags::AFTER_GAP, "after-gap"),
        (PoseFlags::CORRUPT, "corrupt"),
        (PoseFlags::SPARSE, "sparse"),
        (PoseFlags::DARK, "dark"),
        (PoseFlags::SWITCHED, "switched"),
        (PoseFlags::CAMERA_MOVED, "camera-moved"),
        (PoseFlags::UNREFERENCED, "unreferenced"),
    ];
    let bits = (0..u16::BITS).filter(|bit| flags.0 >> bit & 1 == 1);
    let words = bits.map(|bit| {
        let known = WORDS.iter().find(|(flag, _)| flag.0 == 1 << bit);
        known.map_or_else(|| format!("bit{bit}"), |(_, word)| (*word).to_owned())
    });
    words.collect::<Vec<_>>().join("|")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_read_as_words_and_unknown_bits_are_kept() {
        assert_eq!(flag_words(PoseFlags(0)), "");
        assert_eq!(flag_words(PoseFlags::WAITING), "waiting");
        assert_eq!(flag_words(PoseFlags(0xffff)).split('|').count(), 16);
        assert_eq!(flag_words(PoseFlags::AFTER_GAP | PoseFlags(1 << 15)), "after-gap|bit15");
    }
}
