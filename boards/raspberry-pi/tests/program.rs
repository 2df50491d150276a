//! `gangway-pi` as it is called: mistakes are one sentence with the right exit code, and a check says what
//! works.

use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Output, Stdio};

use assert_cmd::Command;
use gangway_wire::{Decoded, Decoder, Record};
use rustix::process::{Pid, Signal, kill_process};

const RIDE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../setup/examples/ride.toml");

fn run(args: &[&str]) -> Output {
    Command::cargo_bin("gangway-pi").unwrap().args(args).output().unwrap()
}

fn sentence(output: &Output, code: i32) -> String {
    let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    assert_eq!(output.status.code(), Some(code), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}

/// A setup whose camera cannot be there.
fn setup(place: &Path, device: &str) -> String {
    let text = std::fs::read_to_string(RIDE).unwrap();
    let device = format!("device = \"{device}\"");
    let text = text.replace("# device = \"/dev/video0\"", &device);
    assert!(text.contains(&device));
    let file = place.join("setup.toml");
    std::fs::write(&file, text).unwrap();
    file.display().to_string()
}

#[test]
fn mistakes_are_one_sentence_with_the_right_exit_code() {
    let said = sentence(&run(&["run", "--setup", "/no/such/setup.toml"]), 1);
    assert!(said.contains("/no/such/setup.toml") && said.lines().count() == 1, "{said}");
    let said = sentence(&run(&["run", "--to", "smoke-signal:hill"]), 2);
    assert!(said.contains("write tcp://HOST:PORT"), "{said}");
    let place = tempfile::tempdir().unwrap();
    let said = sentence(
        &run(&["run", "--setup", &setup(place.path(), "/dev/null"), "--to", "tcp://127.0.0.1:0"]),
        1,
    );
    assert!(said.contains("/dev/null is no camera"), "{said}");
}

#[test]
fn a_check_says_in_a_line_each_what_works_and_what_does_not() {
    let place = tempfile::tempdir().unwrap();
    let setup = setup(place.path(), "/dev/no-such-camera");
    let output = run(&["check", "--setup", &setup, "--to", "tcp://127.0.0.1:0"]);
    assert_eq!(output.status.code(), Some(1), "not everything works");
    let said = String::from_utf8_lossy(&output.stdout);
    for line in [
        "ok    setup: 19 circles on 3 targets",
        "no    camera: there is no camera /dev/no-such-camera; check its plug and name",
        "ok    pins: the setup names none",
        "ok    line: tcp://127.0.0.1:",
    ] {
        assert!(said.lines().any(|said| said.starts_with(line)), "{line}\n{said}");
    }
    for what in ["clock: ", "disk: ", "real time: "] {
        assert!(said.contains(what), "{said}");
    }
}

#[test]
fn the_setup_of_the_readme_is_one_that_the_program_takes() {
    let readme = include_str!("../README.md");
    let keys = readme.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let place = tempfile::tempdir().unwrap();
    let rides = place.path().join("rides").display().to_string();
    assert!(keys.contains("/var/lib/gangway"), "{keys}");
    let ride = std::fs::read_to_string(RIDE).unwrap();
    // What the example has of these two tables is commented out.
    let ride = ride.replace("[capture] ", "# ").replace("[board]\n", "\n");
    let setup = place.path().join("setup.toml");
    std::fs::write(&setup, format!("{ride}\n{}", keys.replace("/var/lib/gangway", &rides))).unwrap();
    let output = run(&["check", "--setup", &setup.display().to_string(), "--to", "tcp://127.0.0.1:0"]);
    let said = String::from_utf8_lossy(&output.stdout);
    for line in ["ok    setup: ", "no    camera: there is no camera /dev/v4l/by-id/usb-"] {
        assert!(said.contains(line), "{line}\n{said}{}", String::from_utf8_lossy(&output.stderr));
    }
    assert!(said.contains(&format!("ok    log: every ride is kept in {rides}")), "{said}");
}

/// The box measuring, and what it says line by line.
fn started(setup: &str, to: &str) -> (Child, impl Iterator<Item = String> + use<>) {
    let mut program = std::process::Command::new(assert_cmd::cargo::cargo_bin("gangway-pi"))
        .args(["run", "--setup", setup, "--to", to])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let said = BufReader::new(program.stderr.take().unwrap()).lines().map(Result::unwrap);
    (program, said)
}

#[test]
fn a_box_without_a_camera_reads_its_setup_again_and_ends_properly() {
    let place = tempfile::tempdir().unwrap();
    let setup = setup(place.path(), "/dev/no-such-camera");
    let records = place.path().join("box.gw");
    let (program, mut said) = started(&setup, &format!("file:{}", records.display()));
    let pid = Pid::from_child(&program);
    let mut expect = |text: &str| {
        let line = said.find(|line| line.contains(text));
        assert!(line.is_some(), "it ended without '{text}'");
    };
    expect("there is no camera /dev/no-such-camera");
    kill_process(pid, Signal::HUP).unwrap();
    expect("the new setup is taken over");
    std::fs::write(&setup, "name = 3").unwrap();
    kill_process(pid, Signal::HUP).unwrap();
    expect("the setup stays as it was");
    kill_process(pid, Signal::TERM).unwrap();
    let output = program.wait_with_output().unwrap();
    assert!(output.status.success());
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.starts_with("0 frames, 0 poses") && told.contains(" 0 not sent"), "{told}");
    let events = events(&std::fs::read(&records).unwrap());
    assert_eq!(events.first().map(String::as_str), Some("Started"));
    assert_eq!(events.iter().filter(|event| *event == "SetupChanged").count(), 1, "{events:?}");
    assert!(events.contains(&"CameraLost".to_owned()), "{events:?}");
    assert_eq!(events.last().map(String::as_str), Some("Ended"));
}

#[test]
fn a_second_signal_does_not_cut_the_end_of_a_session_short() {
    let place = tempfile::tempdir().unwrap();
    let setup = setup(place.path(), "/dev/no-such-camera");
    // Nobody listens there: at the end the box waits for somebody who takes what is left.
    let (program, mut said) = started(&setup, "tcp-connect://127.0.0.1:1");
    let pid = Pid::from_child(&program);
    assert!(said.any(|line| line.contains("there is no camera")));
    // Two different ones are never merged into one.
    kill_process(pid, Signal::INT).unwrap();
    kill_process(pid, Signal::TERM).unwrap();
    let output = program.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", output.status);
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.starts_with("0 frames, 0 poses"), "{told}");
}

#[test]
fn a_box_that_is_not_permitted_real_time_says_so_in_its_records_and_measures_on() {
    let place = tempfile::tempdir().unwrap();
    let setup = setup(place.path(), "/dev/no-such-camera");
    let (records, program) = (place.path().join("box.gw"), place.path().join("gangway-pi"));
    std::fs::copy(assert_cmd::cargo::cargo_bin("gangway-pi"), &program).unwrap();
    let mut shell = std::process::Command::new("sh");
    shell.arg("-c").arg("ulimit -r 0; ulimit -l 64; exec \"$@\"").arg("sh");
    // Who is root may do everything: the program is then started as the user who may do nothing.
    if rustix::process::geteuid().is_root() {
        std::fs::set_permissions(place.path(), std::fs::Permissions::from_mode(0o777)).unwrap();
        shell.uid(65_534).gid(65_534);
    }
    let to = format!("file:{}", records.display());
    let mut program = shell
        .arg(program)
        .args(["run", "--setup", &setup, "--to", &to])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(program.stderr.take().unwrap()).lines().map(Result::unwrap);
    for text in ["memory is not locked (", "the frame thread is not in real time ("] {
        assert!(said.by_ref().any(|line| line.contains(text) && line.contains("; allow Limit")), "{text}");
    }
    // A turn of the loop later it is in the records.
    let pid = Pid::from_child(&program);
    kill_process(pid, Signal::HUP).unwrap();
    assert!(said.by_ref().any(|line| line.contains("the new setup is taken over")));
    kill_process(pid, Signal::TERM).unwrap();
    assert!(program.wait().unwrap().success());
    let events = events(&std::fs::read(&records).unwrap());
    for text in ["memory is not locked", "the frame thread is not in real time"] {
        assert!(events.iter().any(|event| event.contains(text)), "{events:?}");
    }
}

/// The events of a capture, in order.
fn events(capture: &[u8]) -> Vec<String> {
    let mut decoder = Box::new(Decoder::new());
    let (mut events, mut bytes) = (Vec::new(), capture);
    while !bytes.is_empty() {
        let (decoded, rest) = decoder.feed(bytes);
        bytes = rest;
        if let Some(Decoded::Record { record: Record::Event(event), .. }) = decoded {
            events.push(format!("{:?}", event.what));
        }
    }
    events
}
