//! Centres under conditions drawn at random, so that whatever is hard may come together.

use rayon::prelude::*;

use crate::centres::{Outcome, bias, run};
use crate::picture::Conditions;
use crate::random::Random;
use crate::statistics::{mean, median};
use crate::table::Table;

/// Cases for every seed, and rings and exposures of each.
const CASES: u64 = 15;
const RINGS: u64 = 4;
const EXPOSURES: u32 = 100;

/// Conditions anywhere within the claim, but for the white.
fn anywhere(white: f64, random: &mut Random) -> Conditions {
    let mut between = |low: f64, high: f64| low + (high - low) * 0.5 * (random.within(1.0) + 1.0);
    Conditions {
        diameter_px: 12.0 * between(0.0, 5.0_f64.ln()).exp(),
        angle_deg: between(0.0, 35.0),
        blur_px: between(0.4, 1.5),
        uneven: between(0.0, 0.3),
        bits: between(8.0, 13.0) as u8,
        margin_px: between(4.0, 12.0),
        white,
    }
}

/// The table.
pub fn table(seeds: u64) -> Table {
    let mut table = Table::new(
        &format!(
            "Centres where all of it is drawn at random: 12 to 60 px, 0 to 35 degrees, blur 0.4 to 1.5 px, light\n\
             uneven by 0 to 30 %, 8 to 12 bits, white for 4 to 12 px around. {} cases of {RINGS} rings with\n\
             {EXPOSURES} exposures a line; error over the bound as its median, its 95th percentile and the share\n\
             of cases within 1.25 (chance makes 3 % of a case's), also of the bound that counts no more than\n\
             4 px of white; bias per axis of all rings, root mean square, and of the one that has most of it,\n\
             from pictures without noise; and the share of rings with a bias of less than 0.003 px.",
            seeds * CASES
        ),
        &[
            "white",
            "median",
            "95 %",
            "within 1.25",
            "of 4 px",
            "bias px",
            "most px",
            "< 0.003",
            "squared",
            "refused",
        ],
    );
    for white in [0.3, 0.8, 1.2, 1.6] {
        let rings = |case: u64| (0..RINGS).map(move |ring| RINGS * case + ring);
        let (cases, biases): (Vec<Vec<Outcome>>, Vec<Vec<f64>>) = (0..seeds * CASES)
            .into_par_iter()
            .map(|case| {
                let conditions = anywhere(white, &mut Random::new(case));
                let per_axis = |[u, v]: [f64; 2]| (0.5 * (u * u + v * v)).sqrt();
                let outcomes = rings(case).map(|ring| run(conditions, ring, EXPOSURES)).collect();
                (outcomes, rings(case).filter_map(|ring| bias(conditions, ring)).map(per_axis).collect())
            })
            .unzip();
        let refused: u32 = cases.iter().flatten().map(|o| o.refused).sum();
        let over = |of: &dyn Fn(&Outcome) -> f64| {
            let means = cases.iter().map(|case| mean(&case.iter().map(of).collect::<Vec<_>>()));
            let mut over: Vec<f64> = means.filter(|over| over.is_finite()).collect();
            over.sort_by(f64::total_cmp);
            let within = over.partition_point(|over| *over <= 1.25) as f64 / over.len() as f64;
            (over, format!("{:.1} %", 100.0 * within))
        };
        let (all, within) = over(&|o| o.over_bound);
        let (_, within_of_margin) = over(&|o| o.over_bound * o.bound_px / o.bound_of_margin_px);
        let biases = biases.concat();
        let small = biases.iter().filter(|bias| **bias < 0.003).count() as f64 / biases.len() as f64;
        let measured = cases.iter().flatten().filter(|o| o.measured > 0);
        table.row(vec![
            white.to_string(),
            format!("{:.2}", median(all.clone())),
            format!("{:.2}", all[all.len() * 95 / 100]),
            within,
            within_of_margin,
            format!("{:.4}", mean(&biases.iter().map(|bias| bias * bias).collect::<Vec<_>>()).sqrt()),
            format!("{:.4}", biases.iter().copied().fold(0.0, f64::max)),
            format!("{:.1} %", 100.0 * small),
            format!("{:.2}", mean(&measured.map(|o| o.squared).collect::<Vec<_>>())),
            format!("{refused} of {}", seeds * CASES * RINGS * u64::from(EXPOSURES)),
        ]);
    }
    table
}
