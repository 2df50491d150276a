//! The evaluation as JSON, for programs. Its keys are stable: a new one may come, none goes or changes its
//! meaning.

use serde::Serialize;

use crate::evaluation::{FlagCounts, Frames};
use crate::sync::Alignment;
use crate::{DEGREES_OF_FREEDOM, Deviation, Evaluation, Motion, RATE_LIMIT_HZ};

#[derive(Serialize)]
struct Document<'a> {
    version: u32,
    session: &'a str,
    reference: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sync: Option<&'a Alignment>,
    frames: Frames,
    flags: FlagCounts,
    duration_s: f64,
    rate_hz: Option<f64>,
    rate_limit_hz: f64,
    longest_gap_frames: usize,
    motion: Six<'a, Motion>,
    deviation: Option<Six<'a, Deviation>>,
}

/// The six by name.
#[derive(Serialize)]
struct Six<'a, T> {
    x: Of<'a, T>,
    y: Of<'a, T>,
    z: Of<'a, T>,
    roll: Of<'a, T>,
    pitch: Of<'a, T>,
    yaw: Of<'a, T>,
}

#[derive(Serialize)]
struct Of<'a, T> {
    unit: &'static str,
    #[serde(flatten)]
    statistics: &'a T,
}

impl<'a, T> Six<'a, T> {
    fn new(of: &'a [T; 6]) -> Self {
        let one = |i: usize| Of { unit: DEGREES_OF_FREEDOM[i].unit, statistics: &of[i] };
        Self { x: one(0), y: one(1), z: one(2), roll: one(3), pitch: one(4), yaw: one(5) }
    }
}

impl Evaluation {
    /// One JSON object, over several lines, without a newline at its end:
    ///
    /// | key | value |
    /// |---|---|
    /// | `version` | 1 |
    /// | `session`, `reference` | names; the reference is null where there is none, and so is `deviation` |
    /// | `sync` | the fields of [`Alignment`]; only where a recorder was synchronised |
    /// | `frames` | counts, the fields of [`Frames`] |
    /// | `flags` | counts, the fields of [`FlagCounts`] |
    /// | `duration_s`, `rate_hz`, `rate_limit_hz` | first to last frame; rate of the frames; what R(a) asks for |
    /// | `longest_gap_frames` | longest stretch after the first pose without one |
    /// | `motion` | `x`, `y`, `z`, `roll`, `pitch`, `yaw`, each with `unit` (`mm`, `deg`) and the fields of [`Motion`] |
    /// | `deviation` | the same six, each with `unit` and the fields of [`Deviation`] |
    pub fn to_json(&self) -> String {
        let document = Document {
            version: 1,
            session: &self.session,
            reference: self.reference.as_deref(),
            sync: self.sync.as_ref(),
            frames: self.frames,
            flags: self.flags,
            duration_s: self.duration_s,
            rate_hz: self.rate_hz,
            rate_limit_hz: RATE_LIMIT_HZ,
            longest_gap_frames: self.longest_gap_frames,
            motion: Six::new(&self.motion),
            deviation: self.deviation.as_ref().map(Six::new),
        };
        // Numbers and strings only: this cannot fail.
        serde_json::to_string_pretty(&document).unwrap_or_default()
    }
}
