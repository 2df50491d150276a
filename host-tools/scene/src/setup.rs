//! The setup file of a scene, in the form that the box reads: its camera, its targets and, as seeds, where
//! each circle's centre is at rest.

use std::fmt::Write;

use crate::build::Parts;
use crate::file::SetupTables;
use crate::optics::dot;
use crate::plate::Plate;

/// Fewest circles that must show at rest.
pub(crate) const FEWEST_SEEDS: usize = 4;

/// Where a plate's circles are at rest, px; nothing unless all show.
pub(crate) fn seeds(parts: &Parts, plate: &Plate) -> Option<Vec<[f64; 2]>> {
    let in_place = if plate.carbody == 1 { &parts.own } else { &parts.rest };
    let pose = parts.mount.seen(in_place, &parts.own, 0.0);
    let normal = crate::optics::apply(&pose.rotation, &plate.axes[2]);
    plate
        .circles
        .iter()
        .map(|circle| {
            let point = pose.transform(&plate.point(*circle));
            let inside = |pixel: &[f64; 2]| {
                pixel.iter().zip(parts.size).all(|(p, side)| *p >= 0.0 && *p <= f64::from(side) - 1.0)
            };
            parts.lens.project(&point).filter(|pixel| dot(&normal, &point) < 0.0 && inside(pixel))
        })
        .collect()
}

/// The file's text: `parts` as its owner believes them to be, seeds from what is `seen`. `chosen` tells of a
/// target (from 0) and its circle whether the box is to know it; a target without one is left out.
pub(crate) fn text(
    name: &str,
    parts: &Parts,
    seen: &Parts,
    tables: &SetupTables,
    chosen: &dyn Fn(usize, usize) -> bool,
) -> String {
    let mut out = String::new();
    // Writing into a String cannot fail.
    let _ = write_text(&mut out, name, [parts, seen], tables, chosen);
    out
}

fn write_text(
    out: &mut String,
    name: &str,
    [parts, seen]: [&Parts; 2],
    tables: &SetupTables,
    chosen: &dyn Fn(usize, usize) -> bool,
) -> std::fmt::Result {
    let camera = &parts.camera;
    writeln!(out, "# Written with the scene `{}`; seeds are the projected centres at rest.", quoted(name))?;
    writeln!(out, "name = {}\n\n[camera]", quoted(name))?;
    writeln!(out, "width_px = {}\nheight_px = {}", parts.size[0], parts.size[1])?;
    writeln!(out, "rate_hz = {:?}", parts.rate_hz)?;
    if parts.line_time_s != 0.0 {
        writeln!(out, "line_time_us = {}", round(1e6 * parts.line_time_s))?;
    }
    if parts.exposure_s != 0.0 {
        writeln!(out, "exposure_ms = {}", round(1e3 * parts.exposure_s))?;
    }
    writeln!(out, "focal_px = {:?}\nprincipal_px = {:?}", camera.focal, camera.principal)?;
    writeln!(out, "skew_px = {:?}\ndistortion = {:?}", camera.skew, camera.distortion)?;
    if let Some([position, [roll, pitch, yaw]]) = camera.place {
        writeln!(out, "position_mm = {position:?}")?;
        writeln!(out, "roll_deg = {roll:?}\npitch_deg = {pitch:?}\nyaw_deg = {yaw:?}")?;
    }
    for (target, (plate, seen_plate)) in parts.plates.iter().zip(&seen.plates).enumerate() {
        let known: Vec<usize> = (0..plate.circles.len()).filter(|circle| chosen(target, *circle)).collect();
        if known.is_empty() {
            continue;
        }
        writeln!(out, "\n[[target]]\nname = {}", quoted(&plate.name))?;
        if plate.carbody != 2 {
            writeln!(out, "carbody = {}", plate.carbody)?;
        }
        writeln!(out, "origin_mm = {:?}", plate.origin)?;
        writeln!(out, "u = {:?}\nv = {:?}", plate.axes[0], plate.axes[1])?;
        writeln!(out, "outer_diameter_mm = {:?}", 2.0 * plate.radii[0])?;
        if plate.is_lit {
            writeln!(out, "kind = \"led\"")?;
        } else {
            writeln!(out, "inner_diameter_mm = {:?}", 2.0 * plate.radii[1])?;
        }
        let circles: Vec<[f64; 2]> = known.iter().map(|circle| plate.circles[*circle]).collect();
        writeln!(out, "circles_mm = {circles:?}")?;
        if let Some(seeds) = seeds(seen, seen_plate).filter(|_| tables.seeds != Some(false)) {
            let rounded: Vec<String> =
                known.iter().map(|i| format!("[{:.3}, {:.3}]", seeds[*i][0], seeds[*i][1])).collect();
            writeln!(out, "seeds_px = [{}]", rounded.join(", "))?;
        }
    }
    let extra = [
        ("tracker", &tables.tracker),
        ("solver", &tables.solver),
        ("rest", &tables.rest),
        ("limits", &tables.limits),
        ("capture", &tables.capture),
        ("board", &tables.board),
    ];
    for (name, table) in extra {
        if let Some(table) = table {
            writeln!(out, "\n[{name}]\n{}", table.to_string().trim_end())?;
        }
    }
    Ok(())
}

/// A number as it was written in the scene, without the digits that its unit has cost.
fn round(number: f64) -> f64 {
    (number * 1e9).round() / 1e9
}

fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}
