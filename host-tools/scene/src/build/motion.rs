//! The motion of the carbody, and of the camera on its own, from their tables.

use crate::error::Mistake;
use crate::file::{Degree, SceneFile};
use crate::keys::{self, join};
use crate::motion::{Motion, Motions, Term};
use crate::mount::Mount;

pub(super) fn motion(file: &SceneFile, table: Vec<Motions>, rate_hz: f64) -> Result<Motion, Mistake> {
    let tables = &file.motion;
    let rest_s = keys::REST.take("motion", tables.rest_s)?;
    let after_rest = |start: f64, key: String| {
        if start < rest_s {
            return Err(Mistake::new(
                key,
                format!("is {start}, during rest; allowed is {rest_s} s or later"),
            ));
        }
        Ok(start)
    };
    let ordered = |start: f64, end: f64, at: &str| {
        if end <= start {
            let message = format!("is {end}, allowed is more than {start} s, where it starts");
            return Err(Mistake::new(join(at, "end_s"), message));
        }
        Ok(end)
    };
    let mut terms = Vec::new();
    for (i, sine) in tables.sine.iter().enumerate() {
        let at = format!("motion.sine[{i}]");
        let start = keys::TERM_START.take(&at, sine.start_s.or(Some(rest_s)))?;
        let start = after_rest(start, join(&at, "start_s"))?;
        let end = match sine.end_s {
            Some(_) => keys::TERM_END.take(&at, sine.end_s)?,
            None => f64::INFINITY,
        };
        let term = Term::Sine {
            amplitude: keys::AMPLITUDE.take(&at, sine.amplitude)?,
            frequency: keys::FREQUENCY.take(&at, sine.frequency_hz)?,
            phase: keys::PHASE.take(&at, sine.phase_deg)?.to_radians(),
            start,
            end: ordered(start, end, &at)?,
            fade: keys::FADE.take(&at, sine.fade_s)?,
        };
        terms.push((index(sine.degree), term));
    }
    for (i, step) in tables.step.iter().enumerate() {
        let at = format!("motion.step[{i}]");
        let term = Term::Step {
            size: keys::SIZE.take(&at, step.size)?,
            at: after_rest(keys::TERM_AT.take(&at, step.at_s)?, join(&at, "at_s"))?,
            rise: keys::RISE.take(&at, step.rise_s)?,
        };
        terms.push((index(step.degree), term));
    }
    for (i, ramp) in tables.ramp.iter().enumerate() {
        let at = format!("motion.ramp[{i}]");
        let from = after_rest(keys::TERM_START.take(&at, ramp.start_s)?, join(&at, "start_s"))?;
        let to = ordered(from, keys::TERM_END.take(&at, ramp.end_s)?, &at)?;
        terms.push((index(ramp.degree), Term::Ramp { size: keys::SIZE.take(&at, ramp.size)?, from, to }));
    }
    for (i, stairs) in tables.stairs.iter().enumerate() {
        let at = format!("motion.stairs[{i}]");
        let term = Term::Stairs {
            size: keys::SIZE.take(&at, stairs.size)?,
            steps: keys::STEPS.take_whole(&at, stairs.steps)?.into(),
            start: after_rest(keys::TERM_START.take(&at, stairs.start_s)?, join(&at, "start_s"))?,
            every: keys::EVERY.take(&at, stairs.every_s)?,
        };
        terms.push((index(stairs.degree), term));
    }
    Ok(Motion { rest_s, terms, table, rate_hz })
}

pub(super) fn mount(file: &SceneFile) -> Result<Mount, Mistake> {
    let mut terms = Vec::new();
    let sizes = |shift, turn, at: &str| {
        let shift: [f64; 3] = keys::CAMERA_SHIFT.take_all(at, shift)?;
        let turn: [f64; 3] = keys::CAMERA_TURN.take_all(at, turn)?;
        Ok(shift.into_iter().chain(turn).enumerate().filter(|(_, size)| *size != 0.0))
    };
    for (i, knock) in file.knock.iter().enumerate() {
        let table = format!("knock[{i}]");
        let at = keys::TERM_AT.take(&table, knock.at_s)?;
        let rise = keys::KNOCK_TAKES.take(&table, knock.takes_s)?;
        let sizes = sizes(knock.shift_mm, knock.turn_deg, &table)?;
        terms.extend(sizes.map(|(degree, size)| (degree, Term::Step { size, at, rise })));
    }
    for (i, shake) in file.shake.iter().enumerate() {
        let at = format!("shake[{i}]");
        let start = keys::SHAKE_START.take(&at, shake.start_s)?;
        let end = match shake.end_s {
            Some(_) => keys::TERM_END.take(&at, shake.end_s)?,
            None => f64::INFINITY,
        };
        if end <= start {
            let message = format!("is {end}, allowed is more than {start} s, where it starts");
            return Err(Mistake::new(join(&at, "end_s"), message));
        }
        let frequency = keys::FREQUENCY.take(&at, shake.frequency_hz)?;
        let phase = keys::PHASE.take(&at, shake.phase_deg)?.to_radians();
        let fade = keys::FADE.take(&at, shake.fade_s)?;
        let sizes = sizes(shake.shift_mm, shake.turn_deg, &at)?;
        terms.extend(sizes.map(|(degree, amplitude)| {
            (degree, Term::Sine { amplitude, frequency, phase, start, end, fade })
        }));
    }
    Ok(Mount { terms })
}

fn index(degree: Degree) -> usize {
    degree as usize
}
