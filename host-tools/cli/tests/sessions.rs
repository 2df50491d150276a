//! `gangway receive`, `decode`, `export` and `send` as a test engineer meets them.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use gangway_store::Session;
use gangway_wire::{Event, Hello, MAX_FRAME, Motion, Pose, PoseFlags, Record, What, encode};

fn gangway(dir: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gangway"));
    command.current_dir(dir).args(args).stdin(Stdio::null());
    command
}

fn run(dir: &Path, args: &[&str]) -> Output {
    gangway(dir, args).output().unwrap()
}

fn code(output: &Output) -> Option<i32> {
    output.status.code()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn pose(frame: u32) -> Record<'static> {
    Record::Pose(Pose {
        frame,
        time_ns: u64::from(frame) * 20_000_000,
        flags: PoseFlags::default(),
        markers: 15,
        motion: Some(Motion {
            displacement_mm: [frame as f32, 2.0, 3.0],
            rotation_deg: [0.5, 0.25, 0.125],
            sigma: [0.0; 6],
            residual_px: 0.0,
        }),
    })
}

/// A ride of poses; with its end or as the box is still going on.
fn ride(session_id: u64, frames: u32, ended: bool) -> Vec<u8> {
    let hello = Record::Hello(Hello {
        wire_version: 1,
        box_id: 1,
        boot_id: 1,
        session_id,
        name: "ride",
        firmware: "0.1.0",
        setup_digest: [0; 16],
    });
    let end = Record::Event(Event { frame: frames, time_ns: 1, what: What::Ended });
    let records = [hello].into_iter().chain((0..frames).map(pose)).chain(ended.then_some(end));
    let mut bytes = Vec::new();
    for (record, sequence) in records.zip(0..) {
        let mut line = [0; MAX_FRAME];
        let length = encode(&record, sequence, &mut line).unwrap();
        bytes.extend_from_slice(&line[..length]);
    }
    bytes
}

/// The only session in `rides`.
fn only_session(dir: &Path) -> PathBuf {
    let mut all = fs::read_dir(dir.join("rides")).unwrap().map(|entry| entry.unwrap().path());
    let one = all.next().unwrap();
    assert_eq!(all.next(), None);
    one
}

/// Waits, as long as it takes, until the stream of the only session holds this many bytes.
fn wait_for(dir: &Path, bytes: usize) -> PathBuf {
    loop {
        if dir.join("rides").exists() && fs::read_dir(dir.join("rides")).unwrap().count() == 1 {
            let session = only_session(dir);
            if fs::metadata(session.join("stream.gw")).is_ok_and(|about| about.len() >= bytes as u64) {
                return session;
            }
        }
        thread::sleep(Duration::from_millis(10));
    }
}

fn start(dir: &Path, args: &[&str]) -> Child {
    gangway(dir, args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn a_ride_over_tcp_is_received_decoded_and_exported() {
    let dir = tempfile::tempdir().unwrap();
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let from = format!("tcp://{}", server.local_addr().unwrap());
    let child = start(dir.path(), &["receive", "--from", &from, "--into", "rides"]);
    server.accept().unwrap().0.write_all(&ride(0xab, 100, true)).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), Some(0), "{}", stderr(&output));
    let line = stdout(&output);
    assert_eq!(line.lines().count(), 1);
    assert!(line.contains("102 records (100 frames, 100 with a pose"), "{line}");
    assert!(line.contains("0 damaged, 0 newer, no gaps; the box ended"), "{line}");

    let session = only_session(dir.path());
    assert!(session.to_str().unwrap().ends_with("Z-ride-ab") && line.contains("-ride-ab:"));
    let session = session.to_str().unwrap();
    let output = run(dir.path(), &["decode", session]);
    assert_eq!((code(&output), stdout(&output).lines().count()), (Some(0), 102));
    assert!(stderr(&output).contains("102 records"));
    let output = run(dir.path(), &["export", session, "--format", "csv", "--out", "poses.csv"]);
    assert_eq!(code(&output), Some(0), "{}", stderr(&output));
    let table = fs::read_to_string(dir.path().join("poses.csv")).unwrap();
    assert_eq!(table.lines().nth(8).unwrap(), "7,140000000,7,2,3,0.5,0.25,0.125,0,0,0,0,0,0,0,15,");
    assert_eq!(stdout(&run(dir.path(), &["export", session, "--out", "-"])), table);
    let output = run(dir.path(), &["export", session, "--format", "parquet", "--out", "poses.parquet"]);
    assert_eq!(code(&output), Some(0));
    assert!(fs::read(dir.path().join("poses.parquet")).unwrap().starts_with(b"PAR1"));
}

#[test]
fn a_killed_receiver_loses_nothing_that_came_before_the_kill() {
    let dir = tempfile::tempdir().unwrap();
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let from = format!("tcp://{}", server.local_addr().unwrap());
    let mut child = start(dir.path(), &["receive", "--from", &from]);
    let mut stream = server.accept().unwrap().0;
    let bytes = ride(1, 500, false);
    stream.write_all(&bytes).unwrap();
    let session = wait_for(dir.path(), bytes.len());

    let output = run(dir.path(), &["export", session.to_str().unwrap(), "--out", "-"]);
    assert_eq!(code(&output), Some(1));
    let said = stderr(&output);
    assert!(said.contains(&format!("process {} is receiving", child.id())), "{said}");
    assert_eq!(said.lines().count(), 1);

    child.kill().unwrap();
    child.wait().unwrap();
    let (opened, recovery) = Session::open(&session).unwrap();
    assert!(recovery.cut_off);
    assert_eq!(opened.poses().unwrap().len(), 500);
    drop(opened);
    let output = run(dir.path(), &["export", session.to_str().unwrap(), "--out", "-"]);
    assert_eq!((code(&output), stdout(&output).lines().count()), (Some(0), 501));
    assert!(stderr(&output).contains("did not end properly"), "{}", stderr(&output));
}

#[test]
fn an_interrupt_ends_properly() {
    let dir = tempfile::tempdir().unwrap();
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let from = format!("tcp://{}", server.local_addr().unwrap());
    let child = start(dir.path(), &["receive", "--from", &from]);
    let mut stream = server.accept().unwrap().0;
    let bytes = ride(1, 50, false);
    stream.write_all(&bytes).unwrap();
    let session = wait_for(dir.path(), bytes.len());
    let process = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(process, rustix::process::Signal::INT).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), Some(0));
    assert!(stdout(&output).contains("51 records") && stdout(&output).contains("stopped"));
    assert!(Session::open(session).unwrap().1.is_whole());
}

#[test]
fn a_receiver_waits_for_the_box_and_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let from = format!("tcp://{address}");
    let mut child = start(dir.path(), &["receive", "--from", &from]);
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    assert!(line.contains("the box is not there yet") && line.contains("trying on"), "{line}");
    let server = TcpListener::bind(address).unwrap();
    server.accept().unwrap().0.write_all(&ride(1, 3, true)).unwrap();
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(0));
}

#[test]
fn a_disk_that_is_full_from_the_start_leaves_no_session() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("ride.gw"), ride(1, 20, true)).unwrap();
    // No file may grow at all.
    let output = Command::new("sh")
        .current_dir(dir.path())
        .args(["-c", "ulimit -f 0; trap '' XFSZ; exec \"$0\" receive --from file:ride.gw"])
        .arg(env!("CARGO_BIN_EXE_gangway"))
        .output()
        .unwrap();
    assert_eq!(code(&output), Some(1));
    assert!(stderr(&output).contains("the disk is full"), "{}", stderr(&output));
    assert_eq!(fs::read_dir(dir.path().join("rides")).unwrap().count(), 0);
}

#[test]
fn an_address_that_fails_is_told_while_another_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let mut child = start(dir.path(), &["receive", "--from", "udp://127.0.0.1:0", "--from", "file:."]);
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut lines = [const { String::new() }; 2];
    for line in &mut lines {
        said.read_line(line).unwrap();
    }
    assert!(lines[0].contains("listening on") && lines[1].contains("file:.: Is a directory"), "{lines:?}");
    let process = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(process, rustix::process::Signal::INT).unwrap();
    assert_eq!(code(&child.wait_with_output().unwrap()), Some(1));
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    assert!(rest.contains("1 of 2 addresses failed"), "{rest}");
}

#[test]
fn a_serial_line_is_received() {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    let dir = tempfile::tempdir().unwrap();
    let box_side = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&box_side).unwrap();
    unlockpt(&box_side).unwrap();
    let device = ptsname(&box_side, Vec::new()).unwrap().into_string().unwrap();
    let mut child = start(dir.path(), &["receive", "--from", &format!("serial:{device}@230400")]);
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    assert!(line.contains("open"), "{line}");
    let mut box_side = fs::File::from(box_side);
    // All byte values go through: the line is raw.
    let bytes = ride(1, 300, true);
    box_side.write_all(&bytes).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), Some(0));
    assert_eq!(fs::read(only_session(dir.path()).join("stream.gw")).unwrap(), bytes);
}

#[test]
fn a_full_disk_is_said_in_one_sentence_and_what_was_written_opens() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("ride.gw"), ride(1, 2000, true)).unwrap();
    // A limit on the size of files stands for the full disk: 64 blocks of 512 bytes.
    let output = Command::new("sh")
        .current_dir(dir.path())
        .args(["-c", "ulimit -f 64; trap '' XFSZ; exec \"$0\" receive --from file:ride.gw"])
        .arg(env!("CARGO_BIN_EXE_gangway"))
        .output()
        .unwrap();
    assert_eq!(code(&output), Some(1));
    let said = stderr(&output);
    assert!(said.lines().count() == 1 && said.contains("the disk is full"), "{said}");
    let (session, recovery) = Session::open(only_session(dir.path())).unwrap();
    // dash counts blocks of 512 bytes, bash of 1024.
    assert!([64 * 512, 64 * 1024].contains(&recovery.bytes), "{recovery:?}");
    assert!(recovery.cut_off && session.poses().unwrap().len() > 300);
}

#[test]
fn decode_reads_standard_input_and_gives_json_lines() {
    let dir = tempfile::tempdir().unwrap();
    let mut child = gangway(dir.path(), &["decode", "-", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut bytes = ride(1, 3, true);
    let at = bytes.len() - 40;
    bytes[at] ^= 0x40;
    child.stdin.take().unwrap().write_all(&bytes).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), Some(0));
    let kinds: Vec<String> = stdout(&output)
        .lines()
        .map(|line| {
            let value: serde_json::Value = serde_json::from_str(line).unwrap();
            value["kind"].as_str().unwrap().to_owned()
        })
        .collect();
    assert_eq!(kinds, ["hello", "pose", "pose", "damaged", "event"]);
    assert!(stderr(&output).contains("4 records") && stderr(&output).contains("1 damaged"));
}

#[test]
fn a_capture_of_a_later_version_of_the_wire_is_refused_in_one_sentence() {
    let dir = tempfile::tempdir().unwrap();
    let hello = Record::Hello(gangway_wire::Hello {
        wire_version: 2,
        box_id: 1,
        boot_id: 2,
        session_id: 3,
        name: "ride",
        firmware: "9",
        setup_digest: [0; 16],
    });
    let mut line = [0; MAX_FRAME];
    let length = encode(&hello, 0, &mut line).unwrap();
    std::fs::write(dir.path().join("ride.gw"), &line[..length]).unwrap();
    for args in
        [&["decode", "ride.gw"][..], &["export", "ride.gw", "--out", "a.csv"], &["evaluate", "ride.gw"]]
    {
        let output = run(dir.path(), args);
        assert_eq!((code(&output), stderr(&output).lines().count()), (Some(1), 1), "{}", stderr(&output));
        assert!(
            stderr(&output).contains("ride.gw: was sent in version 2 of the wire"),
            "{}",
            stderr(&output)
        );
    }
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("ride.gw"), ride(1, 20_000, true)).unwrap();
    for args in [&["decode", "ride.gw"][..], &["export", "ride.gw", "--out", "-"]] {
        let mut child = start(dir.path(), args);
        child.stdout.take().unwrap().read_exact(&mut [0; 10]).unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!((code(&output), stderr(&output).as_str()), (Some(0), ""));
    }
}

#[test]
fn a_full_disk_behind_standard_output_is_named() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("ride.gw"), ride(1, 20, true)).unwrap();
    for args in [&["decode", "ride.gw"][..], &["export", "ride.gw", "--out", "-"]] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = gangway(dir.path(), args).stdout(full).output().unwrap();
        let said = stderr(&output);
        assert_eq!((code(&output), said.lines().count()), (Some(1), 1), "{said}");
        assert!(said.contains("standard output cannot be written: No space left"), "{said}");
    }
}

#[test]
fn wrong_use_and_failure_have_their_codes_and_one_sentence() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("rubbish"), [7; 5000]).unwrap();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = format!("tcp-listen://{}", taken.local_addr().unwrap());
    for (args, expected, words) in [
        (&["receive", "--from", "127.0.0.1:7007"][..], 2, "allowed are tcp://"),
        (&["receive", "--from", "-", "--from", "-"], 2, "given twice"),
        (&["receive", "--from", "-", "--for", "never"], 2, "number of seconds"),
        (&["receive", "--from", "-", "--for", "-1"], 2, "number of seconds"),
        (&["receive", "--from", "-"], 1, "nothing was received"),
        (&["receive", "--from", "file:none.gw"], 1, "cannot open none.gw"),
        (&["receive", "--from", "file:rubbish"], 1, "no record was received"),
        (&["receive", "--from", &taken], 1, "cannot listen there"),
        (&["decode", "rubbish"], 1, "no record in 5000 bytes"),
        (&["decode", "none.gw"], 1, "cannot open none.gw"),
        (&["export", "rubbish", "--out", "-"], 1, "holds no record"),
        (&["export", ".", "--out", "-"], 1, "holds no stream.gw"),
        (&["export", "/dev/null", "--out", "-"], 1, "is no file and no folder"),
        (&["send", "--to", "udp://127.0.0.1:1", "ping"], 2, "commands go to"),
        (&["send", "--to", "the box", "ping"], 2, "commands go to"),
        (&["send", "--to", "tcp://127.0.0.1", "ping"], 2, "needs a host and a port"),
        (&["send", "--to", "tcp://127.0.0.1:1", "mark", &"x".repeat(65)], 2, "at most 64 bytes"),
    ] {
        let output = run(dir.path(), args);
        let said = stderr(&output);
        assert_eq!(code(&output), Some(expected), "{args:?}: {said}");
        assert!(said.contains(words), "{args:?}: {said}");
        assert!(
            expected == 2 || said.lines().filter(|line| line.starts_with("gangway: ")).count() >= 1,
            "{said}"
        );
    }
}

#[test]
fn a_ping_is_printed_with_both_clocks_and_a_silent_box_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let to = format!("tcp://{}", server.local_addr().unwrap());
    thread::spawn(move || {
        let answer = |mut stream: TcpStream, speaks: bool| {
            let (mut decoder, mut buffer) = (gangway_wire::Decoder::new(), [0; 256]);
            while let Ok(count @ 1..) = stream.read(&mut buffer) {
                let mut rest = &buffer[..count];
                while !rest.is_empty() {
                    let (found, behind) = decoder.feed(rest);
                    rest = behind;
                    if let Some(gangway_wire::Decoded::Record { record: Record::Ping(ping), .. }) = found
                        && speaks
                    {
                        let (number, host_time_ns) = (ping.number, ping.host_time_ns);
                        let pong = gangway_wire::Pong { number, host_time_ns, time_ns: 1_234_567 };
                        let mut line = [0; MAX_FRAME];
                        let length = encode(&Record::Pong(pong), 5, &mut line).unwrap();
                        stream.write_all(&line[..length]).unwrap();
                    }
                }
            }
        };
        answer(server.accept().unwrap().0, true);
        answer(server.accept().unwrap().0, false);
    });
    let output = run(dir.path(), &["send", "--to", &to, "ping"]);
    assert_eq!(code(&output), Some(0), "{}", stderr(&output));
    assert!(stdout(&output).starts_with("box clock 1234567 ns, host clock "), "{}", stdout(&output));
    // The wait may stand on either side of the command.
    let output = run(dir.path(), &["send", "--to", &to, "set-rest", "--wait", "0.2"]);
    assert_eq!((code(&output), stderr(&output).lines().count()), (Some(1), 1));
    assert!(stderr(&output).contains("did not answer within 0.2 s"), "{}", stderr(&output));
}

#[test]
fn every_line_of_complaint_begins_with_the_programs_name() {
    let dir = tempfile::tempdir().unwrap();
    for (args, exit, says) in [
        (&["export", "rides/1", "--out", "a.csv", "--format", "xls"][..], 2, "invalid value 'xls'"),
        (&["receive", "--from", "udp://127.0.0.1:99999"], 2, "a port from 0 to 65535"),
        (&["nothing"], 2, "unrecognized subcommand 'nothing'"),
        (&["decode", "nowhere.gw"], 1, "cannot open nowhere.gw"),
    ] {
        let output = run(dir.path(), args);
        let said = stderr(&output);
        assert_eq!(code(&output), Some(exit), "{said}");
        assert!(said.contains(says), "{said}");
        assert!(said.lines().all(|line| line.starts_with("gangway: ")), "{said}");
    }
}
