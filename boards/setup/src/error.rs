//! What can be wrong with a setup: one sentence a mistake, all mistakes of a file at once.

use std::fmt;

/// One mistake: where it is and one sentence on what is wrong and what is allowed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Line in the file, from 1; `None` where it concerns the file as a whole.
    pub line: Option<usize>,
    /// The sentence, with the key first.
    pub sentence: String,
}

/// Why a setup is refused.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The file could not be read.
    #[error("{name} cannot be read: {cause}")]
    Read {
        /// Name of the file.
        name: String,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The file has mistakes: one line each, `name:line: sentence`.
    #[error("{}", Lines(name, mistakes))]
    Mistakes {
        /// Name of the file.
        name: String,
        /// All of them, in the order of the file; at least one.
        mistakes: Vec<Mistake>,
    },
}

struct Lines<'a>(&'a str, &'a [Mistake]);

impl fmt::Display for Lines<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, mistake) in self.1.iter().enumerate() {
            let end = if i + 1 < self.1.len() { "\n" } else { "" };
            match mistake.line {
                Some(line) => write!(f, "{}:{line}: {}{end}", self.0, mistake.sentence)?,
                None => write!(f, "{}: {}{end}", self.0, mistake.sentence)?,
            }
        }
        Ok(())
    }
}
