//! The frame loop never allocates: counted by an allocator that counts.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use e2e::Ride;

/// The system's allocator, counting what is asked of it while it is armed.
struct Counting;

static ARMED: AtomicBool = AtomicBool::new(false);
static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

fn count() {
    if ARMED.load(Ordering::Relaxed) {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
    }
}

// SAFETY: every call is handed to the system's allocator unchanged; counting touches only atomics.
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

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_thousand_frames_through_the_whole_loop_allocate_nothing() {
    let ride = Ride::short();
    let mut frame_loop = ride.start();
    // To and fro, so that the motion has no jumps where the recording begins again.
    let last = ride.frames.len() - 1;
    let picture = |number: u32| {
        let place = number as usize % (2 * last);
        if place <= last { place } else { 2 * last - place }
    };
    let mut records = 0u32;
    let mut poses = 0u32;
    ARMED.store(true, Ordering::Relaxed);
    for number in 0..1000 {
        frame_loop.step(picture(number), number, |record| {
            records += 1;
            poses += u32::from(matches!(record, gangway_wire::Record::Pose(pose) if pose.motion.is_some()));
        });
    }
    ARMED.store(false, Ordering::Relaxed);
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), 0);
    assert!(poses > 900, "the loop measured: {poses} poses");
    assert!(records > 2000, "and recorded: {records} records");

    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or("peak memory not known here");
    println!("frame loop {} KiB; {peak}", size_of_val(&*frame_loop.engine) / 1024);
    // Tracker half, rest interval and queues most of the other half: what a box must spare.
    assert!(size_of_val(&*frame_loop.engine) < 1 << 20);
}
