//! Records, framing and version: everything that box and host share. `WIRE.md` is the specification.
//!
//! A record goes out through [`encode`] and comes back through a [`Decoder`]:
//!
//! ```text
//! Record -> body (postcard) -> sequence, kind, body, CRC-32 -> COBS, delimiter -> line -> Decoder -> Decoded
//! record.rs  body.rs            frame.rs                        cobs.rs                    decoder.rs
//! ```
#![no_std]
#![forbid(unsafe_code)]

mod body;
mod cobs;
mod counts;
mod decoder;
mod event;
mod frame;
mod marker;
mod record;
mod short;
pub mod size;

pub use body::{BodyError, Record, decode_body, encode_body, kind};
pub use counts::Counts;
pub use decoder::{Damage, Decoded, Decoder};
pub use event::{Event, LostReason, MoveEvidence, What};
pub use frame::{EncodeError, encode, frame};
pub use marker::{Centres, MAX_MARKERS, Marker, Markers, PACKED_MARKER};
pub use record::{
    EXPOSURE_TO_LINE_BITS, Health, Hello, Histogram, LOOP_TIME_BUCKETS, Latency, MAX_FIRMWARE, MAX_MARK,
    MAX_NAME, MAX_SETUP_PIECE, Mark, Motion, Ping, Pong, Pose, PoseFlags, Rest, SetupPiece, TimeSync,
    WAKE_UP_BITS,
};
pub use size::{FRAME_LIMIT, MAX_FRAME};

/// Version of the wire that this crate writes. It is raised only by a change that an older decoder could not
/// read past; what is merely new (kinds, events, fields at the end of a record) does not raise it.
pub const WIRE_VERSION: u16 = 1;
