//! Error and stated uncertainty against the bound that the centres' covariances set (Cramer and Rao): the
//! inverse of `J^T W J`, with the derivative taken here by differences and not from the solver.

use gangway_pose::{Observation, Pose, Settings, solve};
use nalgebra::{Matrix2, Matrix6, SMatrix, Vector3};
use rayon::prelude::*;

use crate::random::Random;
use crate::sets::{Kind, Set, a_frame_before};
use crate::statistics::{error, median, squared};
use crate::table::Table;

/// What the poses of one case came to.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Root of the mean over the six degrees of freedom of squared error over squared bound: 1 is the bound.
    pub of_bound: f64,
    /// The same for the degree of freedom that is furthest from its bound.
    pub worst: f64,
    /// Mean normalised squared error by the solver's covariance: 6 if it is true.
    pub squared: f64,
    /// Poses refused, or given without one of the circles.
    pub lost: u32,
}

/// Solves `poses` pictures of a set whose centres have standard deviations of `sigma_px / 4` to `4 sigma_px`.
pub fn run(kind: Kind, circles: usize, sigma_px: f64, seed: u64, poses: u32) -> Outcome {
    let set = Set::rig(kind, circles);
    let mut random = Random::new(seed);
    let (mut ratios, mut sum, mut lost) = ([0.0; 6], 0.0, 0);
    for _ in 0..poses {
        let truth = set.any_pose(&mut random);
        let observations = random.observe(&set.points, &set.centres(&truth), sigma_px, 4.0);
        let prior = a_frame_before(&truth, &mut random);
        let solution = solve(&observations, &set.lens, &Settings::default(), Some(&prior));
        let Some(solution) = solution.ok().filter(|s| s.used.count_ones() as usize == circles) else {
            lost += 1;
            continue;
        };
        let error = error(&solution.pose, &truth);
        let bound = bound(&set, &truth, &observations);
        for (i, ratio) in ratios.iter_mut().enumerate() {
            *ratio += error[i] * error[i] / bound[(i, i)];
        }
        sum += squared(&error, &solution.covariance);
    }
    let given = f64::from(poses - lost);
    let ratios = ratios.map(|ratio| ratio / given);
    Outcome {
        of_bound: (ratios.iter().sum::<f64>() / 6.0).sqrt(),
        worst: ratios.iter().fold(0.0, |worst: f64, ratio| worst.max(*ratio)).sqrt(),
        squared: sum / given,
        lost,
    }
}

/// The bound: covariance of (v, w) at the true pose.
pub fn bound(set: &Set, truth: &Pose, observations: &[Observation]) -> Matrix6<f64> {
    let mut information = Matrix6::zeros();
    for observation in observations {
        let [uu, uv, vv] = observation.centre.covariance;
        let weight = Matrix2::new(uu, uv, uv, vv).try_inverse().expect("a covariance has an inverse");
        let mut jacobian = SMatrix::<f64, 2, 6>::zeros();
        for i in 0..6 {
            // Steps of 0.01 mm and 1e-6 rad, which move a centre by some 1/100 px.
            let step = if i < 3 { 1e-2 } else { 1e-6 };
            let at = |step: f64| {
                let mut v = Vector3::zeros();
                let mut w = Vector3::zeros();
                if i < 3 {
                    v[i] = step
                } else {
                    w[i - 3] = step
                }
                let turned = nalgebra::Rotation3::new(w) * (truth.rotation * observation.point);
                set.lens.project(&(turned + truth.translation + v)).expect("it is before the camera")
            };
            let (after, before) = (at(step), at(-step));
            for k in 0..2 {
                jacobian[(k, i)] = (after[k] - before[k]) / (2.0 * step);
            }
        }
        information += jacobian.transpose() * weight * jacobian;
    }
    information.try_inverse().expect("the pose is determined")
}

/// The table.
pub fn table(seeds: u64) -> Table {
    let mut table = Table::new(
        "Error over its bound (J^T W J)^-1, all six degrees of freedom together and the worst one, and normalised\n\
         squared error by the solver's 6x6 matrix; each centre with another covariance, standard deviations over a\n\
         range of 16; from the pose of the frame before; medians over the seeds of 200 poses each.",
        &["circles", "set", "sigma px", "error / bound", "worst", "squared error (6)", "lost"],
    );
    for kind in [Kind::General, Kind::Planar] {
        for circles in [4, 5, 6, 7, 10, 15, 21, 28] {
            for sigma_px in [0.005, 0.02] {
                let outcomes: Vec<Outcome> =
                    (0..seeds).into_par_iter().map(|seed| run(kind, circles, sigma_px, seed, 200)).collect();
                let of =
                    |part: fn(&Outcome) -> f64| format!("{:.3}", median(outcomes.iter().map(part).collect()));
                table.row(vec![
                    circles.to_string(),
                    kind.name().to_owned(),
                    sigma_px.to_string(),
                    of(|o| o.of_bound),
                    of(|o| o.worst),
                    of(|o| o.squared),
                    outcomes.iter().map(|o| o.lost).sum::<u32>().to_string(),
                ]);
            }
        }
    }
    table
}
