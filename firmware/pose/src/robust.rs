//! What to do with circles that do not fit. What betrays a wrong one is not how far it is from the pose that
//! it has pulled towards itself, but how much better the others agree without it (Cook and Weisberg 1982,
//! case deletion): it is taken out by that, one by one. Where more than one is wrong they can hide each
//! other; `search` then decides.

use nalgebra::Matrix6;

use crate::ambiguity::{basis_of, mirrored};
use crate::geometry::Pose;
use crate::linear::Basis;
use crate::problem::Problem;
use crate::refine::{Derivative, Fit, derivative, refine};
use crate::scatter::is_significant;

/// Below this count each circle left out must be the only choice.
pub(crate) const SMALL: usize = 10;
/// A second choice of circles counts as a rival when its sum of squares is within this much of the best one's
/// (the 99 % point of six degrees of freedom, and more).
const RIVAL: f64 = 20.0;

/// With so few degrees of freedom left their scatter says little, and a gain must be this many times as large
/// before a circle is wrong by it: one in a hundred by chance (the F distribution of 2 and 2).
const FEW_LEFT: f64 = 2.0;
const FEW_GATE: f64 = 200.0;

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

impl Consensus {
    /// Degrees of freedom that are left.
    pub(crate) fn freedom(&self) -> f64 {
        freedom(self.used)
    }

    /// The factor by which its residuals scatter more than the covariances say, at least one.
    pub(crate) fn scale(&self) -> f64 {
        (self.fit.chi2 / self.freedom().max(1.0)).max(1.0)
    }
}

pub(crate) fn freedom(used: u64) -> f64 {
    (2 * used.count_ones()) as f64 - 6.0
}

/// All circles, where none is beyond the gate: what is left where they do not agree as they should, but no
/// choice of them does better.
pub(crate) fn whole(problem: &Problem, fit: Fit) -> Option<Consensus> {
    let used = problem.all();
    let mut px2 = 0.0;
    for (_, row) in problem.masked(used) {
        let error = problem.error(row, &fit.pose);
        px2 += error.px2;
        if problem.is_beyond_gate(&error) {
            return None;
        }
    }
    Some(Consensus { fit, used, px2, rival: None })
}

/// Takes out what does not fit and refines again. `None` where too little would stay, where others could have
/// been taken out as well, or where what stays is no clear majority.
pub(crate) fn trimmed(problem: &Problem, fit: Fit) -> Option<Consensus> {
    let found = shrink(problem, problem.all(), fit)?;
    if found.used == problem.all() {
        return Some(found);
    }
    let mut found = readmitted(problem, found)?;
    if problem.rows.len() < SMALL
        && let Some(other) = from_mirrored(problem, &found)
        && other.used.count_ones() > found.used.count_ones()
    {
        found = other;
    }
    // Of few circles, two that are left out may be right ones that a wrong one has turned the pose away from.
    if problem.rows.len() < SMALL && found.used.count_ones() as usize + 1 < problem.rows.len() {
        return None;
    }
    let agreed = problem.rows.len() < SMALL || !is_significant(found.fit.chi2, found.freedom());
    (agreed && is_only_choice(problem, &found)).then_some(found)
}

/// What fits the mirrored pose: on the way the wrong circles may have turned a plane over, and a right one
/// then does not fit.
fn from_mirrored(problem: &Problem, found: &Consensus) -> Option<Consensus> {
    let basis = basis_of(problem, found.used).filter(Basis::is_planar)?;
    let fit = refine(problem, found.used, &mirrored(&basis, &found.fit.pose)).ok()?;
    readmitted(problem, Consensus { fit, ..*found })
}

/// Takes circles out until all that stay are within the gate and none of them disturbs the others.
pub(crate) fn shrink(problem: &Problem, mut used: u64, mut fit: Fit) -> Option<Consensus> {
    let least = least_used(problem);
    loop {
        let mut px2 = 0.0;
        let mut beyond = false;
        for (_, row) in problem.masked(used) {
            let error = problem.error(row, &fit.pose);
            px2 += error.px2;
            beyond |= problem.is_beyond_gate(&error);
        }
        let suspect = if beyond || is_significant(fit.chi2, freedom(used)) {
            suspect(problem, used, &fit).filter(|suspect| beyond || suspect.is_wrong)
        } else {
            None
        };
        let Some(suspect) = suspect else {
            return (!beyond).then_some(Consensus { fit, used, px2, rival: None });
        };
        used &= !(1 << suspect.circle);
        if (used.count_ones() as usize) < least {
            return None;
        }
        fit = refine(problem, used, &fit.pose).ok()?;
    }
}

/// The circle without which the others agree best.
struct Suspect {
    circle: usize,
    /// Whether they then agree so much better that it must be wrong.
    is_wrong: bool,
}

fn suspect(problem: &Problem, used: u64, fit: &Fit) -> Option<Suspect> {
    let mut most: Option<(f64, usize, f64)> = None;
    for (i, row) in problem.masked(used) {
        let residual = derivative(problem, row, &fit.pose)?;
        let (gain, px2) = deletion(&residual, [row.weight_u, row.weight_v], row.slope, &fit.covariance);
        if most.is_none_or(|(largest, ..)| gain > largest) {
            most = Some((gain, i, px2));
        }
    }
    let (gain, circle, px2) = most?;
    let crate::Settings { gate_sigmas, gate_px, .. } = *problem.settings;
    // Two numbers less for the others, which are then measured by themselves.
    let left = freedom(used) - 2.0;
    let scale = if left > 0.0 { ((fit.chi2 - gain) / left).max(1.0) } else { f64::INFINITY };
    let gate =
        if left > FEW_LEFT { gate_sigmas * gate_sigmas } else { (gate_sigmas * gate_sigmas).max(FEW_GATE) };
    let is_wrong = gain > gate * scale && px2 > gate_px * gate_px;
    Some(Suspect { circle, is_wrong })
}

/// By how much the sum of squares falls when a circle is left out, and how far the circle is then off, px^2;
/// both by the linearised problem. With the residuals r and their share H = J C J^T W: `r^T W (I - H)^-1 r`.
fn deletion(
    Derivative { a, b, eu, ev }: &Derivative,
    [weight_u, weight_v]: [f64; 2],
    slope: f64,
    covariance: &Matrix6<f64>,
) -> (f64, f64) {
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    for i in 0..6 {
        let (mut ca, mut cb) = (0.0, 0.0);
        for k in 0..6 {
            ca += covariance[(i, k)] * a[k];
            cb += covariance[(i, k)] * b[k];
        }
        aa += a[i] * ca;
        ab += a[i] * cb;
        bb += b[i] * cb;
    }
    let (root_u, root_v) = (libm::sqrt(weight_u), libm::sqrt(weight_v));
    let (haa, hab, hbb) = (1.0 - weight_u * aa, -root_u * root_v * ab, 1.0 - weight_v * bb);
    let (ra, rb) = (root_u * eu, root_v * ev);
    // A circle that alone holds a degree of freedom cannot be judged: rounding keeps its divisor off zero.
    let determinant = (haa * hbb - hab * hab).max(1e-12);
    let (da, db) = ((hbb * ra - hab * rb) / determinant, (haa * rb - hab * ra) / determinant);
    let u = da / root_u;
    let v = db / root_v + slope * u;
    (ra * da + rb * db, u * u + v * v)
}

/// Fewest circles that may decide: two thirds of them, and of a small set all but one.
pub(crate) fn least_used(problem: &Problem) -> usize {
    let circles = problem.rows.len();
    usize::from(problem.settings.min_circles).max(4).max((2 * circles).div_ceil(3))
}

/// Whether leaving out one other circle instead would not do as well. Where nothing was left out, or the set
/// is large, the majority decides.
pub(crate) fn is_only_choice(problem: &Problem, found: &Consensus) -> bool {
    let all = problem.all();
    if found.used == all || problem.rows.len() >= SMALL {
        return true;
    }
    let scale = found.scale();
    (0..problem.rows.len()).all(|i| {
        let rival = all & !(1 << i);
        if rival == found.used {
            return true;
        }
        let Ok(fit) = refine(problem, rival, &found.fit.pose) else { return true };
        fit.chi2 > found.fit.chi2 + RIVAL * scale
    })
}

/// What fits the better pose comes back.
pub(crate) fn readmitted(problem: &Problem, mut found: Consensus) -> Option<Consensus> {
    for _ in 0..3 {
        let used = within_gate(problem, &found.fit.pose);
        if used == found.used {
            break;
        }
        let fit = refine(problem, used, &found.fit.pose).ok()?;
        let next = shrink(problem, used, fit)?;
        // What came back disturbed the others and is out again.
        if next.used == found.used {
            break;
        }
        found = next;
    }
    let found = if problem.rows.len() < SMALL { with_each_back(problem, found) } else { found };
    // From where wrong circles had drawn the pose, one refinement may end on its way.
    let fit = refine(problem, found.used, &found.fit.pose).ok()?;
    Some(shrink(problem, found.used, fit).filter(|settled| settled.used == found.used).unwrap_or(found))
}

/// Few circles determine a pose so badly that one left out can seem wrong and not be: each is tried among the
/// others.
fn with_each_back(problem: &Problem, mut found: Consensus) -> Consensus {
    for (i, _) in problem.masked(problem.all() & !found.used) {
        let more = found.used | 1 << i;
        let Ok(fit) = refine(problem, more, &found.fit.pose) else { continue };
        if is_significant(fit.chi2, freedom(more)) && !is_significant(found.fit.chi2, found.freedom()) {
            continue;
        }
        if let Some(next) = shrink(problem, more, fit).filter(|next| next.used == more) {
            found = next;
        }
    }
    found
}

/// The circles that a pose shows within the gate.
fn within_gate(problem: &Problem, pose: &Pose) -> u64 {
    let mut used = 0_u64;
    for (i, row) in problem.masked(problem.all()) {
        if !problem.is_beyond_gate(&problem.error(row, pose)) {
            used |= 1 << i;
        }
    }
    used
}
