//! Why a set of observations has no pose.

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
