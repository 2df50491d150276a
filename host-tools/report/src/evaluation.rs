//! Matches measured frames with the reference by frame number, and counts what could not be matched.

use serde::Serialize;

use gangway_wire::PoseFlags;

use crate::angle::difference_deg;
use crate::statistics::{self, Deviation, Error, Motion};
use crate::sync::Alignment;
use crate::{DEGREES_OF_FREEDOM, Measured, Reference, ReportError, Sample};

/// A ride, measured against a reference or on its own.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// Name of the session, or its path; titles show the last part.
    pub session: String,
    /// Name or path of the reference; `None` where there is none.
    pub reference: Option<String>,
    /// How the reference's clock was found to stand to the session's; `None` where it goes by frame numbers.
    /// Put in by who synchronised.
    pub sync: Option<Alignment>,
    /// How many frames went where.
    pub frames: Frames,
    /// Frames with a pose that carry a flag.
    pub flags: FlagCounts,
    /// From the first frame to the last, s.
    pub duration_s: f64,
    /// Frame rate, from the median time between frames, Hz; `None` of fewer than two frames.
    pub rate_hz: Option<f64>,
    /// Longest stretch of frames after the first pose that gave none.
    pub longest_gap_frames: usize,
    /// The motion of each degree of freedom, over every frame with a pose.
    pub motion: [Motion; 6],
    /// The deviation of each, over the frames compared; `None` without a reference.
    pub deviation: Option<[Deviation; 6]>,
    /// Every frame, in the order of the session.
    pub rows: Vec<Row>,
}

/// How many frames went where: `all = waiting + without_pose + not_in_reference + compared` with a reference,
/// `all = waiting + without_pose + compared` without one (then `compared` are those that went into the
/// statistics).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Frames {
    /// In the session.
    pub all: usize,
    /// Before the rest pose was known; left out.
    pub waiting: usize,
    /// After it, without a pose; left out.
    pub without_pose: usize,
    /// Of these, taken while the lamps of lit targets were dark or being switched.
    pub unlit: usize,
    /// With a pose that the reference has no row for; left out.
    pub not_in_reference: usize,
    /// In the statistics.
    pub compared: usize,
    /// Of the reference, between the session's first and last frame, that the session does not have.
    pub not_in_session: usize,
}

/// Frames with a pose that carry a flag; they are in the statistics like all others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FlagCounts {
    /// A second solution fits nearly as well.
    pub ambiguous: usize,
    /// A circle was seen but left out.
    pub outliers: usize,
    /// The motion is beyond the setup's limits.
    pub beyond_limits: usize,
    /// Frames are missing before this one.
    pub after_gap: usize,
    /// The frame was torn, short or of another size.
    pub corrupt: usize,
    /// From fewer than 7 in 10 of the circles in the picture.
    pub sparse: usize,
    /// The camera may have moved on its carbody, and nothing tells.
    pub camera_moved: usize,
    /// Without the reference targets that the setup has.
    pub unreferenced: usize,
}

/// One frame of the session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// The source's own frame number.
    pub frame: u32,
    /// Since the session's first frame, s.
    pub time_s: f64,
    /// The flags as measured.
    pub flags: PoseFlags,
    /// The motion; `None` while waiting and where there is no pose.
    pub measured: Option<Measured>,
    /// The truth; `None` where the reference has no row.
    pub truth: Option<[f64; 6]>,
}

impl Row {
    /// Whether the frame came before the rest pose was known.
    pub fn is_waiting(&self) -> bool {
        self.flags.contains(PoseFlags::WAITING)
    }

    /// Measured less true in the six degrees of freedom, mm and degrees.
    pub fn deviation(&self) -> Option<[f64; 6]> {
        let (measured, truth) = (self.measured?.values, self.truth?);
        Some(std::array::from_fn(|i| {
            if DEGREES_OF_FREEDOM[i].is_angle {
                difference_deg(measured[i], truth[i])
            } else {
                measured[i] - truth[i]
            }
        }))
    }
}

/// Evaluates the samples of a session, against a reference where there is one.
///
/// # Errors
///
/// Where nothing is left to evaluate: no frames, no poses, or none of the poses in the reference.
pub fn evaluate(
    session: &str,
    samples: &[Sample],
    reference: Option<&Reference>,
) -> Result<Evaluation, ReportError> {
    let session = session.to_owned();
    let Some(first) = samples.first() else { return Err(ReportError::NoFrames { session }) };
    let rows: Vec<Row> = samples
        .iter()
        .map(|s| Row {
            frame: s.frame,
            time_s: (i128::from(s.time_ns) - i128::from(first.time_ns)) as f64 * 1e-9,
            flags: s.flags,
            measured: if s.is_waiting() { None } else { s.pose().copied() },
            truth: reference.and_then(|r| r.at(s.frame)),
        })
        .collect();

    let frames = count_frames(&rows, reference);
    let posed: Vec<(&Row, Measured)> = rows.iter().filter_map(|r| Some((r, r.measured?))).collect();
    let Some(measured) = range(posed.iter().map(|(r, _)| r.frame)) else {
        return Err(ReportError::NoPose { session, frames: frames.all, waiting: frames.waiting });
    };
    let motion = six(|i| {
        let values: Vec<f64> = posed.iter().map(|(_, m)| m.values[i]).collect();
        let sigmas: Vec<f64> = posed.iter().map(|(_, m)| m.sigmas[i]).collect();
        statistics::motion(&values, &sigmas)
    });
    let Some(motion) = motion else {
        return Err(ReportError::NoPose { session, frames: frames.all, waiting: frames.waiting });
    };

    let deviation = match reference {
        None => None,
        Some(reference) => {
            let compared: Vec<(&Row, &Measured, [f64; 6])> =
                posed.iter().filter_map(|(r, m)| Some((*r, m, r.deviation()?))).collect();
            let of_six = six(|i| {
                let errors: Vec<Error> = compared
                    .iter()
                    .map(|(r, m, e)| Error { frame: r.frame, error: e[i], sigma: m.sigmas[i] })
                    .collect();
                statistics::deviation(&errors, DEGREES_OF_FREEDOM[i].limit)
            });
            match of_six {
                Some(of_six) => Some(of_six),
                None => {
                    let (reference, given) = (reference.name().to_owned(), reference.frames());
                    return Err(ReportError::NoOverlap { session, reference, measured, given });
                }
            }
        }
    };

    Ok(Evaluation {
        session,
        reference: reference.map(|r| r.name().to_owned()),
        sync: None,
        frames,
        flags: count_flags(&rows),
        duration_s: range_f64(rows.iter().map(|r| r.time_s)),
        rate_hz: rate(&rows),
        longest_gap_frames: longest_gap(&rows),
        motion,
        deviation,
        rows,
    })
}

fn six<T>(of: impl Fn(usize) -> Option<T>) -> Option<[T; 6]> {
    Some([of(0)?, of(1)?, of(2)?, of(3)?, of(4)?, of(5)?])
}

fn range(frames: impl Iterator<Item = u32> + Clone) -> Option<(u32, u32)> {
    Some((frames.clone().min()?, frames.max()?))
}

fn range_f64(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
    (high - low).max(0.0)
}

fn count_frames(rows: &[Row], reference: Option<&Reference>) -> Frames {
    let mut frames = Frames { all: rows.len(), ..Frames::default() };
    for row in rows {
        let count = if row.is_waiting() {
            &mut frames.waiting
        } else if row.measured.is_none() {
            let dims = [PoseFlags::DARK, PoseFlags::SWITCHED];
            frames.unlit += usize::from(dims.iter().any(|flag| row.flags.contains(*flag)));
            &mut frames.without_pose
        } else if reference.is_some() && row.truth.is_none() {
            &mut frames.not_in_reference
        } else {
            &mut frames.compared
        };
        *count += 1;
    }
    if let (Some(reference), Some((first, last))) = (reference, range(rows.iter().map(|r| r.frame))) {
        let seen: std::collections::HashSet<u32> = rows.iter().map(|r| r.frame).collect();
        frames.not_in_session = reference.between(first, last).filter(|f| !seen.contains(f)).count();
    }
    frames
}

fn count_flags(rows: &[Row]) -> FlagCounts {
    let count = |flag| rows.iter().filter(|r| r.measured.is_some() && r.flags.contains(flag)).count();
    FlagCounts {
        ambiguous: count(PoseFlags::AMBIGUOUS),
        outliers: count(PoseFlags::OUTLIERS),
        beyond_limits: count(PoseFlags::BEYOND_LIMITS),
        after_gap: count(PoseFlags::AFTER_GAP),
        corrupt: count(PoseFlags::CORRUPT),
        sparse: count(PoseFlags::SPARSE),
        camera_moved: count(PoseFlags::CAMERA_MOVED),
        unreferenced: count(PoseFlags::UNREFERENCED),
    }
}

/// The median leaves out what missed frames do to single intervals.
fn rate(rows: &[Row]) -> Option<f64> {
    let interval = frame_interval_s(rows)?;
    (interval > 0.0).then(|| 1.0 / interval)
}

/// Median time from a frame to the next, s.
pub(crate) fn frame_interval_s(rows: &[Row]) -> Option<f64> {
    statistics::median(rows.windows(2).map(|w| w[1].time_s - w[0].time_s).filter(|t| *t > 0.0).collect())
}

/// Frames that the source numbered and the session lacks count as well.
fn longest_gap(rows: &[Row]) -> usize {
    let mut longest = 0;
    let mut last: Option<u32> = None;
    for row in rows.iter().filter(|r| !r.is_waiting()) {
        if let Some(last) = last {
            let until = if row.measured.is_some() { row.frame } else { row.frame.saturating_add(1) };
            longest = longest.max(until.saturating_sub(last).saturating_sub(1) as usize);
        }
        if row.measured.is_some() {
            last = Some(row.frame);
        }
    }
    longest
}
