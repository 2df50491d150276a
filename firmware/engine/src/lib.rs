//! The frame loop: one [`Engine::step`] a frame, short enough to read as the flow.
//!
//! ```text
//! Camera -> Frame -> windows -> rings -> pose -> motion -> records -> Outbox -> (link thread) -> host
//!           arrive   '------ measure -------'    relate    record
//! ```
//!
//! A step never allocates, never panics, writes no text and waits nowhere but for the camera's next frame.
//! Clock, camera, lamps and the two queues are passed in; nothing else is touched.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod acquire;
mod announce;
mod carbody;
mod engine;
mod expose;
mod health;
mod keep;
mod lamp;
mod layout;
mod light;
mod lit;
mod mount;
mod moved;
mod outbox;
mod own;
mod predict;
mod recorder;
mod report;
mod rest;
mod settings;
mod visibility;
mod windows;

pub use engine::{Board, Engine, Identity, Look, MAX_RECORDS_PER_STEP, Step};
pub use expose::AutoExposure;
pub use gangway_wire::{MAX_MARK, MAX_NAME};
pub use lamp::{LAMP_MARGIN_S, LampMode};
pub use outbox::{
    Command, INBOX_SLOTS, Inbox, InboxConsumer, InboxProducer, OUTBOX_SLOTS, Outbox, OutboxConsumer,
    OutboxProducer, Packet,
};
pub use rest::MAX_REST_FRAMES;
pub use settings::{Limits, RestSettings, Settings};

/// Longest setup text that the box carries and announces, bytes.
pub const MAX_SETUP_TEXT: usize = 16_384;
