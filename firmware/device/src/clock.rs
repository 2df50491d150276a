//! The board's clocks and the readings that go into the health record.

/// The monotonic clock of the board and its offset to UTC.
pub trait Clock {
    /// Monotonic time, ns. The same clock stamps the frames.
    fn now_ns(&self) -> u64;

    /// UTC minus monotonic time, ns since 1970 and its uncertainty, ns; `None` where the board knows no UTC.
    fn utc_offset_ns(&self) -> Option<(i64, u64)>;

    /// Waits until this monotonic time, ns. A clock that nothing real follows, such as a recording's, returns
    /// at once.
    fn wait_until_ns(&self, time_ns: u64) {
        let _ = time_ns;
    }
}

/// What the board can say about itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Temperature of the processor, degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Free space where the board keeps its log, bytes.
    pub free_bytes: Option<u64>,
}

/// A board's own condition. Must not block: the frame loop asks once a second.
pub trait Vitals {
    /// The latest reading.
    fn read(&mut self) -> Reading;
}

impl Vitals for Reading {
    fn read(&mut self) -> Reading {
        *self
    }
}
