//! The same recording gives the same records, byte for byte, at any rate and in any portions.

use std::ops::ControlFlow;
use std::path::Path;
use std::process::Output;

use e2e::bench;
use gangway_scene::{Format, Scene};
use gangway_wire::{Decoded, Decoder, Record, What};

/// Number of kind and body of every record that frames alone decide.
fn frame_records(capture: &[u8], portion: usize) -> Vec<(u8, Vec<u8>)> {
    let mut decoder = Box::new(Decoder::new());
    let mut records = Vec::new();
    for mut bytes in capture.chunks(portion) {
        while !bytes.is_empty() {
            let (decoded, rest) = decoder.feed(bytes);
            bytes = rest;
            if let Some(Decoded::Record { kind, body, record, .. }) = decoded
                && is_of_frames(&record)
            {
                let entry = (kind, body.to_vec());
                // A rest pose comes again with every announcement.
                if !(matches!(record, Record::Rest(_)) && records.contains(&entry)) {
                    records.push(entry);
                }
            }
        }
    }
    assert_eq!(decoder.counts().damaged, 0);
    records
}

/// Clocks, loop times and who connected when differ from run to run; what the frames caused does not.
fn is_of_frames(record: &Record<'_>) -> bool {
    match record {
        Record::Pose(_) | Record::Markers(_) | Record::Rest(_) => true,
        Record::Event(event) => !matches!(event.what, What::QueueOverflow { .. }),
        _ => false,
    }
}

fn same(found: &[(u8, Vec<u8>)], wanted: &[(u8, Vec<u8>)], when: &str) {
    let first = found.iter().zip(wanted).position(|(found, wanted)| found != wanted);
    assert_eq!(first, None, "the first record that differs {when}");
    assert_eq!(found.len(), wanted.len(), "records {when}");
}

fn play(folder: &Path, to: &str, more: &[&str]) -> Vec<u8> {
    let capture = folder.join(to);
    let output: Output = bench()
        .arg("--setup")
        .arg(folder.join("setup.toml"))
        .arg("--frames")
        .arg(folder.join("frames.y4m"))
        .arg("--to")
        .arg(format!("file:{}", capture.display()))
        .args(more)
        .output()
        .expect("the bench runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    std::fs::read(capture).expect("a capture")
}

#[test]
fn the_same_recording_gives_the_same_bytes_at_any_rate_and_in_any_portions() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = Scene::parse(include_str!("scenes/short.toml"), "short.toml").expect("the scene is right");
    scene.write(folder.path(), Format::Y4m, |_| ControlFlow::Continue(())).expect("the scene is written");

    let first = play(folder.path(), "first.gw", &[]);
    let records = frame_records(&first, 4096);
    assert!(records.len() > 2 * 80, "poses and markers of 80 frames: {}", records.len());
    same(&frame_records(&first, 1), &records, "in portions of 1 byte");
    same(&frame_records(&first, 7), &records, "in portions of 7 bytes");

    let again = play(folder.path(), "again.gw", &["--session-id", "77"]);
    same(&frame_records(&again, 4096), &records, "in a second run");
    let paced = play(folder.path(), "paced.gw", &["--real-time"]);
    same(&frame_records(&paced, 4096), &records, "at the recorded rate");
}
