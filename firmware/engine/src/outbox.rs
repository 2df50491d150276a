//! What leaves the frame loop and what comes in: bounded queues that never block it.

use gangway_wire::{Histogram, MAX_FRAME, MAX_MARK};
use heapless::{String, Vec, spsc};

/// Framed records that may wait for the link: about 2.5 s at 50 frames/s.
pub const OUTBOX_SLOTS: usize = 256;
/// Commands that may wait for the next frame.
pub const INBOX_SLOTS: usize = 16;

/// One framed record, ready for the line, delimiter included.
#[derive(Clone, Debug, Default)]
pub struct Packet {
    /// Kind of the record, so that a narrow line can thin by kind.
    pub kind: u8,
    /// Mid-exposure of the frame that a `Pose` belongs to, ns, so that the link can tell how late it is; 0
    /// for others.
    pub exposed_ns: u64,
    /// The framed bytes.
    pub bytes: Vec<u8, MAX_FRAME>,
}

/// What the host or the link asks of the frame loop.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Wait for rest again and set a new rest pose.
    SetRest,
    /// Put this text into the records.
    Mark(String<MAX_MARK>),
    /// Answer with both clocks.
    Ping {
        /// Number of the ping.
        number: u32,
        /// The host's clock, ns.
        host_time_ns: u64,
    },
    /// Somebody new listens: send `Hello` and what follows it.
    Announce,
    /// The line is too narrow for everything: the link left out so many records.
    Thinned {
        /// Records left out since the last such command.
        count: u32,
    },
    /// The link handed poses to the line: how long after their exposures, since the last such command.
    Delivered(Histogram),
    /// The link received a command that it cannot hand on.
    Refused {
        /// Kind of the record.
        kind: u8,
    },
}

/// Queue of packets between frame loop and link thread.
pub type Outbox = spsc::Queue<Packet, OUTBOX_SLOTS>;
/// The frame loop's end of the outbox.
pub type OutboxProducer<'a> = spsc::Producer<'a, Packet>;
/// The link thread's end of the outbox.
pub type OutboxConsumer<'a> = spsc::Consumer<'a, Packet>;
/// Queue of commands between link thread and frame loop.
pub type Inbox = spsc::Queue<Command, INBOX_SLOTS>;
/// The link thread's end of the inbox.
pub type InboxProducer<'a> = spsc::Producer<'a, Command>;
/// The frame loop's end of the inbox.
pub type InboxConsumer<'a> = spsc::Consumer<'a, Command>;
