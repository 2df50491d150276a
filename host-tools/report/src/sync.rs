//! Synchronisation with a reference recorder (thesis 5.4.2): the start of motion in both gives a first
//! offset, the correlation of the motions a fine one, with its uncertainty.
//!
//! The recorder has its own rate and its own clock. What is found is where on the recorder's clock each frame
//! was taken:
//!
//! ```text
//! recorder time = box time - offset - drift (box time - middle)
//! ```
//!
//! The fine alignment makes the slope of the measured motion uncorrelated with the deviation, which is the
//! maximum of the correlation of the two motions. The slope is the measured motion's own: the recorder's
//! noise then adds to the deviation alone, and its interpolation between samples draws the offset nowhere. A
//! constant and a small multiple of each degree of freedom are estimated along, so that what is systematic (a
//! misaligned frame, a scale) does not pass for time. The uncertainty comes from the deviations as they are,
//! correlated in time or not (Newey and West 1987).
#![allow(
    clippy::needless_range_loop,
    reason = "sums over the six degrees of freedom read best with the indices of the formula"
)]

mod fit;
mod recorder;
mod search;
mod start;
#[cfg(test)]
mod tests;
mod track;

use serde::Serialize;

use crate::{Reference, ReportError, Sample};

pub use recorder::Recorder;
pub use start::{motion_start, summed_absolute_difference};
use track::Track;

/// Fewest frames with a pose that can be aligned.
const FEWEST_FRAMES: usize = 20;
/// Motions that correlate less do not belong together.
const LEAST_CORRELATION: f64 = 0.7;

/// How a recorder's clock stands to the box's.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alignment {
    /// Box time (since the session's first frame) less recorder time (since its first row) in the middle of
    /// the frames, s.
    pub offset_s: f64,
    /// Its standard deviation, s.
    pub offset_sigma_s: f64,
    /// By how much the recorder's clock is slow against the box's, in millionths: its time passes that much
    /// less.
    pub drift_ppm: f64,
    /// Its standard deviation; crystals are taken to agree within 100 before anything is measured.
    pub drift_sigma_ppm: f64,
    /// The middle of the frames, box time since the session's first frame, s.
    pub middle_s: f64,
    /// Correlation of the two motions, at most 1.
    pub correlation: f64,
    /// Start of motion by equation 5.1 on the box's time and on the recorder's, s, where both show one.
    pub starts_s: Option<[f64; 2]>,
    /// Another offset that fits nearly as well, s.
    pub rival_s: Option<f64>,
    /// The recorder's clock at its first row, s.
    pub recorder_first_s: f64,
}

impl Alignment {
    /// Recorder time (since its first row) of a box time (since the session's first frame), s.
    pub fn recorder_time(&self, box_s: f64) -> f64 {
        box_s - self.offset_s - self.drift_ppm * 1e-6 * (box_s - self.middle_s)
    }

    /// A sentence or two for people.
    pub(crate) fn notes(&self) -> Vec<String> {
        let mut notes = vec![format!(
            "Synchronised: session time less recorder time {:.5} s (+-{:.5}), drift {:.0} ppm (+-{:.0}), correlation {:.5}.",
            self.offset_s, self.offset_sigma_s, self.drift_ppm, self.drift_sigma_ppm, self.correlation
        )];
        if let Some([session, recorder]) = self.starts_s {
            notes.push(format!(
                "Start of motion by summed absolute difference: {session:.3} s of the session, {recorder:.3} s of the recorder."
            ));
        }
        if let Some(rival) = self.rival_s {
            notes.push(format!(
                "CAUTION: {rival:.3} s fits nearly as well; let the recording begin at rest, so that the start decides."
            ));
        }
        notes
    }
}

/// Finds how the recorder's clock stands to that of the samples, and what the recorder says of each frame: a
/// [`Reference`] by frame number, as [`evaluate`](crate::evaluate) takes it.
///
/// # Errors
///
/// Where there are too few poses, nothing moves, or the motions do not belong together.
pub fn synchronise(
    session: &str,
    samples: &[Sample],
    recorder: &Recorder,
) -> Result<(Alignment, Reference), ReportError> {
    let Some(first) = samples.first() else {
        return Err(ReportError::NoFrames { session: session.to_owned() });
    };
    let seconds = |sample: &Sample| (i128::from(sample.time_ns) - i128::from(first.time_ns)) as f64 * 1e-9;
    let mut times = Vec::new();
    let mut values = Vec::new();
    for sample in samples.iter().filter(|sample| !sample.is_waiting()) {
        if let Some(pose) = sample.pose()
            && times.last().is_none_or(|last| *last < seconds(sample))
        {
            times.push(seconds(sample));
            values.push(pose.values);
        }
    }
    if times.len() < FEWEST_FRAMES {
        let (session, frames) = (session.to_owned(), times.len());
        return Err(ReportError::FewFrames { session, frames, least: FEWEST_FRAMES });
    }
    let measured = Track::new(times, values);
    let failed = |correlation: f64| ReportError::NoAlignment {
        session: session.to_owned(),
        reference: recorder.name().to_owned(),
        correlation,
    };
    let coarse = search::coarse(&measured, &recorder.track).ok_or_else(|| failed(0.0))?;
    if coarse.correlation < LEAST_CORRELATION {
        return Err(failed(coarse.correlation));
    }
    let fine =
        fit::fine(&measured, &recorder.track, coarse.offset).ok_or_else(|| failed(coarse.correlation))?;
    let alignment = Alignment {
        offset_s: fine.offset,
        offset_sigma_s: fine.offset_sigma,
        drift_ppm: 1e6 * fine.drift,
        drift_sigma_ppm: 1e6 * fine.drift_sigma,
        middle_s: fine.middle,
        correlation: search::correlation(&measured, &recorder.track, fine.offset)
            .unwrap_or(coarse.correlation),
        starts_s: coarse.starts,
        rival_s: coarse.rival,
        recorder_first_s: recorder.first_s,
    };
    let truth = samples.iter().filter_map(|sample| {
        let at = alignment.recorder_time(seconds(sample));
        Some((sample.frame, recorder.track.at(at)?.0))
    });
    let reference = Reference::new(recorder.name(), truth).map_err(|_| failed(coarse.correlation))?;
    Ok((alignment, reference))
}
