//! `gangway experiment`: an experiment of thesis chapter 5, simulated with the errors of real targets and
//! cameras, measured by the box's own frame loop with each solver, and set beside the published figures.

mod fiducials;
mod measure;
mod plan;
mod table;
mod thesis;

use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::Instant;

use gangway_report::plots::{Curve, Curves, Look, Panel, Scale, Section, curves};
use gangway_report::sync::motion_start;
use gangway_report::{DEGREES_OF_FREEDOM, Evaluation, Reference, Sample};
use gangway_scene::Scene;

use crate::{simulate, tell};
use measure::{Job, Outcome, Watched};
use plan::{Chosen, Name, Plan};
use thesis::Statistics;

/// The solvers as the setup and as the tables call them.
pub(crate) const SOLVERS: [(&str, &str); 3] = [("dlt", "DLT"), ("epnp", "EPnP"), ("auto", "auto")];

/// Arguments of `gangway experiment`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Which experiment.
    #[arg(value_enum)]
    name: Name,
    /// Folder for tables, figures, captures; each experiment has its own in it.
    #[arg(long, default_value = "experiment", value_name = "DIR")]
    out: PathBuf,
    /// Number of simulations, each with its own noise, targets and calibration; the tables are medians over
    /// them.
    #[arg(
        long, default_value_t = 1, value_name = "N",
        value_parser = clap::value_parser!(u64).range(1..=1000), allow_negative_numbers = true
    )]
    seeds: u64,
}

/// Runs `gangway experiment`.
pub(crate) fn run(args: Args) -> anyhow::Result<()> {
    let began = Instant::now();
    let mut text = match args.name.plan() {
        Some(plan) => seven(&plan, &args)?,
        None => fiducials::run(&args.out.join("fiducials"), args.seeds)?,
    };
    let _ = writeln!(text, "all of it in {:.0} s", began.elapsed().as_secs_f64());
    io::stdout().write_all(text.as_bytes())?;
    Ok(())
}

/// A solver on a choice of circles.
struct Variant {
    solver: &'static str,
    label: String,
    chosen: Option<Chosen>,
}

fn variants(plan: &Plan) -> Vec<Variant> {
    let all = SOLVERS.map(|(solver, label)| Variant { solver, label: label.to_owned(), chosen: None });
    let fewer = plan.fewer.iter().flat_map(|(what, chosen)| {
        [SOLVERS[0], SOLVERS[2]].map(|(solver, label)| Variant {
            solver,
            label: format!("{label}, {what}"),
            chosen: Some(*chosen),
        })
    });
    all.into_iter().chain(fewer).collect()
}

/// The setup of a box with the solver, on a choice of circles.
pub(crate) fn setup_text(scene: &Scene, solver: &str, chosen: &dyn Fn(usize, usize) -> bool) -> String {
    // The experiments' scenes have no table of the solver themselves.
    let setup = scene.setup_text_of(chosen);
    format!("{setup}\n[solver]\nmethod = \"{solver}\"\n")
}

/// One of the seven experiments that are one measurement a seed.
fn seven(plan: &Plan, args: &Args) -> anyhow::Result<String> {
    let folder = args.out.join(plan.name);
    let variants = variants(plan);
    let mut lines: Vec<table::Line> =
        variants.iter().map(|variant| table::Line::new(&format!("ours {}", variant.label))).collect();
    let mut first: Vec<Option<Evaluation>> = Vec::new();
    let mut notes = Vec::new();
    let mut sources = Vec::new();
    let mut start = None;
    for seed in 1..=args.seeds {
        let scene = plan::scene(plan.scene)?.with_seed(seed);
        let folder = if args.seeds == 1 { folder.clone() } else { folder.join(format!("seed-{seed}")) };
        let jobs: Vec<Job> = variants.iter().map(|variant| job(&scene, variant)).collect();
        write(&folder.join("scene.toml"), plan::scene_text(plan.scene))?;
        write(&folder.join("truth.csv"), scene.truth_text())?;
        for job in &jobs {
            write(&folder.join(format!("{}.toml", job.name)), job.setup.clone())?;
        }
        let bar = simulate::progress(&scene);
        let watched = measure::together(&scene, &jobs, &folder, &bar);
        bar.finish_and_clear();
        let Watched { outcomes, differences } = watched?;
        let reference = Reference::parse(scene.truth_text().as_bytes(), "truth.csv")?;
        let mut evaluations = Vec::new();
        for ((outcome, line), variant) in outcomes.into_iter().zip(&mut lines).zip(&variants) {
            evaluations.push(evaluated(plan, outcome, &reference, line, variant, seed, &mut notes)?);
        }
        if seed == 1 {
            first = evaluations;
            sources = scene.error_sources();
            if let Some(number) = plan.start {
                start = Some((number, differences));
            }
        }
    }
    if let Some(note) = start.as_ref().map(|(_, differences)| started(differences)) {
        notes.push(note);
    }
    let text = report(plan, args.seeds, &lines, &first, &sources, &notes);
    write(&folder.join("table.txt"), text.clone())?;
    let mut drawn = figures(plan, &folder, &first)?;
    if let Some((number, differences)) = &start {
        drawn.extend(draw(&folder, &format!("figure-{number}"), &start_figure(number, differences))?);
    }
    for path in drawn {
        tell(&format!("wrote {}", path.display()));
    }
    // The product's own evaluation of its default, with the stated standard deviations.
    if let Some(Some(auto)) = first.get(2) {
        auto.write_all(&folder.join("evaluation"))?;
    }
    Ok(text)
}

fn write(path: &Path, text: String) -> anyhow::Result<()> {
    Ok(gangway_report::write_file(path, text.as_bytes())?)
}

fn job(scene: &Scene, variant: &Variant) -> Job {
    let setup = match variant.chosen {
        Some(chosen) => setup_text(scene, variant.solver, &chosen),
        None => setup_text(scene, variant.solver, &|_, _| true),
    };
    let name = if variant.chosen.is_some() { "-fewer" } else { "" };
    Job { name: format!("{}{name}", variant.solver), setup }
}

/// Takes a job's samples into its line; `None` where the box refused its setup or never measured.
fn evaluated(
    plan: &Plan,
    outcome: Outcome,
    reference: &Reference,
    line: &mut table::Line,
    variant: &Variant,
    seed: u64,
    notes: &mut Vec<String>,
) -> anyhow::Result<Option<Evaluation>> {
    let (mut samples, _) = match outcome {
        Ok(measured) => measured,
        Err(why) => {
            line.refused = Some(why);
            return Ok(None);
        }
    };
    if let Some(axis) = plan.rail {
        let degrees = straighten(&mut samples, reference, axis);
        if seed == 1 && variant.solver == "auto" {
            notes.push(format!(
                "As in the thesis, the rail's constant angle to the rest pose is taken out: {degrees:.2} degrees (seed 1)"
            ));
        }
    }
    let evaluation = gangway_report::evaluate(plan.name, &samples, Some(reference))?;
    let without = evaluation.frames.without_pose;
    if without > 0 {
        notes.push(format!("{}, seed {seed}: {without} frames without a pose", variant.label));
    }
    line.add(&evaluation);
    Ok(Some(evaluation))
}

/// Takes a constant angle out of the measured displacements, so that the rail's direction is the axis it
/// should be (thesis 5.3.2: the rail's misalignment to the rest pose is taken out by a constant angle). Gives
/// the angle, degrees.
fn straighten(samples: &mut [Sample], reference: &Reference, axis: usize) -> f64 {
    let mut direction = [0.0; 3];
    for sample in samples.iter() {
        if let (Some(measured), Some(truth)) = (&sample.measured, reference.at(sample.frame)) {
            for (sum, value) in direction.iter_mut().zip(measured.values) {
                *sum += truth[axis] * value;
            }
        }
    }
    let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
    if length == 0.0 {
        return 0.0;
    }
    let from = direction.map(|d| d / length);
    let mut to = [0.0; 3];
    to[axis] = 1.0;
    let cross = |a: &[f64; 3], b: &[f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let normal = cross(&from, &to);
    let cosine = from[axis];
    for measured in samples.iter_mut().filter_map(|sample| sample.measured.as_mut()) {
        let [x, y, z, ..] = measured.values;
        // Rodrigues' formula for the turn that takes `from` to `to`.
        let once = cross(&normal, &[x, y, z]);
        let twice = cross(&normal, &once);
        for i in 0..3 {
            measured.values[i] += once[i] + twice[i] / (1.0 + cosine);
        }
    }
    cosine.clamp(-1.0, 1.0).acos().to_degrees()
}

fn report(
    plan: &Plan,
    seeds: u64,
    lines: &[table::Line],
    first: &[Option<Evaluation>],
    sources: &[String],
    notes: &[String],
) -> String {
    let mut text = format!("Experiment {}: {}\n\n", plan.name, plan.about);
    text.push_str(&put_in(sources, plan.remarks));
    let what = if seeds == 1 { "seed 1".to_owned() } else { format!("medians over {seeds} seeds") };
    let _ = writeln!(text, "\nDeviations from the reference ({what}); thesis: {}\n", plan.tables);
    text.push_str(&table::text(plan.published, lines));
    if let [Some(dlt), Some(epnp), ..] = first {
        let [mm, degrees] = largest_difference(dlt, epnp);
        let _ = writeln!(
            text,
            "\nDLT and EPnP give the first pose only; both are refined on the reprojection error, and later frames start\n\
             from the pose before. Largest difference between them in a frame (seed 1): {mm:.5} mm, {degrees:.6} degrees"
        );
    }
    for note in notes.iter().take(6) {
        let _ = writeln!(text, "{note}");
    }
    text
}

/// The error sources, and what is not among them.
pub(crate) fn put_in(sources: &[String], remarks: &[&str]) -> String {
    let mut text =
        "Error sources put in (calibration, printing and mounting: standard deviations):\n".to_owned();
    for line in sources {
        let _ = writeln!(text, "  {line}");
    }
    text.push_str("Not put in: video compression, a rolling shutter, bent sheets, a swaying camera.\n");
    if !remarks.is_empty() {
        text.push_str("Other than in the thesis:\n");
    }
    for line in remarks {
        let _ = writeln!(text, "  {line}");
    }
    text
}

/// Between two evaluations of the same frames: mm and degrees.
fn largest_difference(a: &Evaluation, b: &Evaluation) -> [f64; 2] {
    let mut most = [0.0f64; 2];
    for (a, b) in a.rows.iter().zip(&b.rows) {
        if let (Some(a), Some(b)) = (a.measured, b.measured) {
            for (i, (a, b)) in a.values.iter().zip(b.values).enumerate() {
                most[i / 3] = most[i / 3].max((a - b).abs());
            }
        }
    }
    most
}

/// Draws the figures of the thesis from the first seed.
fn figures(plan: &Plan, folder: &Path, first: &[Option<Evaluation>]) -> anyhow::Result<Vec<PathBuf>> {
    let looks = [Look::Wide, Look::Middle, Look::Narrow];
    let drawn: Vec<(Look, &str, &Evaluation)> = looks
        .into_iter()
        .zip(SOLVERS)
        .zip(first)
        .filter_map(|((look, (_, label)), evaluation)| Some((look, label, evaluation.as_ref()?)))
        .collect();
    let coincide = drawn.iter().all(|(_, _, evaluation)| {
        drawn
            .first()
            .is_some_and(|(_, _, first)| largest_difference(first, evaluation).iter().all(|d| *d < 1e-3))
    });
    let coincide = if coincide { "; the solvers coincide" } else { "" };
    let mut written = Vec::new();
    for (number, degrees) in plan.figures {
        let panels = degrees.iter().map(|degree| panel(plan, *degree, &drawn)).collect();
        let figure = Curves {
            title: format!("Experiment {}: deviation from the reference", plan.name),
            subtitle: format!("as thesis figure {number}; {}{coincide}", plan.about),
            legend: drawn.iter().map(|(look, label, _)| (*look, (*label).to_owned())).collect(),
            across: plan.across.to_owned(),
            sections: Vec::new(),
            scale: Scale::Signed,
            panels,
        };
        let name = format!("figure-{}", number.split(',').next().unwrap_or(number));
        written.extend(draw(folder, &name, &figure)?);
    }
    Ok(written)
}

/// What the pictures say about the start of motion.
fn started(differences: &[f64]) -> String {
    match motion_start(differences) {
        Some(frame) => format!(
            "The pictures' summed absolute difference (equation 5.1) grows first in frame {frame}; of the simulation, \
             frame 20 is the last at rest"
        ),
        None => "The pictures' summed absolute difference (equation 5.1) shows no start of motion".to_owned(),
    }
}

/// The summed absolute difference of each picture to the first, as in thesis figure 5.16.
fn start_figure(number: &str, differences: &[f64]) -> Curves {
    let last = differences.len().saturating_sub(1) as f64;
    let sections = motion_start(differences).map(|start| {
        let start = start as f64 - 0.5;
        let section = |name: &str, from_to| Section { name: name.to_owned(), from_to };
        vec![section("rest", [0.0, start]), section("motion", [start, last])]
    });
    let points = differences.iter().enumerate().skip(1).map(|(frame, d)| (frame as f64, Some(*d))).collect();
    Curves {
        title: "Experiment 2a: start of motion in the pictures".to_owned(),
        subtitle: format!(
            "as thesis figure {number}; sum of absolute grey level differences to the first picture"
        ),
        legend: vec![(Look::Narrow, "SAD (equation 5.1)".to_owned())],
        across: "frame".to_owned(),
        sections: sections.unwrap_or_default(),
        scale: Scale::Logarithmic,
        panels: vec![Panel {
            label: "SAD / grey levels".to_owned(),
            remarks: [const { String::new() }; 2],
            curves: vec![Curve { look: Look::Narrow, points }],
            limit: None,
        }],
    }
}

/// Writes a figure as SVG and PNG.
pub(crate) fn draw(folder: &Path, name: &str, figure: &Curves) -> anyhow::Result<[PathBuf; 2]> {
    let picture = curves(figure);
    let (svg, png) = (folder.join(format!("{name}.svg")), folder.join(format!("{name}.png")));
    gangway_report::write_file(&svg, picture.svg().as_bytes())?;
    gangway_report::write_file(&png, &picture.png()?)?;
    Ok([svg, png])
}

fn panel(plan: &Plan, degree: usize, drawn: &[(Look, &str, &Evaluation)]) -> Panel {
    let of = DEGREES_OF_FREEDOM[degree];
    let digits = if of.is_angle { 3 } else { 2 };
    // A space before mm, none before the sign of degrees.
    let unit = if of.is_angle { of.unit_sign.to_owned() } else { format!(" {}", of.unit_sign) };
    let figures = |s: &Statistics, digits: usize| {
        format!("MAX {:.digits$}, RMSE {:.digits$}{unit}", s.max[degree], s.rmse[degree])
    };
    let published =
        plan.published.iter().take(2).map(|p| format!("{} {}", p.name, figures(&p.statistics, digits - 1)));
    let published = published.collect::<Vec<_>>().join("; ");
    let ours = drawn.last().and_then(|(_, label, evaluation)| {
        let deviation = evaluation.deviation.as_ref()?;
        Some(format!("{label}: {}", figures(&table::statistics(deviation), digits)))
    });
    let curve = |(look, _, evaluation): &(Look, &str, &Evaluation)| Curve {
        look: *look,
        points: evaluation
            .rows
            .iter()
            .filter(|row| !row.is_waiting())
            .map(|row| (f64::from(row.frame), row.deviation().map(|d| d[degree])))
            .collect(),
    };
    Panel {
        label: plan::label(degree),
        remarks: [
            if published.is_empty() { String::new() } else { format!("thesis: {published}") },
            ours.unwrap_or_default(),
        ],
        curves: drawn.iter().map(curve).collect(),
        limit: Some(of.limit),
    }
}

#[cfg(test)]
mod tests {
    use gangway_report::Measured;

    use super::*;

    #[test]
    fn a_rail_that_is_not_along_the_axis_is_straightened_and_nothing_else_changes() {
        let angle = 0.02f64;
        let mut samples: Vec<Sample> = (0..40)
            .map(|frame| {
                let along = 10.0 * f64::from(frame);
                // A rail turned by 0.02 about z, and a deviation of 0.3 mm along it in frame 7.
                let along = if frame == 7 { along + 0.3 } else { along };
                let values = [along * angle.cos(), along * angle.sin(), 0.0, 0.0, 0.1, 0.0];
                let measured = Measured { values, sigmas: [0.1; 6], residual_px: 0.1 };
                Sample {
                    frame,
                    time_ns: u64::from(frame),
                    measured: Some(measured),
                    markers: 7,
                    flags: gangway_wire::PoseFlags::default(),
                }
            })
            .collect();
        let truth = (0..40).map(|frame| (frame, [10.0 * f64::from(frame), 0.0, 0.0, 0.0, 0.0, 0.0]));
        let reference = Reference::new("truth.csv", truth).unwrap();
        let degrees = straighten(&mut samples, &reference, 0);
        assert!((degrees - angle.to_degrees()).abs() < 1e-9, "{degrees}");
        for sample in &samples {
            let values = sample.measured.unwrap().values;
            let along = 10.0 * f64::from(sample.frame) + if sample.frame == 7 { 0.3 } else { 0.0 };
            // A few operations on numbers of some hundred.
            assert!((values[0] - along).abs() < 1e-10 && values[1].abs() < 1e-10, "{values:?}");
            assert_eq!(values[4], 0.1);
        }
    }
}
