//! From parts to the file's text: what a program that makes a setup (the simulator) writes.

use std::fmt::Write as _;

use crate::parts::{Parts, Target};
use crate::slot::Value;
use crate::table::{Key, SECTIONS, TARGET};

impl Parts {
    /// The text of a setup file that says exactly this: `Setup::parse` gives the same parts back, bit by bit.
    ///
    /// Optional settings at their default are left out. Nothing is checked here; that is `Setup::parse`'s.
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        let defaults = Parts::default();
        for section in SECTIONS {
            let lines = said(section.keys, self, &defaults);
            match section.name {
                "" => text.push_str(&lines),
                name if section.required || !lines.is_empty() => {
                    let _ = write!(text, "\n[{name}]\n{lines}");
                }
                _ => {}
            }
            if section.name == "camera" {
                for target in &self.targets {
                    let lines = said(TARGET, target, &Target::default());
                    let _ = write!(text, "\n[[target]]\n{lines}");
                }
            }
        }
        text
    }
}

/// One line for each key that is required or not at its default.
fn said<T: Clone>(keys: &[Key<T>], of: &T, defaults: &T) -> String {
    let mut lines = String::new();
    for key in keys {
        let value = key.value(of);
        // Zero and minus zero differ in their bits only: compare what would be written.
        if key.required || value.to_string() != key.value(defaults).to_string() {
            // Long lists take a line an entry, so that mistakes in them have a line of their own.
            match &value {
                Value::Pairs(pairs) if pairs.len() > 1 => {
                    let _ = writeln!(lines, "{} = [", key.name);
                    for pair in pairs {
                        let _ = writeln!(lines, "    {},", Value::Numbers(pair.to_vec()));
                    }
                    lines.push_str("]\n");
                }
                value => {
                    let _ = writeln!(lines, "{} = {value}", key.name);
                }
            }
        }
    }
    lines
}
