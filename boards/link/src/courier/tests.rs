//! The courier against a line of the test's own making, and over a real socket.

use std::cell::RefCell;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::rc::Rc;

use gangway_engine::{INBOX_SLOTS, Inbox, Outbox, Packet};
use gangway_wire::{MAX_FRAME, Mark, Ping, Record, encode};

use super::*;
use crate::TcpServer;

/// What a scripted line does and what came over it.
#[derive(Default)]
struct Script {
    /// Bytes that the line takes from now on.
    room: usize,
    is_connected: bool,
    connections: u32,
    sent: Vec<u8>,
    to_box: Vec<u8>,
}

#[derive(Clone, Default)]
struct Scripted(Rc<RefCell<Script>>);

impl Link for Scripted {
    type Error = Trouble;

    fn send(&mut self, bytes: &[u8]) -> Result<usize, Trouble> {
        let mut script = self.0.borrow_mut();
        if !script.is_connected {
            return Err(Trouble);
        }
        let count = bytes.len().min(script.room);
        script.room -= count;
        script.sent.extend_from_slice(&bytes[..count]);
        Ok(count)
    }

    fn receive(&mut self, into: &mut [u8]) -> Result<usize, Trouble> {
        let mut script = self.0.borrow_mut();
        let count = into.len().min(script.to_box.len());
        into[..count].copy_from_slice(&script.to_box[..count]);
        script.to_box.drain(..count);
        Ok(count)
    }

    fn connections(&self) -> u32 {
        self.0.borrow().connections
    }
}

#[derive(Debug)]
struct Trouble;

impl LinkError for Trouble {
    fn kind(&self) -> LinkErrorKind {
        LinkErrorKind::NotConnected
    }
}

fn packet(text: &[u8]) -> Packet {
    let mut packet = Packet::default();
    packet.bytes.extend_from_slice(text).unwrap();
    packet.bytes.push(0).unwrap();
    packet
}

fn line(record: &Record<'_>) -> Vec<u8> {
    let mut bytes = vec![0; MAX_FRAME];
    let length = encode(record, 0, &mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}

#[test]
fn a_record_that_was_begun_is_finished_before_the_next() {
    let (mut outbox, mut inbox) = (Outbox::new(), Inbox::new());
    let ((mut put, outbox), (inbox, _)) = (outbox.split(), inbox.split());
    let link = Scripted::default();
    let mut courier = Courier::new(outbox, inbox, link.clone());
    put.enqueue(packet(b"abc")).unwrap();
    put.enqueue(packet(b"de")).unwrap();
    link.0.borrow_mut().is_connected = true;
    while courier.left() > 0 {
        link.0.borrow_mut().room = 1;
        assert!(courier.turn().unwrap());
    }
    assert_eq!(link.0.borrow().sent, b"abc\0de\0");
    assert_eq!(courier.carried(), Carried { records: 2, bytes: 7, ..Carried::default() });
}

#[test]
fn a_lost_connection_costs_the_rest_of_one_record_and_the_next_is_announced_to() {
    let (mut outbox, mut inbox) = (Outbox::new(), Inbox::new());
    let ((mut put, outbox), (inbox, mut take)) = (outbox.split(), inbox.split());
    let link = Scripted::default();
    let mut courier = Courier::new(outbox, inbox, link.clone());
    for text in [&b"abc"[..], b"de", b"f"] {
        put.enqueue(packet(text)).unwrap();
    }
    *link.0.borrow_mut() = Script { room: 5, is_connected: true, connections: 1, ..Script::default() };
    courier.turn().unwrap();
    assert_eq!(link.0.borrow().sent, b"abc\0d");
    link.0.borrow_mut().is_connected = false;
    assert!(!courier.turn().unwrap());
    assert_eq!(take.dequeue(), Some(Command::Announce));
    *link.0.borrow_mut() = Script { room: 100, is_connected: true, connections: 2, ..Script::default() };
    courier.turn().unwrap();
    courier.turn().unwrap();
    assert_eq!(link.0.borrow().sent, b"f\0", "'e' alone would be no record");
    assert_eq!(take.dequeue(), Some(Command::Announce));
    assert_eq!(take.dequeue(), None);
    assert_eq!(courier.carried().cut, 1);
}

#[test]
fn while_nobody_listens_packets_stay_in_the_outbox() {
    let (mut outbox, mut inbox) = (Outbox::new(), Inbox::new());
    let ((mut put, outbox), (inbox, _)) = (outbox.split(), inbox.split());
    let mut courier = Courier::new(outbox, inbox, Scripted::default());
    let big = packet(&[7; 500]);
    let mut queued = 0;
    while put.enqueue(big.clone()).is_ok() {
        queued += 1;
        courier.turn().unwrap();
    }
    // One waits in the courier to be sent.
    assert_eq!(queued, put.capacity() + 1);
    assert_eq!(courier.left(), queued);
}

/// A record of a kind, as long as the longest of that kind with 28 circles is.
fn sized(kind: u8, frame: u32, length: usize) -> Packet {
    let mut packet =
        packet(&[&frame.to_be_bytes().map(|byte| byte + 1)[..], &vec![kind; length - 5]].concat());
    packet.kind = kind;
    packet
}

/// Plays 20 s at 50 frames/s over a line that takes `rate` bytes/s: poses and markers sent, and what the loop
/// is told.
fn over_a_line_of(rate: usize) -> (usize, usize, u32, Carried) {
    const FRAMES: u32 = 1_000;
    let (mut outbox, mut inbox) = (Box::new(Outbox::new()), Inbox::new());
    let ((mut put, outbox), (inbox, mut take)) = (outbox.split(), inbox.split());
    let link = Scripted::default();
    link.0.borrow_mut().is_connected = true;
    let mut courier = Courier::new(outbox, inbox, link.clone()).thinning();
    let mut told = 0;
    for frame in 0..FRAMES {
        // Bytes that do not look like a delimiter.
        let frame = frame % 100 * 0x0101;
        assert!(put.enqueue(sized(kind::POSE, frame, 70)).is_ok(), "no pose is lost");
        assert!(put.enqueue(sized(kind::MARKERS, frame, 290)).is_ok());
        link.0.borrow_mut().room += rate / 50;
        courier.turn().unwrap();
        while let Some(command) = take.dequeue() {
            let Command::Thinned { count } = command else { panic!("{command:?}") };
            told += count;
        }
    }
    link.0.borrow_mut().room = usize::MAX / 2;
    while courier.left() > 0 || courier.untold > 0 {
        courier.turn().unwrap();
        while let Some(Command::Thinned { count }) = take.dequeue() {
            told += count;
        }
    }
    let script = link.0.borrow();
    let records: Vec<&[u8]> = script.sent.split(|byte| *byte == 0).collect();
    let count = |kind: u8| records.iter().filter(|record| record.last() == Some(&kind)).count();
    (count(kind::POSE), count(kind::MARKERS), told, courier.carried())
}

#[test]
fn a_narrow_line_carries_every_pose_and_as_many_markers_as_fit() {
    // 115,200 baud; all of it would take 18,000 bytes/s, the poses alone 3,500.
    let (poses, markers, told, carried) = over_a_line_of(11_520);
    assert_eq!(poses, 1_000);
    assert!((500..700).contains(&markers), "27 of the 50 in a second fit: {markers}");
    assert_eq!(
        (u64::from(told), markers + told as usize),
        (carried.thinned, 1_000),
        "every one left out is told"
    );
}

#[test]
fn a_line_wide_enough_for_everything_is_never_thinned() {
    let (poses, markers, told, _) = over_a_line_of(23_040);
    assert_eq!((poses, markers, told), (1_000, 1_000, 0));
}

#[test]
fn commands_wait_for_room_in_the_inbox_and_none_is_lost() {
    let (mut outbox, mut inbox) = (Outbox::new(), Inbox::new());
    let ((_put, outbox), (inbox, mut take)) = (outbox.split(), inbox.split());
    let link = Scripted::default();
    let mut courier = Courier::new(outbox, inbox, link.clone());
    let count = 3 * INBOX_SLOTS as u32;
    for number in 0..count {
        link.0.borrow_mut().to_box.extend(line(&Record::Ping(Ping { number, host_time_ns: 0 })));
    }
    let mut next = 0;
    while next < count {
        courier.turn().unwrap();
        while let Some(command) = take.dequeue() {
            assert_eq!(command, Command::Ping { number: next, host_time_ns: 0 });
            next += 1;
        }
    }
    assert_eq!(courier.carried().commands, u64::from(count));
}

#[test]
fn a_garbled_command_is_counted() {
    let (mut outbox, mut inbox) = (Outbox::new(), Inbox::new());
    let ((_put, outbox), (inbox, mut take)) = (outbox.split(), inbox.split());
    let link = Scripted::default();
    let mut courier = Courier::new(outbox, inbox, link.clone());
    let mut garbled = line(&Record::SetRest);
    garbled[3] ^= 0x41;
    link.0.borrow_mut().to_box = [garbled, line(&Record::SetRest)].concat();
    courier.turn().unwrap();
    assert_eq!(take.dequeue(), Some(Command::SetRest));
    assert_eq!(take.dequeue(), None);
    assert_eq!(courier.heard().damaged, 1);
}

#[test]
fn over_a_socket_everything_arrives_and_commands_come_back() {
    let (mut outbox, mut inbox) = (Outbox::new(), Inbox::new());
    let ((mut put, outbox), (inbox, mut take)) = (outbox.split(), inbox.split());
    let server = TcpServer::bind("127.0.0.1", 0).unwrap();
    let at = server.local_addr();
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let box_side = scope.spawn(|| {
            let mut courier = Courier::new(outbox, inbox, server);
            courier.run(&stop, |error| panic!("{error}"));
            courier.drain(Duration::from_secs(60)).unwrap()
        });
        let host_side = scope.spawn(move || {
            let mut stream = TcpStream::connect(at).unwrap();
            stream.write_all(&line(&Record::Mark(Mark { text: "here" }))).unwrap();
            let mut got = Vec::new();
            stream.read_to_end(&mut got).unwrap();
            got
        });
        let mut commands = Vec::new();
        let mut sent = vec![0];
        for number in 0..2_000u32 {
            let record = packet(format!("record {number}").as_bytes());
            sent.extend_from_slice(&record.bytes);
            let mut record = Some(record);
            while let Some(again) = record.take() {
                record = put.enqueue(again).err();
                commands.extend(take.dequeue());
            }
        }
        while commands.len() < 2 {
            commands.extend(take.dequeue());
            thread::yield_now();
        }
        stop.store(true, Ordering::Release);
        assert_eq!(box_side.join().unwrap(), 0);
        assert_eq!(host_side.join().unwrap(), sent);
        assert!(commands.contains(&Command::Announce));
        assert!(commands.contains(&Command::Mark("here".try_into().unwrap())));
    });
}

#[test]
fn poses_are_timed_from_exposure_to_line_and_a_cut_one_is_not() {
    // Half a second after the start of the clock, so that times are told at once.
    const NOW_NS: u64 = 1_000_000_000;
    let (mut outbox, mut inbox) = (Outbox::new(), Inbox::new());
    let ((mut put, outbox), (inbox, mut take)) = (outbox.split(), inbox.split());
    let link = Scripted::default();
    let mut courier = Courier::new(outbox, inbox, link.clone()).timing(|| NOW_NS);
    let pose = |late_ms: u64| {
        let exposed_ns = NOW_NS - late_ms * 1_000_000;
        Packet { kind: kind::POSE, exposed_ns, ..packet(b"pose") }
    };
    for packet in [pose(30), packet(b"other"), pose(3), pose(70)] {
        put.enqueue(packet).unwrap();
    }
    // Both first poses, the record between them, and the half of the third.
    *link.0.borrow_mut() = Script { room: 5 + 6 + 5 + 2, is_connected: true, ..Script::default() };
    courier.turn().unwrap();
    link.0.borrow_mut().is_connected = false;
    courier.turn().unwrap();
    let Some(Command::Delivered(times)) = take.dequeue() else { panic!("times") };
    // From 2^(16 + 8) = 16.8 ms on, and from 2^(16 + 5) = 2.1 ms on.
    assert_eq!((times.counts[8], times.counts[5], times.total()), (1, 1, 2));
    assert_eq!(times.longest_ns, 30_000_000);
    assert_eq!(courier.carried().cut, 1);
    assert_eq!(take.dequeue(), None);
}

#[test]
fn a_log_has_every_record_while_nobody_listens_and_those_that_a_narrow_line_leaves_out() {
    let (mut outbox, mut inbox) = (Box::new(Outbox::new()), Inbox::new());
    let ((mut put, outbox), (inbox, mut take)) = (outbox.split(), inbox.split());
    let kept = std::sync::Mutex::new(Vec::<u8>::new());
    let link = Scripted::default();
    let mut courier = Courier::new(outbox, inbox, link.clone())
        .thinning()
        .keeping(|record| kept.lock().unwrap().extend(record));
    let mut all = Vec::new();
    // Nobody is connected: four times as many as the outbox holds.
    for i in 0..4 * OUTBOX_SLOTS {
        let packet = packet(format!("{i}").as_bytes());
        all.extend_from_slice(&packet.bytes);
        put.enqueue(packet).expect("the log makes room");
        courier.turn().unwrap();
    }
    let left_out = courier.carried().thinned;
    assert!(left_out > 3 * OUTBOX_SLOTS as u64, "{left_out}");
    assert_eq!(take.dequeue(), None, "told when somebody is there");
    *link.0.borrow_mut() = Script { room: usize::MAX, is_connected: true, ..Script::default() };
    courier.turn().unwrap();
    courier.turn().unwrap();
    assert_eq!(take.dequeue(), Some(Command::Thinned { count: left_out as u32 }));
    assert_eq!(*kept.lock().unwrap(), all);
    assert!(all.ends_with(&link.0.borrow().sent[2..]), "and the line has the latest");

    // A line that takes nothing any more: at the end the log has what waits.
    *link.0.borrow_mut() = Script { is_connected: true, ..Script::default() };
    for text in [&b"last"[..], b"two"] {
        put.enqueue(packet(text)).unwrap();
        all.extend_from_slice(text);
        all.push(0);
    }
    assert_eq!(courier.drain(Duration::ZERO).unwrap(), 2);
    assert_eq!(*kept.lock().unwrap(), all);
}
