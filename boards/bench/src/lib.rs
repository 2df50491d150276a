//! The firmware on recorded frames: the very loop of the box, fed by files, anywhere.
//!
//! ```text
//! FrameSource -> ReadAhead -> Recording -> FaultyCamera -> Engine -> outbox -> Courier -> FaultyLink -> Link
//! y4m, png, pgm, (a thread)    number,       (on request)   step                (a thread)
//! ffmpeg, yours                time, pace
//! ```
//!
//! [`run`] plays a source through the loop into a link; `gangway-bench` is its command line.
//!
//! A recording's frames carry its own time: number over rate, or what a file of times says. As fast as it
//! goes, the next frame is not taken before the outbox has room for all that it can cause, so nothing is ever
//! lost. At the recorded rate nothing waits: what the line does not take is lost and counted, as on a box. A
//! frame that the loop comes late for is delivered late and counted, never left out, so that the same
//! recording gives the same records at any speed.

mod clock;
mod faults;
mod lamp;
mod loop_times;
mod measure;
mod random;
mod read_ahead;
mod recording;
mod run;
pub mod source;
mod times;

pub use clock::{DiskVitals, RecordingClock};
pub use faults::{CameraFaults, FaultError, Faults, FaultyCamera, FaultyLink, LinkFaults};
pub use gangway_engine::Identity;
/// The lines that the records can go to.
pub use gangway_link as link;
pub use lamp::FakeLamp;
pub use loop_times::LoopTimes;
pub use measure::{Measured, measure};
pub use recording::{Pace, Recording, Timing};
pub use run::{BenchError, Failure, Play, Summary, check, run};
pub use source::{FrameSource, Shape, SourceError};
pub use times::{Times, TimesError};
