//! The streaming decoder: bytes in any portions in, records and counted damage out. One copy, no allocation.

use core::fmt;

use crate::body::{BodyError, Record, decode_body};
use crate::cobs::Unstuff;
use crate::counts::{Counts, Sequence};
use crate::frame::CRC;
use crate::size::{BODY_LIMIT, CHECK, HEAD};

/// Longest frame before stuffing.
const RAW_LIMIT: usize = HEAD + BODY_LIMIT + CHECK;

/// What the decoder found.
#[derive(Clone, Debug, PartialEq)]
pub enum Decoded<'d> {
    /// A record.
    Record {
        /// Its running number.
        sequence: u32,
        /// Number of its kind.
        kind: u8,
        /// Its body as it was on the line, for comparisons without the running number.
        body: &'d [u8],
        /// The record.
        record: Record<'d>,
        /// Whether fields of a newer version follow those that this version knows.
        newer: bool,
    },
    /// A sound frame of a kind, or with a kind of event, that this version does not know.
    Newer {
        /// Its running number.
        sequence: u32,
        /// Number of its kind.
        kind: u8,
        /// Its body as it was on the line.
        body: &'d [u8],
    },
    /// A frame that is lost.
    Damaged(Damage),
}

/// Why a frame is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// It ends inside a block of its stuffing.
    Stuffing,
    /// It is shorter than any frame.
    Short,
    /// It is longer than [`crate::FRAME_LIMIT`] allows; said once, at the byte that is too much.
    TooLong,
    /// Its CRC does not fit.
    Check,
    /// Its CRC fits, but its body makes no sense: the sender is at fault.
    Body {
        /// Its running number.
        sequence: u32,
        /// Number of its kind.
        kind: u8,
    },
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stuffing => f.write_str("a frame ends in the middle"),
            Self::Short => f.write_str("a frame is shorter than any record"),
            Self::TooLong => f.write_str("a frame is longer than any record"),
            Self::Check => f.write_str("the checksum of a frame does not fit"),
            Self::Body { sequence, kind } => {
                write!(f, "the body of record {sequence} (kind {kind}) makes no sense")
            }
        }
    }
}

/// Takes the bytes of a line in any portions and gives back what they say.
///
/// ```
/// use gangway_wire::{Decoded, Decoder, MAX_FRAME, Record, encode};
///
/// let mut line = [0; MAX_FRAME];
/// let length = encode(&Record::SetRest, 7, &mut line).unwrap();
/// let mut decoder = Decoder::new();
/// let mut rest = &line[..length];
/// while !rest.is_empty() {
///     let (decoded, behind) = decoder.feed(rest);
///     rest = behind;
///     if let Some(Decoded::Record { sequence, record, .. }) = decoded {
///         assert_eq!((sequence, record), (7, Record::SetRest));
///     }
/// }
/// assert_eq!(decoder.counts().records, 1);
/// ```
#[derive(Clone, Debug)]
pub struct Decoder {
    raw: [u8; RAW_LIMIT],
    /// Bytes in `raw`.
    length: usize,
    /// Bytes on the line since the last delimiter, none but zero or not: an empty frame says nothing.
    is_empty: bool,
    /// The frame was too long: what is left of it is passed over.
    is_skipping: bool,
    unstuff: Unstuff,
    sequence: Sequence,
    counts: Counts,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder at the start of a line.
    pub fn new() -> Self {
        Self {
            raw: [0; RAW_LIMIT],
            length: 0,
            is_empty: true,
            is_skipping: false,
            unstuff: Unstuff::default(),
            sequence: Sequence::default(),
            counts: Counts::default(),
        }
    }

    /// What was met so far.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Takes bytes up to the end of the next frame. Gives back what that frame says, `None` where the bytes
    /// end first, and the bytes behind it: to be called until they are empty.
    pub fn feed<'d, 'b>(&'d mut self, bytes: &'b [u8]) -> (Option<Decoded<'d>>, &'b [u8]) {
        let mut left = bytes.iter();
        while let Some(&byte) = left.next() {
            if byte == 0 {
                if let Some(found) = self.end() {
                    return (Some(self.open(found)), left.as_slice());
                }
            } else if self.take(byte).is_err() {
                self.counts.damaged += 1;
                return (Some(Decoded::Damaged(Damage::TooLong)), left.as_slice());
            }
        }
        (None, &[])
    }

    /// The line is at its end (a file's end, a connection closed): gives back the damage if that is in the
    /// middle of a frame. The decoder can then take another connection's bytes; its counts and running
    /// numbers go on.
    pub fn finish(&mut self) -> Option<Damage> {
        let is_open = !self.is_empty && !self.is_skipping;
        self.begin();
        if !is_open {
            return None;
        }
        self.counts.damaged += 1;
        Some(Damage::Stuffing)
    }

    fn begin(&mut self) {
        self.length = 0;
        self.is_empty = true;
        self.is_skipping = false;
        self.unstuff = Unstuff::default();
    }

    /// Takes a byte that is not a delimiter; an error where the frame becomes too long by it.
    fn take(&mut self, byte: u8) -> Result<(), ()> {
        self.is_empty = false;
        if self.is_skipping {
            return Ok(());
        }
        let Some(byte) = self.unstuff.take(byte) else { return Ok(()) };
        let Some(slot) = self.raw.get_mut(self.length) else {
            self.is_skipping = true;
            return Err(());
        };
        *slot = byte;
        self.length += 1;
        Ok(())
    }

    /// Takes a delimiter; the length of the frame before it or its damage, `None` where there is nothing to
    /// say.
    fn end(&mut self) -> Option<Result<usize, Damage>> {
        let silent = self.is_empty || self.is_skipping;
        let found = if self.unstuff.may_end() { Ok(self.length) } else { Err(Damage::Stuffing) };
        self.begin();
        (!silent).then_some(found)
    }

    /// Reads the frame and counts it.
    fn open(&mut self, found: Result<usize, Damage>) -> Decoded<'_> {
        let opened = found.and_then(|length| open(self.raw.get(..length).unwrap_or_default()));
        let (sequence, kind, body) = match opened {
            Ok(sound) => sound,
            Err(damage) => {
                self.counts.damaged += 1;
                return Decoded::Damaged(damage);
            }
        };
        let decoded = decode_body(kind, body);
        let session = match &decoded {
            Ok((Record::Hello(hello), _)) => Some(hello.session_id),
            _ => None,
        };
        self.sequence.note(sequence, session, &mut self.counts);
        match decoded {
            Ok((record, newer)) => {
                self.counts.records += 1;
                self.counts.extended += u64::from(newer);
                Decoded::Record { sequence, kind, body, record, newer }
            }
            Err(BodyError::Newer) => {
                self.counts.newer += 1;
                Decoded::Newer { sequence, kind, body }
            }
            Err(BodyError::Malformed) => {
                self.counts.damaged += 1;
                self.counts.malformed += 1;
                Decoded::Damaged(Damage::Body { sequence, kind })
            }
        }
    }
}

/// Checks a frame without its stuffing; its sequence, kind and body.
fn open(raw: &[u8]) -> Result<(u32, u8, &[u8]), Damage> {
    let (checked, check) = raw.split_last_chunk().ok_or(Damage::Short)?;
    let (sequence, behind) = checked.split_first_chunk().ok_or(Damage::Short)?;
    let (&kind, body) = behind.split_first().ok_or(Damage::Short)?;
    if CRC.checksum(checked) != u32::from_le_bytes(*check) {
        return Err(Damage::Check);
    }
    Ok((u32::from_le_bytes(*sequence), kind, body))
}
