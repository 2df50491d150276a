//! Centres that scatter more than their covariances say, as on compressed video: is the stated uncertainty
//! true again?

use gangway_pose::{Observation, Settings, solve};
use rayon::prelude::*;

use crate::random::Random;
use crate::sets::{Kind, Set, a_frame_before};
use crate::statistics::{median, squared_error};
use crate::table::Table;

/// Mean normalised squared error of `poses` pictures whose centres are `factor` times further off than they
/// say; 6 is true, and without any scaling it would be 6 times the factor squared.
pub fn run(kind: Kind, circles: usize, factor: f64, seed: u64, poses: u32) -> f64 {
    let set = Set::rig(kind, circles);
    let mut random = Random::new(seed);
    let mut sum = 0.0;
    for _ in 0..poses {
        let truth = set.any_pose(&mut random);
        let mut observations: Vec<Observation> =
            random.observe(&set.points, &set.centres(&truth), 0.01 * factor, 2.0);
        for observation in &mut observations {
            observation.centre.covariance = observation.centre.covariance.map(|c| c / (factor * factor));
        }
        let prior = a_frame_before(&truth, &mut random);
        let solution = solve(&observations, &set.lens, &Settings::default(), Some(&prior));
        sum += squared_error(&solution.expect("noise is no reason to refuse"), &truth).min(1e4);
    }
    sum / f64::from(poses)
}

/// The table.
pub fn table(seeds: u64) -> Table {
    let mut table = Table::new(
        "Normalised squared error (6 is true) where the centres are further off than their covariances say, by the\n\
         factor at the head of a column; medians over the seeds of 200 poses each. Unscaled it would be 6, 13.5, 24, 54, 150.",
        &["circles", "set", "1", "1.5", "2", "3", "5"],
    );
    for kind in [Kind::General, Kind::Planar] {
        for circles in [5, 7, 10, 15, 28] {
            let of = |factor: f64| {
                let all =
                    (0..seeds).into_par_iter().map(|seed| run(kind, circles, factor, seed, 200)).collect();
                format!("{:.2}", median(all))
            };
            let mut row = vec![circles.to_string(), kind.name().to_owned()];
            row.extend([1.0, 1.5, 2.0, 3.0, 5.0].map(of));
            table.row(row);
        }
    }
    table
}
