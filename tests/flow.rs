//! A ride from its scene to its table, through the programs as a test engineer calls them.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Output, Stdio};

use e2e::{bench, gangway, sentence};
use serde_json::Value;

fn done(command: &mut Command) -> Output {
    let output = command.output().expect("the program starts");
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

fn simulate(folder: &Path) {
    std::fs::write(folder.join("short.toml"), include_str!("scenes/short.toml")).expect("a scene file");
    done(gangway().current_dir(folder).args(["simulate", "short.toml", "--out", "."]));
}

#[test]
fn a_ride_is_simulated_measured_received_exported_and_evaluated() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    simulate(at);

    // Port 0 would be any free one, but both sides must name it: one that was free a moment ago.
    let port =
        std::net::TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port").port();
    let address = format!("tcp://127.0.0.1:{port}");
    // The receiver first: it waits for the box.
    let receiver = gangway()
        .current_dir(at)
        .args(["receive", "--from", &address, "--into", "rides", "--once"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the receiver starts");
    done(bench().current_dir(at).args(["--setup", "setup.toml", "--frames", "frames.y4m", "--to", &address]));
    let received = receiver.wait_with_output().expect("the receiver ends");
    assert!(received.status.success(), "{}", String::from_utf8_lossy(&received.stderr));

    let mut sessions = std::fs::read_dir(at.join("rides")).expect("rides").filter_map(Result::ok);
    let session = sessions.next().expect("a session").path();
    assert!(sessions.next().is_none(), "one session");

    let csv = at.join("poses.csv");
    done(gangway().arg("export").arg(&session).args(["--format", "csv", "--out"]).arg(&csv));
    let text = std::fs::read_to_string(&csv).expect("a table");
    let mut rows = text.lines();
    let header = rows.next().expect("a header");
    assert!(header.starts_with("frame,time_ns,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg,"), "{header}");
    assert!(header.ends_with(",residual_px,markers,flags"), "{header}");
    let rows: Vec<_> = rows.collect();
    assert_eq!(rows.len(), 80, "one row a frame");
    assert!(rows[0].starts_with("0,0,,,,,,,"), "a frame without a pose has its row: {}", rows[0]);
    assert!(rows[0].ends_with("waiting"), "and its flag: {}", rows[0]);

    let output =
        done(gangway().arg("evaluate").arg(&session).arg("--truth").arg(at.join("truth.csv")).arg("--json"));
    let json: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(json["frames"]["compared"], 71, "{json}");
    for picture in ["motions.svg", "motions.png", "deviations.svg", "deviations.png"] {
        let size = session.join("evaluation").join(picture).metadata().map_or(0, |file| file.len());
        assert!(size > 10_000, "{picture} has {size} bytes");
    }
}

#[test]
fn a_ping_reaches_the_running_bench_and_comes_back_with_both_clocks() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    simulate(at);
    let mut box_ = bench()
        .current_dir(at)
        .args(["--setup", "setup.toml", "--frames", "frames.y4m", "--to", "tcp://127.0.0.1:0"])
        .args(["--real-time", "--repeat", "1000"])
        .stderr(Stdio::piped())
        .spawn()
        .expect("the bench starts");
    let mut said = BufReader::new(box_.stderr.take().expect("its standard error"));
    let mut line = String::new();
    said.read_line(&mut line).expect("it says where it listens");
    let address =
        line.split_whitespace().find(|word| word.starts_with("tcp://")).expect("an address").to_owned();
    // Keep reading, so that it never waits for us.
    let reader = std::thread::spawn(move || said.read_to_end(&mut Vec::new()));

    let output = gangway().args(["send", "--to", &address, "ping"]).output().expect("gangway runs");
    let mark = gangway().args(["send", "--to", &address, "mark", "start"]).output().expect("gangway runs");
    box_.kill().expect("the bench is there");
    box_.wait().expect("the bench ends");
    let _ = reader.join();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(mark.status.success(), "{}", String::from_utf8_lossy(&mark.stderr));
}

#[test]
fn mistakes_get_one_sentence_and_the_right_exit_code() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    simulate(at);
    let run = |args: &[&str]| bench().current_dir(at).args(args).output().expect("the bench runs");
    let with = |setup: &str, frames: &str, to: &str| run(&["--setup", setup, "--frames", frames, "--to", to]);

    std::fs::create_dir(at.join("empty")).expect("a folder");
    sentence(&with("setup.toml", "empty", "file:out.gw"), 1);
    sentence(&with("setup.toml", "nowhere.y4m", "file:out.gw"), 1);
    sentence(&with("nowhere.toml", "frames.y4m", "file:out.gw"), 1);
    sentence(&with("setup.toml", "frames.y4m", "file:nowhere/out.gw"), 1);

    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = taken.local_addr().expect("its number").port();
    let said = sentence(&with("setup.toml", "frames.y4m", &format!("tcp://127.0.0.1:{port}")), 1);
    assert!(said.contains(&port.to_string()) && said.contains("in use"), "{said}");

    let output = with("setup.toml", "frames.y4m", "smoke-signal:hill");
    assert_eq!(output.status.code(), Some(2), "wrong use");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("write tcp://HOST:PORT"), "it says how an address is written: {said}");

    let setup = std::fs::read_to_string(at.join("setup.toml")).expect("a setup");
    std::fs::write(at.join("wide.toml"), setup.replace("width_px = 800", "width_px = 960")).expect("a setup");
    let said = sentence(&with("wide.toml", "frames.y4m", "file:out.gw"), 1);
    assert!(said.contains("800") && said.contains("960"), "both sizes: {said}");

    let frames = std::fs::read(at.join("frames.y4m")).expect("frames");
    std::fs::write(at.join("torn.y4m"), &frames[..frames.len() / 2]).expect("half of them");
    let output = with("setup.toml", "torn.y4m", "file:torn.gw");
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("cut off") && said.contains("frame 39"), "{said}");
    let decoded =
        done(gangway().current_dir(at).args(["export", "torn.gw", "--format", "csv", "--out", "-"]));
    assert_eq!(
        String::from_utf8_lossy(&decoded.stdout).lines().count(),
        1 + 39,
        "the frames before it are kept"
    );
}
