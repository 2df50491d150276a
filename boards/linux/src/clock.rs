//! The kernel's clocks: monotonic time, and how it stands to UTC as far as the kernel is synchronised.

use gangway_device::Clock;
use rustix::time::{ClockId, Timespec, clock_gettime};

/// The board's clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct SystemClock;

/// Monotonic time, ns.
pub(crate) fn monotonic_ns() -> u64 {
    u64::try_from(ns(clock_gettime(ClockId::Monotonic))).unwrap_or(0)
}

/// Monotonic time and that of the boot clock, which runs on while the board is suspended, ns.
pub fn both_clocks() -> (u64, u64) {
    (monotonic_ns(), u64::try_from(ns(clock_gettime(ClockId::Boottime))).unwrap_or(0))
}

fn ns(time: Timespec) -> i64 {
    time.tv_sec.saturating_mul(1_000_000_000).saturating_add(time.tv_nsec)
}

impl Clock for SystemClock {
    fn now_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn wait_until_ns(&self, time_ns: u64) {
        let Some(left) = time_ns.checked_sub(self.now_ns()) else { return };
        std::thread::sleep(std::time::Duration::from_nanos(left));
    }

    /// What the kernel says of its clock (adjtimex): nothing where nobody synchronises it.
    fn utc_offset_ns(&self) -> Option<(i64, u64)> {
        // SAFETY: a structure of numbers, for which zeros are valid; no mode bit is set, so it is only
        // filled.
        let (state, time) = unsafe {
            let mut time: libc::timex = std::mem::zeroed();
            (libc::adjtimex(&raw mut time), time)
        };
        if state < 0 || state == libc::TIME_ERROR || time.status & libc::STA_UNSYNC != 0 {
            return None;
        }
        let before = ns(clock_gettime(ClockId::Monotonic));
        let utc = ns(clock_gettime(ClockId::Realtime));
        let after = ns(clock_gettime(ClockId::Monotonic));
        let width = u64::try_from(after - before).unwrap_or(0);
        let error_us = u64::try_from(time.maxerror).unwrap_or(u64::MAX);
        Some((utc - before - (after - before) / 2, error_us.saturating_mul(1_000).saturating_add(width)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_runs_and_an_offset_if_any_is_of_this_century() {
        let clock = SystemClock;
        let before = clock.now_ns();
        assert!(clock.now_ns() >= before);
        if let Some((offset, uncertainty)) = clock.utc_offset_ns() {
            let year_2000_ns = 946_684_800_000_000_000;
            assert!(offset + before as i64 > year_2000_ns, "{offset} {uncertainty}");
        }
    }
}
