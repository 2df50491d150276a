//! Why a set of observations has no pose.

use core::fmt;

use crate::MAX_CIRCLES;
use crate::lens::LensError;

/// Why there is no pose. `circle` is the index into the observations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseError {
    /// Fewer distinct circles than the method needs.
    TooFew {
        /// Circles given.
        circles: u8,
        /// Circles needed.
        needed: u8,
    },
    /// More observations than [`crate::MAX_CIRCLES`], or more rest poses than [`crate::MAX_REST_POSES`].
    TooMany,
    /// A coordinate is not a finite number.
    NotFinite {
        /// The observation.
        circle: u8,
    },
    /// A covariance is not positive definite.
    Covariance {
        /// The observation.
        circle: u8,
    },
    /// A pixel is not seen through this lens.
    NoRay {
        /// The observation.
        circle: u8,
        /// Why.
        reason: LensError,
    },
    /// The camera model has a number that is not finite, or a focal length that is not positive.
    Lens,
    /// The circles lie on one line (or on one point): the rotation about it is not determined.
    OnOneLine,
    /// All circles but a few lie in one plane: degenerate for the DLT; EPnP takes such a set.
    NearlyOnePlane,
    /// The normal equations are singular.
    Singular,
    /// No pose before the camera fits a majority of the circles within the gate.
    NoConsensus,
}

/// What a sentence that begins with "there is no pose, for" goes on with; circles are counted from 0.
impl fmt::Display for PoseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFew { circles, needed } => {
                write!(f, "{circles} circles are fewer than the {needed} that are needed")
            }
            Self::TooMany => write!(f, "there are more than {MAX_CIRCLES} circles"),
            Self::NotFinite { circle } => write!(f, "the place of circle {circle} is not a number"),
            Self::Covariance { circle } => write!(f, "circle {circle} has no covariance"),
            Self::NoRay { circle, reason } => write!(f, "circle {circle} is not seen by this lens: {reason}"),
            Self::Lens => f.write_str("the numbers of the camera are none of a lens"),
            Self::OnOneLine => f.write_str("the circles lie on one line"),
            Self::NearlyOnePlane => {
                f.write_str("all circles but a few lie in one plane, which DLT cannot take")
            }
            Self::Singular => f.write_str("the circles leave it open"),
            Self::NoConsensus => f.write_str("no place before the camera explains most of the circles"),
        }
    }
}

impl core::error::Error for PoseError {}
