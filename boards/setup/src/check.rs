//! What one value alone cannot show: whether the values of a setup fit one another.

use gangway_engine::{LAMP_MARGIN_S, LampMode};
use gangway_pose::{Assigner, MAX_CIRCLES};

use crate::document::Document;
use crate::geometry::{Vector, axes, distance, dot, norm, off_line, points};
use crate::parts::{ExposureMode, Kind, Parts, Target};

/// Allowed deviation of an axis from unit length, and of two axes from a right angle.
const AXIS_TOLERANCE: f64 = 1e-3;
/// Fewest circles that give a pose (thesis 3.3.5).
const FEWEST_CIRCLES: usize = 4;
/// Points are on one line if none is further from it than this share of their extent: the pose of anything
/// narrower drowns in noise.
const ON_A_LINE: f64 = 0.01;
/// How many seeds make a first pose.
const NEEDED: &str = "at least 4 circles not on one line need them, or none at all";
/// The lens is tried at the nodes of a grid over the picture, this many steps wide and high.
const LENS_STEPS: u16 = 32;
/// Least diameter of a ring's inner edge, mm.
const LEAST_INNER_MM: f64 = 0.5;
/// Two rings cannot show nearer to each other than the smallest ring that can be measured is wide, px.
const NEAREST_SEEDS_PX: f64 = 6.0;

impl Document<'_> {
    /// Checks the parts that could be read; what has a mistake already is left in peace.
    pub(crate) fn check(&mut self, parts: &Parts) {
        self.check_lens(parts);
        self.check_shutter(parts);
        self.check_lamps(parts);
        if parts.capture.exposure == ExposureMode::Auto
            && parts.camera.exposure_ms == 0.0
            && self.is_clean("camera")
        {
            let sentence = "capture.exposure is \"auto\", up to camera.exposure_ms; give camera.exposure_ms";
            self.at_path("capture.exposure", sentence.to_owned());
        }
        self.check_limits(parts);
        for (i, target) in parts.targets.iter().enumerate() {
            self.check_name(&parts.targets, i);
            let path = format!("target[{i}]");
            if self.is_clean(&path) {
                self.check_plate(&path, target);
                self.check_seeds(&path, target, parts);
            }
        }
        if self.is_clean("target") {
            self.check_all(parts);
        }
        if self.mistakes.is_empty() {
            self.check_fit(parts);
        }
    }

    /// Whether nothing is wrong yet with a section or a key, nor is it missing.
    fn is_clean(&self, path: &str) -> bool {
        !self.meant.contains(path)
            && !self.mistakes.iter().any(|mistake| {
                let sentence = mistake.sentence.strip_prefix('[').unwrap_or(&mistake.sentence);
                sentence.trim_start_matches('[').starts_with(path)
            })
    }

    /// A pixel without a ray could not be measured in.
    fn check_lens(&mut self, parts: &Parts) {
        if !self.is_clean("camera") {
            return;
        }
        let (lens, camera) = (crate::lens(&parts.camera), &parts.camera);
        let (right, bottom) = (f64::from(camera.width_px) - 1.0, f64::from(camera.height_px) - 1.0);
        let steps = 0..=LENS_STEPS;
        let pixels = steps.clone().flat_map(|i| steps.clone().map(move |k| [i, k]));
        let mut blind = pixels
            .map(|[i, k]| [right * f64::from(i), bottom * f64::from(k)].map(|p| p / f64::from(LENS_STEPS)))
            .filter(|pixel| lens.pixel_to_ray(*pixel).is_err());
        if let Some([u, v]) = blind.next() {
            self.at_path(
                "camera.distortion",
                format!(
                    "camera.distortion is not invertible at pixel [{u:.0}, {v:.0}]; it must be everywhere \
                     in the picture: check the order k1, k2, p1, p2, k3 and the signs"
                ),
            );
        }
    }

    /// The rows of a frame are exposed, and each row's exposure is over, before the next frame's.
    fn check_shutter(&mut self, parts: &Parts) {
        let camera = &parts.camera;
        if !self.is_clean("camera") {
            return;
        }
        let frame_ms = 1000.0 / camera.rate_hz;
        let rows_ms = 1e-3 * camera.line_time_us.abs() * f64::from(camera.height_px);
        // A readout that fills the whole frame, to the rounding of the numbers in the file.
        if rows_ms > 1.001 * frame_ms {
            let (line_us, rows) = (camera.line_time_us, camera.height_px);
            let most = 1e3 * frame_ms / f64::from(rows);
            self.at_path(
                "camera.line_time_us",
                format!(
                    "camera.line_time_us is {line_us}; {rows} rows then take {rows_ms:.1} ms, longer than a frame; \
                     it must be at most {most:.2} us"
                ),
            );
        }
        if camera.exposure_ms > 1.001 * frame_ms {
            let exposure_ms = camera.exposure_ms;
            self.at_path(
                "camera.exposure_ms",
                format!(
                    "camera.exposure_ms is {exposure_ms}, longer than a frame; it must be at most {frame_ms:.2} ms"
                ),
            );
        }
    }

    /// Lamps that alternate are switched between two exposures.
    fn check_lamps(&mut self, parts: &Parts) {
        let camera = &parts.camera;
        if parts.board.lamps != LampMode::Alternate || !self.is_clean("camera") {
            return;
        }
        let margin_ms = 1e3 * LAMP_MARGIN_S;
        let frame_ms = 1000.0 / camera.rate_hz;
        let rows_ms = 1e-3 * camera.line_time_us.abs() * f64::from(camera.height_px);
        let most = frame_ms - rows_ms - margin_ms;
        let exposure_ms = camera.exposure_ms;
        if exposure_ms == 0.0 {
            let sentence =
                "board.lamps is \"alternate\", switched between two exposures; give camera.exposure_ms";
            self.at_path("board.lamps", sentence.to_owned());
        } else if most <= 0.0 {
            let sentence = format!(
                "board.lamps is \"alternate\", but the rows of a frame take {rows_ms:.1} of its {frame_ms:.1} ms; \
                 {margin_ms} ms must be left between two exposures: take fewer frames a second or \"on\""
            );
            self.at_path("board.lamps", sentence);
        } else if exposure_ms >= most {
            let sentence = format!(
                "board.lamps is \"alternate\", but camera.exposure_ms is {exposure_ms}; it must be below {most:.2} ms, \
                 so that {margin_ms} ms are left between two exposures"
            );
            self.at_path("board.lamps", sentence);
        }
    }

    fn check_limits(&mut self, parts: &Parts) {
        for (i, key) in ["limits.x_mm", "limits.y_mm", "limits.z_mm"].into_iter().enumerate() {
            let (least, greatest) = (parts.limits.min_mm[i], parts.limits.max_mm[i]);
            if self.is_clean(key) && (least > 0.0 || greatest < 0.0) {
                self.at_path(
                    key,
                    format!("{key} goes from {least} to {greatest} mm; 0, the rest pose, must be within"),
                );
            }
        }
    }

    fn check_name(&mut self, targets: &[Target], i: usize) {
        let name = &targets[i].name;
        let first = targets[..i].iter().position(|other| other.name == *name && !name.is_empty());
        if let Some(first) = first {
            let path = format!("target[{i}].name");
            self.at_path(
                &path,
                format!("{path} is \"{name}\", as target[{first}] is already; no two names may be alike"),
            );
        }
    }

    fn check_plate(&mut self, path: &str, target: &Target) {
        for (axis, name) in [(target.u, "u"), (target.v, "v")] {
            let length = norm(axis);
            if (length - 1.0).abs() > AXIS_TOLERANCE {
                let path = format!("{path}.{name}");
                self.at_path(
                    &path,
                    format!("{path} is {length:.4} long; it must be a unit vector, to within 0.001"),
                );
            }
        }
        let cosine = dot(target.u, target.v);
        if cosine.abs() > AXIS_TOLERANCE {
            let from = if self.lines.contains_key(&format!("{path}.v")) { "v" } else { "u" };
            self.at_path(
                &format!("{path}.{from}"),
                format!(
                    "{path}.u and v are not at right angles: u.v is {cosine:.4}; it must be 0, to \
                    within 0.001"
                ),
            );
        }
        let (outer, inner) = (target.outer_diameter_mm, target.inner_diameter_mm);
        let inner_path = format!("{path}.inner_diameter_mm");
        if target.kind == Kind::Led && inner > 0.0 {
            let sentence = format!("{inner_path} is {inner}; a disc has no inner edge, leave it out");
            self.at_path(&inner_path, sentence);
        } else if target.kind == Kind::Printed && inner < LEAST_INNER_MM {
            let is =
                if self.lines.contains_key(&inner_path) { inner.to_string() } else { "missing".to_owned() };
            let sentence =
                format!("{inner_path} is {is}; it must be between {LEAST_INNER_MM} mm and outer_diameter_mm");
            self.at_path(&inner_path, sentence);
        } else if inner >= outer {
            let sentence = format!("{inner_path} is {inner}; it must be below outer_diameter_mm, {outer} mm");
            self.at_path(&inner_path, sentence);
        }
        if target.circles_mm.is_empty() {
            let path = format!("{path}.circles_mm");
            self.at_path(&path, format!("{path} is empty; it must have at least one pair [u, v]"));
        }
        for (i, a) in target.circles_mm.iter().enumerate() {
            let overlapped = target.circles_mm[..i].iter().position(|b| apart(*a, *b) <= outer);
            if let Some(k) = overlapped {
                let apart = apart(*a, target.circles_mm[k]);
                let path = format!("{path}.circles_mm[{i}]");
                self.at_path(
                    &path,
                    format!(
                        "{path} overlaps circles_mm[{k}]: their centres are {apart:.1} mm apart; it \
                        must be more than outer_diameter_mm, {outer} mm"
                    ),
                );
            }
        }
    }

    fn check_seeds(&mut self, path: &str, target: &Target, parts: &Parts) {
        let (seeds, circles) = (target.seeds_px.len(), target.circles_mm.len());
        if seeds != 0 && seeds != circles {
            let path = format!("{path}.seeds_px");
            self.at_path(
                &path,
                format!(
                    "{path} has {seeds} pairs for {circles} circles; it must have one a circle, or \
                    be left out"
                ),
            );
        }
        if !self.is_clean("camera") {
            return;
        }
        let (width, height) = (f64::from(parts.camera.width_px), f64::from(parts.camera.height_px));
        for (i, [u, v]) in target.seeds_px.iter().enumerate() {
            if !(-0.5..=width - 0.5).contains(u) || !(-0.5..=height - 0.5).contains(v) {
                let path = format!("{path}.seeds_px[{i}]");
                self.at_path(
                    &path,
                    format!("{path} is [{u}, {v}]; it must be within the picture of {width} x {height} px"),
                );
            }
        }
    }

    /// What holds over all targets.
    fn check_all(&mut self, parts: &Parts) {
        let circles: usize = parts.targets.iter().map(|target| target.circles_mm.len()).sum();
        if circles > MAX_CIRCLES {
            self.at(
                None,
                format!("has {circles} circles over all targets; it must be {MAX_CIRCLES} at most"),
            );
            return;
        }
        let all = if parts.targets.iter().any(|target| target.carbody == 1) {
            self.check_carbody(parts, 1, "all targets with carbody = 1");
            "all targets with carbody = 2"
        } else {
            "all targets"
        };
        self.check_carbody(parts, 2, all);
        self.check_plates_apart(parts);
        self.check_seeds_apart(parts);
    }

    /// What holds over all targets of one carbody, whose pose they give.
    fn check_carbody(&mut self, parts: &Parts, carbody: u8, all: &str) {
        let targets = || parts.targets.iter().filter(|target| target.carbody == carbody);
        let circles: Vec<Vector> = targets().flat_map(points).collect();
        if circles.len() < FEWEST_CIRCLES {
            self.at(
                None,
                format!("has {} circles over {all}; a pose needs at least {FEWEST_CIRCLES}", circles.len()),
            );
            return;
        }
        let fewest = usize::from(parts.solver.min_circles);
        if fewest > circles.len() && self.is_clean("solver.min_circles") {
            let more = if all == "all targets" {
                "there are no more circles"
            } else {
                "a carbody has no more circles"
            };
            self.at_path(
                "solver.min_circles",
                format!("solver.min_circles is {fewest}; it must be {} at most, as {more}", circles.len()),
            );
        }
        let of = if all == "all targets" { String::new() } else { format!(" over {all}") };
        if is_line(&circles) {
            self.at(
                None,
                format!("has all its circles{of} on one line; no pose can be told from them, set one further off it"),
            );
        }
        let seeds: Vec<Vector> =
            targets().flat_map(|target| &target.seeds_px).map(|[u, v]| [*u, *v, 0.0]).collect();
        if seeds.is_empty() {
            self.check_patterns(parts, carbody, &of);
        } else if seeds.len() < FEWEST_CIRCLES {
            self.at(None, format!("has only {} seeds_px{of}; {NEEDED}", seeds.len()));
        } else if is_line(&seeds) {
            self.at(None, format!("has all its seeds_px{of} on one line; {NEEDED}"));
        }
    }

    /// Without seeds some target must be known by its circles.
    fn check_patterns(&mut self, parts: &Parts, carbody: u8, of: &str) {
        let targets = parts.targets.iter().enumerate().filter(|(_, target)| target.carbody == carbody);
        let circles: Vec<_> = targets.flat_map(|(i, target)| crate::circles(i, target)).collect();
        if !Assigner::new(&circles).is_able() {
            self.at(
                None,
                format!(
                    "has no seeds_px{of}, and no target with {FEWEST_CIRCLES} circles or more, not on one line, by which \
                     it could be found; give seeds_px"
                ),
            );
        }
    }

    /// No circle of one target in the place of another target's.
    fn check_plates_apart(&mut self, parts: &Parts) {
        for (i, target) in parts.targets.iter().enumerate() {
            for (k, other) in parts.targets[..i].iter().enumerate() {
                // Their places are of two frames.
                if target.carbody != other.carbody {
                    continue;
                }
                let reach = (target.outer_diameter_mm + other.outer_diameter_mm) / 2.0;
                let facing = dot(axes(target)[2], axes(other)[2]);
                let others = points(other);
                // Plates at an angle may come near each other with their edges.
                let overlaps = points(target)
                    .iter()
                    .any(|a| others.iter().any(|b| distance(*a, *b) < reach * facing.abs()));
                if overlaps {
                    let (name, other) = (&target.name, &other.name);
                    self.at_path(
                        &format!("target[{i}]"),
                        format!(
                            "target[{i}] (\"{name}\") has circles in the place of those of \
                            target[{k}] (\"{other}\"); correct one's origin_mm, u or v"
                        ),
                    );
                }
            }
        }
    }

    /// No two rings in one place of the picture.
    fn check_seeds_apart(&mut self, parts: &Parts) {
        let seeds: Vec<(String, [f64; 2])> = parts
            .targets
            .iter()
            .enumerate()
            .flat_map(|(i, target)| {
                let named =
                    move |(k, seed): (usize, &[f64; 2])| (format!("target[{i}].seeds_px[{k}]"), *seed);
                target.seeds_px.iter().enumerate().map(named)
            })
            .collect();
        for (i, (path, seed)) in seeds.iter().enumerate() {
            let near = seeds[..i].iter().find(|(_, other)| apart(*seed, *other) < NEAREST_SEEDS_PX);
            if let Some((other, at)) = near {
                let apart = apart(*seed, *at);
                self.at_path(
                    path,
                    format!(
                        "{path} is {apart:.1} px from {other}; two rings are at least \
                        {NEAREST_SEEDS_PX} px apart"
                    ),
                );
            }
        }
    }
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn is_line(points: &[Vector]) -> bool {
    let (off, extent) = off_line(points);
    off <= ON_A_LINE * extent
}
