//! Centres against the bound that the noise of their pixels sets, and against their own covariances.

use gangway_vision::{Search, Settings, Tracker};
use rayon::prelude::*;

use crate::picture::{Conditions, Scene};
use crate::random::Random;
use crate::statistics::{mean, median};
use crate::table::Table;

/// Exposures of every ring.
const EXPOSURES: u32 = 100;

/// The narrowest margin of white of the claim, px: the outer circles of an A3 7-CCC at 5 m.
const MARGIN_PX: f64 = 4.0;

/// What one ring's exposures came to.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Root mean square error per axis over the bound.
    pub over_bound: f64,
    /// The bound, px.
    pub bound_px: f64,
    /// The bound with no more white counted than the narrowest margin has, px.
    pub bound_of_margin_px: f64,
    /// Mean error, px, along u and v.
    pub bias_px: [f64; 2],
    /// Mean normalised squared error; 2 is true.
    pub squared: f64,
    /// Exposures with a centre.
    pub measured: u32,
    /// Exposures without one.
    pub refused: u32,
}

/// One ring, between the pixels somewhere and lit from somewhere, exposed again and again.
pub fn run(conditions: Conditions, seed: u64, exposures: u32) -> Outcome {
    let mut random = Random::new(seed);
    let scene = Scene::new(conditions, &mut random);
    let light = scene.light();
    let truth = scene.projected();
    let mut tracker = Box::new(Tracker::new(Settings::default()));
    let (mut errors, mut squared, mut refused) = (Vec::new(), Vec::new(), 0);
    for _ in 0..exposures {
        let bytes = scene.expose(&light, &mut random);
        let at = truth.centre.map(|at| at + random.within(1.5));
        let search =
            Search { shape: truth.shape, bias: truth.bias, ..Search::round(at, conditions.diameter_px) };
        let Ok(ring) = tracker.look(&scene.frame(&bytes), &search) else {
            refused += 1;
            continue;
        };
        let [u, v] = [0, 1].map(|i| ring.centre.at[i] - truth.centre[i]);
        let [uu, uv, vv] = ring.centre.covariance;
        squared.push((vv * u * u - 2.0 * uv * u * v + uu * v * v) / (uu * vv - uv * uv));
        errors.push([u, v]);
    }
    let of = |axis: usize| errors.iter().map(|error| error[axis]).collect::<Vec<f64>>();
    let square = mean(&errors.iter().map(|[u, v]| 0.5 * (u * u + v * v)).collect::<Vec<_>>());
    let bound_px = scene.bound_px(f64::INFINITY);
    Outcome {
        over_bound: square.sqrt() / bound_px,
        bound_px,
        bound_of_margin_px: scene.bound_px(MARGIN_PX),
        bias_px: [mean(&of(0)), mean(&of(1))],
        squared: mean(&squared),
        measured: exposures - refused,
        refused,
    }
}

/// Error of a ring, px, in a picture without noise of 16 bits; `None` where it is refused.
pub fn bias(conditions: Conditions, seed: u64) -> Option<[f64; 2]> {
    let mut random = Random::new(seed);
    let scene = Scene::new(Conditions { bits: 16, ..conditions }, &mut random);
    let truth = scene.projected();
    let at = truth.centre.map(|at| at + random.within(1.5));
    let search = Search { shape: truth.shape, bias: truth.bias, ..Search::round(at, conditions.diameter_px) };
    let mut tracker = Box::new(Tracker::new(Settings::default()));
    let ring = tracker.look(&scene.frame(&scene.exact(&scene.light())), &search).ok()?;
    Some([0, 1].map(|i| ring.centre.at[i] - truth.centre[i]))
}

/// The cases of the claim: one thing after the other taken to its ends.
pub fn cases() -> Vec<(String, Conditions)> {
    let usual = Conditions::default();
    let mut cases = vec![("usual".to_owned(), usual)];
    for diameter_px in [12.0, 17.0, 36.0, 60.0] {
        cases.push((format!("{diameter_px} px"), Conditions { diameter_px, ..usual }));
    }
    for angle_deg in [0.0, 20.0, 35.0] {
        cases.push((format!("{angle_deg} degrees"), Conditions { angle_deg, ..usual }));
    }
    for blur_px in [0.4, 1.0, 1.5] {
        cases.push((format!("blur {blur_px} px"), Conditions { blur_px, ..usual }));
    }
    for uneven in [0.0, 0.3] {
        cases.push((format!("light uneven by {:.0} %", 100.0 * uneven), Conditions { uneven, ..usual }));
    }
    for bits in [10, 12] {
        cases.push((format!("{bits} bits"), Conditions { bits, ..usual }));
    }
    for white in [0.3, 1.2, 1.6] {
        cases.push((format!("white {white} of full scale"), Conditions { white, ..usual }));
    }
    cases.push(("white for 12 px around".to_owned(), Conditions { margin_px: 12.0, ..usual }));
    for (diameter_px, blur_px) in
        [(12.0, 0.4), (12.0, 1.0), (12.0, 1.5), (60.0, 0.4), (60.0, 0.7), (60.0, 1.5)]
    {
        let conditions = Conditions { diameter_px, blur_px, angle_deg: 35.0, uneven: 0.3, ..usual };
        cases.push((format!("{diameter_px} px, blur {blur_px} px, 35 degrees, 30 %"), conditions));
    }
    cases
}

/// The table.
pub fn table(seeds: u64) -> Table {
    let mut table = Table::new(
        "Centres of single rings: error per axis over the Cramer-Rao bound of their pixels (levels, slopes, radii and\n\
         blur unknown), bias, and normalised squared error (2 is true). Medians over the seeds of 100 exposures each;\n\
         bias: mean over all, and what is left of the seeds' own beyond their noise (root mean square per axis).\n\
         Usual: 24 px, 10 degrees, blur 0.7 px, light uneven by 10 % over the target, 8 bits, white 0.8 of full scale for\n\
         4 px around the ring, 12,000 electrons at full scale, 20 of reading.",
        &["case", "bound px", "error / bound", "bias px", "of a seed px", "squared", "refused"],
    );
    for (name, conditions) in cases() {
        let outcomes: Vec<Outcome> =
            (0..seeds).into_par_iter().map(|seed| run(conditions, seed, EXPOSURES)).collect();
        let all = |of: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(of).collect::<Vec<f64>>();
        let [u, v] = [0, 1].map(|axis| mean(&all(&|o| o.bias_px[axis])));
        table.row(vec![
            name,
            format!("{:.4}", median(all(&|o| o.bound_px))),
            format!("{:.2}", median(all(&|o| o.over_bound))),
            format!("{:.4}", u.hypot(v)),
            format!("{:.4}", own_bias(&outcomes)),
            format!("{:.2}", mean(&all(&|o| o.squared))),
            outcomes.iter().map(|o| o.refused).sum::<u32>().to_string(),
        ]);
    }
    table
}

/// Root mean square of the seeds' biases per axis, less what noise leaves in a mean of so many exposures, px.
pub fn own_bias(outcomes: &[Outcome]) -> f64 {
    let of = |o: &Outcome| {
        let [u, v] = o.bias_px;
        let noise = (o.over_bound * o.bound_px).powi(2) / f64::from(o.measured);
        0.5 * (u * u + v * v) - noise
    };
    mean(&outcomes.iter().map(of).collect::<Vec<_>>()).max(0.0).sqrt()
}
