//! What the board itself has to say: marks into the records and sentences for the log, never waiting.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use gangway_engine::{Command, MAX_MARK};

/// Notices that may wait; what comes beyond them is dropped and counted.
pub(crate) const SLOTS: usize = 64;

/// One thing to say.
#[derive(Clone, Debug, PartialEq)]
pub enum Notice {
    /// A command for the frame loop: a mark in the records, or what a button asks.
    Command(Command),
    /// A sentence for the log alone.
    Log(String),
}

/// The end that says; it can be cloned for every thread.
#[derive(Clone, Debug)]
pub struct Notices {
    give: SyncSender<Notice>,
    lost: Arc<AtomicU32>,
}

impl Notices {
    /// Both ends.
    pub fn channel() -> (Self, Receiver<Notice>) {
        let (give, take) = sync_channel(SLOTS);
        (Self { give, lost: Arc::default() }, take)
    }

    /// Puts a text into the records, cut to what a mark holds. Neither waits nor allocates.
    pub fn mark(&self, text: &str) {
        self.command(mark(text));
    }

    /// Gives the frame loop a command.
    pub fn command(&self, command: Command) {
        self.give(Notice::Command(command));
    }

    /// Says a sentence in the log.
    pub fn log(&self, sentence: String) {
        self.give(Notice::Log(sentence));
    }

    fn give(&self, notice: Notice) {
        // Full: whoever should listen is overwhelmed, and this thread must not wait for it.
        if self.give.try_send(notice).is_err() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// How many were dropped since this was asked last.
    pub(crate) fn takes_lost(&self) -> u32 {
        self.lost.swap(0, Ordering::Relaxed)
    }
}

/// A mark, its text cut to what it holds.
pub(crate) fn mark(text: &str) -> Command {
    let mut end = text.len().min(MAX_MARK);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    Command::Mark(heapless::String::try_from(text.get(..end).unwrap_or_default()).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_mark_is_cut_at_a_letter_and_a_flood_never_waits() {
        let (notices, taken) = Notices::channel();
        notices.mark(&"ä".repeat(40));
        for _ in 0..2 * SLOTS {
            notices.log("again".to_owned());
        }
        let Ok(Notice::Command(Command::Mark(text))) = taken.recv() else { panic!("a mark") };
        assert_eq!(text.as_str(), "ä".repeat(32));
        assert_eq!(taken.try_iter().count(), SLOTS - 1);
        assert_eq!((notices.takes_lost(), notices.takes_lost()), (SLOTS as u32 + 1, 0), "counted once");
    }
}
