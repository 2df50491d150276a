//! TCP, UDP, serial and file behind the `Link` contract, once for every board.
//!
//! ```text
//! outbox -> Courier -> Link (TcpServer | TcpClient | Udp | Serial | FileLink) -> host
//! inbox  <- Courier <-
//! ```
//!
//! An [`Address`] opens a [`Line`]; a [`Courier`] in a thread of its own carries packets and commands.
//! Nothing here waits for the line, and the frame loop waits for nothing here: while a line is busy or nobody
//! listens, packets stay in the outbox, and the engine counts what no longer fits.

mod address;
mod client;
mod commands;
mod courier;
mod error;
mod file;
mod identity;
mod line;
mod program;
mod serial;
mod server;
mod udp;

pub use address::{Address, DEFAULT_BAUD};
pub use client::TcpClient;
pub use commands::Commands;
pub use courier::{Carried, Courier, IDLE};
pub use error::Error;
pub use file::FileLink;
pub use identity::identity;
pub use line::Line;
pub use program::Program;
pub use serial::Serial;
pub use server::{MAX_CLIENTS, TcpServer};
pub use udp::{MAX_DATAGRAM, Udp};
