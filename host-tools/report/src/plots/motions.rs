//! The six motions against time, measured over true.

use super::axis::{number, with_unit};
use super::figure::{Figure, Key};
use super::picture::Picture;
use super::svg::colour;
use crate::table::digits_for;
use crate::{DEGREES_OF_FREEDOM, Evaluation};

/// Draws the motions as measured and, where there is a reference, the true ones beneath.
pub fn motions(evaluation: &Evaluation) -> Picture {
    let mut legend = vec![(Key::Line(colour::BLUE, 2.5), "measured")];
    if evaluation.reference.is_some() {
        // Wider than the measured line that lies on it: both are seen where they agree.
        legend.push((Key::Line(colour::ORANGE, TRUTH_WIDTH), "truth"));
    }
    let mut figure = Figure::new("Relative motion of the carbodies", evaluation, legend);
    for (i, of) in DEGREES_OF_FREEDOM.iter().enumerate() {
        let m = &evaluation.motion[i];
        let digits = digits_for((m.max - m.min).max(m.std));
        let remark = format!("{} to {}", number(m.min, digits), with_unit(number(m.max, digits), of));
        let truths = evaluation.rows.iter().filter_map(|r| Some(r.truth?[i]));
        let [low, high] = truths.fold([m.min, m.max], |[low, high], v| [low.min(v), high.max(v)]);
        let margin = (high - low) * 0.08;
        let panel = figure.begin_panel(i, [low - margin, high + margin], [("", false), (&remark, false)]);
        figure.grid(&panel);
        figure.line(&panel, colour::ORANGE, TRUTH_WIDTH, |r| Some(r.truth?[i]));
        figure.line(&panel, colour::BLUE, 2.0, |r| Some(r.measured?.values[i]));
        figure.end_panel(&panel);
    }
    figure.finish()
}

/// Wide enough to be seen on both sides of the measured line, px.
const TRUTH_WIDTH: f64 = 7.0;
