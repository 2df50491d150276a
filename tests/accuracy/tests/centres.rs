//! The claims about centres, asserted in short form; `cargo run --release -p accuracy centres` prints the whole table.

use accuracy::centres::{Outcome, own_bias, run};
use accuracy::picture::Conditions;
use accuracy::statistics::{mean, median};

/// The claim.
const MOST_OVER_BOUND: f64 = 1.25;
const MOST_BIAS_PX: f64 = 0.003;

/// Eight rings of 25 exposures: a root mean square of 400 numbers scatters by 3.5 %.
fn outcomes(conditions: Conditions) -> Vec<Outcome> {
    (0..8).map(|seed| run(conditions, seed, 25)).collect()
}

fn check(name: &str, conditions: Conditions) {
    let outcomes = outcomes(conditions);
    let refused: u32 = outcomes.iter().map(|o| o.refused).sum();
    assert!(refused <= 2, "{name}: {refused} of 200 refused");
    let over_bound = median(outcomes.iter().map(|o| o.over_bound).collect());
    assert!(over_bound < MOST_OVER_BOUND, "{name}: {over_bound}");
    let [u, v] = [0, 1].map(|axis| mean(&outcomes.iter().map(|o| o.bias_px[axis]).collect::<Vec<_>>()));
    assert!(u.hypot(v) < MOST_BIAS_PX && own_bias(&outcomes) < MOST_BIAS_PX, "{name}: {u} {v}");
}

#[test]
fn centres_are_within_a_quarter_of_what_their_pixels_can_tell() {
    let usual = Conditions::default();
    check("usual", usual);
    for diameter_px in [12.0, 17.0, 36.0] {
        check("diameter", Conditions { diameter_px, ..usual });
    }
    check("angle", Conditions { angle_deg: 35.0, ..usual });
    check("light", Conditions { uneven: 0.3, ..usual });
    for blur_px in [1.0, 1.5] {
        check("blur", Conditions { blur_px, ..usual });
    }
    check("depth", Conditions { bits: 12, ..usual });
    check("wide margin", Conditions { margin_px: 12.0, ..usual });
}
