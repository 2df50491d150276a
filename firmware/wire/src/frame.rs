//! A record on the line: COBS( sequence, kind, body, CRC-32 ) and a zero.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc, Table};

use crate::body::{Record, encode_body};
use crate::cobs;
use crate::size::{BODY_LIMIT, CHECK, HEAD};

/// CRC-32 as Ethernet, zlib and PNG compute it.
pub(crate) static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Why a record was not written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncodeError {
    /// A string is longer than its bound.
    TooLong {
        /// Which.
        what: &'static str,
        /// Its length, bytes.
        length: usize,
        /// The greatest length, bytes.
        limit: usize,
    },
    /// The masks and the packed bytes of `Markers` do not belong together.
    Masks,
    /// The buffer is too small; [`crate::MAX_FRAME`] bytes always suffice for a record.
    Room,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLong { what, length, limit } => {
                write!(f, "the {what} has {length} bytes; at most {limit} can be sent")
            }
            Self::Masks => f.write_str("the masks of the markers do not fit their centres"),
            Self::Room => f.write_str("the buffer is too small for the record"),
        }
    }
}

impl core::error::Error for EncodeError {}

/// Refuses a text that is longer than its bound.
pub(crate) fn bounded(what: &'static str, text: &str, limit: usize) -> Result<(), EncodeError> {
    let length = text.len();
    if length <= limit { Ok(()) } else { Err(EncodeError::TooLong { what, length, limit }) }
}

/// Writes `record` as a frame with the running number `sequence`, delimiter included; the bytes written.
///
/// # Errors
/// A string beyond its bound, inconsistent `Markers`, or an `out` that is too small; `out` is then of no use.
pub fn encode(record: &Record<'_>, sequence: u32, out: &mut [u8]) -> Result<usize, EncodeError> {
    let mut body = [0; BODY_LIMIT];
    let length = encode_body(record, &mut body)?;
    frame(record.kind(), body.get(..length).ok_or(EncodeError::Room)?, sequence, out)
}

/// Writes any kind and body as a frame, for tests and for records of other versions; see [`encode`].
///
/// # Errors
/// [`EncodeError::Room`] where `out` is too small or the frame would be longer than [`crate::FRAME_LIMIT`].
pub fn frame(kind: u8, body: &[u8], sequence: u32, out: &mut [u8]) -> Result<usize, EncodeError> {
    let mut raw = [0; HEAD + BODY_LIMIT + CHECK];
    let end = HEAD + body.len();
    raw.get_mut(..4).ok_or(EncodeError::Room)?.copy_from_slice(&sequence.to_le_bytes());
    *raw.get_mut(4).ok_or(EncodeError::Room)? = kind;
    raw.get_mut(HEAD..end).ok_or(EncodeError::Room)?.copy_from_slice(body);
    let check = CRC.checksum(raw.get(..end).ok_or(EncodeError::Room)?);
    raw.get_mut(end..end + CHECK).ok_or(EncodeError::Room)?.copy_from_slice(&check.to_le_bytes());
    cobs::stuff(raw.get(..end + CHECK).ok_or(EncodeError::Room)?, out).ok_or(EncodeError::Room)
}
