//! Targets and posters, from their tables.

use crate::error::Mistake;
use crate::file::{Kind, TargetTable};
use crate::keys::{self, join};
use crate::optics::{Vec3, add, cross, dot, scale};
use crate::plate::Plate;

/// How far the given axes of a target may be from unit length and a right angle.
const AXES_TOLERANCE: f64 = 1e-3;

/// The tables of one kind, called `key` in the file.
pub(super) fn plates(tables: &[TargetTable], key: &str) -> Result<Vec<Plate>, Mistake> {
    tables.iter().enumerate().map(|(i, table)| plate(table, &format!("{key}[{i}]"))).collect()
}

fn plate(table: &TargetTable, at: &str) -> Result<Plate, Mistake> {
    let axes = axes(table, at)?;
    let outer = keys::OUTER.take(at, table.outer_diameter_mm)?;
    let is_lit = table.kind == Kind::Led;
    let inner = match (is_lit, table.inner_diameter_mm) {
        (true, None) => 0.0,
        (true, Some(_)) => {
            return Err(Mistake::new(
                join(at, "inner_diameter_mm"),
                "a disc has no inner edge; leave it out",
            ));
        }
        (false, inner) => keys::INNER.take(at, inner)?,
    };
    if inner >= outer {
        let message = format!("is {inner}, allowed is less than outer_diameter_mm, {outer} mm");
        return Err(Mistake::new(join(at, "inner_diameter_mm"), message));
    }
    let circles = join(at, "circles_mm");
    if table.circles_mm.is_empty() {
        return Err(Mistake::new(circles, "allowed is at least one circle"));
    }
    let mut sheet = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for (i, circle) in table.circles_mm.iter().enumerate() {
        keys::CIRCLE.take_all(at, *circle)?;
        if let Some(j) = table.circles_mm[..i]
            .iter()
            .position(|other| (other[0] - circle[0]).hypot(other[1] - circle[1]) <= outer)
        {
            let message =
                format!("circles {j} and {i} overlap, allowed is a distance of more than {outer} mm");
            return Err(Mistake::new(circles, message));
        }
        for (side, middle) in sheet.iter_mut().zip(circle) {
            *side = [side[0].min(middle - 0.5 * outer), side[1].max(middle + 0.5 * outer)];
        }
    }
    // Without a size of its own the sheet leaves half a diameter of paper around the rings.
    let printed = sheet;
    let sheet = match table.sheet_mm {
        Some(size) => keys::SHEET.take_all(at, size)?.map(|side| [-0.5 * side, 0.5 * side]),
        None => sheet.map(|[least, most]| [least - 0.5 * outer, most + 0.5 * outer]),
    };
    if sheet.iter().zip(&printed).any(|(sheet, rings)| rings[0] < sheet[0] || rings[1] > sheet[1]) {
        let need = printed.map(|[least, most]| 2.0 * most.max(-least));
        let message = format!("does not hold the rings, allowed is at least {} x {} mm", need[0], need[1]);
        return Err(Mistake::new(join(at, "sheet_mm"), message));
    }
    let white = if is_lit { keys::UNLIT } else { keys::WHITE };
    let mut reflectance = [white.take(at, table.white)?, keys::BLACK.take(at, table.black)?];
    if reflectance[1] >= reflectance[0] {
        let message = format!("is {}, allowed is less than white, {}", reflectance[1], reflectance[0]);
        return Err(Mistake::new(join(at, "black"), message));
    }
    if is_lit {
        reflectance.reverse();
    }
    Ok(Plate {
        is_lit,
        name: table.name.clone(),
        carbody: keys::CARBODY.take_whole(at, table.carbody)? as u8,
        origin: keys::ORIGIN.take_all(at, table.origin_mm)?,
        axes,
        circles: table.circles_mm.clone(),
        radii: [0.5 * outer, 0.5 * inner],
        sheet,
        reflectance,
    })
}

/// The target's axes: u to the right and v up as a camera sees them that looks along the carbody's x.
fn axes(table: &TargetTable, at: &str) -> Result<[Vec3; 3], Mistake> {
    let (u, v) = (table.u.unwrap_or([0.0, -1.0, 0.0]), table.v.unwrap_or([0.0, 0.0, 1.0]));
    for (axis, key) in [(&u, "u"), (&v, "v")] {
        let length = dot(axis, axis).sqrt();
        if !length.is_finite() || (length - 1.0).abs() > AXES_TOLERANCE {
            let message = format!("has length {length:.4}, allowed is 1 within {AXES_TOLERANCE}");
            return Err(Mistake::new(join(at, key), message));
        }
    }
    let cosine = dot(&u, &v);
    if cosine.abs() > AXES_TOLERANCE {
        let message =
            format!("is not at a right angle to u (u.v = {cosine:.4}), allowed is 0 within {AXES_TOLERANCE}");
        return Err(Mistake::new(join(at, "v"), message));
    }
    let u = scale(&u, 1.0 / dot(&u, &u).sqrt());
    let v = add(&v, &scale(&u, -dot(&u, &v)));
    let v = scale(&v, 1.0 / dot(&v, &v).sqrt());
    Ok([u, v, cross(&u, &v)])
}
