//! The bodies of the records: which kind has which number, and its fields through postcard.

use serde::{Deserialize, Serialize};

use crate::event::Event;
use crate::frame::{EncodeError, bounded};
use crate::marker::Markers;
use crate::record::*;

/// Numbers of the kinds. They never change and are never used again for something else.
pub mod kind {
    /// [`super::Hello`].
    pub const HELLO: u8 = 1;
    /// [`super::SetupPiece`].
    pub const SETUP: u8 = 2;
    /// [`super::Rest`].
    pub const REST: u8 = 3;
    /// [`super::Pose`].
    pub const POSE: u8 = 4;
    /// [`super::Markers`].
    pub const MARKERS: u8 = 5;
    /// [`super::Event`].
    pub const EVENT: u8 = 6;
    /// [`super::Health`].
    pub const HEALTH: u8 = 7;
    /// [`super::TimeSync`].
    pub const TIME_SYNC: u8 = 8;
    /// [`super::Pong`].
    pub const PONG: u8 = 9;
    /// Kinds from here up go from the host to the box.
    pub const FIRST_TO_BOX: u8 = 128;
    /// The box shall wait for rest again and set a new rest pose; an empty body.
    pub const SET_REST: u8 = 128;
    /// [`super::Mark`].
    pub const MARK: u8 = 129;
    /// [`super::Ping`].
    pub const PING: u8 = 130;
}

/// Any record.
#[derive(Clone, Debug, PartialEq)]
pub enum Record<'a> {
    /// Who sends.
    Hello(Hello<'a>),
    /// One piece of the setup's text.
    Setup(SetupPiece<'a>),
    /// The rest pose.
    Rest(Rest),
    /// The motion of one frame.
    Pose(Pose),
    /// The centres of one frame.
    Markers(Markers<'a>),
    /// What happened.
    Event(Event<'a>),
    /// How the box is doing.
    Health(Health),
    /// How its clock stands to UTC.
    TimeSync(TimeSync),
    /// Answer to a `Ping`.
    Pong(Pong),
    /// Host to box: wait for rest again and set a new rest pose.
    SetRest,
    /// Host to box: a mark in the records.
    Mark(Mark<'a>),
    /// Host to box: the host asks for the box's clock.
    Ping(Ping),
}

impl Record<'_> {
    /// Number of the record's kind, see [`kind`].
    pub fn kind(&self) -> u8 {
        match self {
            Record::Hello(_) => kind::HELLO,
            Record::Setup(_) => kind::SETUP,
            Record::Rest(_) => kind::REST,
            Record::Pose(_) => kind::POSE,
            Record::Markers(_) => kind::MARKERS,
            Record::Event(_) => kind::EVENT,
            Record::Health(_) => kind::HEALTH,
            Record::TimeSync(_) => kind::TIME_SYNC,
            Record::Pong(_) => kind::PONG,
            Record::SetRest => kind::SET_REST,
            Record::Mark(_) => kind::MARK,
            Record::Ping(_) => kind::PING,
        }
    }
}

/// Why a body gave no record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyError {
    /// Its kind, or its kind of event, is one that this version does not know: to be skipped.
    Newer,
    /// It is too short, a string is too long or not UTF-8, or its fields contradict each other.
    Malformed,
}

/// Writes the body of `record` into `out`; the bytes written.
///
/// # Errors
/// A string beyond its bound, `Markers` whose masks and bytes do not belong together, or too little room.
pub fn encode_body(record: &Record<'_>, out: &mut [u8]) -> Result<usize, EncodeError> {
    match record {
        Record::Hello(hello) => {
            bounded("name", hello.name, MAX_NAME)?;
            bounded("firmware", hello.firmware, MAX_FIRMWARE)?;
            put(hello, out)
        }
        Record::Setup(piece) => {
            bounded("setup piece", piece.text, MAX_SETUP_PIECE)?;
            put(piece, out)
        }
        Record::Rest(rest) => put(rest, out),
        Record::Pose(pose) => put(pose, out),
        Record::Markers(markers) if !markers.is_consistent() => Err(EncodeError::Masks),
        Record::Markers(markers) => put(markers, out),
        Record::Event(event) => event.encode(out),
        Record::Health(health) => put_health(health, out),
        Record::TimeSync(sync) => put(sync, out),
        Record::Pong(pong) => put(pong, out),
        Record::SetRest => Ok(0),
        Record::Mark(mark) => {
            bounded("mark", mark.text, MAX_MARK)?;
            put(mark, out)
        }
        Record::Ping(ping) => put(ping, out),
    }
}

/// Reads a body; the record, and whether bytes of a newer version follow its fields.
///
/// # Errors
/// See [`BodyError`].
pub fn decode_body(kind: u8, body: &[u8]) -> Result<(Record<'_>, bool), BodyError> {
    let (record, rest) = match kind {
        kind::HELLO => take(body).map(|(hello, rest)| (Record::Hello(hello), rest))?,
        kind::SETUP => take(body).map(|(piece, rest)| (Record::Setup(piece), rest))?,
        kind::REST => take(body).map(|(rest_pose, rest)| (Record::Rest(rest_pose), rest))?,
        kind::POSE => take(body).map(|(pose, rest)| (Record::Pose(pose), rest))?,
        kind::MARKERS => take(body).map(|(markers, rest)| (Record::Markers(markers), rest))?,
        kind::EVENT => Event::decode(body).map(|(event, rest)| (Record::Event(event), rest))?,
        kind::HEALTH => take_health(body).map(|(health, rest)| (Record::Health(health), rest))?,
        kind::TIME_SYNC => take(body).map(|(sync, rest)| (Record::TimeSync(sync), rest))?,
        kind::PONG => take(body).map(|(pong, rest)| (Record::Pong(pong), rest))?,
        kind::SET_REST => (Record::SetRest, body),
        kind::MARK => take(body).map(|(mark, rest)| (Record::Mark(mark), rest))?,
        kind::PING => take(body).map(|(ping, rest)| (Record::Ping(ping), rest))?,
        _ => return Err(BodyError::Newer),
    };
    // The bounds hold on both sides, so that a receiver's own buffers can be sized by them.
    let keeps_bounds = match &record {
        Record::Hello(hello) => hello.name.len() <= MAX_NAME && hello.firmware.len() <= MAX_FIRMWARE,
        Record::Setup(piece) => piece.text.len() <= MAX_SETUP_PIECE,
        Record::Markers(markers) => markers.is_consistent(),
        Record::Mark(mark) => mark.text.len() <= MAX_MARK,
        _ => true,
    };
    if keeps_bounds { Ok((record, !rest.is_empty())) } else { Err(BodyError::Malformed) }
}

/// `Health` as it was at first, and the latencies that came behind it.
fn put_health(health: &Health, out: &mut [u8]) -> Result<usize, EncodeError> {
    let length = put(health, out)?;
    match &health.latency {
        Some(latency) => Ok(length + put(latency, out.get_mut(length..).ok_or(EncodeError::Room)?)?),
        None => Ok(length),
    }
}

/// A body that ends before the latencies is of a box that did not count them yet.
fn take_health(body: &[u8]) -> Result<(Health, &[u8]), BodyError> {
    let (mut health, mut rest) = take::<Health>(body)?;
    if !rest.is_empty() {
        let (latency, behind) = take(rest)?;
        (health.latency, rest) = (Some(latency), behind);
    }
    Ok((health, rest))
}

/// Writes fields; the bytes written.
pub(crate) fn put<T: Serialize + ?Sized>(fields: &T, out: &mut [u8]) -> Result<usize, EncodeError> {
    // Room is all that can be missing: no field is of a length that postcard does not know beforehand.
    postcard::to_slice(fields, out).map(|written| written.len()).map_err(|_| EncodeError::Room)
}

/// Reads fields; them and what is behind them.
pub(crate) fn take<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<(T, &'a [u8]), BodyError> {
    postcard::take_from_bytes(body).map_err(|_| BodyError::Malformed)
}
