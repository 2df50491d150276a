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
