//! Light, sun, glare and lamps, from their tables.

use super::rising;
use crate::error::Mistake;
use crate::file::{FallTable, GlareTable, SceneFile, SunTable};
use crate::keys::{self, join};
use crate::lamp::{Lamp, LampDrive};
use crate::light::{Fall, Light};
use crate::patch::{Glare, Sun};

pub(super) fn light(file: &SceneFile) -> Result<Light, Mistake> {
    let table = &file.light;
    for point in &table.curve {
        keys::CURVE_LEVEL.take("light", Some(point[1]))?;
    }
    rising(table.curve.iter().map(|point| point[0]), "light.curve")?;
    let fall = |(i, fall): (usize, &FallTable)| {
        let at = format!("light.fall[{i}]");
        let falls = [keys::FALL_START.take(&at, fall.start_s)?, keys::FALL_TAKES.take(&at, fall.fall_s)?];
        let returns = [keys::FALL_END.take(&at, fall.end_s)?, keys::FALL_RETURNS.take(&at, fall.rise_s)?];
        if returns[0] < falls[0] + falls[1] {
            let least = falls[0] + falls[1];
            return Err(Mistake::new(
                join(&at, "end_s"),
                format!("is {}, before the fall is over; allowed is {least} s or later", returns[0]),
            ));
        }
        Ok(Fall { falls, returns, level: keys::FALL_LEVEL.take(&at, fall.level)? })
    };
    Ok(Light {
        level: keys::LIGHT.take("light", table.level)?,
        curve: table.curve.clone(),
        flicker: [
            keys::FLICKER_DEPTH.take("light", table.flicker_depth)?,
            keys::FLICKER.take("light", table.flicker_hz)?,
            keys::FLICKER_PHASE.take("light", table.flicker_phase_deg)?.to_radians(),
        ],
        falls: table.fall.iter().enumerate().map(fall).collect::<Result<_, _>>()?,
        gradient: keys::GRADIENT.take_all("light", table.gradient)?,
        vignetting: keys::VIGNETTING.take("light", table.vignetting)?,
    })
}

pub(super) fn suns(file: &SceneFile) -> Result<Vec<Sun>, Mistake> {
    let sun = |(i, table): (usize, &SunTable)| {
        let at = format!("sun[{i}]");
        Ok(Sun {
            size: keys::PATCH_SIZE.take_all(&at, table.size_px)?,
            path: path(&table.path, &at)?,
            edge: keys::SUN_EDGE.take(&at, table.edge_px)?,
            level: keys::SUN_LEVEL.take(&at, table.level)?,
        })
    };
    file.sun.iter().enumerate().map(sun).collect()
}

pub(super) fn glares(file: &SceneFile) -> Result<Vec<Glare>, Mistake> {
    let glare = |(i, table): (usize, &GlareTable)| {
        let at = format!("glare[{i}]");
        Ok(Glare {
            radius: keys::GLARE_RADIUS.take(&at, table.radius_px)?,
            path: path(&table.path, &at)?,
            level: keys::GLARE_LEVEL.take(&at, table.level)?,
        })
    };
    file.glare.iter().enumerate().map(glare).collect()
}

/// Two points (seconds, u, v) or more, at times that rise.
fn path(points: &[[f64; 3]], at: &str) -> Result<Vec<[f64; 3]>, Mistake> {
    for point in points {
        keys::PATCH_PATH.take_all(at, *point)?;
    }
    if points.len() < 2 {
        return Err(Mistake::new(join(at, "path"), "allowed are two points (s, u, v) or more"));
    }
    rising(points.iter().map(|point| point[0]), &join(at, "path"))?;
    Ok(points.to_vec())
}

pub(super) fn lamp(file: &SceneFile, rate_hz: f64) -> Result<Lamp, Mistake> {
    let table = &file.lamp;
    for at in &table.switches_s {
        keys::LAMP_SWITCHES.take("lamp", Some(*at))?;
    }
    let delay_s = 1e-3 * keys::LAMP_DELAY.take("lamp", table.delay_ms)?;
    Ok(Lamp {
        level: keys::LAMP_LEVEL.take("lamp", table.level)?,
        drive: LampDrive::new(table.drive, table.starts_dark, delay_s, rate_hz),
        switches_s: table.switches_s.clone(),
    })
}
