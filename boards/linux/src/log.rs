//! The ride on the box's own card: every record as it leaves the frame loop, whatever the line does with it.
//!
//! A thread of its own writes, so that a slow card holds neither the loop nor the line up. Twice a second the
//! file is synced: with the time that the card takes for it, a box that loses its supply loses no more than
//! the last second. A card that is full or failing ends the log, never the ride.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use crate::notice::Notices;

/// Records that may wait for the card: some ten seconds of them.
const SLOTS: usize = 1_024;
/// Time between two syncs.
const SYNC: Duration = Duration::from_millis(500);

/// The end that gives records; never waits.
#[derive(Debug)]
pub(crate) struct Log {
    give: SyncSender<Vec<u8>>,
    notices: Notices,
    is_missing: bool,
    has_ended: bool,
}

/// The end that writes them.
#[derive(Debug)]
pub(crate) struct Writer<W> {
    take: Receiver<Vec<u8>>,
    file: W,
    name: String,
    notices: Notices,
}

/// Something that can be made safe.
pub(crate) trait Sync: Write {
    fn sync(&mut self) -> std::io::Result<()>;
}

impl Sync for File {
    fn sync(&mut self) -> std::io::Result<()> {
        self.sync_data()
    }
}

/// The file of a session in a folder, which is made if need be; it has the session's number for a name.
///
/// # Errors
/// One sentence.
pub fn file(folder: &Path, session_id: u64) -> Result<(PathBuf, File), String> {
    let path = folder.join(format!("{session_id:016x}.gw"));
    let made = std::fs::create_dir_all(folder)
        .and_then(|()| OpenOptions::new().append(true).create(true).open(&path))
        // The name, too, is to be there after a loss of the supply.
        .and_then(|file| File::open(folder)?.sync_all().map(|()| file));
    made.map(|file| (path, file)).map_err(|error| {
        format!(
            "no log can be kept in {} ({error}); make room there or correct board.log_dir",
            folder.display()
        )
    })
}

/// Both ends of a log.
pub(crate) fn open<W: Sync>(file: W, path: &Path, notices: &Notices) -> (Log, Writer<W>) {
    let (give, take) = sync_channel(SLOTS);
    let log = Log { give, notices: notices.clone(), is_missing: false, has_ended: false };
    (log, Writer { take, file, name: path.display().to_string(), notices: notices.clone() })
}

impl Log {
    /// Gives a record to the card.
    pub(crate) fn put(&mut self, record: &[u8]) {
        if self.has_ended {
            return;
        }
        match self.give.try_send(record.to_vec()) {
            Ok(()) => {}
            // The numbers of the records tell where.
            Err(TrySendError::Full(_)) => {
                if !std::mem::replace(&mut self.is_missing, true) {
                    self.notices.mark("the card is too slow: records are missing in the log");
                }
            }
            Err(TrySendError::Disconnected(_)) => self.has_ended = true,
        }
    }
}

impl<W: Sync> Writer<W> {
    /// Writes until the log is dropped or the card takes no more.
    pub(crate) fn run(mut self) {
        if let Err(error) = self.write() {
            let why = if error.kind() == std::io::ErrorKind::StorageFull { "full" } else { "failing" };
            self.notices.mark(&format!("the card is {why}: the log has ended"));
            self.notices.log(format!("the log {} has ended: {error}; the ride goes on", self.name));
        }
    }

    fn write(&mut self) -> std::io::Result<()> {
        let mut synced = Instant::now();
        let mut is_dirty = false;
        loop {
            match self.take.recv_timeout(SYNC) {
                Ok(record) => {
                    self.file.write_all(&record)?;
                    is_dirty = true;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return self.file.sync(),
            }
            if is_dirty && synced.elapsed() >= SYNC {
                self.file.sync()?;
                (synced, is_dirty) = (Instant::now(), false);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_record_is_in_the_file_of_the_session() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("rides");
        let (path, made) = file(&folder, 0xab).unwrap();
        assert_eq!(path, folder.join("00000000000000ab.gw"));
        let (mut log, writer) = open(made, &path, &Notices::channel().0);
        log.put(b"ab\0");
        log.put(b"c\0");
        drop(log);
        writer.run();
        assert_eq!(std::fs::read(&path).unwrap(), b"ab\0c\0");
    }

    #[test]
    fn a_full_card_ends_the_log_with_one_mark_and_never_waits() {
        let (notices, said) = Notices::channel();
        let full = OpenOptions::new().append(true).open("/dev/full").unwrap();
        let (mut log, writer) = open(full, Path::new("/dev/full"), &notices);
        let thread = std::thread::spawn(move || writer.run());
        log.put(b"ab\0");
        thread.join().unwrap();
        for _ in 0..10 * SLOTS {
            log.put(b"ab\0");
        }
        let said: Vec<String> = said.try_iter().map(|notice| format!("{notice:?}")).collect();
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].contains("the card is full: the log has ended"), "{said:?}");
    }

    #[test]
    fn a_card_that_is_too_slow_loses_records_with_one_mark() {
        let (notices, said) = Notices::channel();
        let place = tempfile::tempdir().unwrap();
        let (path, made) = file(place.path(), 1).unwrap();
        let (mut log, writer) = open(made, &path, &notices);
        for _ in 0..2 * SLOTS {
            log.put(b"a\0");
        }
        drop(log);
        writer.run();
        assert_eq!(std::fs::read(&path).unwrap().len(), 2 * SLOTS);
        assert_eq!(said.try_iter().count(), 1);
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_one_sentence() {
        let said = file(Path::new("/dev/null/rides"), 1).unwrap_err();
        assert!(said.starts_with("no log can be kept in /dev/null/rides ("), "{said}");
    }
}
