//! The scene file (TOML): its tables as they are written, and where in it a mistake is. `build` makes a
//! validated scene of them. The scenes built in are its commented examples.

use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{Mistake, SceneError};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneFile {
    pub(crate) name: String,
    pub(crate) frames: Option<i64>,
    #[serde(default)]
    pub(crate) seed: u64,
    pub(crate) camera: CameraTable,
    #[serde(default)]
    pub(crate) sensor: SensorTable,
    #[serde(default)]
    pub(crate) light: LightTable,
    #[serde(default)]
    pub(crate) sun: Vec<SunTable>,
    #[serde(default)]
    pub(crate) glare: Vec<GlareTable>,
    #[serde(default)]
    pub(crate) lamp: LampTable,
    #[serde(default)]
    pub(crate) background: BackgroundTable,
    pub(crate) target: Vec<TargetTable>,
    #[serde(default)]
    pub(crate) tolerance: ToleranceTable,
    #[serde(default)]
    pub(crate) poster: Vec<TargetTable>,
    #[serde(default)]
    pub(crate) motion: MotionTable,
    #[serde(default)]
    pub(crate) knock: Vec<KnockTable>,
    #[serde(default)]
    pub(crate) shake: Vec<ShakeTable>,
    #[serde(default)]
    pub(crate) occluder: Vec<OccluderTable>,
    #[serde(default)]
    pub(crate) post: Vec<PostTable>,
    #[serde(default)]
    pub(crate) person: Vec<PersonTable>,
    #[serde(default)]
    pub(crate) setup: SetupTables,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CameraTable {
    pub(crate) width_px: Option<i64>,
    pub(crate) height_px: Option<i64>,
    pub(crate) rate_hz: Option<f64>,
    pub(crate) focal_px: [f64; 2],
    pub(crate) principal_px: [f64; 2],
    pub(crate) skew_px: Option<f64>,
    #[serde(default)]
    pub(crate) distortion: [f64; 5],
    pub(crate) exposure_ms: Option<f64>,
    pub(crate) line_time_us: Option<f64>,
    pub(crate) position_mm: [f64; 3],
    pub(crate) own_position_mm: Option<[f64; 3]>,
    pub(crate) roll_deg: Option<f64>,
    pub(crate) pitch_deg: Option<f64>,
    pub(crate) yaw_deg: Option<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SensorTable {
    pub(crate) bits: Option<i64>,
    pub(crate) blur_px: Option<f64>,
    pub(crate) full_well_e: Option<f64>,
    pub(crate) read_noise_e: Option<f64>,
    pub(crate) shot_noise: Option<bool>,
    pub(crate) gain: Option<f64>,
    pub(crate) black_level: Option<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LightTable {
    pub(crate) level: Option<f64>,
    #[serde(default)]
    pub(crate) gradient: [f64; 2],
    pub(crate) vignetting: Option<f64>,
    #[serde(default)]
    pub(crate) curve: Vec<[f64; 2]>,
    pub(crate) flicker_depth: Option<f64>,
    pub(crate) flicker_hz: Option<f64>,
    pub(crate) flicker_phase_deg: Option<f64>,
    #[serde(default)]
    pub(crate) fall: Vec<FallTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SunTable {
    pub(crate) size_px: [f64; 2],
    pub(crate) path: Vec<[f64; 3]>,
    pub(crate) edge_px: Option<f64>,
    pub(crate) level: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GlareTable {
    pub(crate) radius_px: Option<f64>,
    pub(crate) path: Vec<[f64; 3]>,
    pub(crate) level: Option<f64>,
}

/// How the lamps of lit targets are driven: a recording cannot follow the box.
#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Drive {
    #[default]
    On,
    Off,
    Alternate,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LampTable {
    pub(crate) level: Option<f64>,
    #[serde(default)]
    pub(crate) drive: Drive,
    #[serde(default)]
    pub(crate) starts_dark: bool,
    pub(crate) delay_ms: Option<f64>,
    #[serde(default)]
    pub(crate) switches_s: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FallTable {
    pub(crate) start_s: Option<f64>,
    pub(crate) fall_s: Option<f64>,
    pub(crate) end_s: Option<f64>,
    pub(crate) rise_s: Option<f64>,
    pub(crate) level: Option<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BackgroundTable {
    pub(crate) level: Option<f64>,
    pub(crate) texture: Option<f64>,
    pub(crate) grain_px: Option<f64>,
    pub(crate) shapes: Option<i64>,
    pub(crate) wheels: Option<i64>,
    pub(crate) loudspeakers: Option<i64>,
}

#[derive(Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Kind {
    #[default]
    Printed,
    Led,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TargetTable {
    pub(crate) name: String,
    #[serde(default)]
    pub(crate) kind: Kind,
    pub(crate) carbody: Option<i64>,
    pub(crate) origin_mm: [f64; 3],
    pub(crate) u: Option<[f64; 3]>,
    pub(crate) v: Option<[f64; 3]>,
    pub(crate) outer_diameter_mm: Option<f64>,
    pub(crate) inner_diameter_mm: Option<f64>,
    pub(crate) circles_mm: Vec<[f64; 2]>,
    pub(crate) sheet_mm: Option<[f64; 2]>,
    pub(crate) white: Option<f64>,
    pub(crate) black: Option<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ToleranceTable {
    pub(crate) print_mm: Option<f64>,
    pub(crate) print_scale_percent: Option<f64>,
    pub(crate) mounting_mm: Option<f64>,
    pub(crate) mounting_deg: Option<f64>,
    pub(crate) focal_percent: Option<f64>,
    pub(crate) principal_percent: Option<f64>,
    pub(crate) distortion_percent: Option<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MotionTable {
    pub(crate) rest_s: Option<f64>,
    pub(crate) csv: Option<String>,
    #[serde(default)]
    pub(crate) sine: Vec<SineTable>,
    #[serde(default)]
    pub(crate) step: Vec<StepTable>,
    #[serde(default)]
    pub(crate) ramp: Vec<RampTable>,
    #[serde(default)]
    pub(crate) stairs: Vec<StairsTable>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Degree {
    X,
    Y,
    Z,
    Roll,
    Pitch,
    Yaw,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SineTable {
    pub(crate) degree: Degree,
    pub(crate) amplitude: Option<f64>,
    pub(crate) frequency_hz: Option<f64>,
    pub(crate) phase_deg: Option<f64>,
    pub(crate) start_s: Option<f64>,
    pub(crate) end_s: Option<f64>,
    pub(crate) fade_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StepTable {
    pub(crate) degree: Degree,
    pub(crate) size: Option<f64>,
    pub(crate) at_s: Option<f64>,
    pub(crate) rise_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RampTable {
    pub(crate) degree: Degree,
    pub(crate) size: Option<f64>,
    pub(crate) start_s: Option<f64>,
    pub(crate) end_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StairsTable {
    pub(crate) degree: Degree,
    pub(crate) size: Option<f64>,
    pub(crate) steps: Option<i64>,
    pub(crate) start_s: Option<f64>,
    pub(crate) every_s: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct OccluderTable {
    pub(crate) size_px: [f64; 2],
    pub(crate) path: Vec<[f64; 3]>,
    pub(crate) level: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PostTable {
    pub(crate) width_px: Option<f64>,
    pub(crate) enters_s: Option<f64>,
    pub(crate) leaves_s: Option<f64>,
    pub(crate) to: Side,
    pub(crate) level: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PersonTable {
    pub(crate) width_px: Option<f64>,
    pub(crate) height_px: Option<f64>,
    pub(crate) at_px: Option<f64>,
    pub(crate) enters_s: Option<f64>,
    pub(crate) stands_s: Option<f64>,
    pub(crate) goes_s: Option<f64>,
    pub(crate) leaves_s: Option<f64>,
    pub(crate) to: Side,
    pub(crate) level: Option<f64>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Side {
    Left,
    Right,
}

/// The camera's mount is knocked out of its place, and stays there.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct KnockTable {
    pub(crate) at_s: Option<f64>,
    pub(crate) takes_s: Option<f64>,
    #[serde(default)]
    pub(crate) shift_mm: [f64; 3],
    #[serde(default)]
    pub(crate) turn_deg: [f64; 3],
}

/// The camera's mount vibrates about its place.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ShakeTable {
    pub(crate) frequency_hz: Option<f64>,
    pub(crate) phase_deg: Option<f64>,
    pub(crate) start_s: Option<f64>,
    pub(crate) end_s: Option<f64>,
    pub(crate) fade_s: Option<f64>,
    #[serde(default)]
    pub(crate) shift_mm: [f64; 3],
    #[serde(default)]
    pub(crate) turn_deg: [f64; 3],
}

/// What goes into the written setup: whether the targets have seeds, how far off the camera's place is told
/// if it is told at all, and tables as they are.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SetupTables {
    pub(crate) seeds: Option<bool>,
    pub(crate) place_off_mm: Option<f64>,
    pub(crate) place_off_deg: Option<f64>,
    pub(crate) tracker: Option<toml::Table>,
    pub(crate) solver: Option<toml::Table>,
    pub(crate) rest: Option<toml::Table>,
    pub(crate) limits: Option<toml::Table>,
    pub(crate) capture: Option<toml::Table>,
    pub(crate) board: Option<toml::Table>,
}

impl SceneFile {
    /// Reads the text; `name` is the file's name for messages.
    pub(crate) fn parse(text: &str, name: &str) -> Result<Self, SceneError> {
        toml::from_str(text).map_err(|error| {
            let at = error.span().unwrap_or(0..0);
            let key = DeTable::parse(text).ok().and_then(|tree| key_at(&tree, &at)).unwrap_or_default();
            let message = plain(&error.message().trim().replace('\n', ", "));
            SceneError::Value { file: name.to_owned(), line: line_of(text, at.start), key, message }
        })
    }
}

/// A message without the names of the language's types.
fn plain(message: &str) -> String {
    let names = [
        ("expected u64", "expected a whole number of 0 or more"),
        ("expected i64", "expected a number"),
        ("expected f64", "expected a number"),
        (" as i128", ""),
    ];
    names.iter().fold(message.to_owned(), |message, (name, means)| message.replace(name, means))
}

/// The error of a mistake, with the line of its key, or of the nearest table around it.
pub(crate) fn locate(mistake: Mistake, text: &str, name: &str) -> SceneError {
    let offset = DeTable::parse(text).map_or(0, |tree| offset_of(&tree, &mistake.key));
    SceneError::Value {
        file: name.to_owned(),
        line: line_of(text, offset),
        key: mistake.key,
        message: mistake.message,
    }
}

fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
}

/// Where a key as in `target[1].circles_mm` stands in the text.
fn offset_of(tree: &Spanned<DeTable<'_>>, key: &str) -> usize {
    let mut offset = 0;
    let mut table = Some(tree.get_ref());
    for part in key.split('.') {
        let (name, index) = match part.split_once('[') {
            Some((name, rest)) => (name, rest.trim_end_matches(']').parse::<usize>().ok()),
            None => (part, None),
        };
        let Some((found, value)) = table.and_then(|table| table.get_key_value(name)) else { break };
        offset = found.span().start;
        let mut value = value.get_ref();
        if let Some(item) = index.and_then(|index| value.get(index)) {
            offset = item.span().start;
            value = item.get_ref();
        }
        table = value.as_table();
    }
    offset
}

/// The key whose value is at a place in the text.
fn key_at(tree: &Spanned<DeTable<'_>>, at: &Range<usize>) -> Option<String> {
    fn holds(span: Range<usize>, at: &Range<usize>) -> bool {
        span.start <= at.start && at.end <= span.end
    }
    fn in_table(table: &DeTable<'_>, prefix: &str, at: &Range<usize>) -> Option<String> {
        table.iter().find_map(|(name, value)| {
            let path = crate::keys::join(prefix, name.get_ref());
            match value.get_ref() {
                DeValue::Table(inner) => in_table(inner, &path, at),
                DeValue::Array(items) => items
                    .iter()
                    .enumerate()
                    .find_map(|(i, item)| in_table(item.get_ref().as_table()?, &format!("{path}[{i}]"), at))
                    .or_else(|| holds(value.span(), at).then_some(path)),
                _ => holds(value.span(), at).then_some(path),
            }
        })
    }
    in_table(tree.get_ref(), "", at)
}
