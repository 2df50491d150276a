//! What to do with circles that do not fit: left out worst first while a clear majority stays, else a search over
//! poses from three circles (Fischler and Bolles 1981, with the score of Geman and McClure), deterministic.

use crate::PoseError;
use crate::ambiguity::is_same;
use crate::geometry::Pose;
use crate::p3p::p3p;
use crate::problem::{Problem, Rays};
use crate::refine::{Fit, refine};

/// Triples that the search looks at where it cannot look at all of them. With 45 % wrong circles one triple in six
/// is right.
const TRIPLES: usize = 96;
/// Sets up to this size are searched over all their triples (84 of nine).
const EXHAUSTIVE: usize = 9;
/// Hypotheses that are refined.
const KEPT: usize = 6;
/// A hypothesis from three circles is inexact far from them: an error of this many pixels counts half ...
const SCORE_PX: f64 = 2.0;
/// ... and circles within this are taken into the first refinement.
const NEAR_PX: f64 = 10.0;
/// Below this count each circle left out must be the only choice.
const SMALL: usize = 10;
/// A second choice of circles counts as a rival when its sum of squares is within this much of the best one's
/// (the 99 % point of six degrees of freedom, and more).
const RIVAL: f64 = 20.0;

/// A fit and the circles that it rests on, all of them within the gate.
#[derive(Clone, Copy)]
pub(crate) struct Consensus {
    pub(crate) fit: Fit,
    pub(crate) used: u64,
    /// Their squared reprojection errors summed, px^2.
    pub(crate) px2: f64,
    /// Another pose that as many circles agree on, where the search came upon one.
    pub(crate) rival: Option<Fit>,
}

/// Takes out what is beyond the gate, the worst first, and refines again. `None` where too little would stay, or
/// where others could have been taken out as well.
pub(crate) fn trimmed(problem: &Problem, fit: Fit) -> Option<Consensus> {
    let found = shrink(problem, problem.all(), fit)?;
    let found = if found.used == problem.all() { found } else { readmitted(problem, found)? };
    is_only_choice(problem, &found).then_some(found)
}

fn shrink(problem: &Problem, mut used: u64, mut fit: Fit) -> Option<Consensus> {
    let least = least_used(problem);
    loop {
        let mut worst: Option<(f64, usize)> = None;
        let mut px2 = 0.0;
        for (i, row) in problem.masked(used) {
            let error = problem.error(row, &fit.pose);
            px2 += error.px2;
            if problem.is_beyond_gate(&error) && worst.is_none_or(|(most, _)| error.chi2 > most) {
                worst = Some((error.chi2, i));
            }
        }
        let Some((_, i)) = worst else { return Some(Consensus { fit, used, px2, rival: None }) };
        used &= !(1 << i);
        if (used.count_ones() as usize) < least {
            return None;
        }
        fit = refine(problem, used, &fit.pose).ok()?;
    }
}

/// Fewest circles that may decide: two thirds of them, and of a small set all but one.
fn least_used(problem: &Problem) -> usize {
    let circles = problem.rows.len();
    usize::from(problem.settings.min_circles).max(4).max((2 * circles).div_ceil(3))
}

/// Whether leaving out one other circle instead would not do as well. Where nothing was left out, or the set is
/// large, the majority decides.
fn is_only_choice(problem: &Problem, found: &Consensus) -> bool {
    let all = problem.all();
    if found.used == all || problem.rows.len() >= SMALL {
        return true;
    }
    let freedom = (2 * found.used.count_ones()) as f64 - 6.0;
    let scale = (found.fit.chi2 / freedom.max(1.0)).max(1.0);
    (0..problem.rows.len()).all(|i| {
        let rival = all & !(1 << i);
        if rival == found.used {
            return true;
        }
        let Ok(fit) = refine(problem, rival, &found.fit.pose) else { return true };
        let Some(other) = shrink(problem, rival, fit) else { return true };
        other.used == found.used
            || other.used.count_ones() < found.used.count_ones()
            || other.fit.chi2 > found.fit.chi2 + RIVAL * scale
    })
}

/// Searches for the pose that most circles agree on.
pub(crate) fn search(problem: &Problem, rays: &Rays) -> Result<Consensus, PoseError> {
    let mut kept: [Option<(f64, Pose)>; KEPT] = [None; KEPT];
    for_each_triple(problem.rows.len(), |triple| {
        let points = triple.map(|i| problem.rows[i].point);
        let unit = triple.map(|i| {
            let [x, y] = rays[i];
            let norm = libm::sqrt(x * x + y * y + 1.0);
            [x / norm, y / norm, 1.0 / norm]
        });
        for pose in p3p(&points, &unit) {
            let score = problem
                .rows
                .iter()
                .map(|row| 1.0 - SCORE_PX * SCORE_PX / (SCORE_PX * SCORE_PX + problem.error(row, &pose).px2))
                .sum();
            keep(&mut kept, score, pose);
        }
    });
    let mut best: Option<Consensus> = None;
    for (_, pose) in kept.iter().flatten() {
        let Some(found) = grown(problem, pose) else { continue };
        let better = best.as_ref().is_none_or(|b| {
            let (many, more) = (b.used.count_ones(), found.used.count_ones());
            more > many || (more == many && found.fit.chi2 < b.fit.chi2)
        });
        // Of two poses on the same circles the second is remembered.
        let former = best.filter(|b| b.used == found.used && !is_same(&b.fit.pose, &found.fit.pose));
        if better {
            best = Some(Consensus { rival: former.map(|f| f.fit), ..found });
        } else if let (Some(best), Some(_)) = (best.as_mut(), former)
            && best.rival.is_none_or(|r| found.fit.chi2 < r.chi2)
        {
            best.rival = Some(found.fit);
        }
    }
    best.filter(|found| is_only_choice(problem, found)).ok_or(PoseError::NoConsensus)
}

/// Refines a hypothesis on the circles near to it, then on all that are within the gate.
fn grown(problem: &Problem, pose: &Pose) -> Option<Consensus> {
    let mut near = 0_u64;
    for (i, row) in problem.masked(problem.all()) {
        if problem.error(row, pose).px2 < NEAR_PX * NEAR_PX {
            near |= 1 << i;
        }
    }
    if (near.count_ones() as usize) < least_used(problem) {
        return None;
    }
    readmitted(problem, shrink(problem, near, refine(problem, near, pose).ok()?)?)
}

/// What fits the better pose comes back.
fn readmitted(problem: &Problem, mut found: Consensus) -> Option<Consensus> {
    for _ in 0..3 {
        let mut used = 0_u64;
        for (i, row) in problem.masked(problem.all()) {
            if !problem.is_beyond_gate(&problem.error(row, &found.fit.pose)) {
                used |= 1 << i;
            }
        }
        if used == found.used {
            break;
        }
        let fit = refine(problem, used, &found.fit.pose).ok()?;
        found = shrink(problem, used, fit)?;
    }
    Some(found)
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
    // Linear congruential generator (Numerical Recipes): the same triples in every frame and on every machine.
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
