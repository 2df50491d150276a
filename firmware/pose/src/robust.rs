//! What to do with circles that do not fit: left out worst first while a clear majority stays.

use crate::PoseError;
use crate::problem::{Problem, Rays};
use crate::refine::{Fit, refine};

/// A fit and the circles that it rests on, all of them within the gate.
pub(crate) struct Consensus {
    pub(crate) fit: Fit,
    pub(crate) used: u64,
}

/// Takes out what is beyond the gate, the worst first, and refines again. `None` where too little would stay.
pub(crate) fn trimmed(problem: &Problem, mut fit: Fit) -> Option<Consensus> {
    let mut used = problem.all();
    let least = least_used(problem);
    loop {
        let mut worst: Option<(f64, usize)> = None;
        for (i, row) in problem.masked(used) {
            let error = problem.error(row, &fit.pose);
            if problem.is_beyond_gate(&error) && worst.is_none_or(|(most, _)| error.chi2 > most) {
                worst = Some((error.chi2, i));
            }
        }
        let Some((_, i)) = worst else { return Some(Consensus { fit, used }) };
        used &= !(1 << i);
        if (used.count_ones() as usize) < least {
            return None;
        }
        fit = refine(problem, used, &fit.pose).ok()?;
    }
}

/// Fewest circles that may decide: a majority of at least two thirds.
pub(crate) fn least_used(problem: &Problem) -> usize {
    let circles = problem.rows.len();
    usize::from(problem.settings.min_circles).max(4).max((2 * circles).div_ceil(3))
}

pub(crate) fn search(_problem: &Problem, _rays: &Rays) -> Result<Consensus, PoseError> {
    Err(PoseError::NoConsensus)
}
