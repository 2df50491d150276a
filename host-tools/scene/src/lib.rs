//! Simulated rides: a scene file says what camera looks at what targets, how they move, in what light and
//! what passes in front; out come frames with noise, the exact truth and the setup file for a box that
//! watches them.
//!
//! The projection code here is the simulator's own, so that it can judge the firmware: nothing of `firmware/`
//! is used. Conventions of frames, signs and units are those of the whole project (thesis 1.2, 3.3, 3.4).
//!
//! ```
//! let scene = gangway_scene::Scene::builtin("ride")?;
//! let mut samples = Vec::new();
//! let truth = scene.render(0, &mut samples);
//! assert_eq!(samples.len(), 1920 * 1080);
//! assert_eq!(truth.displacement_mm, [0.0; 3]);
//! # Ok::<(), gangway_scene::SceneError>(())
//! ```

mod background;
mod build;
mod coverage;
mod error;
mod file;
mod keys;
mod lamp;
mod light;
mod motion;
mod mount;
mod occluder;
mod optics;
mod output;
mod patch;
mod plate;
mod render;
mod scene;
mod sensor;
mod setup;
mod table;
mod tolerance;

pub use error::SceneError;
pub use output::{Format, Written};
pub use scene::{Scene, Truth};

/// The scenes that are built in: name and text. After the two of every day come those of the thesis'
/// experiments (chapter 5; 2a is `rig`).
pub const BUILTIN: [(&str, &str); 7] = [
    ("rig", include_str!("../scenes/rig.toml")),
    ("ride", include_str!("../scenes/ride.toml")),
    ("1a", include_str!("../scenes/1a.toml")),
    ("1b", include_str!("../scenes/1b.toml")),
    ("1c", include_str!("../scenes/1c.toml")),
    ("2b", include_str!("../scenes/2b.toml")),
    ("2c", include_str!("../scenes/2c.toml")),
];

/// The tolerances of the experiments as a table of a scene file, to follow the text of a scene that has none.
pub const TOLERANCE: &str = include_str!("../scenes/tolerance.toml");
