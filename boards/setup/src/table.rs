//! The one table of everything that a person can set: key, unit, bounds, meaning, source and place.
//!
//! Reading, checking, showing, writing and the reference in SETUP.md all follow it. A default is what the
//! place holds before a file is read.

mod hardware;
mod measuring;
mod view;

use crate::parts::Parts;
use crate::slot::{Slot, Value};
use hardware::{BOARD, CAPTURE};
use measuring::{LIMITS, REST, SOLVER, TRACKER};
use view::CAMERA;
pub(crate) use view::TARGET;

/// One setting of `T`.
pub(crate) struct Key<T> {
    /// Its key within its section.
    pub(crate) name: &'static str,
    /// Its unit; empty where it has none.
    pub(crate) unit: &'static str,
    /// Least value (of each number; of a text: its length in bytes).
    pub(crate) least: f64,
    /// Greatest value, as `least`.
    pub(crate) greatest: f64,
    /// Whether the file must say it.
    pub(crate) required: bool,
    /// What it means, in one line.
    pub(crate) meaning: &'static str,
    /// The thesis section that it comes from; empty where it comes from none.
    pub(crate) source: &'static str,
    /// Where it lives.
    pub(crate) slot: for<'a> fn(&'a mut T) -> Slot<'a>,
}

/// A table of the file with its keys; the first, without a name, is the file's head.
pub(crate) struct Section {
    /// Its name in the file.
    pub(crate) name: &'static str,
    /// Whether the file must have it.
    pub(crate) required: bool,
    /// Its keys.
    pub(crate) keys: &'static [Key<Parts>],
}

impl<T> Key<T> {
    /// The path of this key in a section.
    pub(crate) fn path(&self, section: &str) -> String {
        if section.is_empty() { self.name.to_owned() } else { format!("{section}.{}", self.name) }
    }

    /// What `of` holds for this key.
    pub(crate) fn value(&self, of: &T) -> Value
    where
        T: Clone,
    {
        (self.slot)(&mut of.clone()).value()
    }

    /// Whether a number is in the bounds.
    pub(crate) fn within(&self, number: f64) -> bool {
        number >= self.least && number <= self.greatest
    }

    /// The bounds of a number, to follow "it must be".
    pub(crate) fn between(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        format!("between {} and {}{unit}", self.least, self.greatest)
    }

    /// What is allowed, to follow "it must be".
    pub(crate) fn allowed(&self, slot: &Slot) -> String {
        let between = self.between();
        match slot {
            Slot::Text(_) => {
                format!("a text of {} to {} bytes without control characters", self.least, self.greatest)
            }
            Slot::Word(word) => {
                word.words().iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>().join(" or ")
            }
            Slot::Flag(_) => "true or false".to_owned(),
            Slot::Byte(_) | Slot::Whole(_) => format!("a whole number {between}"),
            Slot::Number(_) => format!("a number {between}"),
            Slot::Numbers(numbers) => format!("a list of {} numbers, each {between}", numbers.len()),
            Slot::Range(..) => {
                format!("[least, greatest], two numbers {between}, the least below the greatest")
            }
            Slot::Pairs(_) => format!("a list of pairs of numbers [u, v], each {between}"),
            Slot::Bytes(_) => format!("a list of whole numbers, each {between}"),
        }
    }
}

/// A key of the whole file, not of a target.
type FileKey = Key<Parts>;

/// The sections, in the order in which they are written and shown.
pub(crate) const SECTIONS: &[Section] = &[
    Section { name: "", required: true, keys: HEAD },
    Section { name: "camera", required: true, keys: CAMERA },
    Section { name: "tracker", required: false, keys: TRACKER },
    Section { name: "solver", required: false, keys: SOLVER },
    Section { name: "rest", required: false, keys: REST },
    Section { name: "limits", required: false, keys: LIMITS },
    Section { name: "capture", required: false, keys: CAPTURE },
    Section { name: "board", required: false, keys: BOARD },
];

const HEAD: &[FileKey] = &[Key {
    name: "name",
    unit: "",
    least: 1.0,
    greatest: gangway_engine::MAX_NAME as f64,
    required: true,
    meaning: "Name of the box, as records and sessions carry it.",
    source: "",
    slot: |p| Slot::Text(&mut p.name),
}];
