//! What every Linux board shares: a V4L2 camera that comes back, the frame loop in a thread of its own that
//! is scheduled in real time, signals, systemd, a lamp on the GPIO character device, and the board's own
//! condition.
//!
//! ```text
//! V4l2 -> Recovering -> Engine -> outbox -> Courier -> Line          signals --> Signals --\
//!         (frame thread, locked memory,      (link thread)          systemd <-- Watchdog <-- frame loop
//!          SCHED_FIFO, one core)             notices -> marks, log
//! ```
//!
//! [`run`](run::run) is the whole box but for its pins, which a board brings along.

mod allocations;
pub mod camera;
mod clock;
mod lamp;
pub mod log;
mod notice;
mod realtime;
pub mod run;
mod signals;
mod vitals;
mod watchdog;

pub use allocations::{Counting, allocations};
pub use clock::{SystemClock, both_clocks};
pub use lamp::{GpioLamp, LampError};
pub use notice::{Notice, Notices};
pub use realtime::{Faults, enter, lock_memory};
pub use run::{State, Status};
pub use signals::Signals;
pub use vitals::SystemVitals;
pub use watchdog::Watchdog;
