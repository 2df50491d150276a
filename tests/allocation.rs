//! The frame loop never allocates: counted by an allocator that counts.

use e2e::Ride;

/// The allocator of the box's own proofs, with its own test. The whole crate would ask for system libraries.
#[expect(unreachable_pub, reason = "public in its own crate")]
#[path = "../boards/linux/src/allocations.rs"]
mod allocations;

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
    let before = allocations::allocations().expect("the program counts");
    for number in 0..1000 {
        frame_loop.step(picture(number), number, |record| {
            records += 1;
            poses += u32::from(matches!(record, gangway_wire::Record::Pose(pose) if pose.motion.is_some()));
        });
    }
    assert_eq!(allocations::allocations(), Some(before));
    assert!(poses > 900, "the loop measured: {poses} poses");
    assert!(records > 2000, "and recorded: {records} records");

    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or("peak memory not known here");
    println!("frame loop {} KiB; {peak}", size_of_val(&*frame_loop.engine) / 1024);
    // Tracker half, rest interval and queues most of the other half: what a box must spare.
    assert!(size_of_val(&*frame_loop.engine) < 1 << 20);
}
