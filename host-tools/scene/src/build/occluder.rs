//! What passes between camera and targets: occluders, people and posts, from their tables.

use super::rising;
use crate::error::Mistake;
use crate::file::{PersonTable, SceneFile, Side};
use crate::keys::{self, join};
use crate::occluder::Occluder;

pub(super) fn occluders(file: &SceneFile, [width, height]: [u32; 2]) -> Result<Vec<Occluder>, Mistake> {
    let mut all = Vec::new();
    for (i, table) in file.occluder.iter().enumerate() {
        let at = format!("occluder[{i}]");
        for point in &table.path {
            keys::OCCLUDER_PATH.take_all(&at, *point)?;
        }
        if table.path.len() < 2 {
            return Err(Mistake::new(join(&at, "path"), "allowed are two points (s, u, v) or more"));
        }
        rising(table.path.iter().map(|point| point[0]), &join(&at, "path"))?;
        all.push(Occluder {
            size: keys::OCCLUDER_SIZE.take_all(&at, table.size_px)?,
            path: table.path.clone(),
            level: keys::OCCLUDER_LEVEL.take(&at, table.level)?,
        });
    }
    let (width, height) = (f64::from(width), f64::from(height));
    for (i, table) in file.person.iter().enumerate() {
        all.extend(person(table, &format!("person[{i}]"), [width, height])?);
    }
    for (i, table) in file.post.iter().enumerate() {
        let at = format!("post[{i}]");
        let post = keys::POST_WIDTH.take(&at, table.width_px)?;
        let times =
            [keys::POST_ENTERS.take(&at, table.enters_s)?, keys::POST_LEAVES.take(&at, table.leaves_s)?];
        rising(times.into_iter(), &join(&at, "leaves_s"))?;
        // From just outside one edge to just outside the other.
        let ends = [-0.5 - 0.5 * post, width - 0.5 + 0.5 * post];
        let [from, to] = match table.to {
            Side::Right => ends,
            Side::Left => [ends[1], ends[0]],
        };
        let middle = 0.5 * height;
        all.push(Occluder {
            size: [post, 4.0 * height],
            path: vec![[times[0], from, middle], [times[1], to, middle]],
            level: keys::OCCLUDER_LEVEL.take(&at, table.level)?,
        });
    }
    Ok(all)
}

/// A person who comes in from one side, stands and goes on to the other: head, trunk and two legs. The feet
/// are below the picture.
fn person(
    table: &PersonTable,
    at: &str,
    [width, height]: [f64; 2],
) -> Result<impl Iterator<Item = Occluder> + use<>, Mistake> {
    let wide = keys::PERSON_WIDTH.take(at, table.width_px)?;
    let tall = keys::PERSON_HEIGHT.take(at, table.height_px)?;
    let stands = keys::PERSON_AT.take(at, table.at_px)?;
    let times = [
        keys::PERSON_ENTERS.take(at, table.enters_s)?,
        keys::PERSON_STANDS.take(at, table.stands_s)?,
        keys::PERSON_GOES.take(at, table.goes_s)?,
        keys::PERSON_LEAVES.take(at, table.leaves_s)?,
    ];
    rising(times.into_iter(), &join(at, "leaves_s"))?;
    let level = keys::OCCLUDER_LEVEL.take(at, table.level)?;
    let ends = [-0.5 - 0.5 * wide, width - 0.5 + 0.5 * wide];
    let places = match table.to {
        Side::Right => [ends[0], stands, stands, ends[1]],
        Side::Left => [ends[1], stands, stands, ends[0]],
    };
    // A tenth of the height is below the picture's edge.
    let top = 1.1 * height - tall;
    // Middle and size of each piece, as shares of width and height.
    let pieces = [
        ([0.0, 0.07], [0.4, 0.14]),
        ([0.0, 0.35], [1.0, 0.44]),
        ([-0.25, 0.785], [0.4, 0.43]),
        ([0.25, 0.785], [0.4, 0.43]),
    ];
    Ok(pieces.into_iter().map(move |([u, v], size)| Occluder {
        size: [size[0] * wide, size[1] * tall],
        path: times.iter().zip(places).map(|(t, place)| [*t, place + u * wide, top + v * tall]).collect(),
        level,
    }))
}
