//! From the file's TOML to [`Parts`], by the table of settings: every value with its line, every mistake
//! with its sentence.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::Mistake;
use crate::parts::{Parts, Target};
use crate::slot::Slot;
use crate::table::{Key, SECTIONS, TARGET};

/// A file under the reader's eyes.
pub(crate) struct Document<'t> {
    text: &'t str,
    /// Mistakes so far.
    pub(crate) mistakes: Vec<Mistake>,
    /// The line of every path that the file says.
    pub(crate) lines: BTreeMap<String, usize>,
    /// Paths that are probably meant by keys that are not known: not to be missed once more.
    pub(crate) meant: BTreeSet<String>,
}

impl<'t> Document<'t> {
    /// Opens a text.
    pub(crate) fn new(text: &'t str) -> Self {
        Self { text, mistakes: Vec::new(), lines: BTreeMap::new(), meant: BTreeSet::new() }
    }

    /// Reads the whole file; what it does not say, or says wrongly, keeps its default. `None`: no TOML.
    pub(crate) fn read(&mut self) -> Option<Parts> {
        let mut parts = Parts::default();
        let (document, errors) = DeTable::parse_recoverable(self.text);
        // One mistake in the writing, as a bracket that is left open, makes others of all lines behind it.
        if let Some(error) = errors.iter().min_by_key(|error| error.span().map_or(0, |span| span.start)) {
            let line = error.span().map(|span| self.line(&span));
            let message: Vec<&str> = error.message().lines().map(str::trim).collect();
            let at = error.span().and_then(|span| self.text.get(span)).map(clip);
            let at = at.filter(|at| !at.trim().is_empty()).map_or(String::new(), |at| format!(" at {at}"));
            self.at(line, format!("this is not TOML{at}: {}", message.join("; ")));
            return None;
        }
        let document = document.get_ref();
        self.unknown("", document, &top_level(), "");
        for section in SECTIONS {
            if section.name.is_empty() {
                self.section("", document, None, section.keys, &mut parts);
            } else if let Some(value) = document.get(section.name) {
                let line = self.line(&value.span());
                self.lines.insert(section.name.to_owned(), line);
                match value.get_ref() {
                    DeValue::Table(table) => {
                        let names: Vec<&str> = section.keys.iter().map(|key| key.name).collect();
                        self.unknown(section.name, table, &names, section.name);
                        self.section(section.name, table, Some(line), section.keys, &mut parts);
                    }
                    _ => {
                        let name = section.name;
                        self.wrong(name, value, &format!("a table, [{name}]"));
                    }
                }
            } else if section.required && !self.meant.contains(section.name) {
                self.at(None, format!("[{}] is missing; {}", section.name, needs(section.keys)));
            }
        }
        self.targets(document, &mut parts);
        Some(parts)
    }

    fn targets(&mut self, document: &DeTable, parts: &mut Parts) {
        let Some(value) = document.get("target") else {
            if self.meant.contains("target") {
                return;
            }
            self.at(None, format!("[[target]] is missing; at least one is needed, and {}", needs(TARGET)));
            return;
        };
        let DeValue::Array(tables) = value.get_ref() else {
            return self.wrong("target", value, "a list of tables: each target below its own [[target]]");
        };
        let names: Vec<&str> = TARGET.iter().map(|key| key.name).collect();
        for (i, value) in tables.iter().enumerate() {
            let path = format!("target[{i}]");
            let line = self.line(&value.span());
            self.lines.insert(path.clone(), line);
            let mut target = Target::default();
            if let DeValue::Table(table) = value.get_ref() {
                self.unknown(&path, table, &names, "target");
                self.section(&path, table, Some(line), TARGET, &mut target);
            } else {
                self.wrong(&path, value, "a table, [[target]]");
            }
            parts.targets.push(target);
        }
    }

    /// Reads the known keys of one section.
    fn section<T>(
        &mut self,
        section: &str,
        table: &DeTable,
        line: Option<usize>,
        keys: &[Key<T>],
        into: &mut T,
    ) {
        for key in keys {
            let path = key.path(section);
            let mut slot = (key.slot)(into);
            match table.get(key.name) {
                Some(value) => {
                    let line = self.line(&value.span());
                    self.lines.insert(path.clone(), line);
                    self.value(&path, key, &mut slot, value);
                }
                None if key.required && !self.meant.contains(&path) => {
                    let allowed = key.allowed(&slot);
                    self.at(line, format!("{path} is missing; it must be {allowed}"));
                }
                None => {}
            }
        }
    }

    /// Reads one value into its place.
    fn value<T>(&mut self, path: &str, key: &Key<T>, slot: &mut Slot, value: &Spanned<DeValue>) {
        let content = value.get_ref();
        let taken = match slot {
            Slot::Text(place) => content
                .as_str()
                .filter(|text| key.within(text.len() as f64) && !text.chars().any(char::is_control))
                .map(|text| **place = text.to_owned()),
            Slot::Word(place) => content
                .as_str()
                .and_then(|text| place.words().iter().position(|word| *word == text))
                .map(|index| place.choose(index)),
            Slot::Flag(place) => content.as_bool().map(|flag| **place = flag),
            Slot::Byte(place) => {
                whole(content).filter(|number| key.within(*number)).map(|number| **place = number as u8)
            }
            Slot::Whole(place) => {
                whole(content).filter(|number| key.within(*number)).map(|number| **place = number as u16)
            }
            Slot::Number(place) => return self.number(path, key, place, value),
            Slot::Numbers(places) => match content.as_array() {
                Some(items) if items.len() == places.len() => {
                    for (i, (place, item)) in places.iter_mut().zip(items.iter()).enumerate() {
                        self.number(&format!("{path}[{i}]"), key, place, item);
                    }
                    Some(())
                }
                _ => None,
            },
            Slot::Range(least, greatest) => {
                let items = content.as_array().map(|items| items.iter().collect::<Vec<_>>());
                match items.as_deref() {
                    Some([first, second]) => {
                        let before = self.mistakes.len();
                        self.number(&format!("{path}[0]"), key, least, first);
                        self.number(&format!("{path}[1]"), key, greatest, second);
                        (before < self.mistakes.len() || **least < **greatest).then_some(())
                    }
                    _ => None,
                }
            }
            Slot::Pairs(places) => content.as_array().map(|items| {
                for (i, item) in items.iter().enumerate() {
                    self.pair(&format!("{path}[{i}]"), key, places, item);
                }
            }),
            Slot::Bytes(places) => content.as_array().and_then(|items| {
                let number = |item: &Spanned<DeValue>| whole(item.get_ref()).filter(|n| key.within(*n));
                items.iter().map(number).collect::<Option<Vec<f64>>>().map(|numbers| {
                    **places = numbers.into_iter().map(|number| number as u8).collect();
                })
            }),
        };
        if taken.is_none() {
            self.wrong(path, value, &key.allowed(slot));
        }
    }

    /// Reads one number, by itself or of a list.
    fn number<T>(&mut self, path: &str, key: &Key<T>, place: &mut f64, value: &Spanned<DeValue>) {
        match number(value.get_ref()) {
            Some(number) if key.within(number) => *place = number,
            Some(number) if number.is_finite() => self.wrong(path, value, &key.between()),
            Some(_) => self.wrong(path, value, &format!("finite and {}", key.between())),
            None => self.wrong(path, value, &format!("a number {}", key.between())),
        }
    }

    /// Reads one pair and puts it at the end of `places`.
    fn pair<T>(&mut self, path: &str, key: &Key<T>, places: &mut Vec<[f64; 2]>, value: &Spanned<DeValue>) {
        self.lines.insert(path.to_owned(), self.line(&value.span()));
        let mut pair = [0.0; 2];
        match value.get_ref().as_array() {
            Some(numbers) if numbers.len() == 2 => {
                for (i, (place, number)) in pair.iter_mut().zip(numbers.iter()).enumerate() {
                    self.number(&format!("{path}[{i}]"), key, place, number);
                }
            }
            _ => self.wrong(path, value, "a pair of numbers [u, v]"),
        }
        places.push(pair);
    }

    /// Refuses keys that are not in `known`.
    fn unknown(&mut self, section: &str, table: &DeTable, known: &[&str], is_in: &str) {
        for (key, _) in table {
            let name: &str = key.get_ref();
            if known.contains(&name) {
                continue;
            }
            let path = if section.is_empty() { clip(name) } else { format!("{section}.{}", clip(name)) };
            let line = Some(self.line(&key.span()));
            let near = nearest(name, known);
            if let Some(near) = near {
                self.meant.insert(if section.is_empty() {
                    near.to_owned()
                } else {
                    format!("{section}.{near}")
                });
            }
            let hint = match (near, elsewhere(name, is_in)) {
                (Some(near), _) => format!("did you mean {near}?"),
                (None, Some(place)) => format!("it belongs {place}"),
                (None, None) => format!("known here: {}", known.join(", ")),
            };
            self.at(line, format!("{path} is not a setting; {hint}"));
        }
    }

    /// Notes a value that cannot be taken.
    fn wrong(&mut self, path: &str, value: &Spanned<DeValue>, must: &str) {
        let written = self.text.get(value.span()).unwrap_or_default();
        let short = written.chars().count() <= CLIP && !written.contains('\n');
        // As it is written, or what it is where that is long.
        let what = match value.get_ref() {
            DeValue::Array(items) if !short => format!("a list of {}", items.len()),
            DeValue::Table(_) => "a table".to_owned(),
            _ => clip(written),
        };
        self.at(Some(self.line(&value.span())), format!("{path} is {what}; it must be {must}"));
    }

    /// Notes a mistake.
    pub(crate) fn at(&mut self, line: Option<usize>, sentence: String) {
        self.mistakes.push(Mistake { line, sentence });
    }

    /// Notes a mistake in the line of a path of the file.
    pub(crate) fn at_path(&mut self, path: &str, sentence: String) {
        self.at(self.lines.get(path).copied(), sentence);
    }

    /// The line in which a span starts, from 1.
    fn line(&self, span: &Range<usize>) -> usize {
        let before = self.text.as_bytes().get(..span.start).unwrap_or(self.text.as_bytes());
        1 + before.iter().filter(|byte| **byte == b'\n').count()
    }
}

/// A number, whole or not; it may be infinite or no number at all.
fn number(value: &DeValue) -> Option<f64> {
    match value {
        DeValue::Integer(_) => whole(value),
        DeValue::Float(float) => float.as_str().parse().ok(),
        _ => None,
    }
}

/// A whole number. Beyond 2^53 it is not exact any more, and far out of every bound.
fn whole(value: &DeValue) -> Option<f64> {
    let integer = value.as_integer()?;
    i128::from_str_radix(integer.as_str(), integer.radix()).ok().map(|number| number as f64)
}

/// Longest piece of a file in a sentence, characters.
const CLIP: usize = 40;

/// A piece of the file, short enough for a sentence and without line breaks.
fn clip(text: &str) -> String {
    const LONGEST: usize = 40;
    let clean: String =
        text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(LONGEST + 1).collect();
    if clean.chars().count() > LONGEST {
        clean.chars().take(LONGEST - 3).chain("...".chars()).collect()
    } else {
        clean
    }
}

/// Everything that the head of the file may say.
fn top_level() -> Vec<&'static str> {
    let head = SECTIONS.iter().filter(|section| section.name.is_empty());
    let sections = SECTIONS.iter().filter(|section| !section.name.is_empty());
    head.flat_map(|section| section.keys.iter().map(|key| key.name))
        .chain(sections.map(|section| section.name))
        .chain(["target"])
        .collect()
}

/// What a section that is missing must say.
fn needs<T>(keys: &[Key<T>]) -> String {
    let names: Vec<&str> = keys.iter().filter(|key| key.required).map(|key| key.name).collect();
    format!("it must say {}", names.join(", "))
}

/// Where a key that is known in another section belongs.
fn elsewhere(name: &str, is_in: &str) -> Option<String> {
    let place = |section: &str| match section {
        "" => "at the head of the file, above all tables".to_owned(),
        section => format!("below [{section}]"),
    };
    if TARGET.iter().any(|key| key.name == name) && is_in != "target" && name != "name" {
        return Some("below [[target]]".to_owned());
    }
    SECTIONS
        .iter()
        .find(|section| section.name != is_in && section.keys.iter().any(|key| key.name == name))
        .map(|section| place(section.name))
}

/// The known key that is nearest to what was written, if it is near.
fn nearest<'k>(written: &str, known: &[&'k str]) -> Option<&'k str> {
    // No key is longer than this; a long name need not be compared.
    const LONGEST: usize = 64;
    let written: Vec<char> = written.chars().take(LONGEST).flat_map(char::to_lowercase).collect();
    known
        .iter()
        .map(|key| (edits(&written, &key.chars().collect::<Vec<_>>()), *key))
        .filter(|(edits, key)| *edits <= 1 + key.len() / 4)
        .min_by_key(|(edits, _)| *edits)
        .map(|(_, key)| key)
}

/// Letters to insert, delete, replace or swap with their neighbour to get from one word to another (optimal
/// string alignment).
fn edits(from: &[char], to: &[char]) -> usize {
    let mut rows = vec![vec![0; to.len() + 1]; from.len() + 1];
    for i in 0..=from.len() {
        for j in 0..=to.len() {
            rows[i][j] = if i == 0 || j == 0 {
                i + j
            } else {
                let same = usize::from(from[i - 1] != to[j - 1]);
                let mut least = (rows[i - 1][j] + 1).min(rows[i][j - 1] + 1).min(rows[i - 1][j - 1] + same);
                if i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1] {
                    least = least.min(rows[i - 2][j - 2] + 1);
                }
                least
            };
        }
    }
    rows[from.len()][to.len()]
}
