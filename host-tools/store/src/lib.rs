//! Sessions on disk: receive, decode, index, export.
//!
//! ```text
//! Address -> Source -> Receiver -> SessionWriter -> rides/SESSION/{stream.gw, index.gwi, session.json}
//! address.rs source.rs receive.rs  writer.rs                         |
//!                                     Session (session.rs, scan.rs) -+-> rows -> CSV, Parquet; text, JSON lines
//! ```
//!
//! The stream holds the bytes as they came and follows from nothing else; index and notes can be lost.

mod address;
mod command;
mod error;
mod export;
mod index;
mod meta;
mod parquet;
mod pieces;
mod receive;
mod rows;
mod scan;
mod session;
mod source;
mod tally;
#[cfg(test)]
mod testing;
mod text;
mod utc;
mod writer;

pub use address::{Address, DEFAULT_BAUD};
pub use command::{Answer, Command, send};
pub use error::StoreError;
pub use export::{Format, Rows};
/// Most bytes of a mark.
pub use gangway_wire::MAX_MARK;
pub use index::Entry;
pub use meta::{End, Meta, Sender};
pub use receive::{Received, Receiver, Until};
pub use rows::{MARKER_COLUMNS, MarkerRow, POSE_COLUMNS, PoseRow, flag_words, numbers};
pub use scan::{Found, Walk, walk};
pub use session::{INDEX, IndexState, Missing, Recovery, STREAM, Session};
pub use tally::{Tally, foreign_version};
pub use text::line;
pub use writer::{SYNC_PERIOD, SessionWriter};
