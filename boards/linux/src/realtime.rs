//! Real time: memory locked, the frame thread ahead of all ordinary ones and on a core of its own. What is
//! not permitted is told in a sentence; the box measures all the same.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity};

/// Locks all memory, now and later, so that no page is ever fetched while a frame waits.
///
/// # Errors
/// One sentence that says what is missing.
pub fn lock_memory() -> Result<(), String> {
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)
        .map_err(|error| format!("memory is not locked ({error}); allow LimitMEMLOCK=infinity"))
}

/// Puts the calling thread under SCHED_FIFO with this priority (0: leaves it) and on this core (none: any).
/// Gives a sentence for everything that is not permitted.
pub fn enter(priority: u8, core: Option<usize>) -> Vec<String> {
    let mut refusals = Vec::new();
    if let Some(core) = core {
        let mut set = CpuSet::new();
        let fits = core < CpuSet::MAX_CPU;
        if fits {
            set.set(core);
        }
        if !fits || sched_setaffinity(None, &set).is_err() {
            refusals.push(format!("there is no core {core} for the frame thread; any one is used"));
        }
    }
    if priority > 0 {
        let parameters = libc::sched_param { sched_priority: i32::from(priority) };
        // SAFETY: the structure lives through the call, which only reads it; 0 is the calling thread.
        let set = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) };
        if set != 0 {
            let error = std::io::Error::last_os_error();
            refusals.push(format!(
                "the frame thread is not in real time ({error}); allow LimitRTPRIO={priority}"
            ));
        }
    }
    refusals
}

/// Counts the calling thread's page faults since it was made.
#[derive(Clone, Copy, Debug)]
pub struct Faults {
    before: i64,
}

impl Faults {
    /// Counts from now on.
    pub fn start() -> Self {
        Self { before: faults() }
    }

    /// Page faults since the start.
    pub fn count(&self) -> i64 {
        faults() - self.before
    }
}

fn faults() -> i64 {
    // SAFETY: a structure of numbers, for which zeros are valid; the call only fills it.
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_THREAD, &raw mut usage);
        usage
    };
    usage.ru_minflt + usage.ru_majflt
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_permitted_is_a_sentence_and_no_panic() {
        std::thread::spawn(|| {
            let refusals = enter(0, Some(100_000));
            assert_eq!(refusals, ["there is no core 100000 for the frame thread; any one is used"]);
            assert_eq!(enter(0, None), Vec::<String>::new());
        })
        .join()
        .unwrap();
    }

    #[test]
    fn a_page_that_is_touched_for_the_first_time_is_counted() {
        let faults = Faults::start();
        let pages = std::hint::black_box(vec![1u8; 1 << 22]);
        assert!(faults.count() > 0, "{}", pages.len());
        let faults = Faults::start();
        std::hint::black_box(pages.iter().map(|byte| u64::from(*byte)).sum::<u64>());
        assert_eq!(faults.count(), 0);
    }
}
