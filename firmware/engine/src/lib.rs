//! The frame loop: one step a frame.
#![no_std]
#![forbid(unsafe_code)]

mod outbox;
mod settings;

pub use outbox::{
    Command, INBOX_SLOTS, Inbox, InboxConsumer, InboxProducer, MAX_MARK, OUTBOX_SLOTS, Outbox,
    OutboxConsumer, OutboxProducer, Packet,
};
pub use settings::{Limits, RestSettings, Settings};

/// Longest setup text that the box carries and announces, bytes.
pub const MAX_SETUP_TEXT: usize = 16_384;
/// Longest name of a box, bytes.
pub const MAX_NAME: usize = 32;
