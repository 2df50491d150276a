//! A session that was received: a folder with the bytes as they came, an index and a few words about it.
//! A capture (one file of bytes) opens as well; it has no index and no lock.

use std::collections::BTreeSet;
use std::fmt;
use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use gangway_wire::{Decoded, Pose, Record, Rest, WIRE_VERSION};

use crate::index::{self, Entry, Seconds};
use crate::meta::{Meta, replace};
use crate::pieces::Pieces;
use crate::scan::{Found, Walk, walk, walk_from};
use crate::tally::{Tally, foreign_version, moment};
use crate::{MarkerRow, StoreError};

/// The bytes as they were received, append-only.
pub const STREAM: &str = "stream.gw";
/// Where each second begins.
pub const INDEX: &str = "index.gwi";

/// A session or a capture, open for reading. While it is open, no process can append to it.
#[derive(Debug)]
pub struct Session {
    path: PathBuf,
    stream: PathBuf,
    /// Holds the lock.
    _lock: File,
    entries: Vec<Entry>,
    meta: Option<Meta>,
}

/// What opening a session found: what is there, and what was cut off.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recovery {
    /// Bytes in the stream.
    pub bytes: u64,
    /// Whole records in it, those of newer kinds among them.
    pub records: u64,
    /// Bytes of an unfinished record at its end; they are left out.
    pub unfinished: u64,
    /// What index or notes know of that the stream does not hold.
    pub missing: Option<Missing>,
    /// Whether receiving was cut off, so that up to a second more may be missing.
    pub cut_off: bool,
    /// How the index was found.
    pub index: IndexState,
}

/// What is gone, at least.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Missing {
    /// Bytes.
    pub bytes: u64,
    /// Records.
    pub records: u64,
    /// Seconds of the box's clock.
    pub seconds: f64,
}

/// How the index was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IndexState {
    /// Whole; or there is none, for a capture.
    #[default]
    Whole,
    /// Behind the stream by some entries, and continued.
    Continued,
    /// Missing, and made again.
    Missing,
    /// Damaged, and made again.
    Damaged,
}

impl Recovery {
    /// Whether everything that was ever received is there.
    pub fn is_whole(&self) -> bool {
        self.unfinished == 0 && self.missing.is_none() && !self.cut_off && self.index == IndexState::Whole
    }
}

impl fmt::Display for Recovery {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} records in {} bytes", self.records, self.bytes)?;
        if self.unfinished > 0 {
            write!(f, ", {} bytes of an unfinished record at the end left out", self.unfinished)?;
        }
        if let Some(Missing { bytes, records, seconds }) = self.missing {
            write!(f, ", at least {bytes} bytes, {records} records, {seconds:.2} s cut off")?;
        }
        if self.cut_off {
            f.write_str(", receiving did not end properly (the last second may be missing)")?;
        }
        f.write_str(match self.index {
            IndexState::Whole => "",
            IndexState::Continued => ", index continued",
            IndexState::Missing => ", index was missing and is made again",
            IndexState::Damaged => ", index was damaged and is made again",
        })
    }
}

impl Session {
    /// Opens a session's folder or a capture and says what was cut off.
    ///
    /// # Errors
    /// Something else than a session; a session that is being received; one of a later version of the wire; a
    /// capture with several sessions.
    pub fn open(path: impl AsRef<Path>) -> Result<(Self, Recovery), StoreError> {
        let path = path.as_ref();
        let about = fs::metadata(path).map_err(|e| StoreError::io("open", path, e))?;
        let is_folder = about.is_dir();
        // A session is read more than once, which a pipe cannot give.
        if !is_folder && !about.is_file() {
            let why = "is no file and no folder; store it with `gangway receive --from -` first".to_owned();
            return Err(StoreError::NoSession { path: path.to_owned(), why });
        }
        let stream = if is_folder { path.join(STREAM) } else { path.to_owned() };
        let file = File::open(&stream).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => StoreError::NoSession {
                path: path.to_owned(),
                why: format!("is no session: it holds no {STREAM}"),
            },
            _ => StoreError::io("open", &stream, error),
        })?;
        let meta = if is_folder { Meta::read(path) } else { None };
        if is_folder && matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)) {
            let process = meta.map_or("?".to_owned(), |meta| meta.process.to_string());
            return Err(StoreError::Locked { path: path.to_owned(), process });
        }
        let mut session = Self { path: path.to_owned(), stream, _lock: file, entries: Vec::new(), meta };
        let recovery = if is_folder { session.recover()? } else { session.survey()? };
        Ok((session, recovery))
    }

    /// Reads a capture once: it must be one session.
    fn survey(&mut self) -> Result<Recovery, StoreError> {
        let mut sessions = BTreeSet::new();
        let mut foreign = None;
        let walk = self.walk(|found| {
            foreign = foreign.or_else(|| foreign_version(&found.decoded));
            if let Decoded::Record { record: Record::Hello(hello), .. } = &found.decoded {
                sessions.insert((hello.box_id, hello.boot_id, hello.session_id));
            }
            ControlFlow::Continue(())
        })?;
        self.refuse(foreign)?;
        let records = walk.counts.records + walk.counts.newer;
        let path = self.path.clone();
        match sessions.len() {
            0 | 1 if records > 0 => {}
            0 | 1 => {
                let why = match walk.bytes {
                    0 => "is empty".to_owned(),
                    bytes => format!("holds no record in {bytes} bytes; a capture of Gangway is needed"),
                };
                return Err(StoreError::NoSession { path, why });
            }
            count => return Err(StoreError::Several { path, count }),
        }
        Ok(Recovery { bytes: walk.bytes, records, unfinished: walk.unfinished, ..Recovery::default() })
    }

    /// Refuses what is of a version of the wire that this program does not read.
    fn refuse(&self, foreign: Option<u16>) -> Result<(), StoreError> {
        let what = || self.path.display().to_string();
        foreign.map_or(Ok(()), |version| Err(StoreError::Foreign { what: what(), version }))
    }

    /// The sender's version of the wire, if it is a later one: from the notes, or where they are gone from
    /// the first `Hello`.
    fn foreign_sender(&self) -> Result<Option<u16>, StoreError> {
        if let Some(sender) = self.meta.as_ref().and_then(|meta| meta.sender.as_ref()) {
            return Ok(Some(sender.wire_version).filter(|version| *version > WIRE_VERSION));
        }
        let mut foreign = None;
        self.walk(|found| match &found.decoded {
            Decoded::Record { record: Record::Hello(_), .. } => {
                foreign = foreign_version(&found.decoded);
                ControlFlow::Break(())
            }
            _ => ControlFlow::Continue(()),
        })?;
        Ok(foreign)
    }

    /// Checks the index against the stream, continues it or makes it again, and says what is missing.
    fn recover(&mut self) -> Result<Recovery, StoreError> {
        self.refuse(self.foreign_sender()?)?;
        let path = self.path.join(INDEX);
        let (entries, mut state) = match fs::read(&path) {
            Ok(bytes) => match index::from_bytes(&bytes) {
                (entries, true) => (entries, IndexState::Whole),
                (entries, false) => (entries, IndexState::Damaged),
            },
            Err(error) if error.kind() == io::ErrorKind::NotFound => (Vec::new(), IndexState::Missing),
            Err(error) => return Err(StoreError::io("read", &path, error)),
        };
        let io = |e| StoreError::io("read", &self.stream, e);
        let mut file = File::open(&self.stream).map_err(io)?;
        let bytes = file.metadata().map_err(io)?.len();
        let within = entries.partition_point(|entry| entry.offset < bytes);
        let beyond = entries.last().filter(|_| within < entries.len()).copied();
        self.entries = entries;
        self.entries.truncate(within);
        if let Some(entry) = self.entries.last()
            && !is_boundary(&mut file, entry.offset).map_err(io)?
        {
            // Another stream's index, or a damaged stream: trust the stream alone.
            self.entries.clear();
            state = IndexState::Damaged;
        }

        let (start, before) = self.entries.last().map_or((0, 0), |entry| (entry.offset, entry.records));
        file.seek(SeekFrom::Start(start)).map_err(io)?;
        let mut seconds = Seconds::after(self.entries.last());
        let mut last_time = self.entries.last().map_or(0, |entry| entry.time_ns);
        let (mut records, known) = (before, self.entries.len());
        let walked = walk_from(start, file, |found| {
            let moment = match &found.decoded {
                Decoded::Record { record, .. } => moment(record),
                Decoded::Newer { .. } => None,
                Decoded::Damaged(_) => return ControlFlow::Continue(()),
            };
            if let Some((frame, time_ns)) = moment {
                last_time = time_ns;
                if seconds.begins(time_ns) {
                    self.entries.push(Entry { offset: found.start, records, time_ns, frame });
                }
            }
            records += 1;
            ControlFlow::Continue(())
        })
        .map_err(|e| StoreError::io("read", &self.stream, e))?;
        if state == IndexState::Whole && self.entries.len() > known {
            state = IndexState::Continued;
        }
        if state != IndexState::Whole || beyond.is_some() {
            // Where the folder cannot be written, the index is made again at the next opening.
            let _ = replace(&path, |file| file.write_all(&index::to_bytes(&self.entries)));
        }

        let seconds_from = |time_ns: u64| time_ns.saturating_sub(last_time) as f64 * 1e-9;
        let end = self.meta.as_ref().and_then(|meta| meta.end.as_ref());
        let missing = match (end, beyond) {
            (Some(end), _) if end.bytes > bytes => Some(Missing {
                bytes: end.bytes - bytes,
                records: end.records.saturating_sub(records),
                seconds: end.last_time_ns.map_or(0.0, seconds_from),
            }),
            (None, Some(entry)) => Some(Missing {
                bytes: entry.offset + 1 - bytes,
                records: (entry.records + 1).saturating_sub(records),
                seconds: seconds_from(entry.time_ns),
            }),
            _ => None,
        };
        let unfinished = walked.unfinished;
        Ok(Recovery { bytes, records, unfinished, missing, cut_off: end.is_none(), index: state })
    }

    /// The folder or file that was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What stands beside the stream; `None` for a capture and where it was lost.
    pub fn meta(&self) -> Option<&Meta> {
        self.meta.as_ref()
    }

    /// Where each second begins; empty for a capture.
    pub fn seconds(&self) -> &[Entry] {
        &self.entries
    }

    /// The bytes as they were received.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub fn stream(&self) -> Result<File, StoreError> {
        File::open(&self.stream).map_err(|e| StoreError::io("open", &self.stream, e))
    }

    /// Hands everything in the stream to `visitor`, damage included, until it breaks.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn walk(&self, visitor: impl FnMut(&Found<'_>) -> ControlFlow<()>) -> Result<Walk, StoreError> {
        walk(self.stream()?, visitor).map_err(|e| StoreError::io("read", &self.stream, e))
    }

    /// Hands every record in the stream to `visitor`.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn records(&self, mut visitor: impl FnMut(&Record<'_>)) -> Result<Walk, StoreError> {
        self.walk(|found| {
            if let Decoded::Record { record, .. } = &found.decoded {
                visitor(record);
            }
            ControlFlow::Continue(())
        })
    }

    /// One row a frame, in the order of the stream.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn poses(&self) -> Result<Vec<Pose>, StoreError> {
        let mut rows = Vec::new();
        self.records(|record| {
            if let Record::Pose(pose) = record {
                rows.push(*pose);
            }
        })?;
        Ok(rows)
    }

    /// One row a circle seen, in the order of the stream.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn markers(&self) -> Result<Vec<MarkerRow>, StoreError> {
        let mut rows = Vec::new();
        self.records(|record| {
            if let Record::Markers(markers) = record {
                rows.extend(MarkerRow::of(markers));
            }
        })?;
        Ok(rows)
    }

    /// The last rest pose.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn rest(&self) -> Result<Option<Rest>, StoreError> {
        let mut rest = None;
        self.records(|record| {
            if let Record::Rest(now) = record {
                rest = Some(now.clone());
            }
        })?;
        Ok(rest)
    }

    /// The setup's text as the box announced it last, put together from its pieces and checked.
    ///
    /// # Errors
    /// No complete setup in the session, or the file cannot be read.
    pub fn setup_text(&self) -> Result<String, StoreError> {
        let mut pieces = Pieces::default();
        self.records(|record| {
            if let Record::Setup(piece) = record {
                pieces.add(piece);
            }
        })?;
        pieces.text().map_err(|why| StoreError::Setup { path: self.path.clone(), why })
    }

    /// What the session holds, in counts.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn counts(&self) -> Result<Tally, StoreError> {
        let mut tally = Tally::default();
        let walk = self.walk(|found| {
            tally.note(&found.decoded);
            ControlFlow::Continue(())
        })?;
        tally.wire = walk.counts;
        tally.bytes = walk.bytes;
        tally.unfinished = walk.unfinished;
        Ok(tally)
    }
}

/// Whether a frame may begin at `offset`.
fn is_boundary(file: &mut File, offset: u64) -> io::Result<bool> {
    let Some(before) = offset.checked_sub(1) else { return Ok(true) };
    file.seek(SeekFrom::Start(before))?;
    let mut byte = [1];
    file.read_exact(&mut byte)?;
    Ok(byte == [0])
}

#[cfg(test)]
mod tests;
