//! `gangway simulate` as a person calls it.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

fn gangway(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gangway")).arg("simulate").args(args).output().unwrap()
}

fn error(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn a_built_in_scene_and_a_copy_of_its_file_give_the_same_recording() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).display().to_string();
    let output = gangway(&["ride", "--frames", "2", "--out", &at("one")]);
    assert!(output.status.success(), "{}", error(&output));
    assert_eq!(names(&dir.path().join("one")), ["frames.y4m", "setup.toml", "truth.csv"]);
    let printed = gangway(&["ride", "--print"]);
    std::fs::write(at("mine.toml"), &printed.stdout).unwrap();
    let output = gangway(&[&at("mine.toml"), "--frames", "2", "--out", &at("two")]);
    assert!(output.status.success(), "{}", error(&output));
    for file in ["one/frames.y4m", "one/truth.csv", "one/setup.toml"] {
        let other = file.replace("one", "two");
        assert!(std::fs::read(at(file)).unwrap() == std::fs::read(at(&other)).unwrap(), "{file}");
    }
}

#[test]
fn a_full_disk_is_one_sentence_and_leaves_no_file() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    // A limit on the size of files stands for the disk: 512 kB (in units of 512 bytes), and no signal.
    let script = "trap '' XFSZ; ulimit -f 1024; exec \"$0\" simulate rig --frames 2 --out \"$1\"";
    let output =
        Command::new("sh").args(["-c", script, env!("CARGO_BIN_EXE_gangway")]).arg(&out).output().unwrap();
    let error = error(&output);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    assert!(error.contains("frames.y4m: cannot be written:"), "{error}");
    assert_eq!(names(&out), [] as [String; 0]);
}

#[test]
fn an_interrupt_is_one_sentence_and_leaves_no_file() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let child = Command::new(env!("CARGO_BIN_EXE_gangway"))
        .args(["simulate", "rig", "--frames", "100000", "--out"])
        .arg(&out)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = || out.exists() && names(&out).iter().any(|name| name.contains("frames.y4m"));
    for _ in 0..2000 {
        if begun() {
            break;
        }
        thread::sleep(Duration::from_millis(10));
    }
    let process = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(process, rustix::process::Signal::INT).unwrap();
    let output = child.wait_with_output().unwrap();
    let said = error(&output);
    assert_eq!((output.status.code(), said.lines().count()), (Some(1), 1), "{said}");
    assert!(said.contains("stopped before the last frame"), "{said}");
    assert_eq!(names(&out), [] as [String; 0]);
}

#[test]
fn wrong_use_and_a_wrong_scene_have_their_exit_codes() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().display().to_string();
    assert_eq!(gangway(&["ride"]).status.code(), Some(2));
    assert_eq!(gangway(&["ride", "--frames", "0", "--out", &out]).status.code(), Some(2));
    let output = gangway(&["moon", "--out", &out]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        error(&output)
            .contains("there is no built-in scene `moon`, there are: rig, ride, 1a, 1b, 1c, 2b, 2c")
    );
    let output = gangway(&["no/such.toml", "--out", &out]);
    assert_eq!(output.status.code(), Some(1));
    assert!(error(&output).contains("no/such.toml: cannot be read:"), "{}", error(&output));
}
