//! The setup file and the firmware's validated settings.
#![forbid(unsafe_code)]

mod error;

use std::path::Path;

pub use error::{Mistake, SetupError};

/// A setup that was read and checked.
#[derive(Clone, Debug)]
pub struct Setup {
    text: String,
}

impl Setup {
    /// Reads and checks a setup file.
    pub fn read(path: &Path) -> Result<Self, SetupError> {
        let name = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&text, &name),
            Err(source) => Err(SetupError::Read { name, source }),
        }
    }

    /// Checks the text of a setup; `name` is what mistakes call it.
    pub fn parse(text: &str, _name: &str) -> Result<Self, SetupError> {
        Ok(Self { text: text.to_owned() })
    }

    /// The text as it was read.
    pub fn text(&self) -> &str {
        &self.text
    }
}
