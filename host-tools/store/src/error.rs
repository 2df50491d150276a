//! What can go wrong with a session, each as one sentence that says what to do.

use std::io;
use std::path::{Path, PathBuf};

use gangway_wire::WIRE_VERSION;

/// Why something about a session could not be done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// An address that cannot be read.
    #[error("{text}: {why}")]
    Address {
        /// The address as given.
        text: String,
        /// What is wrong and what is allowed.
        why: String,
    },
    /// A place that bytes should come from or go to cannot be opened.
    #[error("{what}: {why}")]
    Connect {
        /// The address.
        what: String,
        /// What is wrong.
        why: String,
    },
    /// A file or folder refuses.
    #[error("cannot {doing} {}: {error}", path.display())]
    Io {
        /// A verb: open, read, write...
        doing: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        error: io::Error,
    },
    /// No room left.
    #[error("{}: the disk is full; make room and start again; a session keeps what it has received", path.display())]
    Full {
        /// What was being written.
        path: PathBuf,
    },
    /// Another process is receiving this session.
    #[error(
        "{}: process {process} is receiving this session; wait until it has ended, or look into it with \
         `gangway decode {}`", path.display(), path.join(crate::session::STREAM).display()
    )]
    Locked {
        /// The session's folder.
        path: PathBuf,
        /// Number of that process, or a question mark.
        process: String,
    },
    /// What was named is neither a session nor a capture.
    #[error("{}: {why}", path.display())]
    NoSession {
        /// What was named.
        path: PathBuf,
        /// What is missing and what would do.
        why: String,
    },
    /// Records of a later version of the wire.
    #[error(
        "{what}: was sent in version {version} of the wire, and this program reads version {WIRE_VERSION} only; take a \
         newer gangway"
    )]
    Foreign {
        /// The session or capture.
        what: String,
        /// The version.
        version: u16,
    },
    /// A capture that holds several sessions.
    #[error(
        "{}: holds {count} sessions; take them apart with `gangway receive --from file:{} --into DIR`",
        path.display(), path.display()
    )]
    Several {
        /// The capture.
        path: PathBuf,
        /// Sessions in it.
        count: usize,
    },
    /// The setup's text cannot be put together from its pieces.
    #[error("{}: {why}", path.display())]
    Setup {
        /// The session.
        path: PathBuf,
        /// What is missing.
        why: String,
    },
    /// The box did not answer a command as it should.
    #[error("{what}: {why}")]
    Command {
        /// The box's address.
        what: String,
        /// What happened.
        why: String,
    },
}

impl StoreError {
    /// An error of the system with what was being done to which path; a full disk is told apart.
    pub(crate) fn io(doing: &'static str, path: &Path, error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
                Self::Full { path: path.to_owned() }
            }
            _ => Self::Io { doing, path: path.to_owned(), error },
        }
    }
}
