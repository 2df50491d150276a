//! The plots: six panels over one time axis, as SVG, and as PNG drawn from the very same SVG.
//!
//! Hours of data stay small: what falls on one column of the picture is drawn as its smallest and largest
//! value. `curves` sets the same measurement by several solvers beside each other, as the thesis' figures do.
//! Lines end where there is no pose; nothing is joined across.

mod axis;
mod curves;
mod deviations;
mod figure;
mod motions;
mod picture;
mod svg;
mod trace;

pub use curves::{Curve, Curves, Look, Panel, Scale, Section, curves};
pub use deviations::deviations;
pub use motions::motions;
pub use picture::{Picture, WIDTH_PX};
pub(crate) use svg::escape;
