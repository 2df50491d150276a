//! Every setting with its value and where it came from, and the reference of all settings for SETUP.md.

use std::fmt::Write as _;

use crate::Setup;
use crate::parts::{Parts, Target};
use crate::slot::{Slot, Value};
use crate::table::{Key, SECTIONS, TARGET};

/// One setting as it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Its path in the file, such as `target[0].origin_mm`.
    pub path: String,
    /// Its value.
    pub value: Value,
    /// Its unit; empty where it has none.
    pub unit: &'static str,
    /// Its default; `None` where the file must say it.
    pub default: Option<Value>,
    /// What is allowed: bounds, or the words to choose from.
    pub allowed: Allowed,
    /// The line of the file that says it; `None` where it is the default.
    pub line: Option<usize>,
    /// What it means.
    pub meaning: &'static str,
    /// The thesis section it comes from; empty where it comes from none.
    pub source: &'static str,
}

/// What a setting may be.
#[derive(Clone, Debug, PartialEq)]
pub enum Allowed {
    /// Least and greatest value of each number.
    Between(f64, f64),
    /// Least and greatest length of a text, bytes.
    Bytes(usize, usize),
    /// One of these words.
    Words(&'static [&'static str]),
    /// True or false.
    Flag,
}

impl std::fmt::Display for Allowed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Allowed::Between(least, greatest) => write!(f, "{least} to {greatest}"),
            Allowed::Bytes(least, greatest) => write!(f, "{least} to {greatest} bytes"),
            Allowed::Words(words) => f.write_str(&words.join(", ")),
            Allowed::Flag => f.write_str("true, false"),
        }
    }
}

impl Setup {
    /// Every setting, those of the targets after the camera's.
    pub fn table(&self) -> Vec<Row> {
        let (parts, defaults) = (self.parts(), Parts::default());
        let mut rows = Vec::new();
        for section in SECTIONS {
            self.rows(&mut rows, section.name, section.keys, parts, &defaults);
            if section.name == "camera" {
                for (i, target) in parts.targets.iter().enumerate() {
                    self.rows(&mut rows, &format!("target[{i}]"), TARGET, target, &Target::default());
                }
            }
        }
        rows
    }

    fn rows<T: Clone>(&self, rows: &mut Vec<Row>, section: &str, keys: &[Key<T>], of: &T, defaults: &T) {
        for key in keys {
            let path = key.path(section);
            rows.push(Row {
                value: key.value(of),
                unit: key.unit,
                default: (!key.required).then(|| key.value(defaults)),
                allowed: allowed(key, defaults),
                line: self.line(&path),
                meaning: key.meaning,
                source: key.source,
                path,
            });
        }
    }
}

fn allowed<T: Clone>(key: &Key<T>, defaults: &T) -> Allowed {
    match (key.slot)(&mut defaults.clone()) {
        Slot::Text(_) => Allowed::Bytes(key.least as usize, key.greatest as usize),
        Slot::Word(word) => Allowed::Words(word.words()),
        Slot::Flag(_) => Allowed::Flag,
        _ => Allowed::Between(key.least, key.greatest),
    }
}

/// The reference of all settings, as SETUP.md carries it: one Markdown table a section.
pub fn reference() -> String {
    let mut text = String::new();
    for section in SECTIONS {
        let name = match section.name {
            "" => "Head of the file".to_owned(),
            name => format!("`[{name}]`"),
        };
        tables(&mut text, &name, section.keys, &Parts::default());
        if section.name == "camera" {
            tables(&mut text, "`[[target]]`, once a target", TARGET, &Target::default());
        }
    }
    text
}

fn tables<T: Clone>(text: &mut String, name: &str, keys: &[Key<T>], defaults: &T) {
    let _ = writeln!(text, "### {name}\n");
    text.push_str(
        "| key | type | unit | default | allowed | meaning | thesis |\n|---|---|---|---|---|---|---|\n",
    );
    for key in keys {
        let kind = match (key.slot)(&mut defaults.clone()) {
            Slot::Text(_) => "text".to_owned(),
            Slot::Word(_) => "word".to_owned(),
            Slot::Flag(_) => "flag".to_owned(),
            Slot::Byte(_) | Slot::Whole(_) => "whole number".to_owned(),
            Slot::Number(_) => "number".to_owned(),
            Slot::Numbers(numbers) => format!("{} numbers", numbers.len()),
            Slot::Range(..) => "least, greatest".to_owned(),
            Slot::Pairs(_) => "pairs of numbers".to_owned(),
            Slot::Bytes(_) => "whole numbers".to_owned(),
        };
        let default = match key.required {
            true => "required".to_owned(),
            false => format!("`{}`", key.value(defaults)),
        };
        let _ = writeln!(
            text,
            "| `{}` | {kind} | {} | {default} | {} | {} | {} |",
            key.name,
            key.unit,
            allowed(key, defaults),
            key.meaning,
            key.source
        );
    }
    text.push('\n');
}
