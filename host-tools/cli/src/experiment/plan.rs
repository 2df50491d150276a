//! The eight experiments: what scene, what was published, which circles, which figures.

use gangway_report::DEGREES_OF_FREEDOM;
use gangway_scene::{BUILTIN, Scene, SceneError, TOLERANCE};

use super::thesis::{self, Published};

/// An experiment of thesis chapter 5.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Name {
    /// One target moves along x, f = 55 mm, photographs (thesis 5.3.2).
    #[value(name = "1a")]
    Ex1a,
    /// One target moves along y, f = 35 mm, photographs (5.3.3).
    #[value(name = "1b")]
    Ex1b,
    /// One target turns about z (5.3.4).
    #[value(name = "1c")]
    Ex1c,
    /// Four targets on the test rig, one set back (5.4.3).
    #[value(name = "2a")]
    Ex2a,
    /// The same with other displacements (5.4.4).
    #[value(name = "2b")]
    Ex2b,
    /// One large target on the test rig (5.4.5).
    #[value(name = "2c")]
    Ex2c,
    /// The test ride (5.5).
    Ride,
    /// Evaluations 2a and 2b: error against the number of circles (5.4.6, 5.4.7).
    Fiducials,
}

/// Which circles a box is told of, by target and circle on it, from 0.
pub(crate) type Chosen = fn(usize, usize) -> bool;

/// What one of the seven experiments is.
pub(crate) struct Plan {
    /// As in `gangway experiment 1a`.
    pub(crate) name: &'static str,
    /// The scene that is rendered.
    pub(crate) scene: &'static str,
    /// What it shows, in a line.
    pub(crate) about: &'static str,
    /// What differs from the thesis, a line each.
    pub(crate) remarks: &'static [&'static str],
    /// Its tables in the thesis.
    pub(crate) tables: &'static str,
    /// The published lines.
    pub(crate) published: &'static [Published],
    /// One more box, with fewer circles: what it is called, and the circles.
    pub(crate) fewer: Option<(&'static str, Chosen)>,
    /// The degree of freedom along which a rail led the target, from which a constant angle is taken out.
    pub(crate) rail: Option<usize>,
    /// The figures of the thesis, with the degrees of freedom that each shows.
    pub(crate) figures: &'static [(&'static str, &'static [usize])],
    /// The figure of the summed absolute differences, where there is one.
    pub(crate) start: Option<&'static str>,
    /// Name of the axis across.
    pub(crate) across: &'static str,
}

const TRANSLATIONS: &[usize] = &[0, 1, 2];
const ROTATIONS: &[usize] = &[3, 4, 5];
const COMPRESSED: &str =
    "the trajectory of 16 minutes is compressed to 6 s at 50 frames/s, with an exposure of 4 ms for 20";
const SHEET: &str = "the thesis does not say on what sheet the 7-CCC of experiment 1 was printed; here A3";
const LASER: &str = "the reference is exact; the laser rangefinder of the thesis had up to 1.2 mm";
const CYLINDERS: &str = "the reference is exact and in step; the rig's own had up to 3 mm and 2 degrees, and \
                         was aligned to a frame";

/// A row of photographs of one target on a rail; each experiment says what is its own.
const PHOTOGRAPHS: Plan = Plan {
    name: "",
    scene: "",
    about: "",
    remarks: &[SHEET, LASER],
    tables: "",
    published: &[],
    fewer: None,
    rail: None,
    figures: &[],
    start: None,
    across: "photograph",
};

/// A film of targets on the test rig.
const RIG: Plan = Plan { remarks: &[COMPRESSED, CYLINDERS], across: "frame", ..PHOTOGRAPHS };

impl Name {
    /// Its plan; none of `fiducials`, which is many measurements of one scene.
    pub(crate) fn plan(self) -> Option<Plan> {
        Some(match self {
            Self::Ex1a => Plan {
                name: "1a",
                scene: "1a",
                about: "one 7-CCC target moves 790 mm along x, 4.5 m away, f = 55 mm, 4912 x 3264 px",
                remarks: &[
                    "the middle 4096 of 4912 columns are used: a record carries centres up to 4,095 px",
                    SHEET,
                    LASER,
                ],
                tables: "table 5.1",
                published: thesis::EX_1A,
                rail: Some(0),
                figures: &[("5.5", &[0])],
                ..PHOTOGRAPHS
            },
            Self::Ex1b => Plan {
                name: "1b",
                scene: "1b",
                about: "one 7-CCC target moves 860 mm along y and back, 3.6 m away, f = 35 mm, 2448 x 1624 px",
                tables: "table 5.2",
                published: thesis::EX_1B,
                rail: Some(1),
                figures: &[("5.9", &[1])],
                ..PHOTOGRAPHS
            },
            Self::Ex1c => Plan {
                name: "1c",
                scene: "1c",
                about: "one 7-CCC target turns 0, 25, -25, 0 degrees about z, 3.6 m away, f = 35 mm, \
                        2448 x 1624 px",
                remarks: &[
                    SHEET,
                    "the reference is exact; angles were read by hand in the thesis, to 2 degrees",
                ],
                tables: "table 5.3",
                published: thesis::EX_1C,
                figures: &[("5.13", &[5])],
                ..PHOTOGRAPHS
            },
            Self::Ex2a => Plan {
                name: "2a",
                scene: "rig",
                about: "four A3 7-CCC targets on the test rig, one set back, 4.6 m away, f = 18 mm, 1080p",
                tables: "tables 5.4 and 5.7",
                published: thesis::EX_2A,
                // T1, T2 and T4 (the one set back), each without its circles 6 and 7.
                fewer: Some(("3 x 5-CCC", |target, circle| target != 2 && circle < 5)),
                figures: &[("5.19", TRANSLATIONS), ("5.21", ROTATIONS)],
                start: Some("5.16"),
                ..RIG
            },
            Self::Ex2b => Plan {
                name: "2b",
                scene: "2b",
                about: "as 2a, with other displacements",
                tables: "tables 5.5 and 5.6",
                published: thesis::EX_2B,
                fewer: Some(("middle A3 only", |target, _| target == 1)),
                figures: &[("5.23", TRANSLATIONS), ("5.24", ROTATIONS)],
                ..RIG
            },
            Self::Ex2c => Plan {
                name: "2c",
                scene: "2c",
                about: "one A1 7-CCC target on the test rig, 5.67 m away, f = 55 mm, 1080p",
                tables: "table 5.6, where EPnP is left out",
                published: thesis::EX_2C,
                figures: &[("5.26", TRANSLATIONS), ("5.27", ROTATIONS)],
                ..RIG
            },
            Self::Ride => Plan {
                name: "ride",
                scene: "ride",
                about: "one 5-CCC and two 7-CCC targets 1.65 m away, f = 18 mm, 1080p, through a tunnel and \
                        past a post",
                remarks: &[
                    "the thesis gives no deviations: there was no reference on the train (5.5.2)",
                    "the ride of 76 minutes is compressed to 5 s at 50 frames/s, with an exposure of 5 ms \
                     for 20",
                ],
                tables: "no table",
                figures: &[("5.33, as deviations", TRANSLATIONS), ("5.34, as deviations", ROTATIONS)],
                ..RIG
            },
            Self::Fiducials => return None,
        })
    }
}

/// A built-in scene with the experiments' tolerances.
pub(crate) fn scene(name: &str) -> Result<Scene, SceneError> {
    Scene::parse(&scene_text(name), &format!("{name}.toml"))
}

/// Its text.
pub(crate) fn scene_text(name: &str) -> String {
    let text = BUILTIN.iter().find(|(known, _)| *known == name).map_or("", |(_, text)| text);
    format!("{text}{TOLERANCE}")
}

/// Name and unit of a degree of freedom, as at the side of a panel.
pub(crate) fn label(degree: usize) -> String {
    let of = DEGREES_OF_FREEDOM[degree];
    format!("{} / {}", of.name, of.unit_sign)
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

    use super::*;

    #[test]
    fn every_experiment_has_a_scene_with_tolerances_that_the_box_accepts() {
        for plan in Name::value_variants().iter().filter_map(|name| name.plan()) {
            for seed in 0..20 {
                let scene = scene(plan.scene).unwrap().with_seed(seed);
                gangway_setup::Setup::parse(&scene.setup_text(), "setup.toml").unwrap();
                if let Some((_, chosen)) = plan.fewer {
                    gangway_setup::Setup::parse(&scene.setup_text_of(&chosen), "setup.toml").unwrap();
                }
            }
        }
    }

    #[test]
    fn published_figures_agree_with_themselves() {
        for published in
            Name::value_variants().iter().filter_map(|name| name.plan()).flat_map(|p| p.published)
        {
            let s = &published.statistics;
            for i in 0..6 {
                // Printed to a tenth of a mm and a hundredth of a degree, each rounded by itself.
                let unit: f64 = if i < 3 { 0.1 } else { 0.01 };
                let rmse = s.mean[i].hypot(s.std[i]);
                assert!(
                    (s.rmse[i] - rmse).abs() <= 1.5 * unit,
                    "{} {i}: {} {rmse}",
                    published.name,
                    s.rmse[i]
                );
                assert!(s.max[i] >= s.rmse[i]);
            }
        }
    }
}
