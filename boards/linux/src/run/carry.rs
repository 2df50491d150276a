//! The link thread: records out, commands and the board's own notices in.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::thread;
use std::time::Duration;

use gangway_engine::Command;
use gangway_link::{Carried, Courier, IDLE, Line};

use crate::Signals;
use crate::notice::{Notice, Notices, mark};

/// What is left at the end may take so long to be sent.
const PATIENCE: Duration = Duration::from_secs(3);

/// What was carried, and how many records nobody took.
pub(super) type Delivered = Result<(Carried, u64), gangway_link::Error>;

/// Carries until everything is sent.
pub(super) fn carry(
    mut courier: Courier<'_, Line>,
    said: &Receiver<Notice>,
    notices: &Notices,
    done: &AtomicBool,
    signals: &Signals,
    say: &(dyn Fn(&str) + Sync),
) -> Delivered {
    let mut waiting: Option<Command> = None;
    loop {
        let is_done = done.load(Ordering::Acquire);
        loop {
            let command = match waiting
                .take()
                .map_or_else(|| said.try_recv(), |command| Ok(Notice::Command(command)))
            {
                Ok(Notice::Log(sentence)) => {
                    say(&sentence);
                    continue;
                }
                Ok(Notice::Command(command)) => command,
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => break,
            };
            waiting = courier.command(command).err();
            if waiting.is_some() {
                break;
            }
        }
        if waiting.is_none() {
            let lost = notices.takes_lost();
            if lost > 0 {
                let told = mark(&format!("{lost} marks and notices are lost: too many at once"));
                waiting = courier.command(told).err();
            }
        }
        if is_done {
            break;
        }
        match courier.turn() {
            Ok(true) => {}
            Ok(false) => thread::sleep(IDLE),
            Err(error) => {
                signals.stop();
                return Err(error);
            }
        }
    }
    let unsent = courier.drain(PATIENCE)? as u64;
    Ok((courier.carried(), unsent))
}

#[cfg(test)]
mod tests {
    use gangway_engine::{Inbox, Outbox};
    use gangway_link::Address;

    use super::*;
    use crate::notice::SLOTS;

    #[test]
    fn marks_that_come_too_fast_are_told_by_their_count() {
        let place = tempfile::tempdir().unwrap();
        let (mut outbox, mut inbox) = (Box::new(Outbox::new()), Inbox::new());
        let ((_put, outbox), (inbox, mut take)) = (outbox.split(), inbox.split());
        let line = Address::File(place.path().join("box.gw")).open().unwrap();
        let (notices, said) = Notices::channel();
        for _ in 0..SLOTS + 5 {
            notices.log("again".to_owned());
        }
        let courier = Courier::new(outbox, inbox, line);
        carry(courier, &said, &notices, &AtomicBool::new(true), &Signals::default(), &|_| {}).unwrap();
        assert_eq!(take.dequeue(), Some(mark("5 marks and notices are lost: too many at once")));
        assert_eq!(take.dequeue(), None);
    }
}
