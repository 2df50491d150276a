//! Why a ring was not taken.

/// Why no centre was given for a circle in this frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The window lies outside the picture, in part or whole, so far that no whole ring can be in it.
    OutsidePicture,
    /// The difference between dark and bright in the window is too small.
    LowContrast,
    /// No pair of dark and bright components that could be a ring.
    NotFound,
    /// A ring is there, but the picture's edge cuts it.
    CutByPicture,
    /// A ring is there, but the window's edge cuts it (after the second look).
    CutByWindow,
    /// The ring's black or the white around it is saturated or clipped so that its edge cannot be placed.
    Saturated,
    /// A ring is there, but its size, area ratio or outline does not fit: covered in part, or something else.
    Outline,
    /// A ring is there, but it could be a neighbour of the one searched for.
    Neighbour,
    /// A ring was measured, but it does not fit to the pose of the others.
    Residual,
    /// A disc was measured, but its lamp did not shine over the whole exposure.
    Unlit,
}
