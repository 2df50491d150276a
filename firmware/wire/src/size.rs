//! How long a record can be on the line: the worst case of every kind, derived from its fields and checked at
//! compile time.

use crate::cobs;
use crate::marker::{MAX_MARKERS, PACKED_MARKER};
use crate::record::{LOOP_TIME_BUCKETS, MAX_FIRMWARE, MAX_MARK, MAX_NAME, MAX_SETUP_PIECE};

/// Sequence and kind, in front of every body.
pub(crate) const HEAD: usize = 4 + 1;
/// The CRC-32 behind every body.
pub(crate) const CHECK: usize = 4;

/// No frame of this wire version will ever be longer, delimiter included: a decoder with room for that much
/// can tell a newer record from damage.
pub const FRAME_LIMIT: usize = 1024;
/// Longest body that keeps [`FRAME_LIMIT`].
pub(crate) const BODY_LIMIT: usize = 1009;

// Variable-length integers at their longest, and the tag of an optional field.
const VAR_16: usize = 3;
const VAR_32: usize = 5;
const VAR_64: usize = 10;
const TAG: usize = 1;

/// A string of at most `limit` bytes with its length, which takes one byte up to 127 and two up to 16,383.
const fn text(limit: usize) -> usize {
    (if limit < 128 { 1 } else { 2 }) + limit
}

/// Bytes on the line for a body of `body` bytes: head, check, stuffing and delimiter included.
pub const fn framed(body: usize) -> usize {
    let raw = HEAD + body + CHECK;
    raw + cobs::overhead(raw) + 1
}

/// Longest `Hello`: version, three ids, name, firmware, digest.
pub const HELLO: usize = framed(VAR_16 + 3 * 8 + text(MAX_NAME) + text(MAX_FIRMWARE) + 16);
/// Longest `Setup`: digest, index, count, text.
pub const SETUP: usize = framed(16 + 2 * VAR_16 + text(MAX_SETUP_PIECE));
/// Longest `Rest`: interval, frames, rotation, translation, covariance.
pub const REST: usize = framed(2 * VAR_32 + VAR_16 + 4 * 8 + 3 * 8 + 21 * 4);
/// Longest `Pose`: frame, time, flags, markers, tag, displacement, rotation, sigmas, residual.
pub const POSE: usize = framed(VAR_32 + 8 + VAR_16 + 1 + TAG + 3 * 4 + 3 * 4 + 6 * 2 + 2);
/// Longest `Event`: frame, time, number, text of a mark.
pub const EVENT: usize = framed(VAR_32 + 8 + 1 + text(MAX_MARK));
/// A histogram: its counts and the longest time.
const HISTOGRAM: usize = LOOP_TIME_BUCKETS * VAR_16 + VAR_32;

/// Longest `Health`: time, three counts, high water, loop times, temperature, free space, two latencies.
pub const HEALTH: usize = framed(8 + 3 * VAR_32 + VAR_16 + 3 * HISTOGRAM + (TAG + VAR_16) + (TAG + VAR_64));
/// Longest `TimeSync`: time, offset, uncertainty.
pub const TIME_SYNC: usize = framed(8 + (TAG + VAR_64) + VAR_64);
/// Longest `Pong`: number and two times.
pub const PONG: usize = framed(VAR_32 + 2 * 8);
/// `SetRest` has no fields.
pub const SET_REST: usize = framed(0);
/// Longest `Mark`: its text.
pub const MARK: usize = framed(text(MAX_MARK));
/// Longest `Ping`: number and time.
pub const PING: usize = framed(VAR_32 + 8);

/// Longest `Markers` with `circles` visible: frame, two masks, length, centres.
pub const fn markers(circles: usize) -> usize {
    framed(VAR_32 + 2 * VAR_64 + text(circles * PACKED_MARKER))
}

/// Longest frame over all kinds, delimiter included: a buffer of this size takes any record.
pub const MAX_FRAME: usize = {
    let all = [
        HELLO,
        SETUP,
        REST,
        POSE,
        markers(MAX_MARKERS),
        EVENT,
        HEALTH,
        TIME_SYNC,
        PONG,
        SET_REST,
        MARK,
        PING,
    ];
    let mut longest = 0;
    let mut i = 0;
    while i < all.len() {
        if all[i] > longest {
            longest = all[i];
        }
        i += 1;
    }
    longest
};

const _: () = assert!(framed(BODY_LIMIT) <= FRAME_LIMIT && framed(BODY_LIMIT + 1) > FRAME_LIMIT);
const _: () = assert!(MAX_FRAME <= FRAME_LIMIT);
// The line's budget: see the test of the serial line's load.
const _: () = assert!(POSE <= 72);
const _: () = assert!(markers(15) <= 175);
