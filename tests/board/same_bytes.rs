//! The same frames give the same bytes: on the emulated board, in user emulation and on the bench of this
//! machine.

use std::path::Path;
use std::process::Command;

use e2e::{bench, emulated_bench, gangway};
use gangway_wire::Histogram;

use crate::receiver::{Receiver, free_port};
use crate::said::Said;
use crate::show::{RATE_HZ, Show, begin, job};

/// The same frames with the same numbers and times through a bench, with the capture's name in the folder.
pub(crate) fn replay(
    mut bench: Command,
    show: &Show,
    said: &Said,
    first: u32,
    folder: &Path,
    name: &str,
) -> Said {
    let depth = if show.bits > 8 { show.bits.to_string() } else { String::new() };
    let mut y4m = format!("YUV4MPEG2 W{} H{} F{RATE_HZ}:1 Cmono{depth}\n", 800, 450).into_bytes();
    let mut times = String::from("frame,time_ns\n");
    for (number, (time_ns, _, _)) in &said.poses {
        y4m.extend_from_slice(b"FRAME\n");
        y4m.extend_from_slice(show.picture(*number, first));
        times.push_str(&format!("{number},{time_ns}\n"));
    }
    std::fs::write(folder.join("frames.y4m"), y4m).expect("the frames");
    std::fs::write(folder.join("times.csv"), times).expect("their times");
    std::fs::write(folder.join("setup.toml"), &show.setup).expect("the setup");
    let to = folder.join(name);
    let output = bench
        .current_dir(folder)
        .args(["--setup", "setup.toml", "--frames", "frames.y4m", "--times", "times.csv", "--to"])
        .arg(format!("file:{}", to.display()))
        .output()
        .expect("the bench runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Said::of(&std::fs::read(to).expect("a capture"))
}

/// Every pose, every centre and the rest pose are the same bytes.
pub(crate) fn assert_same(one: &Said, other: &Said) {
    for (frame, (_, _, body)) in &one.poses {
        assert_eq!(other.poses.get(frame).map(|(_, _, body)| body), Some(body), "pose of frame {frame}");
        assert_eq!(other.markers.get(frame), one.markers.get(frame), "markers of frame {frame}");
    }
    assert_eq!(one.poses.len(), other.poses.len());
    assert_eq!(one.rests, other.rests);
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn the_emulated_box_gives_the_bytes_of_the_bench_over_tcp() {
    let folder = tempfile::tempdir().expect("a folder");
    let show = Show::new("");
    let port = free_port();
    let receiver = Receiver::start(folder.path(), &format!("tcp-listen://127.0.0.1:{port}"));
    let job = job(&format!("tcp-connect://10.0.2.2:{port}"))
        + "read go; touch /tmp/go
        read go; rm /tmp/go
        grep -E 'VmHWM|Threads' /proc/$BOX/status
        kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"";
    let mut board = show.boot(&job);
    receiver.wait_for(12);
    let first = begin(&mut board);
    board.go();
    board.expect("board: box ended with 0");
    board.wait();

    let (session, said) = receiver.end();
    said.assert_accounted();
    let last = first + show.ride.frames.len() as u32 - 1;
    let measured = said.poses.range(first..=last).count();
    println!("{measured} of {} frames of the ride measured, the others told missing", show.ride.frames.len());
    assert!(said.has("RestSet") && said.has("Ended"), "{:?}", said.events);
    let told = |what: &str, times: &Histogram| {
        println!("{what}: {:?}, at most {:.1} ms", times.counts, f64::from(times.longest_ns) / 1e6);
        times.total() as usize
    };
    let woken = told("frame complete to loop", &said.latency.wake_up);
    let handed = told("exposure to line", &said.latency.exposure_to_line);
    // The loop-back device does not say by which clock it notes its times.
    let all = if said.has("clock is not monotonic") { 0 } else { said.poses.len() };
    assert_eq!(woken, all);
    // The link tells the loop every half second what it has handed over.
    let least = said.poses.len() - RATE_HZ as usize;
    assert!((least..=said.poses.len()).contains(&handed), "{handed} poses of {}", said.poses.len());
    // A machine that does many other things may lose some; most of the ride must be there to prove anything.
    assert!(measured * 10 >= show.ride.frames.len() * 8, "{measured} frames of the ride");

    let here = replay(bench(), &show, &said, first, folder.path(), "here.gw");
    assert_same(&said, &here);
    // And the same program for arm64 without a board.
    assert_same(&said, &replay(emulated_bench(), &show, &said, first, folder.path(), "arm64.gw"));

    // Against the truth, moved to the box's frame numbers: as the bench, to the last digit.
    let mut truth = String::from("frame,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n");
    for (frame, at) in (first..).zip(&show.ride.truth) {
        let [x, y, z] = at.displacement_mm;
        let [roll, pitch, yaw] = at.rotation_deg;
        truth.push_str(&format!("{frame},{x},{y},{z},{roll},{pitch},{yaw}\n"));
    }
    std::fs::write(folder.path().join("truth.csv"), truth).expect("the truth");
    let evaluate = |what: &Path| {
        let output = gangway()
            .arg("evaluate")
            .arg(what)
            .arg("--truth")
            .arg(folder.path().join("truth.csv"))
            .arg("--json")
            .output()
            .expect("it evaluates");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let mut json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let object = json.as_object_mut().expect("an object");
        object.retain(|key, _| key != "session" && key != "reference");
        json
    };
    let (box_, bench) = (evaluate(&session), evaluate(&folder.path().join("here.gw")));
    assert_eq!(box_, bench);
    println!("{}", box_["deviation"]);
}

#[test]
#[ignore = "needs the programs for arm64; tests/board/prepare builds them"]
fn the_bench_for_arm64_gives_the_bytes_of_the_bench_of_this_machine() {
    let folder = tempfile::tempdir().expect("a folder");
    let show = Show::new("");
    let mut said = Said::default();
    // Uneven times, as of a real camera.
    for (number, time_ns) in
        (7..).zip((0..show.ride.frames.len() as u64).map(|i| i * 20_000_000 + i * i % 7_919))
    {
        said.poses.insert(number, (time_ns, false, Vec::new()));
    }
    let here = replay(bench(), &show, &said, 7, folder.path(), "here.gw");
    let arm64 = replay(emulated_bench(), &show, &said, 7, folder.path(), "arm64.gw");
    assert_eq!(here.poses.len(), show.ride.frames.len());
    assert!(here.poses.values().any(|(_, has_motion, _)| *has_motion) && here.has("RestSet"));
    assert_same(&here, &arm64);
    println!("{} poses and centres are the same bytes", here.poses.len());
}
