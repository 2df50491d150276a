//! Cold starts by each method: how often do they end in another pose than the best one, and what do they
//! cost?

use std::time::Instant;

use gangway_pose::{Method, Observation, Pose, Settings, solve};
use rayon::prelude::*;

use crate::random::Random;
use crate::sets::{Kind, Set};
use crate::statistics::error;
use crate::table::Table;

/// What the cold starts of one case came to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    /// Starts asked for.
    pub asked: u32,
    /// Refused.
    pub refused: u32,
    /// Given, but another minimum than the start from the truth leads to, and a worse one.
    pub worse: u32,
    /// Microseconds a start.
    pub micros: f64,
}

/// Cold starts on `poses` pictures, by every method in `methods`.
pub fn run(
    kind: Kind,
    circles: usize,
    sigma_px: f64,
    methods: &[Method],
    seed: u64,
    poses: u32,
) -> Vec<Outcome> {
    let set = Set::rig(kind, circles);
    let mut random = Random::new(seed);
    let pictures: Vec<(Pose, Vec<Observation>)> = (0..poses)
        .map(|_| {
            let truth = set.any_pose(&mut random);
            let observations = random.observe(&set.points, &set.centres(&truth), sigma_px, 1.5);
            (truth, observations)
        })
        .collect();
    let outcome = |method: &Method| {
        let settings = Settings { method: *method, ..Settings::default() };
        let mut outcome = Outcome { asked: poses, ..Outcome::default() };
        let start = Instant::now();
        let solutions: Vec<_> =
            pictures.iter().map(|(_, seen)| solve(seen, &set.lens, &settings, None)).collect();
        outcome.micros = start.elapsed().as_secs_f64() * 1e6 / f64::from(poses);
        for (solution, (truth, seen)) in solutions.iter().zip(&pictures) {
            let Ok(solution) = solution else {
                outcome.refused += 1;
                continue;
            };
            let from_truth = solve(seen, &set.lens, &settings, Some(truth)).expect("the truth is a start");
            let off = error(&solution.pose, &from_truth.pose);
            // A tenth of a standard deviation is another minimum, not the rounding of the same.
            let other = (0..6).any(|i| off[i] * off[i] > 0.01 * from_truth.covariance[(i, i)]);
            let worse = from_truth.residual_px < 0.999 * solution.residual_px
                || solution.used.count_ones() < from_truth.used.count_ones();
            outcome.worse += u32::from(other && worse);
        }
        outcome
    };
    methods.iter().map(outcome).collect()
}

/// The table.
pub fn table(seeds: u64) -> Table {
    let methods = [Method::Dlt, Method::Epnp, Method::Auto];
    let mut table = Table::new(
        "Cold starts: refused, or refined to a worse minimum than the truth leads to, percent of 100 poses a seed; and\n\
         microseconds with refinement and covariance, the least over the seeds.",
        &[
            "circles",
            "set",
            "sigma px",
            "DLT refused",
            "worse",
            "us",
            "EPnP refused",
            "worse",
            "us",
            "auto refused",
            "worse",
            "us",
        ],
    );
    for kind in Kind::ALL {
        for circles in [4, 5, 6, 7, 10, 15, 16, 21, 28] {
            for sigma_px in [0.01, 0.1, 0.5] {
                let outcomes: Vec<Vec<Outcome>> = (0..seeds)
                    .into_par_iter()
                    .map(|seed| run(kind, circles, sigma_px, &methods, seed, 100))
                    .collect();
                let mut row = vec![circles.to_string(), kind.name().to_owned(), sigma_px.to_string()];
                for method in 0..methods.len() {
                    let share = |part: fn(&Outcome) -> u32| {
                        let sum: u32 = outcomes.iter().map(|o| part(&o[method])).sum();
                        let asked: u32 = outcomes.iter().map(|o| o[method].asked).sum();
                        format!("{:.2}", 100.0 * f64::from(sum) / f64::from(asked))
                    };
                    row.extend([share(|o| o.refused), share(|o| o.worse)]);
                    let micros = outcomes.iter().map(|o| o[method].micros).fold(f64::INFINITY, f64::min);
                    row.push(format!("{micros:.1}"));
                }
                table.row(row);
            }
        }
    }
    table
}
