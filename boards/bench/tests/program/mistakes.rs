//! What a user can get wrong, and what a disk or a line can: one sentence each, and the right exit code.

use std::net::TcpListener;

use crate::ride::{Capture, Ride};

/// Runs the program; exit code and what it complained, one line.
fn complaint(ride: &Ride, arguments: &[&str]) -> (i32, String) {
    let run = ride.program().args(arguments).output().unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    assert!(said.lines().all(|line| line.starts_with("gangway-bench: ")), "{said}");
    (run.status.code().unwrap(), said)
}

/// As [`complaint`], where it must be one sentence and a failure.
fn fails(ride: &Ride, arguments: &[&str]) -> String {
    let (code, said) = complaint(ride, arguments);
    assert_eq!((code, said.lines().count()), (1, 1), "{said}");
    said
}

#[test]
fn a_wrong_command_line_is_a_usage_error() {
    let ride = Ride::new(1);
    let frames = ["--frames", "ride.y4m"];
    for (arguments, says) in [
        (&["--to", "file:a"][..], "--frames"),
        (&frames, "--to"),
        (&["--frames", "ride.y4m", "--to", "ride.gw"], "is no address"),
        (&["--frames", "ride.y4m", "--to", "tcp://a:99999"], "'99999' is no port"),
        (&["--frames", "ride.y4m", "--to", "file:a", "--fault", "blur:1"], "'blur' is no fault"),
        (&["--frames", "ride.y4m", "--to", "file:a", "--wait", "soon"], "number of seconds"),
        (&["--frames", "ride.y4m", "--to", "file:a", "--wait", "-1"], "number of seconds"),
        (&["--frames", "ride.y4m", "--to", "file:a", "--repeat", "0"], "--repeat"),
        (&["--frames", "ride.y4m", "--to", "file:a", "--limit", "0"], "--limit"),
        (&["--frames", "ride.y4m", "--to", "file:a", "--box-id", "9a"], "hexadecimal digits"),
        (&["--frames", "ride.y4m", "--to", "file:a", "--measure"], "--measure"),
    ] {
        let (code, said) = complaint(&ride, arguments);
        assert_eq!(code, 2, "{said}");
        assert!(said.contains(says), "{said}");
    }
}

#[test]
fn frames_of_another_size_than_the_setups_are_refused() {
    let ride = Ride::new(1);
    std::fs::write(ride.path("small.y4m"), b"YUV4MPEG2 W2 H1 Cmono\nFRAME\nab").unwrap();
    assert_eq!(
        fails(&ride, &["--frames", "small.y4m", "--to", "file:a.gw"]),
        "gangway-bench: the frames are 2 x 1, but the setup says 160 x 120; give the setup of the camera that \
         took them\n"
    );
    assert!(!ride.path("a.gw").exists(), "what cannot be measured leaves no capture");
}

#[test]
fn a_capture_that_is_there_is_refused_and_stays_as_it_is() {
    let ride = Ride::new(2);
    std::fs::write(ride.path("ride.gw"), "a ride of long ago").unwrap();
    assert_eq!(
        fails(&ride, &["--frames", "ride.y4m", "--to", "file:ride.gw"]),
        "gangway-bench: ride.gw holds something already, and is left as it is; give another name, or --append to \
         go on in it\n"
    );
    assert_eq!(std::fs::read(ride.path("ride.gw")).unwrap(), b"a ride of long ago");
}

#[test]
fn what_comes_before_a_cut_is_measured_and_sent() {
    let ride = Ride::new(5);
    let bytes = ride.bytes();
    std::fs::write(ride.path("cut.y4m"), &bytes[..bytes.len() - 1]).unwrap();
    let said = fails(&ride, &["--frames", "cut.y4m", "--to", "file:cut.gw"]);
    assert!(said.contains("cut.y4m is cut off: it ends within frame 4"), "{said}");
    let capture = Capture::read(&ride.path("cut.gw"));
    assert_eq!(capture.frames, [0, 1, 2, 3]);
    assert!(capture.has("Ended"));
}

#[test]
fn missing_and_empty_recordings_are_named() {
    let ride = Ride::new(1);
    let to = ["--to", "file:a.gw", "--frames"];
    let said = fails(&ride, &[&to[..], &["no.y4m"]].concat());
    assert!(said.contains("no.y4m does not exist"), "{said}");
    std::fs::create_dir(ride.path("empty")).unwrap();
    let said = fails(&ride, &[&to[..], &["empty"]].concat());
    assert!(said.contains("the directory empty holds no PNG or PGM file"), "{said}");
    std::fs::write(ride.path("head.y4m"), "YUV4MPEG2 W160 H120 Cmono\n").unwrap();
    let said = fails(&ride, &[&to[..], &["head.y4m"]].concat());
    assert!(said.contains("head.y4m holds no frame"), "{said}");
    std::fs::write(ride.path("nothing.y4m"), "").unwrap();
    let said = fails(&ride, &[&to[..], &["nothing.y4m"]].concat());
    assert!(said.contains("nothing.y4m holds no frame"), "{said}");
    std::fs::write(ride.path("short.y4m"), &ride.bytes()[..1_000]).unwrap();
    let said = fails(&ride, &[&to[..], &["short.y4m"]].concat());
    assert!(said.contains("short.y4m is cut off: it ends within its first frame"), "{said}");
    assert!(!ride.path("a.gw").exists(), "what cannot be played leaves no capture");
}

#[test]
fn without_ffmpeg_a_video_is_refused_in_one_sentence() {
    let ride = Ride::new(1);
    std::fs::write(ride.path("ride.mp4"), "no video either").unwrap();
    let run = ride.program().env("PATH", "").args(["--frames", "ride.mp4", "--to", "file:a.gw"]).output();
    assert_eq!(
        String::from_utf8(run.unwrap().stderr).unwrap(),
        "gangway-bench: ride.mp4 is no Y4M file, and other videos need the program ffmpeg, which is not \
         installed; install it or convert the video to Y4M\n"
    );
}

#[test]
fn a_port_in_use_is_refused() {
    let ride = Ride::new(1);
    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let at = other.local_addr().unwrap();
    let said = fails(&ride, &["--frames", "ride.y4m", "--to", &format!("tcp://{at}")]);
    let port = at.port();
    let expected = format!(
        "gangway-bench: port {port} of 127.0.0.1 is in use; end the program that has it or give another port\n"
    );
    assert_eq!(said, expected);
}

#[test]
fn a_full_disk_ends_the_ride_with_one_sentence() {
    let ride = Ride::new(5);
    let said = fails(&ride, &["--frames", "ride.y4m", "--to", "file:/dev/full", "--repeat", "1000"]);
    assert!(said.contains("the disk is full: /dev/full has no room"), "{said}");
}

#[test]
fn a_receiver_that_never_comes_is_given_up_when_asked() {
    let ride = Ride::new(3);
    let arguments = ["--frames", "ride.y4m", "--to", "tcp://127.0.0.1:0", "--wait", "0.5"];
    let (code, said) = complaint(&ride, &arguments);
    assert_eq!(code, 1);
    assert!(said.contains("waiting for a receiver on tcp://127.0.0.1:"), "{said}");
    assert!(said.contains("nobody took the records on tcp://127.0.0.1:"), "{said}");
}

#[test]
fn a_row_of_times_that_is_missing_is_named() {
    let ride = Ride::new(3);
    std::fs::write(ride.path("times.csv"), "frame,time_ns\n0,0\n1,20\n").unwrap();
    let said = fails(&ride, &["--frames", "ride.y4m", "--to", "file:a.gw", "--times", "times.csv"]);
    assert!(said.contains("times.csv has rows for 2 frames only"), "{said}");
    assert_eq!(Capture::read(&ride.path("a.gw")).frames, [0, 1]);
}
