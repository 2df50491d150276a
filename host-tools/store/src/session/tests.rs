use std::fs::OpenOptions;

use super::*;
use crate::testing::{RATE, ride, ride_of};
use crate::{Address, Received, Receiver, SessionWriter, Until};

/// A session as receiving leaves it, of 3 s.
fn session(dir: &Path) -> Received {
    receive(dir, &ride(1, 3 * RATE as u32))
}

fn receive(dir: &Path, bytes: &[u8]) -> Received {
    let file = dir.join("ride.gw");
    fs::write(&file, bytes).unwrap();
    let receiver = Receiver::open(&Address::File(file), &dir.join("rides"), Until::default()).unwrap();
    receiver.run(&false.into(), |_| (), |_| ()).unwrap().remove(0)
}

fn cut(path: &Path, bytes: usize) {
    OpenOptions::new().write(true).open(path).unwrap().set_len(bytes as u64).unwrap();
}

/// Where each record ends.
fn ends(bytes: &[u8]) -> Vec<usize> {
    bytes.iter().enumerate().filter(|(_, byte)| **byte == 0).map(|(at, _)| at + 1).collect()
}

#[test]
fn a_stream_cut_at_any_byte_opens_and_loses_only_what_was_cut() {
    let dir = tempfile::tempdir().unwrap();
    // Three frames a second, so that a small session spans several entries of the index.
    let folder = receive(dir.path(), &ride_of(1, (0..150).step_by(17))).folder;
    let bytes = fs::read(folder.join(STREAM)).unwrap();
    let index = fs::read(folder.join(INDEX)).unwrap();
    let ends = ends(&bytes);
    let all = Session::open(&folder).unwrap().0.poses().unwrap();
    // From the end towards the start, as a cut file cannot grow again.
    for at in (0..bytes.len()).rev() {
        cut(&folder.join(STREAM), at);
        fs::write(folder.join(INDEX), &index).unwrap();
        let (session, recovery) = Session::open(&folder).unwrap();
        let whole = ends.partition_point(|end| *end <= at);
        assert_eq!((recovery.bytes, recovery.records), (at as u64, whole as u64), "cut at {at}");
        assert_eq!(recovery.unfinished as usize, at - whole.checked_sub(1).map_or(0, |i| ends[i]));
        let missing = recovery.missing.unwrap();
        assert_eq!(missing.bytes as usize, bytes.len() - at);
        assert_eq!(missing.records as usize, ends.len() - whole);
        let poses = session.poses().unwrap();
        assert_eq!(poses, all[..poses.len()]);
        assert!(session.counts().unwrap().wire.damaged == 0, "an unfinished record is not damage");
    }
}

#[test]
fn a_receiver_that_was_killed_leaves_a_session_that_opens() {
    let dir = tempfile::tempdir().unwrap();
    let folder = session(dir.path()).folder;
    let bytes = fs::read(folder.join(STREAM)).unwrap();
    let mut meta = Meta::read(&folder).unwrap();
    meta.end = None;
    meta.write(&folder).unwrap();
    // Power went after the index had reached the disk, the stream only in part.
    let known = Session::open(&folder).unwrap().0.seconds().to_vec();
    cut(&folder.join(STREAM), known[3].offset as usize - 10);
    let (session, recovery) = Session::open(&folder).unwrap();
    assert!(recovery.cut_off);
    let missing = recovery.missing.unwrap();
    assert_eq!((missing.bytes, missing.records), (11, known[3].records + 1 - recovery.records));
    // From the last frame to the end of the loop: one period, to the rounding of a double.
    assert!((missing.seconds - 0.02).abs() < 1e-9, "{missing:?}");
    assert!(recovery.to_string().contains("did not end properly"));
    assert_eq!(session.seconds(), &known[..3]);
    drop(session);
    assert!(Session::open(&folder).unwrap().1.missing.is_none(), "the index now fits the stream");
    assert!(bytes.starts_with(&fs::read(folder.join(STREAM)).unwrap()), "opening never writes the stream");
}

#[test]
fn an_index_cut_damaged_or_gone_is_made_again() {
    let dir = tempfile::tempdir().unwrap();
    let folder = session(dir.path()).folder;
    let path = folder.join(INDEX);
    let good = fs::read(&path).unwrap();
    for at in 0..good.len() {
        fs::write(&path, &good[..at]).unwrap();
        let (session, recovery) = Session::open(&folder).unwrap();
        assert_ne!(recovery.index, IndexState::Whole, "cut at {at}");
        assert_eq!(recovery.records, 3 + 300 + 1);
        drop(session);
        assert_eq!(fs::read(&path).unwrap(), good, "cut at {at}");
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        fs::write(&path, &bad).unwrap();
        assert_eq!(Session::open(&folder).unwrap().1.index, IndexState::Damaged, "damaged at {at}");
        assert_eq!(fs::read(&path).unwrap(), good);
    }
    fs::remove_file(&path).unwrap();
    assert_eq!(Session::open(&folder).unwrap().1.index, IndexState::Missing);
    assert_eq!(fs::read(&path).unwrap(), good);
    assert!(Session::open(&folder).unwrap().1.is_whole());
}

#[test]
fn an_index_of_another_stream_is_not_believed() {
    let dir = tempfile::tempdir().unwrap();
    let folder = session(dir.path()).folder;
    let good = fs::read(folder.join(INDEX)).unwrap();
    let other = [Entry { offset: 1001, records: 3, time_ns: 5, frame: 1 }];
    fs::write(folder.join(INDEX), index::to_bytes(&other)).unwrap();
    assert_eq!(Session::open(&folder).unwrap().1.index, IndexState::Damaged);
    assert_eq!(fs::read(folder.join(INDEX)).unwrap(), good);
}

#[test]
fn a_session_without_its_notes_opens() {
    let dir = tempfile::tempdir().unwrap();
    let one = session(dir.path());
    fs::write(one.folder.join(crate::meta::META), "{ not json").unwrap();
    let (session, recovery) = Session::open(&one.folder).unwrap();
    assert!(recovery.cut_off && session.meta().is_none());
    assert_eq!(session.counts().unwrap(), one.tally);
}

#[test]
fn a_session_that_is_being_received_is_refused_until_it_is_over() {
    let dir = tempfile::tempdir().unwrap();
    let mut writer = SessionWriter::create(dir.path(), "-", None).unwrap();
    writer.append(&ride(1, 10)).unwrap();
    let folder = writer.folder().to_owned();
    let said = Session::open(&folder).unwrap_err().to_string();
    assert!(said.contains(&std::process::id().to_string()) && said.contains("wait until"), "{said}");
    drop(writer);
    let (session, recovery) = Session::open(&folder).unwrap();
    assert!(recovery.cut_off);
    assert_eq!((session.poses().unwrap().len(), recovery.records), (10, 24));
}

#[test]
fn two_sessions_of_the_same_second_never_share_a_folder() {
    let dir = tempfile::tempdir().unwrap();
    let writers: Vec<_> = (0..5).map(|_| SessionWriter::create(dir.path(), "-", None).unwrap()).collect();
    let folders: BTreeSet<_> = writers.iter().map(|writer| writer.folder().to_owned()).collect();
    assert_eq!(folders.len(), 5);
}

#[test]
fn what_is_no_session_is_refused_in_one_sentence() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |path: &Path| Session::open(path).unwrap_err().to_string();
    assert!(refused(dir.path()).contains("holds no stream.gw"));
    assert!(refused(&dir.path().join("none")).contains("cannot open"));
    let file = dir.path().join("a.gw");
    fs::write(&file, "").unwrap();
    assert!(refused(&file).contains("is empty"));
    fs::write(&file, "frame,time_ns\n1,2\n").unwrap();
    assert!(refused(&file).contains("holds no record"));
}

#[test]
fn a_capture_opens_as_a_session() {
    let dir = tempfile::tempdir().unwrap();
    let one = session(dir.path());
    let (capture, recovery) = Session::open(dir.path().join("ride.gw")).unwrap();
    assert!(recovery.is_whole());
    assert_eq!(capture.counts().unwrap(), one.tally);
    assert_eq!(capture.poses().unwrap().len(), 150);
    assert_eq!(capture.markers().unwrap().len(), 5 * 150);
    assert_eq!(
        capture.setup_text().unwrap_err().to_string().split(": ").last().unwrap(),
        "holds only 1 of 2 pieces of the setup"
    );
    assert_eq!(capture.rest().unwrap(), None);
}
