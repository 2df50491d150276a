//! From poses to search windows: where each ring will be, how large, and how near its next neighbour is.

use gangway_pose::{Centre, Circle, MAX_CIRCLES, Observation, Pose, PoseError, project_circle, solve};
use gangway_vision::Search;
use heapless::Vec;

use crate::Settings;

/// Standard deviation that a seed is given, px: it was picked by hand.
const SEED_SIGMA_PX: f64 = 1.0;
/// A ring further from its prediction than this share of the way to its nearest neighbour could be that one.
const REACH: f64 = 0.5;

/// One carbody's circles and what they are seen with.
#[derive(Clone, Copy)]
pub(crate) struct Sight<'s> {
    pub(crate) settings: &'s Settings,
    pub(crate) circles: &'s [Circle],
    /// One entry a circle.
    pub(crate) seeds: &'s [Option<[f64; 2]>],
}

/// The pose that the setup's seeds give.
pub(crate) fn seed_pose(sight: &Sight<'_>) -> Result<Pose, PoseError> {
    let variance = SEED_SIGMA_PX * SEED_SIGMA_PX;
    let observations: Vec<Observation, MAX_CIRCLES> = sight
        .circles
        .iter()
        .zip(sight.seeds)
        .filter_map(|(circle, seed)| {
            let centre = Centre { at: (*seed)?, covariance: [variance, 0.0, variance] };
            Some(Observation { point: circle.point, centre })
        })
        .collect();
    Ok(solve(&observations, &sight.settings.lens, &sight.settings.solver, None)?.pose)
}

/// One search for every circle, in their order.
///
/// With `at_seeds` the windows stand at the seeds themselves where there are some: they were picked in the
/// picture, the pose from them is only as good as the setup.
pub(crate) fn searches(
    sight: &Sight<'_>,
    pose: &Pose,
    at_seeds: bool,
    searches: &mut Vec<Search, MAX_CIRCLES>,
) {
    searches.clear();
    for (circle, seed) in sight.circles.iter().zip(sight.seeds) {
        let mut search = match project_circle(circle, pose, &sight.settings.lens) {
            Ok(projected) => Search {
                at: projected.centre,
                shape: projected.shape,
                ratio: circle.outer_mm / circle.inner_mm,
                bias: projected.bias,
                reach_px: 0.0,
                target: circle.target,
                confident: !at_seeds,
                uncertain_px: 0.0,
            },
            Err(_) => Search { target: circle.target, ..Search::round([f64::NAN; 2], 0.0) },
        };
        if let (true, Some(seed)) = (at_seeds, seed) {
            search.at = *seed;
        }
        // As many searches as circles: both are bounded by MAX_CIRCLES.
        let _ = searches.push(search);
    }
    set_reaches(searches);
}

/// How many circles should show in the picture, as a whole.
pub(crate) fn in_picture(searches: &[Search], (width, height): (u16, u16)) -> u32 {
    let inside = |search: &&Search| {
        let radius = 0.5 * search.diameter_px();
        let fits = |at: f64, size: u16| at >= radius && at <= f64::from(size) - 1.0 - radius;
        fits(search.at[0], width) && fits(search.at[1], height)
    };
    searches.iter().filter(inside).count() as u32
}

/// Half the way to the nearest other circle, for each.
fn set_reaches(searches: &mut [Search]) {
    for i in 0..searches.len() {
        let at = searches[i].at;
        let nearest = searches
            .iter()
            .enumerate()
            .filter(|(j, _)| *j != i)
            .map(|(_, other)| square(at[0] - other.at[0]) + square(at[1] - other.at[1]))
            .fold(f64::INFINITY, f64::min);
        searches[i].reach_px = REACH * libm::sqrt(nearest);
    }
}

fn square(x: f64) -> f64 {
    x * x
}
