//! A camera that stalls, vanishes or refuses a control.

use std::collections::BTreeSet;

use e2e::guest::Guest;

use crate::receiver::{Receiver, free_port};
use crate::said::Said;
use crate::show::{RATE_HZ, Show, camera, job};

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn a_stalled_and_a_vanished_camera_come_back_and_every_gap_is_in_the_records() {
    let folder = tempfile::tempdir().expect("a folder");
    let show = Show::new("");
    let port = free_port();
    let receiver = Receiver::start(folder.path(), &format!("tcp-listen://127.0.0.1:{port}"));
    let camera = camera();
    let job = job(&format!("tcp-connect://10.0.2.2:{port}"))
        + &format!(
            "read go
            kill -STOP $FEED; sleep 5; kill -CONT $FEED; echo 'board: stalled'
            read go
            kill -STOP $FEED; sleep 3; kill -KILL $FEED; wait $FEED
            until rmmod v4l2loopback; do sleep 1; done; echo 'board: vanished'
            sleep 2
            {camera}
            read go
            kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"
            kill $FEED"
        );
    let mut board = show.boot(&job);
    receiver.wait_for(12);
    board.go();
    board.expect("board: stalled");
    let before = receiver.frames();
    receiver.wait_for(before + 12);
    board.go();
    board.expect("board: vanished");
    let before = receiver.frames();
    receiver.wait_for(before + 12);
    board.go();
    board.expect("board: box ended with 0");
    board.wait();
    let (_, said) = receiver.end();
    said.assert_accounted();
    let told: Vec<&str> = said.events.iter().map(|(_, event)| event.as_str()).collect();
    let count = |what: &str| told.iter().filter(|told| told.contains(what)).count();
    assert!(count("CameraStalled") >= 2 && count("CameraReopened") >= 2, "{told:?}");
    // By the box's own clock, in which the job counts its seconds too. A picture that comes late is stamped
    // late: by no more than two periods.
    let silences = silences(&said);
    println!("silences of {silences:.2?} s");
    let late = 2.0 / f64::from(RATE_HZ);
    assert!(silences.iter().any(|silence| *silence >= 5.0 - late), "{silences:?}");
    assert!(silences.last().is_some_and(|silence| *silence >= 3.0 + 2.0 - late), "{silences:?}");
}

/// How long there were no new pictures, s, wherever the camera stalled. Over every stall the frames' numbers
/// go on by as many periods as have passed. A loop-back device that is opened again gives its last picture
/// once more: what follows on that is the end of the silence.
fn silences(said: &Said) -> Vec<f64> {
    let time = |frame: u32| said.poses.get(&frame).map_or(0, |(time_ns, ..)| *time_ns);
    let seconds = |from: u32, to: u32| time(to).saturating_sub(time(from)) as f64 * 1e-9;
    let next = |frame: u32| said.poses.range(frame + 1..).next().map(|(next, _)| *next);
    let stalls: BTreeSet<u32> =
        said.events.iter().filter(|(_, event)| event == "CameraStalled").map(|(frame, _)| *frame).collect();
    let mut silences: Vec<(u32, u32)> = Vec::new();
    for before in stalls {
        let after = next(before).expect("a frame after the stall");
        let periods = (seconds(before, after) * f64::from(RATE_HZ)).round() as u32;
        assert_eq!(after - before, periods, "periods between frames {before} and {after}");
        let end = next(after).expect("a frame after the first one");
        match silences.last_mut() {
            Some((_, last)) if *last == after => *last = end,
            _ => silences.push((before, end)),
        }
    }
    silences.into_iter().map(|(from, to)| seconds(from, to)).collect()
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn a_control_that_the_driver_refuses_is_told_and_a_camera_with_a_clock_shows_how_late_the_loop_is() {
    let job = "insmod /modules/vivid.ko n_devs=1 node_types=0x0001
        gangway-pi run --setup /refused.toml --to file:/tmp/no.gw; echo \"board: refused with $?\"
        gangway-pi run --setup /setup.toml --to serial:/dev/ttyAMA0@115200 & BOX=$!
        sleep 8
        kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"";
    // A vivid device, whose controls are real.
    let setup = Show::setup_of_size(1280, 720);
    let refused = format!("{setup}\n[capture]\ngain = 1000\n");
    let mut board =
        Guest::boot(job, &[("setup.toml", setup.as_bytes()), ("refused.toml", refused.as_bytes())]);
    let told = board.expect("the control 'Gain'");
    println!("{told}");
    assert!(told.contains("is 255 after 1000 was written; it takes 0 to 255 in steps of 1"), "{told}");
    board.expect("board: refused with 1");
    board.expect("board: box ended with 0");
    board.wait();
    let said = Said::of(&std::fs::read(board.uart()).expect("records"));
    let (frames, woken) = (said.poses.len(), said.latency.wake_up.total() as usize);
    println!("{woken} of {frames} frames: {:?}", said.latency.wake_up);
    assert!(frames >= 2 * RATE_HZ as usize, "{frames}");
    // The module notes the end of a frame ahead of it: a time to come is none of the monotonic clock's, and
    // is told.
    let is_told = said.has("clock is not monotonic");
    assert!(woken == frames || (woken < frames && is_told), "{woken} of {frames}, {:?}", said.events);
}
