//! The program from its command line: recordings in, records out, and every mistake in one sentence.

mod mistakes;
mod ride;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::process::Child;
use std::time::Duration;

use gangway_wire::kind;
use ride::{Capture, Ride};
use rustix::process::{Pid, Signal, kill_process};
use serialport::{SerialPort, TTYPort};

/// Plays the ride to a file with these arguments.
fn play(ride: &Ride, name: &str, arguments: &[&str]) -> Capture {
    let to = format!("file:{name}");
    ride.program().args(["--frames", "ride.y4m", "--to", &to]).args(arguments).assert().success();
    Capture::read(&ride.path(name))
}

/// The address that a program says it listens on.
fn listens(child: &mut Child) -> String {
    let mut line = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut line).unwrap();
    line.trim().strip_prefix("gangway-bench: listening on tcp://").unwrap().to_owned()
}

/// Everything up to the end of the connection.
fn receive(at: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    TcpStream::connect(at).unwrap().read_to_end(&mut bytes).unwrap();
    bytes
}

#[test]
fn every_frame_of_a_recording_has_its_record_and_one_line_closes() {
    let ride = Ride::new(12);
    let run = ride.program().args(["--frames", "ride.y4m", "--to", "file:ride.gw"]).assert().success();
    let capture = Capture::read(&ride.path("ride.gw"));
    assert_eq!(capture.frames, (0..12).collect::<Vec<u32>>());
    assert_eq!(capture.times_ns, (0..12).map(|frame| frame * 20_000_000).collect::<Vec<u64>>());
    assert_eq!((capture.missing, capture.damaged), (0, 0));
    assert!(capture.has("Ended"));
    let said = String::from_utf8_lossy(&run.get_output().stdout).into_owned();
    assert!(said.starts_with("12 frames, 3 poses, ") && said.ends_with("; to file:ride.gw\n"), "{said}");
    assert_eq!(said.lines().count(), 1);
}

#[test]
fn a_ride_without_rest_says_what_rest_takes() {
    let ride = Ride::new(9);
    let run = ride.program().args(["--frames", "ride.y4m", "--to", "file:ride.gw"]).assert().success();
    let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    assert!(said.contains("at least 10 frames at rest"), "{said}");
    assert!(said.contains("seeds_px, or 5 frames more"), "{said}");
}

#[test]
fn every_way_in_and_every_way_out_gives_the_same_records() {
    let ride = Ride::new(12);
    let expected = play(&ride, "file.gw", &[]).measured;
    assert!(!expected.is_empty());

    assert_eq!(play(&ride, "paced.gw", &["--real-time"]).measured, expected, "at the recorded rate");

    let mut program = ride.program();
    program.args(["--frames", "-", "--to", "file:stdin.gw"]).write_stdin(ride.bytes()).assert().success();
    assert_eq!(Capture::read(&ride.path("stdin.gw")).measured, expected, "from standard input");

    let mut child = ride.spawn(&["--to", "tcp://127.0.0.1:0"]);
    let at = listens(&mut child);
    assert_eq!(Capture::of(&receive(&at)).measured, expected, "as a server");
    assert!(child.wait().unwrap().success());

    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let to = format!("tcp-connect://{}", listener.local_addr().unwrap());
    let mut child = ride.spawn(&["--to", &to]);
    let mut bytes = Vec::new();
    listener.accept().unwrap().0.read_to_end(&mut bytes).unwrap();
    assert_eq!(Capture::of(&bytes).measured, expected, "as a client");
    assert!(child.wait().unwrap().success());
}

#[test]
fn a_session_begins_with_its_hello() {
    let ride = Ride::new(2);
    // One behind the other on a line without connections.
    play(&ride, "ride.gw", &["--session-id", "1"]);
    let capture = play(&ride, "ride.gw", &["--session-id", "2", "--append"]);
    assert_eq!(capture.firsts, [kind::HELLO, kind::HELLO]);
}

#[test]
fn the_clock_of_the_box_is_that_of_the_frames() {
    let ride = Ride::new(60);
    for pace in [&[][..], &["--real-time"]] {
        let capture = play(&ride, "ride.gw", &[&["--fault", "late:0.2"], pace].concat());
        assert!(capture.clock_ns.len() > 3, "a greeting, stalls and health: {:?}", capture.clock_ns);
        // 1.2 s of frames; a machine whose own clock stood below a minute would have to start up at once.
        let bound = 60_000_000_000;
        assert!(capture.clock_ns.iter().all(|&time| time < bound), "{:?}", capture.clock_ns);
        std::fs::remove_file(ride.path("ride.gw")).unwrap();
    }
}

#[test]
fn datagrams_carry_whole_records() {
    let ride = Ride::new(12);
    let expected = play(&ride, "file.gw", &[]).measured;
    let host = UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut child = ride.spawn(&["--to", &format!("udp://{}", host.local_addr().unwrap())]);
    let (mut bytes, mut datagram) = (Vec::new(), [0; 2_048]);
    while !Capture::of(&bytes).has("Ended") {
        let count = host.recv(&mut datagram).unwrap();
        assert_eq!(datagram[..count].last(), Some(&0));
        bytes.extend_from_slice(&datagram[..count]);
    }
    assert!(child.wait().unwrap().success());
    assert_eq!(Capture::of(&bytes).measured, expected);
}

#[test]
fn a_serial_line_carries_the_records() {
    let ride = Ride::new(12);
    let expected = play(&ride, "file.gw", &[]).measured;
    let (mut host, slave) = TTYPort::pair().unwrap();
    host.set_timeout(Duration::from_secs(60)).unwrap();
    let name = slave.name().unwrap();
    let mut child = ride.spawn(&["--to", &format!("serial:{name}@230400")]);
    let (mut bytes, mut portion) = (Vec::new(), [0; 512]);
    while !Capture::of(&bytes).has("Ended") {
        let count = host.read(&mut portion).unwrap();
        bytes.extend_from_slice(&portion[..count]);
    }
    assert!(child.wait().unwrap().success());
    assert_eq!(Capture::of(&bytes).measured, expected);
}

#[test]
fn ids_times_repeats_and_limits_are_those_given() {
    let ride = Ride::new(3);
    std::fs::write(ride.path("times.csv"), "frame,time_ns\n4,1000\n5,3000\n7,5000\n").unwrap();
    let ids = ["--box-id", "7", "--boot-id", "8", "--session-id", "0x9a"];
    let capture = play(
        &ride,
        "ride.gw",
        &[&["--times", "times.csv", "--repeat", "3", "--limit", "5"][..], &ids].concat(),
    );
    assert_eq!(capture.hellos[0], (7, 8, 0x9a));
    assert_eq!(capture.frames, [4, 5, 7, 8, 9]);
    assert_eq!(capture.times_ns, [1_000, 3_000, 5_000, 7_000, 9_000]);
}

#[test]
fn nothing_is_lost_to_a_receiver_that_comes_late_and_reads_slowly() {
    let ride = Ride::new(40);
    // Far more records than the outbox holds.
    let mut child = ride.spawn(&["--to", "tcp://127.0.0.1:0", "--repeat", "25"]);
    let at = listens(&mut child);
    std::thread::sleep(Duration::from_millis(50));
    let mut host = TcpStream::connect(at).unwrap();
    let (mut bytes, mut portion) = (Vec::new(), [0; 777]);
    loop {
        match host.read(&mut portion).unwrap() {
            0 => break,
            count => bytes.extend_from_slice(&portion[..count]),
        }
    }
    let capture = Capture::of(&bytes);
    assert_eq!(capture.frames, (0..1_000).collect::<Vec<u32>>());
    assert_eq!((capture.missing, capture.damaged), (0, 0));
    assert!(child.wait().unwrap().success());
}

#[test]
fn who_connects_after_a_lost_connection_is_told_everything_again() {
    let ride = Ride::new(40);
    let mut child = ride.spawn(&["--to", "tcp://127.0.0.1:0", "--repeat", "1000"]);
    let at = listens(&mut child);
    let mut first = TcpStream::connect(&at).unwrap();
    let mut some = vec![0; 20_000];
    first.read_exact(&mut some).unwrap();
    assert!(!Capture::of(&some).hellos.is_empty());
    drop(first);
    let mut second = TcpStream::connect(&at).unwrap();
    // Whatever else comes: a new greeting within what the outbox held and one step more.
    let mut bytes = Vec::new();
    let mut portion = [0; 4_096];
    while Capture::of(&bytes).hellos.is_empty() {
        let count = second.read(&mut portion).unwrap();
        assert!(count > 0, "the ride ended without a greeting");
        bytes.extend_from_slice(&portion[..count]);
    }
    assert_eq!(Capture::of(&bytes).damaged, 0, "a connection begins with a whole record");
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn commands_of_the_host_reach_the_frame_loop() {
    let ride = Ride::new(40);
    let mut child = ride.spawn(&["--to", "tcp://127.0.0.1:0", "--repeat", "1000"]);
    let mut host = TcpStream::connect(listens(&mut child)).unwrap();
    let mut command = [0; gangway_wire::MAX_FRAME];
    let mark = gangway_wire::Record::Mark(gangway_wire::Mark { text: "tunnel" });
    let length = gangway_wire::encode(&mark, 0, &mut command).unwrap();
    host.write_all(&command[..length]).unwrap();
    let (mut bytes, mut portion) = (Vec::new(), [0; 65_536]);
    while !Capture::of(&bytes).has("Mark { text: \"tunnel\" }") {
        let count = host.read(&mut portion).unwrap();
        assert!(count > 0, "the ride ended without the mark");
        bytes.extend_from_slice(&portion[..count]);
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_signal_ends_the_ride_properly() {
    for signal in [Signal::INT, Signal::TERM] {
        let ride = Ride::new(12);
        let mut child = ride.spawn(&["--to", "file:ride.gw", "--real-time", "--repeat", "100000"]);
        // The signals are caught before the first record is written.
        while std::fs::metadata(ride.path("ride.gw")).map_or(0, |file| file.len()) == 0 {
            assert_eq!(child.try_wait().unwrap(), None, "the ride is long enough");
            std::thread::sleep(Duration::from_millis(5));
        }
        kill_process(Pid::from_child(&child), signal).unwrap();
        assert!(child.wait().unwrap().success());
        let mut said = String::new();
        child.stdout.take().unwrap().read_to_string(&mut said).unwrap();
        assert!(said.starts_with("interrupted: "), "{said}");
        let capture = Capture::read(&ride.path("ride.gw"));
        assert!(capture.has("Ended"));
        assert_eq!((capture.missing, capture.damaged), (0, 0));
    }
}

#[test]
fn faults_are_the_same_for_the_same_seed_and_leave_their_records() {
    let ride = Ride::new(40);
    let faults = ["--fault", "drop:0.1,repeat:0.1,torn:0.1,dark:0.1,late:0.1", "--repeat", "5", "--seed"];
    let first = play(&ride, "first.gw", &[&faults[..], &["3"]].concat());
    assert_eq!(play(&ride, "again.gw", &[&faults[..], &["3"]].concat()).measured, first.measured);
    assert_ne!(play(&ride, "other.gw", &[&faults[..], &["4"]].concat()).frames, first.frames);
    for event in ["FramesMissed", "FrameRepeated", "FrameCorrupt", "CameraStalled"] {
        assert!(first.has(event), "{event}");
    }
}

#[test]
fn faults_of_the_link_cost_the_records_that_they_hit() {
    let ride = Ride::new(40);
    let faults = ["--fault", "link-garble:0.1,link-stall:0.01,link-drop:0.01"];
    let hit = play(&ride, "hit.gw", &[&faults[..], &["--repeat", "5"]].concat());
    let whole = play(&ride, "whole.gw", &["--repeat", "5"]);
    assert!(hit.damaged > 0 && hit.missing > 0);
    assert!(hit.frames.len() < 200 && hit.frames.len() > 100, "{}", hit.frames.len());
    assert!(hit.measured.iter().all(|record| whole.measured.contains(record)), "nothing is invented");
}

#[test]
fn the_loop_alone_is_measured_on_request() {
    let ride = Ride::new(12);
    let run = ride.program().args(["--frames", "ride.y4m", "--measure", "--repeat", "2"]).assert().success();
    let said = String::from_utf8_lossy(&run.get_output().stdout).into_owned();
    assert!(said.starts_with("12 frames x 2 passes, 5 circles, "), "{said}");
    assert!(said.contains("step: median "), "{said}");
}
