//! Few circles of which one may be wrong without showing it: where one alone holds a degree of freedom (the
//! set-back one of five, say) the pose gives way to it and the residuals stay small. They tell that something
//! does not fit, but not what. Then the pose without any one of those that it may be is as good, and the
//! covariance must cover it.

use nalgebra::Matrix6;

use crate::ambiguity::{basis_of, mirrored};
use crate::linear::Basis;
use crate::problem::Problem;
use crate::refine::{Fit, refine};
use crate::rest::difference;
use crate::robust::{SMALL, freedom};
use crate::scatter::is_significant;

/// What is to be added to the covariance of a fit to all circles: the squared ways to the poses without each
/// circle whose absence explains why they do not fit. Zero where they do fit, where no one circle explains it
/// (calibration and printing, which are in all of them), and where there are enough for [`crate::robust`] to
/// decide.
pub(crate) fn of_one_circle(problem: &Problem, fit: &Fit) -> Matrix6<f64> {
    let mut doubt = Matrix6::zeros();
    let all = problem.all();
    let left = freedom(all) - 2.0;
    if problem.rows.len() >= SMALL || left <= 0.0 || !is_significant(fit.chi2, freedom(all)) {
        return doubt;
    }
    for (i, _) in problem.masked(all) {
        let others = all & !(1 << i);
        let basis = basis_of(problem, others).filter(Basis::is_planar);
        let starts = [Some(fit.pose), basis.map(|basis| mirrored(&basis, &fit.pose))];
        for start in starts.iter().flatten() {
            if let Ok(without) = refine(problem, others, start)
                && !is_significant(without.chi2, left)
            {
                let way = difference(&without.pose, &fit.pose);
                doubt += way * way.transpose() + without.covariance;
            }
        }
    }
    doubt
}
