//! A file as a line: records are appended as they come.

use std::fmt;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Write};
use std::path::Path;

use gangway_device::Link;

use crate::Error;
use crate::error::is_busy;

/// Appends to a file; synced to disk by [`Link::finish`].
#[derive(Debug)]
pub struct FileLink {
    file: File,
    path: String,
    /// A record of an earlier session may end in the middle: a delimiter goes in between.
    begins: bool,
}

impl FileLink {
    /// Creates the file; one that is there must be empty. A pipe or a device is as good as empty.
    ///
    /// # Errors
    /// [`Error::Occupied`] where the file holds something, and as [`FileLink::append`].
    pub fn create(path: &Path) -> Result<Self, Error> {
        let link = Self::append(path)?;
        if link.begins { Err(Error::Occupied { path: link.path }) } else { Ok(link) }
    }

    /// Opens or creates the file, to append to it.
    ///
    /// # Errors
    /// [`Error::Open`] where the file cannot be made or written, or another program is writing to it.
    pub fn append(path: &Path) -> Result<Self, Error> {
        let name = path.display().to_string();
        let open = |why: String| Error::Open { line: format!("file:{name}"), why };
        if path.is_dir() {
            return Err(open("that is a directory; give the name of a file in it".into()));
        }
        let file = OpenOptions::new().append(true).create(true).open(path).map_err(|error| {
            open(match error.kind() {
                ErrorKind::NotFound => "its directory does not exist; make it first".into(),
                ErrorKind::PermissionDenied => "it may not be written; choose another place".into(),
                ErrorKind::StorageFull => "the disk is full; make room or write elsewhere".into(),
                _ => error.to_string(),
            })
        })?;
        let about = file.metadata();
        // Two sessions between each other's records are a capture that nobody can open. A pipe or a device
        // belongs to many.
        let is_file = about.as_ref().is_ok_and(|file| file.is_file());
        if is_file && matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(open("another program is writing to it; end that one or give another name".into()));
        }
        let begins = about.is_ok_and(|file| file.len() > 0);
        Ok(Self { file, path: name, begins })
    }

    fn error(&self, source: std::io::Error) -> Error {
        match source.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
                Error::Full { path: self.path.clone() }
            }
            _ => Error::Failed { line: self.to_string(), source },
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        match self.file.write(bytes) {
            Ok(count) => Ok(count),
            Err(error) if is_busy(&error) => Ok(0),
            Err(error) => Err(self.error(error)),
        }
    }
}

impl fmt::Display for FileLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "file:{}", self.path)
    }
}

impl Link for FileLink {
    type Error = Error;

    fn send(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        if self.begins && self.write(&[0])? == 0 {
            return Ok(0);
        }
        self.begins = false;
        self.write(bytes)
    }

    fn receive(&mut self, _into: &mut [u8]) -> Result<usize, Error> {
        Ok(0)
    }

    fn finish(&mut self) -> Result<bool, Error> {
        match self.file.sync_all() {
            // A pipe or a device has nothing to sync.
            Err(error) if error.kind() != ErrorKind::InvalidInput => Err(self.error(error)),
            _ => Ok(true),
        }
    }

    fn connections(&self) -> u32 {
        0
    }
}

#[cfg(test)]
mod tests {
    use gangway_device::{LinkError, LinkErrorKind};

    use super::*;

    #[test]
    fn a_second_session_is_appended_behind_a_delimiter() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("ride.gw");
        for record in [b"ab\0", b"cd\0"] {
            let mut link = FileLink::append(&path).unwrap();
            assert_eq!(link.send(record).unwrap(), 3);
            assert!(link.finish().unwrap());
        }
        assert_eq!(std::fs::read(&path).unwrap(), b"ab\0\0cd\0");
    }

    #[test]
    fn a_file_that_holds_something_is_no_new_one_and_keeps_it() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("ride.gw");
        std::fs::write(&path, "").unwrap();
        assert_eq!(FileLink::create(&path).unwrap().send(b"ab\0").unwrap(), 3);
        let error = FileLink::create(&path).unwrap_err();
        assert!(matches!(error, Error::Occupied { .. }), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"ab\0");
        assert!(FileLink::create(Path::new("/dev/null")).is_ok());
    }

    #[test]
    fn a_file_that_another_program_writes_is_refused_until_that_has_ended() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("ride.gw");
        let writing = FileLink::append(&path).unwrap();
        for refused in [FileLink::append(&path), FileLink::create(&path)] {
            let said = refused.unwrap_err().to_string();
            assert!(said.contains("another program is writing to it"), "{said}");
        }
        drop(writing);
        assert!(FileLink::append(&path).is_ok());
        let devices = [(); 2].map(|()| FileLink::append(Path::new("/dev/null")));
        assert!(devices.iter().all(Result::is_ok));
    }

    #[test]
    fn a_full_disk_is_one_sentence() {
        let mut link = FileLink::append(Path::new("/dev/full")).unwrap();
        let error = link.send(b"ab\0").unwrap_err();
        assert_eq!(error.kind(), LinkErrorKind::Full);
        assert_eq!(
            error.to_string(),
            "the disk is full: /dev/full has no room for the next record; make room or write elsewhere"
        );
    }

    #[test]
    fn a_file_that_cannot_be_made_is_refused_with_what_to_do() {
        let place = tempfile::tempdir().unwrap();
        let said = FileLink::append(place.path()).unwrap_err().to_string();
        assert!(said.contains("that is a directory"), "{said}");
        let said = FileLink::append(&place.path().join("no/ride.gw")).unwrap_err().to_string();
        assert!(said.contains("its directory does not exist"), "{said}");
    }
}
