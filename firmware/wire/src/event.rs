//! What happened: events and their numbers on the wire, which are given here, pinned by `WIRE.md`, and never
//! change.

use serde::{Deserialize, Serialize};

use crate::body::{BodyError, put, take};
use crate::frame::{EncodeError, bounded};
use crate::record::MAX_MARK;

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event<'a> {
    /// The frame it belongs to.
    pub frame: u32,
    /// Monotonic clock, ns.
    pub time_ns: u64,
    /// What happened.
    pub what: What<'a>,
}

/// Kinds of event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum What<'a> {
    /// The frame loop started.
    Started,
    /// The frame loop ended properly.
    Ended,
    /// A circle that was seen is not seen any more.
    MarkerLost {
        /// Index of the circle.
        circle: u8,
        /// Why.
        reason: LostReason,
    },
    /// A circle that was lost is seen again.
    MarkerFound {
        /// Index of the circle.
        circle: u8,
    },
    /// A circle is still lost, but for another reason.
    MarkerStillLost {
        /// Index of the circle.
        circle: u8,
        /// Why now.
        reason: LostReason,
    },
    /// Frames that the source numbered but never delivered, or delivered torn: each of these has its own
    /// event too.
    FramesMissed {
        /// How many.
        count: u32,
    },
    /// A frame came with a number not above the one before: not measured again.
    FrameRepeated,
    /// A frame came torn, short or of another size.
    FrameCorrupt,
    /// The rest pose was set from this interval.
    RestSet {
        /// Frames in the mean.
        frames: u16,
    },
    /// A command asked for a new rest pose; the loop waits for rest again.
    RestRequested,
    /// The level of the targets' white changed by more than a quarter since the last such event.
    LightChanged {
        /// Level now, percent of full scale.
        percent: u8,
    },
    /// The outbox was full; records were lost.
    QueueOverflow {
        /// How many.
        count: u32,
    },
    /// No frame for three periods.
    CameraStalled,
    /// The camera is gone or failing.
    CameraLost,
    /// The camera was opened again.
    CameraReopened,
    /// A mark given by the operator: start, end, a remark.
    Mark {
        /// Its text, at most [`MAX_MARK`] bytes.
        text: &'a str,
    },
    /// A command came that cannot be followed.
    CommandRefused {
        /// Kind of the command's record.
        kind: u8,
    },
    /// A new setup was taken over.
    SetupChanged,
    /// The camera was told another exposure or gain.
    ExposureChanged {
        /// Exposure, us.
        exposure_us: u32,
        /// Gain, thousandths of that without amplification.
        gain_permille: u32,
    },
    /// The camera has left its place on its own carbody, or may have.
    CameraMoved {
        /// What tells it.
        evidence: MoveEvidence,
        /// How far the camera has moved, or what is seen through it, mm.
        shift_mm: f32,
        /// How far it has turned, degrees.
        turn_deg: f32,
    },
    /// The camera shakes in its place, as its reference targets show; told again when that has doubled or
    /// halved, and with zeros when it is over.
    CameraShaking {
        /// Root mean square of its shift over a second, mm.
        shift_mm: f32,
        /// Root mean square of its turn, degrees.
        turn_deg: f32,
    },
}

/// What tells that the camera has moved; the numbers never change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum MoveEvidence {
    /// Reference targets on its own carbody: it has, and the measured motion goes on without it.
    References = 0,
    /// A step from one frame to the next that no train can make: it probably has.
    Shock = 1,
    /// The train stands, and not where it stood at rest: it may have.
    Standing = 2,
    /// Evidence that this version does not know.
    Other = 255,
}

impl MoveEvidence {
    fn from_number(number: u8) -> Self {
        match number {
            0 => Self::References,
            1 => Self::Shock,
            2 => Self::Standing,
            _ => Self::Other,
        }
    }
}

/// Why a circle is not seen; the numbers never change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum LostReason {
    /// Its window is outside the picture.
    OutsidePicture = 0,
    /// Too little contrast.
    LowContrast = 1,
    /// No ring in the window.
    NotFound = 2,
    /// Cut by the picture's edge.
    CutByPicture = 3,
    /// Cut by the window's edge.
    CutByWindow = 4,
    /// Saturated.
    Saturated = 5,
    /// Size, ratio or outline do not fit.
    Outline = 6,
    /// Could be a neighbour.
    Neighbour = 7,
    /// Does not fit the pose of the others.
    Residual = 8,
    /// Its lamp does not shine.
    Unlit = 9,
    /// A reason that this version does not know.
    Other = 255,
}

impl LostReason {
    fn from_number(number: u8) -> Self {
        match number {
            0 => Self::OutsidePicture,
            1 => Self::LowContrast,
            2 => Self::NotFound,
            3 => Self::CutByPicture,
            4 => Self::CutByWindow,
            5 => Self::Saturated,
            6 => Self::Outline,
            7 => Self::Neighbour,
            8 => Self::Residual,
            9 => Self::Unlit,
            _ => Self::Other,
        }
    }
}

/// The fields that every event starts with.
#[derive(Serialize, Deserialize)]
struct Head {
    frame: u32,
    #[serde(with = "postcard::fixint::le")]
    time_ns: u64,
    number: u8,
}

impl What<'_> {
    /// Number of the event on the wire.
    pub fn number(&self) -> u8 {
        match self {
            What::Started => 1,
            What::Ended => 2,
            What::MarkerLost { .. } => 3,
            What::MarkerFound { .. } => 4,
            What::MarkerStillLost { .. } => 5,
            What::FramesMissed { .. } => 6,
            What::FrameRepeated => 7,
            What::FrameCorrupt => 8,
            What::RestSet { .. } => 9,
            What::RestRequested => 10,
            What::LightChanged { .. } => 11,
            What::QueueOverflow { .. } => 12,
            What::CameraStalled => 13,
            What::CameraLost => 14,
            What::CameraReopened => 15,
            What::Mark { .. } => 16,
            What::CommandRefused { .. } => 17,
            What::SetupChanged => 18,
            What::ExposureChanged { .. } => 19,
            What::CameraMoved { .. } => 24,
            What::CameraShaking { .. } => 25,
        }
    }
}

impl<'a> Event<'a> {
    /// Writes the body; the bytes written.
    pub(crate) fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let head = Head { frame: self.frame, time_ns: self.time_ns, number: self.what.number() };
        let length = put(&head, out)?;
        let out = out.get_mut(length..).unwrap_or_default();
        let fields = match self.what {
            What::Started
            | What::Ended
            | What::FrameRepeated
            | What::FrameCorrupt
            | What::RestRequested
            | What::CameraStalled
            | What::CameraLost
            | What::CameraReopened
            | What::SetupChanged => 0,
            What::MarkerLost { circle, reason } | What::MarkerStillLost { circle, reason } => {
                put(&(circle, reason as u8), out)?
            }
            What::MarkerFound { circle } => put(&circle, out)?,
            What::FramesMissed { count } | What::QueueOverflow { count } => put(&count, out)?,
            What::RestSet { frames } => put(&frames, out)?,
            What::LightChanged { percent } => put(&percent, out)?,
            What::Mark { text } => {
                bounded("mark", text, MAX_MARK)?;
                put(&text, out)?
            }
            What::CommandRefused { kind } => put(&kind, out)?,
            What::ExposureChanged { exposure_us, gain_permille } => put(&(exposure_us, gain_permille), out)?,
            What::CameraMoved { evidence, shift_mm, turn_deg } => {
                put(&(evidence as u8, shift_mm, turn_deg), out)?
            }
            What::CameraShaking { shift_mm, turn_deg } => put(&(shift_mm, turn_deg), out)?,
        };
        Ok(length + fields)
    }

    /// Reads the body; the event and what is behind its fields.
    pub(crate) fn decode(body: &'a [u8]) -> Result<(Self, &'a [u8]), BodyError> {
        let (head, rest): (Head, _) = take(body)?;
        let (what, rest) = match head.number {
            1 => (What::Started, rest),
            2 => (What::Ended, rest),
            3 => {
                let ((circle, reason), rest) = take(rest)?;
                (What::MarkerLost { circle, reason: LostReason::from_number(reason) }, rest)
            }
            4 => take(rest).map(|(circle, rest)| (What::MarkerFound { circle }, rest))?,
            5 => {
                let ((circle, reason), rest) = take(rest)?;
                (What::MarkerStillLost { circle, reason: LostReason::from_number(reason) }, rest)
            }
            6 => take(rest).map(|(count, rest)| (What::FramesMissed { count }, rest))?,
            7 => (What::FrameRepeated, rest),
            8 => (What::FrameCorrupt, rest),
            9 => take(rest).map(|(frames, rest)| (What::RestSet { frames }, rest))?,
            10 => (What::RestRequested, rest),
            11 => take(rest).map(|(percent, rest)| (What::LightChanged { percent }, rest))?,
            12 => take(rest).map(|(count, rest)| (What::QueueOverflow { count }, rest))?,
            13 => (What::CameraStalled, rest),
            14 => (What::CameraLost, rest),
            15 => (What::CameraReopened, rest),
            16 => {
                let (text, rest): (&str, _) = take(rest)?;
                if text.len() > MAX_MARK {
                    return Err(BodyError::Malformed);
                }
                (What::Mark { text }, rest)
            }
            17 => take(rest).map(|(kind, rest)| (What::CommandRefused { kind }, rest))?,
            18 => (What::SetupChanged, rest),
            19 => {
                let ((exposure_us, gain_permille), rest) = take(rest)?;
                (What::ExposureChanged { exposure_us, gain_permille }, rest)
            }
            24 => {
                let ((evidence, shift_mm, turn_deg), rest) = take(rest)?;
                let evidence = MoveEvidence::from_number(evidence);
                (What::CameraMoved { evidence, shift_mm, turn_deg }, rest)
            }
            25 => {
                let ((shift_mm, turn_deg), rest) = take(rest)?;
                (What::CameraShaking { shift_mm, turn_deg }, rest)
            }
            _ => return Err(BodyError::Newer),
        };
        Ok((Event { frame: head.frame, time_ns: head.time_ns, what }, rest))
    }
}
