//! Evaluation of a measured ride against a reference, after thesis 5.3.5: statistics, plots and the written
//! report.
//!
//! ```text
//! samples (one a frame) ──┐
//!                         ├─> evaluate -> Evaluation ─> table, JSON, plots (SVG, PNG), page (HTML)
//! truth.csv -> Reference ─┘
//!
//! recorder.csv -> sync::Recorder ─> sync::synchronise (with the samples) ─> Reference
//! ```
//!
//! With the deviation `e_i = measured_i - true_i` of degree of freedom by degree of freedom, over the `n`
//! frames that have a pose and a truth:
//!
//! ```text
//! MAX  = max |e_i|                          RMSE = sqrt( sum e_i^2 / n )
//! MEAN = sum e_i / n                        STD  = sqrt( sum (e_i - MEAN)^2 / n )
//! ```
//!
//! so that `RMSE^2 = MEAN^2 + STD^2`: MEAN is what is systematic, STD what scatters about it. Deviations of
//! angles are taken the short way round. Each is checked against requirement R(a) of thesis 1.3, and against
//! the standard deviation that the box itself stated for that frame.
//!
//! Frames flagged as waiting for the rest pose are left out and counted; so are frames without a pose, frames
//! that the reference does not know, and frames of the reference that the session does not have.

mod angle;
mod columns;
mod error;
mod evaluation;
mod html;
mod json;
pub mod plots;
mod reference;
mod sample;
mod statistics;
pub mod sync;
mod table;
mod write;

pub use error::ReportError;
pub use evaluation::{Evaluation, FlagCounts, Frames, Row, evaluate};
pub use html::{Page, html};
pub use reference::Reference;
pub use sample::{DEGREES_OF_FREEDOM, DegreeOfFreedom, Measured, RATE_LIMIT_HZ, Sample};
pub use statistics::{Deviation, Motion};
pub use write::write_file;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
