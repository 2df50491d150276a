use std::io::Write;
use std::net::{TcpListener, UdpSocket};
use std::sync::mpsc::channel;
use std::thread;

use super::*;
use crate::testing::{self, hello, ride};
use crate::{STREAM, Session};

fn quiet(_: &str) {}

/// Receives a file with these bytes.
fn receive(bytes: &[u8], into: &Path) -> Vec<Received> {
    let file = into.with_extension("gw");
    std::fs::write(&file, bytes).unwrap();
    let receiver = Receiver::open(&Address::File(file), into, Until::default()).unwrap();
    receiver.run(&AtomicBool::new(false), quiet, |_| ()).unwrap()
}

fn stream(one: &Received) -> Vec<u8> {
    std::fs::read(one.folder.join(STREAM)).unwrap()
}

#[test]
fn bytes_are_stored_as_they_came() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = ride(7, 120);
    let got = receive(&bytes, &dir.path().join("rides"));
    assert_eq!(got.len(), 1);
    assert_eq!(stream(&got[0]), bytes);
    assert!(got[0].folder.to_str().unwrap().ends_with("Z-ride-7"));
    assert_eq!((got[0].tally.frames, got[0].tally.poses, got[0].tally.wire.records), (120, 117, 244));
    let (session, recovery) = Session::open(&got[0].folder).unwrap();
    assert!(recovery.is_whole(), "{recovery}");
    assert_eq!(session.counts().unwrap(), got[0].tally);
    assert_eq!(session.seconds().len(), 3, "120 frames at 50 Hz reach into three seconds");
    assert_eq!(session.meta().unwrap().end.as_ref().unwrap().why, "end of input");
}

#[test]
fn a_line_without_records_is_told_once() {
    let dir = tempfile::tempdir().unwrap();
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let from = Address::Tcp(server.local_addr().unwrap().to_string());
    let noise = thread::spawn(move || server.accept().unwrap().0.write_all(&[0x55; 300_000]).unwrap());
    let until = Until { once: true, ..Until::default() };
    let mut said = Vec::new();
    let receiver = Receiver::open(&from, dir.path(), until).unwrap();
    receiver.run(&AtomicBool::new(false), |what| said.push(what.to_owned()), |_| ()).unwrap();
    noise.join().unwrap();
    assert_eq!(said.iter().filter(|what| what.contains("no record among them")).count(), 1, "{said:?}");
}

#[test]
fn a_folder_that_cannot_be_written_is_told_before_the_box_comes() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("notes.txt");
    std::fs::write(&file, "no folder").unwrap();
    let from: Address = "udp://127.0.0.1:0".parse().unwrap();
    let said = Receiver::open(&from, &file.join("rides"), Until::default()).unwrap_err().to_string();
    assert!(said.contains("cannot create") && said.contains("notes.txt/rides"), "{said}");
    let into = dir.path().join("rides");
    Receiver::open(&from, &into, Until::default()).unwrap();
    assert_eq!(std::fs::read_dir(into).unwrap().count(), 0, "the trial leaves nothing");
}

#[test]
fn a_later_version_of_the_wire_is_stored_and_said_but_not_read() {
    let dir = tempfile::tempdir().unwrap();
    let (file, into) = (dir.path().join("ride.gw"), dir.path().join("rides"));
    std::fs::write(&file, testing::foreign_ride()).unwrap();
    let mut said = Vec::new();
    let receiver = Receiver::open(&Address::File(file.clone()), &into, Until::default()).unwrap();
    let got = receiver.run(&AtomicBool::new(false), |what| said.push(what.to_owned()), |_| ()).unwrap();
    assert_eq!((got.len(), stream(&got[0])), (1, testing::foreign_ride()));
    let said: Vec<_> = said.iter().filter(|what| what.contains("version 2 of the wire")).collect();
    assert_eq!(said.len(), 1, "{said:?}");
    // Where the notes are gone, the stream tells.
    for gone in ["", "session.json", "index.gwi"] {
        let _ = std::fs::remove_file(got[0].folder.join(gone));
        let refused = Session::open(&got[0].folder).unwrap_err().to_string();
        assert!(
            refused.contains("version 2 of the wire, and this program reads version 1 only"),
            "{refused}"
        );
    }
    let refused = Session::open(&file).unwrap_err().to_string();
    assert!(refused.ends_with("version 1 only; take a newer gangway"), "{refused}");
}

#[test]
fn a_new_session_of_the_box_begins_a_new_folder() {
    let dir = tempfile::tempdir().unwrap();
    let rides = [ride(1, 60), ride(2, 5), ride(1, 10)];
    let got = receive(&rides.concat(), &dir.path().join("rides"));
    assert_eq!(got.iter().map(stream).collect::<Vec<_>>(), rides);
    for one in &got {
        let (session, recovery) = Session::open(&one.folder).unwrap();
        assert!(recovery.is_whole(), "{recovery}");
        assert_eq!(session.counts().unwrap(), one.tally);
        assert_eq!(one.tally.wire.missing, 0);
    }
    let capture = dir.path().join("rides.gw");
    let said = Session::open(capture).unwrap_err().to_string();
    assert!(said.contains("holds 2 sessions"), "{said}");
}

#[test]
fn a_stream_joined_in_the_middle_is_kept_from_its_first_byte() {
    let dir = tempfile::tempdir().unwrap();
    let (mut bytes, mut sequence) = (ride(3, 9)[400..].to_vec(), 30);
    let cut = bytes.len();
    testing::put(&mut bytes, &mut sequence, &hello(3));
    testing::put(&mut bytes, &mut sequence, &Record::Pose(testing::pose(9)));
    let got = receive(&bytes, &dir.path().join("rides"));
    assert_eq!(got.len(), 1);
    assert_eq!(stream(&got[0]), bytes);
    assert!(got[0].folder.to_str().unwrap().ends_with("Z-ride-3"), "renamed when Hello came");

    let got = receive(&bytes[..cut], &dir.path().join("rides"));
    assert!(got[0].folder.to_str().unwrap().ends_with("Z-unknown"));
    assert!(Session::open(&got[0].folder).unwrap().1.is_whole());
}

#[test]
fn rubbish_is_kept_and_counted() {
    let dir = tempfile::tempdir().unwrap();
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    for bytes in [vec![7; 20_000], vec![0; 100], (0..50_000).map(|_| random()).collect()] {
        let got = receive(&bytes, &dir.path().join("rides"));
        assert_eq!(stream(&got[0]), bytes);
        assert_eq!((got[0].tally.wire.records, got[0].tally.bytes), (0, bytes.len() as u64));
        assert_eq!(Session::open(&got[0].folder).unwrap().1.records, 0);
    }
    assert_eq!(receive(&[], &dir.path().join("rides")), []);
}

#[test]
fn damage_costs_only_what_it_touches() {
    let dir = tempfile::tempdir().unwrap();
    let mut bytes = ride(1, 50);
    let at = bytes.len() / 2;
    bytes[at] ^= 0x55;
    let got = receive(&bytes, &dir.path().join("rides"));
    let wire = got[0].tally.wire;
    assert!((1..=2).contains(&wire.damaged) && wire.records + 2 >= 104 && wire.missing <= 2, "{wire:?}");
    assert_eq!(Session::open(&got[0].folder).unwrap().0.counts().unwrap(), got[0].tally);
}

#[test]
fn a_dropped_connection_costs_only_its_unfinished_record() {
    let dir = tempfile::tempdir().unwrap();
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let from = Address::Tcp(server.local_addr().unwrap().to_string());
    let bytes = ride(5, 40);
    let (first, rest) = bytes.split_at(bytes.len() / 2);
    let whole = first.iter().rposition(|&byte| byte == 0).unwrap() + 1;
    assert!(whole < first.len(), "the cut lies within a record");
    let line = testing::ride(5, 0);
    let hello_end = line.iter().position(|&byte| byte == 0).unwrap() + 1;
    let next = rest.iter().position(|&byte| byte == 0).unwrap() + 1;
    let (head, tail) = (first.to_vec(), rest[next..].to_vec());
    let serve = thread::spawn(move || {
        server.accept().unwrap().0.write_all(&head).unwrap();
        let mut again = server.accept().unwrap().0;
        again.write_all(&line[..hello_end]).unwrap();
        again.write_all(&tail).unwrap();
    });
    let receiver = Receiver::open(&from, dir.path(), Until::default()).unwrap();
    let got = receiver.run(&AtomicBool::new(false), quiet, |_| ()).unwrap();
    serve.join().unwrap();
    assert_eq!(got.len(), 1, "the same session goes on in the same folder");
    assert_eq!(got[0].why, "the box ended");
    // The original's records, one of them damaged, and Hello once more.
    assert_eq!((got[0].tally.wire.records, got[0].tally.wire.damaged), (84 - 1 + 1, 1));
    assert_eq!(got[0].tally.bytes as usize, bytes.len() - next + 1 + hello_end);
}

#[test]
fn two_boxes_at_once_have_a_session_each() {
    let dir = tempfile::tempdir().unwrap();
    let servers: Vec<_> = (0..2).map(|_| TcpListener::bind("127.0.0.1:0").unwrap()).collect();
    let got: Vec<_> = thread::scope(|scope| {
        let running: Vec<_> = servers
            .iter()
            .zip(1u64..)
            .map(|(server, id)| {
                scope.spawn(move || server.accept().unwrap().0.write_all(&ride(id, 200)).unwrap());
                let from = Address::Tcp(server.local_addr().unwrap().to_string());
                let receiver = Receiver::open(&from, dir.path(), Until::default()).unwrap();
                scope.spawn(move || receiver.run(&AtomicBool::new(false), quiet, |_| ()).unwrap())
            })
            .collect();
        running.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    for (got, id) in got.iter().zip(1..) {
        assert_eq!(stream(&got[0]), ride(id, 200));
    }
}

#[test]
fn datagrams_are_received_and_a_second_sender_is_left_out() {
    let dir = tempfile::tempdir().unwrap();
    let from: Address = "udp://127.0.0.1:0".parse().unwrap();
    let receiver = Receiver::open(&from, dir.path(), Until::default()).unwrap();
    let to = receiver.local_address().unwrap();
    let bytes = ride(1, 20);
    let (told, tell) = channel();
    let run = {
        let running = move || {
            receiver.run(&AtomicBool::new(false), |what| told.send(what.to_owned()).unwrap(), |_| ()).unwrap()
        };
        thread::spawn(running)
    };
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    let other = UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut lines = bytes.split_inclusive(|&byte| byte == 0);
    sender.send_to(lines.next().unwrap(), to).unwrap();
    assert!(tell.recv().unwrap().contains("sends"));
    other.send_to(&ride(9, 1)[..100], to).unwrap();
    assert!(tell.recv().unwrap().contains("left out"));
    for line in lines {
        sender.send_to(line, to).unwrap();
    }
    let got = run.join().unwrap();
    assert_eq!((got.len(), stream(&got[0])), (1, bytes));
}

#[test]
fn a_box_that_connects_is_received_and_others_wait() {
    let dir = tempfile::tempdir().unwrap();
    let from: Address = "tcp-listen://127.0.0.1:0".parse().unwrap();
    let receiver = Receiver::open(&from, dir.path(), Until { once: true, ..Until::default() }).unwrap();
    let to = receiver.local_address().unwrap();
    let in_use = Address::TcpListen(to.to_string());
    let said = Receiver::open(&in_use, dir.path(), Until::default()).unwrap_err().to_string();
    assert!(said.contains("cannot listen there: another program has this port"), "{said}");
    let bytes = ride(1, 20);
    let without_end = bytes[..bytes.len() / 2].to_vec();
    let sent = without_end.clone();
    thread::spawn(move || std::net::TcpStream::connect(to).unwrap().write_all(&sent).unwrap());
    let got = receiver.run(&AtomicBool::new(false), quiet, |_| ()).unwrap();
    assert_eq!((got[0].why.as_str(), stream(&got[0])), ("the other side closed", without_end));
    assert!(got[0].tally.unfinished > 0);
}

#[test]
fn receiving_ends_when_the_time_is_up_and_when_it_is_told_to() {
    let dir = tempfile::tempdir().unwrap();
    let from: Address = "udp://127.0.0.1:0".parse().unwrap();
    let until = Until { duration: Some(Duration::from_millis(1)), ..Until::default() };
    let run = |until, stop| {
        let receiver = Receiver::open(&from, dir.path(), until).unwrap();
        receiver.run(&AtomicBool::new(stop), quiet, |_| ()).unwrap()
    };
    assert_eq!(run(until, false), []);
    assert_eq!(run(Until::default(), true), []);
}
