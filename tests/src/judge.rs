//! What was measured beside what was simulated.

use gangway_scene::Truth;
use gangway_wire::{Markers, Motion};

/// How far a motion is off in its own standard deviations: x, y, z, roll, pitch, yaw.
pub fn sigmas_off(motion: &Motion, truth: &Truth) -> [f64; 6] {
    let measured = [motion.displacement_mm, motion.rotation_deg];
    let truth = [truth.displacement_mm, truth.rotation_deg];
    let off = |i: usize| (f64::from(measured[i / 3][i % 3]) - truth[i / 3][i % 3]).abs();
    std::array::from_fn(|i| off(i) / f64::from(motion.sigma[i]))
}

/// The rings that went into a pose, by their circles' numbers, and how far they are from where these truly
/// show, px; without limit from one that shows nowhere.
pub fn used_rings(markers: &Markers<'_>, centres: &[Option<[f64; 2]>]) -> impl Iterator<Item = (usize, f64)> {
    markers.iter().filter(|(circle, _)| markers.is_used(*circle)).map(|(circle, marker)| {
        let [u, v] = marker.at_px.map(f64::from);
        let off = |at: [f64; 2]| (u - at[0]).hypot(v - at[1]);
        (usize::from(circle), centres[usize::from(circle)].map_or(f64::INFINITY, off))
    })
}
