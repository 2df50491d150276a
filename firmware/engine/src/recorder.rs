//! Records into the outbox: numbered, framed, never waiting. What does not fit is counted, and the loss is
//! itself recorded as soon as there is room.

use gangway_wire::{Event, MAX_FRAME, Record, What, encode};

use crate::{OutboxProducer, Packet};

/// Numbers and frames records for one session.
#[derive(Debug, Default)]
pub(crate) struct Recorder {
    sequence: u32,
    lost: u32,
    lost_unreported: u32,
    high_water: u16,
    frame: u32,
    time_ns: u64,
}

impl Recorder {
    /// The frame and time that the following events belong to.
    pub(crate) fn at(&mut self, frame: u32, time_ns: u64) {
        self.frame = frame;
        self.time_ns = time_ns;
    }

    /// Records lost since start.
    pub(crate) fn lost(&self) -> u32 {
        self.lost
    }

    /// Most records that ever waited.
    pub(crate) fn high_water(&self) -> u16 {
        self.high_water
    }

    /// Queues one record, or counts it as lost.
    pub(crate) fn put(&mut self, outbox: &mut OutboxProducer<'_>, record: &Record<'_>) {
        if self.lost_unreported > 0 && outbox.capacity() - outbox.len() >= 2 {
            let count = self.lost_unreported;
            self.lost_unreported = 0;
            let event =
                Event { frame: self.frame, time_ns: self.time_ns, what: What::QueueOverflow { count } };
            self.queue(outbox, &Record::Event(event));
        }
        self.queue(outbox, record);
    }

    /// Queues an event of the current frame.
    pub(crate) fn event(&mut self, outbox: &mut OutboxProducer<'_>, what: What<'_>) {
        let event = Event { frame: self.frame, time_ns: self.time_ns, what };
        self.put(outbox, &Record::Event(event));
    }

    fn queue(&mut self, outbox: &mut OutboxProducer<'_>, record: &Record<'_>) {
        // The number runs on for lost records too, so that the host sees the gap without reading the event.
        let sequence = self.sequence;
        self.sequence = self.sequence.wrapping_add(1);
        let exposed_ns = if let Record::Pose(pose) = record { pose.time_ns } else { 0 };
        let mut packet = Packet { kind: record.kind(), exposed_ns, ..Packet::default() };
        let framed = packet
            .bytes
            .resize_default(MAX_FRAME)
            .ok()
            .and_then(|()| encode(record, sequence, &mut packet.bytes).ok());
        let queued = framed.is_some_and(|length| {
            packet.bytes.truncate(length);
            outbox.enqueue(packet).is_ok()
        });
        if !queued {
            self.lost = self.lost.saturating_add(1);
            self.lost_unreported = self.lost_unreported.saturating_add(1);
        }
        self.high_water = self.high_water.max(outbox.len() as u16);
    }
}
