//! `gangway setup` as it is called: what it says, where it says it, and how it ends.

use std::process::{Command, Output, Stdio};

const RIDE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../boards/setup/examples/ride.toml");

fn gangway(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gangway")).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    str::from_utf8(bytes).unwrap()
}

#[test]
fn a_good_setup_is_called_good() {
    let output = gangway(&["setup", "check", RIDE]);
    assert!(output.status.success() && output.stderr.is_empty());
    assert!(
        text(&output.stdout).contains("ride.toml: good; \"ride\", 3 targets, 19 circles, 19 seeds, digest ")
    );
}

#[test]
fn every_mistake_has_a_line_and_the_exit_code_is_1() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.toml");
    let bad =
        std::fs::read_to_string(RIDE).unwrap().replace("inner_diameter_mm = 21.0", "inner_diameter_mm = -1");
    std::fs::write(&path, bad).unwrap();
    let output = gangway(&["setup", "check", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stdout.is_empty());
    let lines: Vec<&str> = text(&output.stderr).lines().collect();
    assert_eq!(lines.len(), 3);
    for (line, number) in lines.iter().zip([25, 49, 75]) {
        assert!(
            line.starts_with("gangway: ") && line.contains(&format!("bad.toml:{number}: target[")),
            "{line}"
        );
    }
}

#[test]
fn a_setup_that_is_not_there_is_one_sentence_and_exit_code_1() {
    let output = gangway(&["setup", "show", "not-there.toml"]);
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stderr);
    assert!(
        said.starts_with("gangway: not-there.toml cannot be read: ") && said.lines().count() == 1,
        "{said}"
    );
}

#[test]
fn a_wrong_call_ends_with_exit_code_2() {
    assert_eq!(gangway(&["setup", "check"]).status.code(), Some(2));
    assert_eq!(gangway(&["setup", "chekc", RIDE]).status.code(), Some(2));
}

#[test]
fn show_tells_value_bounds_and_origin() {
    let output = gangway(&["setup", "show", RIDE]);
    let shown = text(&output.stdout);
    let words = |setting: &str| -> Vec<&str> {
        let line = shown.lines().find(|line| line.split(' ').next() == Some(setting));
        line.unwrap_or_else(|| panic!("no {setting} in\n{shown}")).split_whitespace().collect()
    };
    assert_eq!(words("rest.frames")[1..], ["25", "frames", "10", "10", "to", "250", "line", "111"]);
    assert_eq!(words("solver.gate_px")[1..], ["0.5", "px", "0.5", "0.05", "to", "10", "default"]);
    assert_eq!(words("target[2].seeds_px[6]")[1..], ["[1483.8,", "690.1]", "px", "line", "92"]);
}

#[test]
fn show_as_json_carries_the_same() {
    let output = gangway(&["setup", "show", "--json", RIDE]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let settings = json["settings"].as_array().unwrap();
    let frames = settings.iter().find(|setting| setting["setting"] == "rest.frames").unwrap();
    assert_eq!(
        (&frames["value"], &frames["default"], &frames["line"]),
        (&25.into(), &10.into(), &111.into())
    );
    assert_eq!(frames["allowed"]["greatest"], 250.0);
    assert_eq!(json["digest"].as_str().unwrap().len(), 32);
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    for arguments in [&["setup", "show", RIDE][..], &["setup", "show", "--json", RIDE]] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_gangway"))
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    }
}
