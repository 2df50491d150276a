//! An allocator that counts by thread, for builds that are to show that the frame loop never allocates.
//!
//! A program that wants it declares `#[global_allocator] static ALLOCATOR: Counting = Counting;`.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};

/// The system's allocator; it counts what each thread asks of it.
#[derive(Debug)]
pub struct Counting;

/// Some allocation was counted: the program has this allocator.
static COUNTS: AtomicBool = AtomicBool::new(false);

thread_local! {
    // Made at compile time and never dropped: it can be used within an allocation.
    static ASKED: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    COUNTS.store(true, Ordering::Relaxed);
    // A thread that is being taken down is not counted any more.
    let _ = ASKED.try_with(|asked| asked.set(asked.get() + 1));
}

// SAFETY: every call is handed to the system's allocator unchanged; counting touches an atomic and a number
// of this thread, and neither allocates.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are the system allocator's own.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// Calls of the allocator by this thread so far, to take and to give back; `None` where nobody counts.
pub fn allocations() -> Option<u64> {
    COUNTS.load(Ordering::Relaxed).then(|| ASKED.with(Cell::get))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[global_allocator]
    static ALLOCATOR: Counting = Counting;

    #[test]
    fn a_thread_counts_its_own_allocations_only() {
        let before = allocations().unwrap();
        let kept = std::hint::black_box(Box::new(7u64));
        assert_eq!(allocations(), Some(before + 1));
        std::thread::scope(|scope| {
            let before = allocations().unwrap();
            scope.spawn(|| {
                // As long as the other one allocates nothing itself.
                let own = allocations().unwrap();
                drop(std::hint::black_box(vec![0u8; 100]));
                assert_eq!(allocations(), Some(own + 2));
            });
            assert!(allocations().unwrap() >= before);
        });
        let before = allocations().unwrap();
        drop(kept);
        assert_eq!(allocations(), Some(before + 1));
        assert_eq!(allocations(), Some(before + 1), "and asking costs none");
    }
}
