//! The claims about centres, asserted in short form; `cargo run --release -p accuracy centres` prints the whole table.

use accuracy::centres::{Outcome, own_bias, run};
use accuracy::picture::Conditions;
use accuracy::statistics::{mean, median};

/// The claim.
const MOST_OVER_BOUND: f64 = 1.25;
const MOST_BIAS_PX: f64 = 0.003;
const TRUE_SQUARED: f64 = 2.0;
const MOST_OFF_SQUARED: f64 = 0.15;

/// Eight rings of 25 exposures: a root mean square of 400 numbers scatters by 3.5 %.
fn outcomes(conditions: Conditions) -> Vec<Outcome> {
    (0..8).map(|seed| run(conditions, seed, 25)).collect()
}

/// Checks error and bias and gives the mean normalised squared error.
fn check(name: &str, conditions: Conditions) -> f64 {
    let outcomes = outcomes(conditions);
    let refused: u32 = outcomes.iter().map(|o| o.refused).sum();
    assert!(refused <= 2, "{name}: {refused} of 200 refused");
    let over_bound = median(outcomes.iter().map(|o| o.over_bound).collect());
    assert!(over_bound < MOST_OVER_BOUND, "{name}: {over_bound}");
    let [u, v] = [0, 1].map(|axis| mean(&outcomes.iter().map(|o| o.bias_px[axis]).collect::<Vec<_>>()));
    assert!(u.hypot(v) < MOST_BIAS_PX && own_bias(&outcomes) < MOST_BIAS_PX, "{name}: {u} {v}");
    mean(&outcomes.iter().map(|o| o.squared).collect::<Vec<_>>())
}

#[test]
fn centres_are_within_a_quarter_of_what_their_pixels_can_tell_and_state_it() {
    let usual = Conditions::default();
    let mut squared = vec![check("usual", usual)];
    for diameter_px in [12.0, 17.0, 36.0, 60.0] {
        squared.push(check("diameter", Conditions { diameter_px, ..usual }));
    }
    squared.push(check("angle", Conditions { angle_deg: 35.0, ..usual }));
    squared.push(check("light", Conditions { uneven: 0.3, ..usual }));
    for blur_px in [0.4, 1.0, 1.5] {
        squared.push(check("blur", Conditions { blur_px, ..usual }));
    }
    squared.push(check("clipped", Conditions { white: 1.2, ..usual }));
    squared.push(check("depth", Conditions { bits: 12, ..usual }));
    squared.push(check("wide margin", Conditions { margin_px: 12.0, ..usual }));
    // Of 2,600 exposures: chance makes 2 %.
    let squared = mean(&squared);
    assert!((squared / TRUE_SQUARED - 1.0).abs() < MOST_OFF_SQUARED, "{squared}");
}
