//! What a listener needs before it can read anything else: `Hello`, the setup, the rest pose and the time.
//!
//! Sent at start, to every new listener, after every change and every ten seconds of frame time. The setup's
//! text goes out a few pieces a frame, so that poses never wait behind it.

use gangway_device::Clock;
use gangway_wire::{Hello, MAX_SETUP_PIECE, Record, SetupPiece, TimeSync, WIRE_VERSION};

use crate::recorder::Recorder;
use crate::rest::Found;
use crate::{Identity, OutboxProducer, Settings, report};

/// Announced again after this much frame time, ns.
const PERIOD_NS: u64 = 10_000_000_000;
/// Pieces of the setup sent in one step.
const PIECES_PER_STEP: usize = 2;

#[derive(Debug, Default)]
pub(crate) struct Announcer {
    greet: bool,
    /// Byte of the setup's text that the next piece starts with; `None` when all is sent.
    position: Option<usize>,
    due_ns: Option<u64>,
}

impl Announcer {
    /// Announce everything again: the greeting at once, then the setup, some pieces a step.
    pub(crate) fn restart(&mut self) {
        self.greet = true;
        self.position = Some(0);
    }

    /// Starts again when the period is over; the first one begins with the first frame.
    pub(crate) fn tick(&mut self, frame_time_ns: u64) {
        let due = *self.due_ns.get_or_insert(frame_time_ns.saturating_add(PERIOD_NS));
        if frame_time_ns >= due {
            self.due_ns = Some(frame_time_ns.saturating_add(PERIOD_NS));
            self.restart();
        }
    }

    /// Sends `Hello`, the time and the rest pose, if they are due.
    pub(crate) fn greet(
        &mut self,
        settings: &Settings,
        identity: &Identity,
        rest: Option<&Found>,
        clock: &impl Clock,
        recorder: &mut Recorder,
        outbox: &mut OutboxProducer<'_>,
    ) {
        if core::mem::take(&mut self.greet) {
            recorder.put(outbox, &hello(settings, identity));
            recorder.put(outbox, &time_sync(clock));
            if let Some(rest) = rest {
                recorder.put(outbox, &report::rest(rest));
            }
        }
    }

    /// Sends the pieces of the setup that are due in this step.
    pub(crate) fn step(
        &mut self,
        settings: &Settings,
        recorder: &mut Recorder,
        outbox: &mut OutboxProducer<'_>,
    ) {
        for _ in 0..PIECES_PER_STEP {
            self.next_piece(settings, recorder, outbox);
        }
    }

    /// Sends the pieces that are left at the session's end, as far as there is room for them beside `others`
    /// records: whoever has only what was sent cannot ask for them.
    pub(crate) fn finish(
        &mut self,
        settings: &Settings,
        others: usize,
        recorder: &mut Recorder,
        outbox: &mut OutboxProducer<'_>,
    ) {
        while self.position.is_some() && outbox.capacity() - outbox.len() > others {
            self.next_piece(settings, recorder, outbox);
        }
    }

    fn next_piece(&mut self, settings: &Settings, recorder: &mut Recorder, outbox: &mut OutboxProducer<'_>) {
        let Some(position) = self.position else { return };
        let piece = piece(settings, position);
        self.position = piece.as_ref().map(|(_, next)| *next);
        if let Some((record, _)) = piece {
            recorder.put(outbox, &record);
        }
    }
}

fn hello<'s>(settings: &'s Settings, identity: &Identity) -> Record<'s> {
    Record::Hello(Hello {
        wire_version: WIRE_VERSION,
        box_id: identity.box_id,
        boot_id: identity.boot_id,
        session_id: identity.session_id,
        name: &settings.name,
        firmware: identity.firmware,
        setup_digest: settings.digest,
    })
}

fn time_sync(clock: &impl Clock) -> Record<'static> {
    let offset = clock.utc_offset_ns();
    Record::TimeSync(TimeSync {
        time_ns: clock.now_ns(),
        utc_offset_ns: offset.map(|(offset, _)| offset),
        uncertainty_ns: offset.map_or(u64::MAX, |(_, uncertainty)| uncertainty),
    })
}

/// The piece that starts at byte `position` and where the next one starts; `None` behind the last.
///
/// Every piece but the last is cut at the last character boundary within `MAX_SETUP_PIECE`, so pieces are
/// numbered by walking from the start: a setup has at most a hundred.
fn piece(settings: &Settings, position: usize) -> Option<(Record<'_>, usize)> {
    let mut found = None;
    let mut count = 0u16;
    let mut start = 0;
    while let Some(text) = head(settings.text.get(start..)?) {
        if start == position {
            found = Some((count, text));
        }
        start += text.len();
        count += 1;
    }
    let (index, text) = found?;
    let record = Record::Setup(SetupPiece { digest: settings.digest, index, count, text });
    Some((record, position + text.len()))
}

/// The longest start of `text` that fits into a piece; `None` of nothing.
fn head(text: &str) -> Option<&str> {
    if text.is_empty() {
        return None;
    }
    let mut end = text.len().min(MAX_SETUP_PIECE);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text.get(..end)
}
