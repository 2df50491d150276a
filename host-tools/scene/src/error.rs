//! What can go wrong with a scene: each one sentence that says where and what to do.

use std::io;
use std::path::PathBuf;

/// Why a scene could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The scene file, or the table it names, cannot be read.
    #[error("{}: cannot be read: {why}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        why: io::Error,
    },
    /// The file says something that is not allowed.
    #[error("{file}:{line}: {}{message}", if key.is_empty() { String::new() } else { format!("{key}: ") })]
    Value {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Key with its tables, as in `target[1].circles_mm`; empty where there is none.
        key: String,
        /// What is wrong and what is allowed.
        message: String,
    },
    /// No scene of this name is built in.
    #[error("there is no built-in scene `{name}`, there are: {}; or name a scene file", crate::BUILTIN.map(|s| s.0).join(", "))]
    Unknown {
        /// The name.
        name: String,
    },
    /// An output cannot be written; nothing of it is left behind.
    #[error("{}: cannot be written: {why}; nothing was left there", path.display())]
    Write {
        /// The output.
        path: PathBuf,
        /// What the system said.
        why: io::Error,
    },
    /// Writing was broken off.
    #[error("{}: stopped before the last frame; nothing of it was left there", path.display())]
    Stopped {
        /// The directory.
        path: PathBuf,
    },
    /// An output of an earlier run is in the way.
    #[error("{}: is there already; remove it or choose another directory", path.display())]
    Exists {
        /// The output.
        path: PathBuf,
    },
}

/// A mistake in a scene before its line is known: the key with its tables, and what is wrong.
#[derive(Debug, PartialEq)]
pub(crate) struct Mistake {
    /// As in `target[1].circles_mm`.
    pub(crate) key: String,
    /// What is wrong and what is allowed.
    pub(crate) message: String,
}

impl Mistake {
    /// A mistake at a key.
    pub(crate) fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into() }
    }
}
