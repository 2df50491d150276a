//! The six deviations against time, with the band of the stated standard deviation.

use super::axis::{number, with_unit};
use super::figure::{Figure, Key};
use super::picture::Picture;
use super::svg::colour;
use crate::table::{block_digits, kept};
use crate::{DEGREES_OF_FREEDOM, Deviation, Evaluation, Row};

/// Draws the deviations; `None` where there is no reference.
pub fn deviations(evaluation: &Evaluation) -> Option<Picture> {
    let deviation = evaluation.deviation.as_ref()?;
    let ranges: [f64; 6] = std::array::from_fn(|i| half_range(evaluation, i, &deviation[i]));
    let mut legend = vec![
        (Key::Line(colour::BLUE, 2.5), "measured \u{2212} truth"),
        (Key::Area(colour::BAND_1), "±1 stated σ"),
        (Key::Area(colour::BAND_3), "±3 stated σ"),
    ];
    if (0..6).any(|i| deviation[i].limit <= ranges[i]) {
        legend.push((Key::Dashed(colour::VERMILLION), "limit R(a)"));
    }
    let mut figure = Figure::new("Deviation of the measured motion from the truth", evaluation, legend);
    for (i, d) in deviation.iter().enumerate() {
        let digits = block_digits(i, |i| deviation[i].rmse);
        let text = |v: f64| number(v, digits);
        let of = &DEGREES_OF_FREEDOM[i];
        let limit = format!("R(a) ±{}: {}", with_unit(d.limit.to_string(), of), kept(d.within_limit));
        let statistics = format!(
            "MAX {} at frame {}  ·  RMSE {}  ·  MEAN {}  ·  STD {}",
            text(d.max),
            d.max_frame,
            text(d.rmse),
            text(d.mean),
            with_unit(text(d.std), of)
        );
        let range = [-ranges[i], ranges[i]];
        let panel = figure.begin_panel(i, range, [(&limit, !d.within_limit), (&statistics, false)]);
        let sigma = |r: &Row| r.deviation().and(r.measured).map(|m| m.sigmas[i]);
        figure.band(&panel, colour::BAND_3, |r| Some(3.0 * sigma(r)?));
        figure.band(&panel, colour::BAND_1, sigma);
        figure.grid(&panel);
        if d.limit <= ranges[i] {
            figure.limit(&panel, d.limit);
            figure.limit(&panel, -d.limit);
        }
        figure.line(&panel, colour::BLUE, 2.0, |r| Some(r.deviation()?[i]));
        figure.end_panel(&panel);
    }
    Some(figure.finish())
}

/// All deviations, and the band of a usual frame: a frame that states next to nothing must not flatten the
/// rest.
fn half_range(evaluation: &Evaluation, i: usize, deviation: &Deviation) -> f64 {
    let usual = evaluation.motion[i].sigma_median.unwrap_or(0.0);
    let range = 1.08 * deviation.max.max(4.0 * usual);
    if range > 0.0 { range } else { 1.0 }
}
