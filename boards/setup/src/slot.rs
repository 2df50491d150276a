//! Where a setting lives and what it holds: the typed places that the table of settings points at.

use std::fmt;

use gangway_engine::LampMode;
use gangway_pose::Method;

/// A borrowed place of one setting.
pub(crate) enum Slot<'a> {
    /// A text of limited length.
    Text(&'a mut String),
    /// One of a few words.
    Word(&'a mut dyn Word),
    /// True or false.
    Flag(&'a mut bool),
    /// A whole number of one byte.
    Byte(&'a mut u8),
    /// A whole number of two bytes.
    Whole(&'a mut u16),
    /// A number.
    Number(&'a mut f64),
    /// So many numbers.
    Numbers(&'a mut [f64]),
    /// The least and the greatest of something.
    Range(&'a mut f64, &'a mut f64),
    /// Any number of pairs.
    Pairs(&'a mut Vec<[f64; 2]>),
    /// Any number of whole numbers of one byte.
    Bytes(&'a mut Vec<u8>),
}

/// A setting that takes one of a few words.
pub(crate) trait Word {
    /// All words.
    fn words(&self) -> &'static [&'static str];
    /// The present one.
    fn index(&self) -> usize;
    /// Takes another.
    fn choose(&mut self, index: usize);
}

impl Word for LampMode {
    fn words(&self) -> &'static [&'static str] {
        &["on", "off", "alternate"]
    }
    fn index(&self) -> usize {
        match self {
            LampMode::On => 0,
            LampMode::Off => 1,
            LampMode::Alternate => 2,
        }
    }
    fn choose(&mut self, index: usize) {
        *self = match index {
            0 => LampMode::On,
            1 => LampMode::Off,
            _ => LampMode::Alternate,
        };
    }
}

impl Word for Method {
    fn words(&self) -> &'static [&'static str] {
        &["auto", "dlt", "epnp"]
    }
    fn index(&self) -> usize {
        match self {
            Method::Auto => 0,
            Method::Dlt => 1,
            Method::Epnp => 2,
        }
    }
    fn choose(&mut self, index: usize) {
        *self = match index {
            0 => Method::Auto,
            1 => Method::Dlt,
            _ => Method::Epnp,
        };
    }
}

impl Slot<'_> {
    /// What the place holds.
    pub(crate) fn value(&self) -> Value {
        match self {
            Slot::Text(text) => Value::Text((*text).clone()),
            Slot::Word(word) => Value::Text(word.words()[word.index()].to_owned()),
            Slot::Flag(flag) => Value::Flag(**flag),
            Slot::Byte(number) => Value::Whole(u16::from(**number)),
            Slot::Whole(number) => Value::Whole(**number),
            Slot::Number(number) => Value::Number(**number),
            Slot::Numbers(numbers) => Value::Numbers(numbers.to_vec()),
            Slot::Range(least, greatest) => Value::Numbers(vec![**least, **greatest]),
            Slot::Pairs(pairs) => Value::Pairs((*pairs).clone()),
            Slot::Bytes(bytes) => Value::Wholes((*bytes).clone()),
        }
    }
}

/// What a setting holds. Its `Display` is TOML and reads back exactly.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A text or a word.
    Text(String),
    /// True or false.
    Flag(bool),
    /// A whole number.
    Whole(u16),
    /// A number.
    Number(f64),
    /// Several numbers.
    Numbers(Vec<f64>),
    /// Pairs of numbers.
    Pairs(Vec<[f64; 2]>),
    /// Whole numbers.
    Wholes(Vec<u8>),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Text(text) => write!(f, "{}", toml::Value::String(text.clone())),
            Value::Flag(flag) => write!(f, "{flag}"),
            Value::Whole(number) => write!(f, "{number}"),
            // The debug form of a number is the shortest that reads back exactly, and always has a point or
            // an exponent, as TOML wants it.
            Value::Number(number) => write!(f, "{}", Float(*number)),
            Value::Numbers(numbers) => list(f, numbers.iter(), |f, number| write!(f, "{}", Float(*number))),
            Value::Pairs(pairs) => {
                list(f, pairs.iter(), |f, [a, b]| write!(f, "[{}, {}]", Float(*a), Float(*b)))
            }
            Value::Wholes(numbers) => list(f, numbers.iter(), |f, number| write!(f, "{number}")),
        }
    }
}

/// A number as TOML writes it.
struct Float(f64);

impl fmt::Display for Float {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_nan() { f.write_str("nan") } else { write!(f, "{:?}", self.0) }
    }
}

fn list<T>(
    f: &mut fmt::Formatter<'_>,
    items: impl Iterator<Item = T>,
    item: impl Fn(&mut fmt::Formatter<'_>, T) -> fmt::Result,
) -> fmt::Result {
    f.write_str("[")?;
    for (i, each) in items.enumerate() {
        if i > 0 {
            f.write_str(", ")?;
        }
        item(f, each)?;
    }
    f.write_str("]")
}
