//! The link thread: records out, commands and the board's own notices in.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::thread;
use std::time::Duration;

use gangway_engine::Command;
use gangway_link::{Carried, Courier, IDLE, Line};

use crate::Signals;
use crate::notice::Notice;

/// What is left at the end may take so long to be sent.
const PATIENCE: Duration = Duration::from_secs(3);

/// What was carried, and how many records nobody took.
pub(super) type Delivered = Result<(Carried, u64), gangway_link::Error>;

/// Carries until everything is sent.
pub(super) fn carry(
    mut courier: Courier<'_, Line>,
    said: &Receiver<Notice>,
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
