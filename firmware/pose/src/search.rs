//! The search where circles hide each other: poses from three circles (Fischler and Bolles 1981), each
//! brought to the circles that fit it best (Rousseeuw and Van Driessen 2006, least trimmed squares with
//! concentration steps). Deterministic.

use heapless::Vec;

use crate::MAX_CIRCLES;
use crate::PoseError;
use crate::ambiguity::is_same;
use crate::geometry::Pose;
use crate::p3p::p3p;
use crate::problem::{Problem, Rays};
use crate::refine::refine;
use crate::robust::{Consensus, is_only_choice, least_used, readmitted, shrink};

/// Triples that the search looks at where it cannot look at all of them. With 45 % wrong circles one triple
/// in six is right.
const TRIPLES: usize = 96;
/// Sets up to this size are searched over all their triples (84 of nine).
const EXHAUSTIVE: usize = 9;
/// Hypotheses that are refined.
const KEPT: usize = 6;
/// Concentration steps of a hypothesis; two or three are usual.
const STEPS: usize = 6;

/// Searches for the pose that most circles agree on.
pub(crate) fn search(problem: &Problem, rays: &Rays) -> Result<Consensus, PoseError> {
    let mut kept: [Option<(f64, Pose)>; KEPT] = [None; KEPT];
    for_each_triple(problem.rows.len(), |triple| {
        for pose in poses_of_triple(problem, rays, triple) {
            let score = trimmed_px2(problem, &pose);
            keep(&mut kept, score, pose);
        }
    });
    let mut all: Vec<Consensus, KEPT> = Vec::new();
    for (_, pose) in kept.iter().flatten() {
        if let Some(found) = concentrated(problem, pose) {
            // As many places as hypotheses.
            let _ = all.push(found);
        }
    }
    let best = best_of(problem, &all).ok_or(PoseError::NoConsensus)?;
    Some(best).filter(|found| is_only_choice(problem, found)).ok_or(PoseError::NoConsensus)
}

/// All poses that put three circles exactly where they were seen.
pub(crate) fn poses_of_triple(problem: &Problem, rays: &Rays, triple: [usize; 3]) -> Vec<Pose, 4> {
    let mut points = [[0.0; 3]; 3];
    let mut unit = [[0.0; 3]; 3];
    for ((point, ray), i) in points.iter_mut().zip(&mut unit).zip(triple) {
        let (Some(row), Some([x, y])) = (problem.rows.get(i), rays.get(i)) else { return Vec::new() };
        let norm = libm::sqrt(x * x + y * y + 1.0);
        *point = row.point;
        *ray = [x / norm, y / norm, 1.0 / norm];
    }
    p3p(&points, &unit)
}

/// The candidate with the least cost: squared errors, and for each circle left out the gate's own, in units
/// of the scatter of the best candidate. Of two poses on the same circles the second is remembered.
fn best_of(problem: &Problem, all: &[Consensus]) -> Option<Consensus> {
    let scale = all.iter().map(Consensus::scale).fold(f64::INFINITY, f64::min);
    let gate = problem.settings.gate_sigmas * problem.settings.gate_sigmas;
    let cost = |found: &Consensus| {
        let left_out = problem.rows.len() - found.used.count_ones() as usize;
        found.fit.chi2 / scale + gate * left_out as f64
    };
    let best = all.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
    let rivals = all.iter().filter(|c| c.used == best.used && !is_same(&c.fit.pose, &best.fit.pose));
    let rival = rivals.min_by(|a, b| a.fit.chi2.total_cmp(&b.fit.chi2)).map(|c| c.fit);
    Some(Consensus { rival, ..*best })
}

/// Refines a hypothesis on the circles that fit it best, as long as that changes which they are, then on all
/// that are within the gate.
fn concentrated(problem: &Problem, pose: &Pose) -> Option<Consensus> {
    let count = majority(problem);
    // Far from its three circles the hypothesis is wrong by more than the centres: pixels tell, not sigmas.
    let mut used = nearest(problem, pose, count, |px2, _| px2)?;
    let mut fit = refine(problem, used, pose).ok()?;
    for _ in 0..STEPS {
        let next = nearest(problem, &fit.pose, count, |_, chi2| chi2)?;
        if next == used {
            break;
        }
        used = next;
        fit = refine(problem, used, &fit.pose).ok()?;
    }
    readmitted(problem, shrink(problem, used, fit)?)
}

/// Circles that are surely right: all but three in ten, of a small set all but one.
fn majority(problem: &Problem) -> usize {
    let circles = problem.rows.len();
    let wrong = if circles < 10 { 1 } else { 3 * circles / 10 };
    (circles - wrong.min(circles)).max(least_used(problem)).min(circles)
}

/// The squared errors, px^2, summed over the circles that fit best. A sum over all would prefer a pose that
/// is a little off everywhere, between the right circles and wrong ones that agree with each other.
fn trimmed_px2(problem: &Problem, pose: &Pose) -> f64 {
    let mut errors: Vec<f64, MAX_CIRCLES> = Vec::new();
    for row in &problem.rows {
        // As many as circles.
        let _ = errors.push(problem.error(row, pose).px2);
    }
    let mut sorted = errors.clone();
    let last = majority(problem).saturating_sub(1).min(sorted.len().saturating_sub(1));
    let (_, greatest, _) = sorted.select_nth_unstable_by(last, f64::total_cmp);
    errors.iter().filter(|px2| *px2 <= greatest).sum()
}

/// The `count` circles with the smallest errors.
fn nearest(problem: &Problem, pose: &Pose, count: usize, measure: impl Fn(f64, f64) -> f64) -> Option<u64> {
    let mut order: Vec<(f64, usize), MAX_CIRCLES> = Vec::new();
    for (i, row) in problem.rows.iter().enumerate() {
        let error = problem.error(row, pose);
        order.push((measure(error.px2, error.chi2), i)).ok()?;
    }
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let taken = order.get(..count)?;
    taken.last()?.0.is_finite().then(|| taken.iter().fold(0, |mask, (_, i)| mask | 1 << i))
}
/// Keeps the best scores, ascending; equal poses are kept once.
fn keep(kept: &mut [Option<(f64, Pose)>; KEPT], score: f64, pose: Pose) {
    let mut entry = Some((score, pose));
    for slot in kept.iter_mut() {
        match (&slot, &entry) {
            (Some((kept_score, _)), Some((new_score, _))) if kept_score <= new_score => {}
            _ => core::mem::swap(slot, &mut entry),
        }
        if entry.is_none() {
            break;
        }
    }
}

/// Calls for every triple of a small set, else for a fixed sequence of triples.
fn for_each_triple(count: usize, mut call: impl FnMut([usize; 3])) {
    if count <= EXHAUSTIVE {
        for a in 0..count {
            for b in a + 1..count {
                for c in b + 1..count {
                    call([a, b, c]);
                }
            }
        }
        return;
    }
    // Linear congruential generator (Numerical Recipes): the same triples in every frame and on every
    // machine.
    let mut state = 1_u32;
    let mut draw = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize % count
    };
    for _ in 0..TRIPLES {
        let a = draw();
        let mut b = draw();
        while b == a {
            b = draw();
        }
        let mut c = draw();
        while c == a || c == b {
            c = draw();
        }
        call([a, b, c]);
    }
}
