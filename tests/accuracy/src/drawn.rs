//! Centres under conditions drawn at random, so that whatever is hard may come together.

use rayon::prelude::*;

use crate::centres::{Outcome, own_bias, run};
use crate::picture::Conditions;
use crate::random::Random;
use crate::statistics::{mean, median};
use crate::table::Table;

/// Cases for every seed, and rings and exposures of each.
const CASES: u64 = 15;
const RINGS: u64 = 4;
const EXPOSURES: u32 = 40;

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
             of cases within 1.25 (chance makes 5 % of a case's); bias of the ring that has most of it.",
            seeds * CASES
        ),
        &["white", "median", "95 %", "within 1.25", "bias px", "squared", "refused"],
    );
    for white in [0.3, 0.8, 1.2, 1.6] {
        let cases: Vec<Vec<Outcome>> = (0..seeds * CASES)
            .into_par_iter()
            .map(|case| {
                let conditions = anywhere(white, &mut Random::new(case));
                (0..RINGS).map(|ring| run(conditions, RINGS * case + ring, EXPOSURES)).collect()
            })
            .collect();
        let refused: u32 = cases.iter().flatten().map(|o| o.refused).sum();
        let mut over: Vec<f64> = cases
            .iter()
            .map(|case| mean(&case.iter().map(|o| o.over_bound).collect::<Vec<_>>()))
            .filter(|over| over.is_finite())
            .collect();
        over.sort_by(f64::total_cmp);
        let within = over.partition_point(|over| *over <= 1.25) as f64 / over.len() as f64;
        let measured = || cases.iter().flatten().filter(|o| o.measured > 0);
        table.row(vec![
            white.to_string(),
            format!("{:.2}", median(over.clone())),
            format!("{:.2}", over[over.len() * 95 / 100]),
            format!("{:.0} %", 100.0 * within),
            format!("{:.4}", measured().map(|o| own_bias(std::slice::from_ref(o))).fold(0.0, f64::max)),
            format!("{:.2}", mean(&measured().map(|o| o.squared).collect::<Vec<_>>())),
            format!("{refused} of {}", seeds * CASES * RINGS * u64::from(EXPOSURES)),
        ]);
    }
    table
}
