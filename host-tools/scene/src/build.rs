//! From the scene file's tables to a validated scene: bounds, axes, sheets, times.

use std::path::Path;

use crate::background::Background;
use crate::error::Mistake;
use crate::file::{Degree, Kind, PersonTable, SceneFile, Side, TargetTable};
use crate::keys::{self, join};
use crate::lamp::{Lamp, LampDrive};
use crate::light::{Fall, Light};
use crate::motion::{Motion, Motions, Term};
use crate::mount::Mount;
use crate::occluder::Occluder;
use crate::optics::{Lens, Pose, Vec3, add, cross, dot, scale};
use crate::patch::{Glare, Sun};
use crate::plate::Plate;
use crate::sensor::Sensor;
use crate::tolerance::Tolerance;

/// How far the given axes of a target may be from unit length and a right angle.
const AXES_TOLERANCE: f64 = 1e-3;

/// Everything that a scene file says, checked.
#[derive(Clone, Debug)]
pub(crate) struct Parts {
    pub(crate) frames: u32,
    pub(crate) size: [u32; 2],
    pub(crate) rate_hz: f64,
    pub(crate) exposure_s: f64,
    /// From the exposure of one row to that of the next one below; the frame's time is the middle row's.
    pub(crate) line_time_s: f64,
    pub(crate) camera: CameraNumbers,
    pub(crate) lens: Lens,
    /// CB_02 in the camera at rest.
    pub(crate) rest: Pose,
    /// CB_01, the camera's own carbody, in the camera while that is in its place.
    pub(crate) own: Pose,
    /// How the camera leaves that place.
    pub(crate) mount: Mount,
    pub(crate) sensor: Sensor,
    pub(crate) light: Light,
    pub(crate) suns: Vec<Sun>,
    pub(crate) glares: Vec<Glare>,
    pub(crate) lamp: Lamp,
    pub(crate) background: Background,
    pub(crate) plates: Vec<Plate>,
    /// Sheets with rings on the carbody that are no targets.
    pub(crate) posters: Vec<Plate>,
    pub(crate) motion: Motion,
    pub(crate) occluders: Vec<Occluder>,
    pub(crate) tolerance: Tolerance,
}

/// The camera as the setup file tells it.
#[derive(Clone, Debug)]
pub(crate) struct CameraNumbers {
    pub(crate) focal: [f64; 2],
    pub(crate) principal: [f64; 2],
    pub(crate) skew: f64,
    pub(crate) distortion: [f64; 5],
    /// Its place in CB_02 at rest, mm, and roll, pitch, yaw, degrees, as far off as the scene says, if the
    /// setup tells it.
    pub(crate) place: Option<[[f64; 3]; 2]>,
}

/// Reads the table of motions that a scene names: the only thing outside its file.
pub(crate) type ReadTable<'a> = &'a dyn Fn(&Path) -> Result<Vec<Motions>, Mistake>;

/// Checks a scene file; its motion table is read by `read_table`.
pub(crate) fn build(file: &SceneFile, read_table: ReadTable<'_>) -> Result<Parts, Mistake> {
    if file.name.is_empty() || file.name.len() > 32 {
        return Err(Mistake::new("name", "allowed are 1 to 32 bytes"));
    }
    let table = match &file.motion.csv {
        Some(path) => read_table(Path::new(path))?,
        None => Vec::new(),
    };
    let frames = match (file.frames, table.len()) {
        (None, rows) if rows > 0 => keys::FRAMES.take_whole("", Some(rows as i64))?,
        (frames, _) => keys::FRAMES.take_whole("", frames)?,
    };
    let camera = &file.camera;
    let size = [
        keys::WIDTH.take_whole("camera", camera.width_px)?,
        keys::HEIGHT.take_whole("camera", camera.height_px)?,
    ];
    let rate_hz = keys::RATE.take("camera", camera.rate_hz)?;
    let exposure_ms = keys::EXPOSURE.take("camera", camera.exposure_ms)?;
    if exposure_ms > 1000.0 / rate_hz {
        return Err(Mistake::new(
            "camera.exposure_ms",
            format!(
                "is {exposure_ms}, longer than a frame at {rate_hz} Hz; allowed is 0 to {} ms",
                1000.0 / rate_hz
            ),
        ));
    }
    let position = keys::POSITION.take_all("camera", camera.position_mm)?;
    let turned = [
        keys::CAMERA_ROLL.take("camera", camera.roll_deg)?,
        keys::CAMERA_PITCH.take("camera", camera.pitch_deg)?,
        keys::CAMERA_YAW.take("camera", camera.yaw_deg)?,
    ];
    let off_mm = keys::PLACE_OFF.take("setup", file.setup.place_off_mm)?;
    let off_deg = keys::PLACE_TURNED.take("setup", file.setup.place_off_deg)?;
    let is_told = file.setup.place_off_mm.is_some() || file.setup.place_off_deg.is_some();
    let numbers = CameraNumbers {
        place: is_told.then(|| [position.map(|at| at + off_mm), turned.map(|angle| angle + off_deg)]),
        focal: keys::FOCAL.take_all("camera", camera.focal_px)?,
        principal: keys::PRINCIPAL.take_all("camera", camera.principal_px)?,
        skew: keys::SKEW.take("camera", camera.skew_px)?,
        distortion: keys::DISTORTION.take_all("camera", camera.distortion)?,
    };
    // Without a place of its own the ends of the two carbodies touch at rest.
    let own_position = match camera.own_position_mm {
        Some(position) => keys::OWN_POSITION.take_all("camera", position)?,
        None => position,
    };
    let [roll, pitch, yaw] = turned;
    let rest = Pose::of_camera(&position, roll, pitch, yaw);
    if file.target.is_empty() {
        return Err(Mistake::new("target", "allowed is at least one target"));
    }
    let plates = file
        .target
        .iter()
        .enumerate()
        .map(|(i, table)| plate(table, &format!("target[{i}]")))
        .collect::<Result<_, _>>()?;
    let posters = file
        .poster
        .iter()
        .enumerate()
        .map(|(i, table)| plate(table, &format!("poster[{i}]")))
        .collect::<Result<_, _>>()?;
    Ok(Parts {
        frames,
        size,
        rate_hz,
        exposure_s: exposure_ms / 1000.0,
        line_time_s: 1e-6 * keys::LINE_TIME.take("camera", camera.line_time_us)?,
        lens: Lens::new(numbers.focal, numbers.principal, numbers.skew, numbers.distortion),
        camera: numbers,
        rest,
        own: Pose::of_camera(&own_position, roll, pitch, yaw),
        mount: mount(file)?,
        sensor: sensor(file)?,
        light: light(file)?,
        suns: suns(file)?,
        glares: glares(file)?,
        lamp: lamp(file, rate_hz)?,
        background: Background {
            level: keys::BACKGROUND.take("background", file.background.level)?,
            texture: keys::TEXTURE.take("background", file.background.texture)?,
            grain_px: keys::GRAIN.take("background", file.background.grain_px)?,
            shapes: keys::SHAPES.take_whole("background", file.background.shapes)?,
            wheels: keys::WHEELS.take_whole("background", file.background.wheels)?,
            loudspeakers: keys::LOUDSPEAKERS.take_whole("background", file.background.loudspeakers)?,
        },
        plates,
        posters,
        motion: motion(file, table, rate_hz)?,
        occluders: occluders(file, size)?,
        tolerance: tolerance(file)?,
    })
}

fn sensor(file: &SceneFile) -> Result<Sensor, Mistake> {
    let table = &file.sensor;
    Ok(Sensor {
        bits: keys::BITS.take_whole("sensor", table.bits)?,
        blur_px: keys::BLUR.take("sensor", table.blur_px)?,
        full_well_e: keys::FULL_WELL.take("sensor", table.full_well_e)?,
        read_noise_e: keys::READ_NOISE.take("sensor", table.read_noise_e)?,
        shot_noise: table.shot_noise.unwrap_or(true),
        gain: keys::GAIN.take("sensor", table.gain)?,
        black_level: keys::BLACK_LEVEL.take("sensor", table.black_level)?,
    })
}

fn tolerance(file: &SceneFile) -> Result<Tolerance, Mistake> {
    let table = &file.tolerance;
    let at = "tolerance";
    Ok(Tolerance {
        print_mm: keys::PRINT.take(at, table.print_mm)?,
        print_scale: 0.01 * keys::PRINT_SCALE.take(at, table.print_scale_percent)?,
        mounting_mm: keys::MOUNTING.take(at, table.mounting_mm)?,
        mounting_deg: keys::MOUNTING_TURN.take(at, table.mounting_deg)?,
        focal: 0.01 * keys::FOCAL_ERROR.take(at, table.focal_percent)?,
        principal: 0.01 * keys::PRINCIPAL_ERROR.take(at, table.principal_percent)?,
        distortion: 0.01 * keys::DISTORTION_ERROR.take(at, table.distortion_percent)?,
    })
}

fn light(file: &SceneFile) -> Result<Light, Mistake> {
    let table = &file.light;
    for point in &table.curve {
        keys::CURVE_LEVEL.take("light", Some(point[1]))?;
    }
    rising(table.curve.iter().map(|point| point[0]), "light.curve")?;
    let fall = |(i, fall): (usize, &crate::file::FallTable)| {
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

fn suns(file: &SceneFile) -> Result<Vec<Sun>, Mistake> {
    let sun = |(i, table): (usize, &crate::file::SunTable)| {
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

fn glares(file: &SceneFile) -> Result<Vec<Glare>, Mistake> {
    let glare = |(i, table): (usize, &crate::file::GlareTable)| {
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

fn lamp(file: &SceneFile, rate_hz: f64) -> Result<Lamp, Mistake> {
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

fn motion(file: &SceneFile, table: Vec<Motions>, rate_hz: f64) -> Result<Motion, Mistake> {
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

fn mount(file: &SceneFile) -> Result<Mount, Mistake> {
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

fn occluders(file: &SceneFile, [width, height]: [u32; 2]) -> Result<Vec<Occluder>, Mistake> {
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

fn rising(times: impl Iterator<Item = f64>, key: &str) -> Result<(), Mistake> {
    let mut last = f64::NEG_INFINITY;
    for time in times {
        if !time.is_finite() || time <= last {
            return Err(Mistake::new(
                key,
                format!("time {time} follows {last}, allowed are times that rise"),
            ));
        }
        last = time;
    }
    Ok(())
}
