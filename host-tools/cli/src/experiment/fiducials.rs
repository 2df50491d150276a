//! Evaluations 2a and 2b (thesis 5.4.6, 5.4.7): the deviations of experiment 2a against the number of
//! circles, 4 to 28, with the target that is set back last (F = 7 (T - 1) + O, equation 5.2) and second.

use std::fmt::Write;
use std::path::Path;

use gangway_report::Reference;
use gangway_report::plots::{Curve, Curves, Look, Panel, Scale, Section};

use super::measure::{self, Job, Outcome};
use super::table::{Line, aligned, cell};
use super::thesis::Statistics;
use super::{SOLVERS, draw, plan, put_in, setup_text};
use crate::{simulate, tell};

const CIRCLES_A_TARGET: usize = 7;
const FEWEST: usize = 4;
const MOST: usize = 28;
/// What requirement R(a) allows, mm.
const LIMIT_MM: f64 = 10.0;

/// In which order the targets give their circles.
struct Order {
    name: &'static str,
    about: &'static str,
    figure: &'static str,
    /// Targets of the scene, from 0; 3 is the one set back.
    targets: [usize; 4],
    /// From how many circles on the thesis kept R(a), DLT and EPnP.
    published: &'static str,
}

const ORDERS: [Order; 2] = [
    Order {
        name: "Evaluation 2a",
        about: "coplanar targets first: T1, T2, T3, T4",
        figure: "5.29",
        targets: [0, 1, 2, 3],
        published: "thesis: DLT from 11, EPnP from 18",
    },
    Order {
        name: "Evaluation 2b",
        about: "the target set back second: T1, T4, T3, T2",
        figure: "5.30",
        targets: [0, 3, 2, 1],
        published: "thesis: all but EPnP's x nearly constant from 8",
    },
];

impl Order {
    /// Whether a circle is among the first `count`.
    fn has(&self, count: usize, target: usize, circle: usize) -> bool {
        let place = self.targets.iter().position(|t| *t == target).unwrap_or(usize::MAX / 8);
        CIRCLES_A_TARGET * place + circle < count
    }
}

/// What one number of circles gave: a line a solver.
type Counted = Vec<(usize, [Line; 3])>;

/// Runs both evaluations into a folder; gives the text.
pub(crate) fn run(folder: &Path, seeds: u64) -> anyhow::Result<String> {
    let mut orders: [Counted; 2] = ORDERS.each_ref().map(|_| empty());
    let mut without = [0usize; 2];
    let mut sources = Vec::new();
    for seed in 1..=seeds {
        let scene = plan::scene("rig")?.with_seed(seed);
        let captures = folder.join("captures").join(format!("seed-{seed}"));
        gangway_report::write_file(&captures.join("truth.csv"), scene.truth_text().as_bytes())?;
        let mut jobs = Vec::new();
        for order in &ORDERS {
            for count in FEWEST..=MOST {
                for (solver, _) in SOLVERS {
                    let setup =
                        setup_text(&scene, solver, &|target, circle| order.has(count, target, circle));
                    jobs.push(Job { name: format!("{}-{count}-{solver}", order.figure), setup });
                }
            }
        }
        let bar = simulate::progress(&scene);
        let outcomes = measure::one_by_one(&scene, &jobs, &captures, &bar);
        bar.finish_and_clear();
        let reference = Reference::parse(scene.truth_text().as_bytes(), "truth.csv")?;
        let mut outcomes = outcomes?.into_iter();
        for (counted, without) in orders.iter_mut().zip(&mut without) {
            for (_, lines) in counted {
                for (line, outcome) in lines.iter_mut().zip(outcomes.by_ref()) {
                    *without += take(outcome, line, &reference)?;
                }
            }
        }
        if seed == 1 {
            sources = scene.error_sources();
        }
    }
    let what = if seeds == 1 { "seed 1".to_owned() } else { format!("medians over {seeds} seeds") };
    let mut text = format!("Deviations of experiment 2a against the number of circles ({what})\n\n");
    text.push_str(&put_in(&sources, &[]));
    for ((order, counted), without) in ORDERS.iter().zip(&orders).zip(without) {
        text.push_str(&table(order, counted));
        if without > 0 {
            let _ = writeln!(text, "{without} frames in all were left without a pose");
        }
        for path in draw(folder, &format!("figure-{}", order.figure), &figure(order, counted))? {
            tell(&format!("wrote {}", path.display()));
        }
    }
    gangway_report::write_file(&folder.join("table.txt"), text.as_bytes())?;
    Ok(text)
}

fn empty() -> Counted {
    (FEWEST..=MOST).map(|count| (count, SOLVERS.map(|(_, label)| Line::new(label)))).collect()
}

/// Takes a job's samples; gives how many frames had no pose.
fn take(outcome: Outcome, line: &mut Line, reference: &Reference) -> anyhow::Result<usize> {
    match outcome {
        Ok((samples, _)) => {
            let evaluation = gangway_report::evaluate("fiducials", &samples, Some(reference))?;
            line.add(&evaluation);
            Ok(evaluation.frames.without_pose)
        }
        Err(why) => {
            line.refused = Some(why);
            Ok(0)
        }
    }
}

fn table(order: &Order, counted: &Counted) -> String {
    let mut text = format!("\n{}: {} (thesis figure {})\n\n", order.name, order.about, order.figure);
    let mut head = vec!["circles".to_owned(), String::new()];
    head.extend(SOLVERS.iter().flat_map(|(_, label)| [format!("{label} MAX x/y/z mm"), "RMSE".to_owned()]));
    let mut rows = vec![head];
    for (count, lines) in counted {
        let target = order.targets[(count - 1) / CIRCLES_A_TARGET] + 1;
        let mut row = vec![count.to_string(), format!("T{target}")];
        row.extend(lines.iter().flat_map(|line| match line.medians() {
            Some(s) => [s.max, s.rmse].map(|of| cell(&of[..3], 2)),
            None => ["refused".to_owned(), String::new()],
        }));
        rows.push(row);
    }
    text.push_str(&aligned(&rows));
    let kept = [0, 1, 2].map(|solver| {
        let from = kept_from(counted, solver);
        format!("{} {}", SOLVERS[solver].1, from.map_or("never".to_owned(), |count| format!("from {count}")))
    });
    let _ = writeln!(
        text,
        "R(a), {LIMIT_MM} mm, is kept in x, y and z: {}; {}",
        kept.join(", "),
        order.published
    );
    let refused: Vec<(usize, usize)> = counted
        .iter()
        .flat_map(|(count, lines)| {
            lines.iter().enumerate().filter(|(_, line)| line.refused.is_some()).map(|(i, _)| (*count, i))
        })
        .collect();
    if let Some((count, solver)) = refused.first() {
        let why = counted
            .iter()
            .find(|(other, _)| other == count)
            .and_then(|(_, lines)| lines[*solver].refused.as_deref())
            .unwrap_or_default();
        let list: Vec<String> = refused.iter().map(|(n, i)| format!("{} {n}", SOLVERS[*i].1)).collect();
        let _ = writeln!(text, "refused by the box ({}): {why}", list.join(", "));
    }
    text
}

/// The smallest number of circles from which on MAX stays within R(a); what was refused does not count.
fn kept_from(counted: &Counted, solver: usize) -> Option<usize> {
    let is_kept = |line: &Line| line.medians().is_none_or(|s| s.max[..3].iter().all(|max| *max <= LIMIT_MM));
    let tail = counted.iter().rev().take_while(|(_, lines)| is_kept(&lines[solver]));
    let measured = tail.filter(|(_, lines)| lines[solver].medians().is_some());
    measured.last().map(|(count, _)| *count)
}

fn figure(order: &Order, counted: &Counted) -> Curves {
    type Pick = fn(&Statistics) -> &[f64; 6];
    let kinds: [(Pick, [Look; 3], &str); 2] = [
        (|s| &s.max, [Look::Wide, Look::Middle, Look::Narrow], "MAX"),
        (|s| &s.rmse, [Look::WideDashed, Look::MiddleDashed, Look::NarrowDashed], "RMSE"),
    ];
    let curve = |degree: usize, solver: usize, of: Pick, look: Look| Curve {
        look,
        points: counted
            .iter()
            .map(|(count, lines)| (*count as f64, lines[solver].medians().map(|s| of(&s)[degree])))
            .collect(),
    };
    let panel = |degree: usize| Panel {
        label: plan::label(degree),
        remarks: [const { String::new() }; 2],
        curves: kinds
            .iter()
            .flat_map(|(of, looks, _)| (0..3).map(|solver| curve(degree, solver, *of, looks[solver])))
            .collect(),
        limit: Some(LIMIT_MM),
    };
    let legend = kinds.iter().flat_map(|(_, looks, what)| {
        looks.iter().zip(SOLVERS).map(move |(look, (_, label))| (*look, format!("{label} {what}")))
    });
    let sections = order.targets.iter().enumerate().map(|(place, target)| {
        let first = (CIRCLES_A_TARGET * place) as f64 + 0.5;
        let end = first + CIRCLES_A_TARGET as f64;
        Section { name: format!("T{}", target + 1), from_to: [first.max(FEWEST as f64 - 0.5), end] }
    });
    Curves {
        title: format!("{}: deviation against the number of circles", order.name),
        subtitle: format!("as thesis figure {}; {}", order.figure, order.about),
        legend: legend.collect(),
        across: "number of circles".to_owned(),
        sections: sections.collect(),
        scale: Scale::Logarithmic,
        panels: (0..3).map(panel).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circles_are_numbered_as_in_equation_5_2() {
        let [coplanar, back] = &ORDERS;
        let count = |order: &Order, n| {
            (0..4).flat_map(|t| (0..7).map(move |c| (t, c))).filter(|(t, c)| order.has(n, *t, *c)).count()
        };
        for n in FEWEST..=MOST {
            assert_eq!((count(coplanar, n), count(back, n)), (n, n));
        }
        assert!(coplanar.has(8, 1, 0) && !coplanar.has(8, 3, 0));
        assert!(back.has(8, 3, 0) && !back.has(8, 1, 0));
    }
}
