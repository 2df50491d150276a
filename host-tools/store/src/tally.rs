//! What a session holds, in counts: records, damage, and the events that matter.

use std::fmt;

use gangway_wire::{Counts, Decoded, Record, WIRE_VERSION, What};

/// Counts over a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Bytes in all.
    pub bytes: u64,
    /// Bytes of an unfinished record at the end.
    pub unfinished: u64,
    /// What the decoder counted: records, damage, gaps.
    pub wire: Counts,
    /// Highest version of the wire that a `Hello` named, 0 without one.
    pub wire_version: u16,
    /// Frames with a `Pose` record.
    pub frames: u64,
    /// Of these, the ones with a motion.
    pub poses: u64,
    /// `Markers` records.
    pub markers: u64,
    /// Rest poses set.
    pub rests: u64,
    /// Marks given.
    pub marks: u64,
    /// Frames that the source numbered but never delivered whole.
    pub frames_missed: u64,
    /// Frames that came torn or of another size.
    pub frames_corrupt: u64,
    /// Frames that came twice.
    pub frames_repeated: u64,
    /// Records that the box lost to a full outbox.
    pub overflow: u64,
    /// Circles lost from sight.
    pub markers_lost: u64,
    /// Times that the camera stalled.
    pub camera_stalled: u64,
    /// Times that the camera was lost.
    pub camera_lost: u64,
    /// Whether the frame loop said that it ended.
    pub ended: bool,
    /// First frame and its time, ns.
    pub first: Option<(u32, u64)>,
    /// Last frame and its time, ns.
    pub last: Option<(u32, u64)>,
}

/// The version of the wire that a record names, if this program cannot read it: what else is on such a line
/// is not guessed at.
pub fn foreign_version(decoded: &Decoded<'_>) -> Option<u16> {
    match decoded {
        Decoded::Record { record: Record::Hello(hello), .. } => {
            Some(hello.wire_version).filter(|version| *version > WIRE_VERSION)
        }
        _ => None,
    }
}

/// Frame and time of a record, as far as it has both.
pub(crate) fn moment(record: &Record<'_>) -> Option<(u32, u64)> {
    match record {
        Record::Pose(pose) => Some((pose.frame, pose.time_ns)),
        Record::Event(event) => Some((event.frame, event.time_ns)),
        _ => None,
    }
}

impl Tally {
    /// Counts what the decoder found.
    pub fn note(&mut self, decoded: &Decoded<'_>) {
        let Decoded::Record { record, .. } = decoded else { return };
        match record {
            Record::Hello(hello) => self.wire_version = self.wire_version.max(hello.wire_version),
            Record::Pose(pose) => {
                self.frames += 1;
                self.poses += u64::from(pose.motion.is_some());
                self.first = self.first.or(Some((pose.frame, pose.time_ns)));
                self.last = Some((pose.frame, pose.time_ns));
            }
            Record::Markers(_) => self.markers += 1,
            Record::Event(event) => match event.what {
                What::Started => self.ended = false,
                What::Ended => self.ended = true,
                What::RestSet { .. } => self.rests += 1,
                What::Mark { .. } => self.marks += 1,
                What::FramesMissed { count } => self.frames_missed += u64::from(count),
                What::FrameCorrupt => self.frames_corrupt += 1,
                What::FrameRepeated => self.frames_repeated += 1,
                What::QueueOverflow { count } => self.overflow += u64::from(count),
                What::MarkerLost { .. } => self.markers_lost += 1,
                What::CameraStalled => self.camera_stalled += 1,
                What::CameraLost => self.camera_lost += 1,
                _ => {}
            },
            _ => {}
        }
    }

    /// Seconds of the box's clock from the first to the last frame.
    pub fn seconds(&self) -> f64 {
        match (self.first, self.last) {
            (Some((_, first)), Some((_, last))) => last.saturating_sub(first) as f64 * 1e-9,
            _ => 0.0,
        }
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Counts { records, newer, damaged, missing, gaps, .. } = self.wire;
        write!(
            f,
            "{records} records ({} frames, {} with a pose, {:.1} s), {damaged} damaged, {newer} newer, ",
            self.frames,
            self.poses,
            self.seconds()
        )?;
        match missing {
            0 => write!(f, "no gaps")?,
            _ => write!(f, "{missing} missing in {gaps} gaps")?,
        }
        for (count, what) in [
            (self.frames_missed, "frames missed"),
            (self.frames_corrupt, "frames corrupt"),
            (self.frames_repeated, "frames repeated"),
            (self.overflow, "records lost to a full outbox"),
            (self.markers_lost, "times a marker lost"),
            (self.camera_stalled, "times the camera stalled"),
            (self.camera_lost, "times the camera lost"),
            (self.unfinished, "bytes of an unfinished record"),
        ] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        Ok(())
    }
}
