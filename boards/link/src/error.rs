//! What can go wrong with a line, each in one sentence that says what to do.

use std::io;

use gangway_device::{LinkError, LinkErrorKind};

/// An error of a line or of its address.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The text is no address.
    #[error("'{text}' is no address: {why}")]
    Address {
        /// What was given.
        text: String,
        /// What is wrong and what is right.
        why: String,
    },
    /// Another program listens there.
    #[error("port {port} of {host} is in use; end the program that has it or give another port")]
    InUse {
        /// Host as given.
        host: String,
        /// Port.
        port: u16,
    },
    /// The file of a new capture is not empty.
    #[error(
        "{path} holds something already, and is left as it is; give another name, or --append to go on in it"
    )]
    Occupied {
        /// The file.
        path: String,
    },
    /// The line could not be opened.
    #[error("cannot open {line}: {why}")]
    Open {
        /// Address of the line.
        line: String,
        /// What is wrong and what to do.
        why: String,
    },
    /// Nobody is connected at the moment.
    #[error("nobody is connected to {line}; trying on")]
    NotConnected {
        /// Address of the line.
        line: String,
    },
    /// The disk is full.
    #[error("the disk is full: {path} has no room for the next record; make room or write elsewhere")]
    Full {
        /// The file.
        path: String,
    },
    /// The line failed.
    #[error("{line} failed: {source}")]
    Failed {
        /// Address of the line.
        line: String,
        /// What the system said.
        source: io::Error,
    },
}

impl LinkError for Error {
    fn kind(&self) -> LinkErrorKind {
        match self {
            Self::NotConnected { .. } => LinkErrorKind::NotConnected,
            Self::Full { .. } => LinkErrorKind::Full,
            _ => LinkErrorKind::Other,
        }
    }
}

/// Whether an error only says "not now".
pub(crate) fn is_busy(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted | io::ErrorKind::TimedOut)
}
