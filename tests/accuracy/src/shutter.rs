//! A rolling shutter and motion within the exposure: what remains of them.

use gangway_pose::{Observation, Pose, Settings, Shutter, Track, moved, solve, solve_in_motion};
use rayon::prelude::*;

use crate::random::Random;
use crate::sets::Set;
use crate::statistics::{error, mean, median, squared};
use crate::table::Table;

/// Frames a second: a readout of 1080 rows at 20 us fits in.
const RATE_HZ: f64 = 40.0;
/// Moments of an exposure.
const MOMENTS: usize = 16;
/// A ring's centre is as good as this, px.
const SIGMA_PX: f64 = 0.005;
/// Rows of the picture.
const ROWS: f64 = 1080.0;

/// Root mean square errors over a ride.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Of x, y and z together, mm: as if the shutter were global, and taken row by row.
    pub mm: [f64; 2],
    /// Of roll, pitch and yaw together, degrees, likewise.
    pub deg: [f64; 2],
    /// Mean normalised squared error, row by row.
    pub squared: f64,
}

/// Sways sideways with up to 1 m/s and about the vertical axis with up to 20 degrees/s, both at `hz`, for
/// `frames`.
pub fn run(line_time_us: f64, exposure_ms: f64, hz: f64, seed: u64, frames: usize) -> Outcome {
    let set = Set::ride();
    let mut random = Random::new(seed);
    let phases = [random.within(180.0), random.within(180.0)];
    let omega = std::f64::consts::TAU * hz;
    let pose_at = |t: f64| {
        let y = 1000.0 / omega * (omega * t + phases[0].to_radians()).sin();
        let yaw = 20.0 / omega * (omega * t + phases[1].to_radians()).sin();
        moved(&set.rest, [0.0, y, 0.0], [0.0, 0.0, yaw])
    };
    let shutter = Shutter {
        line_time_s: 1e-6 * line_time_us,
        exposure_s: 1e-3 * exposure_ms,
        middle_row: 0.5 * (ROWS - 1.0),
    };
    let mut errors = [Vec::new(), Vec::new()];
    let mut squares = Vec::new();
    let mut track = Track::default();
    let mut priors: [Option<[Pose; 2]>; 2] = [None; 2];
    for frame in 0..frames {
        let t = frame as f64 / RATE_HZ;
        let time_ns = 1_000_000_000 + (1e9 * t).round() as u64;
        let truth = pose_at(t);
        let centres: Vec<[f64; 2]> =
            set.points.iter().map(|point| seen(&set, point, &pose_at, t, &shutter)).collect();
        let observations: Vec<Observation> = random.observe(&set.points, &centres, SIGMA_PX, 1.5);
        let expected = |prior: &Option<[Pose; 2]>| {
            prior.map_or(truth, |[last, before]| Pose {
                rotation: last.rotation * before.rotation.transpose() * last.rotation,
                translation: last.translation * 2.0 - before.translation,
            })
        };
        let settings = Settings { gate_px: 10.0, ..Settings::default() };
        let global = solve(&observations, &set.lens, &settings, Some(&expected(&priors[0])));
        let by_row = solve_in_motion(
            &observations,
            &set.lens,
            &settings,
            &expected(&priors[1]),
            &shutter,
            &mut track,
            time_ns,
        );
        for (i, solution) in [global, by_row].into_iter().enumerate() {
            let solution = solution.expect("nineteen circles give a pose");
            if i == 1 {
                track.follow(time_ns, &solution.pose);
            }
            let last = priors[i].map_or(solution.pose, |[last, _]| last);
            priors[i] = Some([solution.pose, last]);
            // The first three frames know no motion yet.
            if frame >= 3 {
                let error = error(&solution.pose, &truth);
                errors[i].push(error);
                if i == 1 {
                    squares.push(squared(&error, &solution.covariance));
                }
            }
        }
    }
    let rms = |errors: &[nalgebra::Vector6<f64>], first: usize| {
        let squares: Vec<f64> = errors.iter().map(|e| e.fixed_rows::<3>(first).norm_squared()).collect();
        mean(&squares).sqrt()
    };
    Outcome {
        mm: [0, 1].map(|i| rms(&errors[i], 0)),
        deg: [0, 1].map(|i| rms(&errors[i], 3).to_degrees()),
        squared: mean(&squares),
    }
}

/// Where a point is seen by rows that are each exposed at their own time, on average over the exposure.
fn seen(
    set: &Set,
    point: &nalgebra::Vector3<f64>,
    pose_at: &impl Fn(f64) -> Pose,
    t: f64,
    shutter: &Shutter,
) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for i in 0..MOMENTS {
        let within = shutter.exposure_s * ((i as f64 + 0.5) / MOMENTS as f64 - 0.5);
        let mut at = [0.0, shutter.middle_row];
        // The row that sees the point is the one where it is at that row's time.
        for _ in 0..8 {
            let then = t + within + (at[1] - shutter.middle_row) * shutter.line_time_s;
            at = set.lens.project(&pose_at(then).transform(point)).expect("it is before the camera");
        }
        sum = [sum[0] + at[0], sum[1] + at[1]];
    }
    sum.map(|s| s / MOMENTS as f64)
}

/// The table.
pub fn table(seeds: u64) -> Table {
    let mut table = Table::new(
        "Rolling shutter and exposure: 19 circles at 1.65 m, 1080 rows, 40 Hz, up to 1 m/s sideways and 20 degrees/s\n\
         of yaw, centres of 0.005 px. Root mean square of the position (x, y, z together) and of the rotation, as if the\n\
         shutter were global and taken row by row; medians over the seeds of 200 frames each.",
        &[
            "line time us",
            "exposure ms",
            "sway Hz",
            "global mm",
            "by row mm",
            "global deg",
            "by row deg",
            "squared error (6)",
        ],
    );
    let mut cases = Vec::new();
    for hz in [0.5, 1.0, 2.0] {
        for line_time_us in [0.0, 10.0, 20.0] {
            cases.extend([1.0, 5.0].map(|exposure_ms| (line_time_us, exposure_ms, hz)));
        }
    }
    // Long exposures of fast motion, of which four poses do not tell all.
    cases.extend([2.0, 4.0, 6.5].map(|hz| (0.0, 10.0, hz)));
    for (line_time_us, exposure_ms, hz) in cases {
        let outcomes: Vec<Outcome> =
            (0..seeds).into_par_iter().map(|seed| run(line_time_us, exposure_ms, hz, seed, 200)).collect();
        let of = |part: &dyn Fn(&Outcome) -> f64| median(outcomes.iter().map(part).collect());
        table.row(vec![
            line_time_us.to_string(),
            exposure_ms.to_string(),
            hz.to_string(),
            format!("{:.4}", of(&|o| o.mm[0])),
            format!("{:.4}", of(&|o| o.mm[1])),
            format!("{:.5}", of(&|o| o.deg[0])),
            format!("{:.5}", of(&|o| o.deg[1])),
            format!("{:.2}", of(&|o| o.squared)),
        ]);
    }
    table
}
