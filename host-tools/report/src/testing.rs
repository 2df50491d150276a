//! Rides made up for the tests.

use gangway_wire::PoseFlags;

use crate::{Measured, Reference, Sample};

/// Ten frames of waiting, then a swaying ride at 50 frames/s with a small wavy deviation and steady sigmas.
pub(crate) fn ride(frames: u32) -> (Vec<Sample>, Reference) {
    let truth = |i: u32| {
        let t = f64::from(i.saturating_sub(10)) / 50.0;
        let sway = |amplitude: f64, hz: f64| amplitude * (std::f64::consts::TAU * hz * t).sin();
        [
            sway(8.0, 0.9),
            sway(60.0, 0.35) + sway(3.0, 4.1),
            sway(25.0, 1.2),
            sway(1.4, 0.7),
            sway(0.8, 1.9),
            sway(2.2, 0.4),
        ]
    };
    let sample = |frame: u32| {
        let waiting = frame < 10;
        let phase = f64::from(frame);
        let sigmas = [0.018, 0.019, 0.005, 0.0004, 0.001, 0.003];
        let values = std::array::from_fn(|i| {
            let wave =
                (phase * (0.7 + 0.31 * i as f64)).sin() + 0.6 * (phase * (2.1 + 0.17 * i as f64)).cos();
            truth(frame)[i] + sigmas[i] * wave
        });
        Sample {
            frame,
            time_ns: 1_000_000_000 + u64::from(frame) * 20_000_000,
            measured: (!waiting).then_some(Measured { values, sigmas, residual_px: 0.03 }),
            markers: 19,
            flags: if waiting { PoseFlags::WAITING } else { PoseFlags::default() },
        }
    };
    let reference = Reference::new("truth.csv", (0..frames).map(|i| (i, truth(i)))).unwrap();
    ((0..frames).map(sample).collect(), reference)
}
