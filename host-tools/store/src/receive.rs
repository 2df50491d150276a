//! From a source into sessions: every byte is written as it came, decoded once on the way, and a new session
//! of the box begins a new folder.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use gangway_wire::{Counts, Decoded, Record, WIRE_VERSION};

use crate::index::{Entry, Seconds};
use crate::scan::{Found, Scanner};
use crate::source::{Got, Source};
use crate::tally::moment;
use crate::writer::check_folder;
use crate::{Address, SessionWriter, StoreError, Tally};

/// Bytes that may wait for the end of their record; more are no record and are written at once.
const MAX_WAITING: usize = 4096;
/// A line that has brought so many bytes without a record is worth a word; a box's first record is its second
/// or third hundred bytes.
const STRANGE: u64 = 4096;
/// What a box sends behind its `Ended` is waited for this long.
const AFTER_END: Duration = Duration::from_millis(500);

/// When receiving ends by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Until {
    /// After this time.
    pub duration: Option<Duration>,
    /// When the other side closes, instead of waiting for it to come back.
    pub once: bool,
    /// Not when the box says that its session ended: the next one is waited for.
    pub stay: bool,
}

/// A session that was received.
#[derive(Clone, Debug, PartialEq)]
pub struct Received {
    /// Its folder.
    pub folder: PathBuf,
    /// What it holds.
    pub tally: Tally,
    /// Why it ended.
    pub why: String,
}

/// Receives from one address.
#[derive(Debug)]
pub struct Receiver {
    address: Address,
    into: PathBuf,
    until: Until,
    source: Source,
}

impl Receiver {
    /// Opens or binds `from`; folders of sessions are made in `into`.
    ///
    /// # Errors
    /// An address that is in use, a file that is not there, a folder that nothing can be written to. A box
    /// that is not there yet is no error.
    pub fn open(from: &Address, into: &Path, until: Until) -> Result<Self, StoreError> {
        let source = Source::open(from)?;
        check_folder(into)?;
        Ok(Self { address: from.clone(), into: into.to_owned(), until, source })
    }

    /// Where a listening source listens, for a port that the system chose.
    pub fn local_address(&self) -> Option<std::net::SocketAddr> {
        self.source.local_address()
    }

    /// Receives until the end, or until `stop`. `say` gets what a person should know meanwhile; `done` every
    /// session when it is over.
    ///
    /// # Errors
    /// A full disk, a source that fails for good. What was received is kept.
    pub fn run(
        mut self,
        stop: &AtomicBool,
        mut say: impl FnMut(&str),
        mut done: impl FnMut(&Received),
    ) -> Result<Vec<Received>, StoreError> {
        let mut ingest = Ingest::new(&self.into, self.address.to_string());
        let mut received = Vec::new();
        let mut buffer = vec![0; 1 << 16];
        let began = Instant::now();
        let mut last_bytes = began;
        let (mut foreign_said, mut strange_said) = (0, false);
        let why = loop {
            if stop.load(Ordering::Relaxed) {
                break "stopped";
            }
            if self.until.duration.is_some_and(|duration| began.elapsed() >= duration) {
                break "time is up";
            }
            let got = self.source.read(&mut buffer).map_err(|error| StoreError::Connect {
                what: self.address.to_string(),
                why: error.to_string(),
            });
            let ended = ingest.is_ended() && !self.until.stay && self.source.is_live();
            match got? {
                Got::Bytes(count) => {
                    last_bytes = Instant::now();
                    ingest.take(&buffer[..count], &mut |one| {
                        done(&one);
                        received.push(one);
                    })?;
                    let version = ingest.tally.wire_version;
                    if version > WIRE_VERSION && version != foreign_said {
                        foreign_said = version;
                        say(&format!(
                            "{}: the box speaks version {version} of the wire, and this program reads version \
                             {WIRE_VERSION} only; all of it is stored for a newer gangway",
                            self.address
                        ));
                    }
                    if !strange_said && self.source.is_live() && ingest.is_strange() {
                        strange_said = true;
                        say(&format!(
                            "{}: bytes come, but no record among them; does a box send there, and at this speed?",
                            self.address
                        ));
                    }
                }
                Got::Nothing if ended && last_bytes.elapsed() >= AFTER_END => break "the box ended",
                Got::Nothing => {}
                Got::Said(what) => say(&format!("{}: {what}", self.address)),
                Got::Joined(what) => {
                    say(&format!("{}: {what}", self.address));
                    ingest.separate()?;
                }
                Got::Left(_) if ended => break "the box ended",
                Got::Left(what) if self.until.once => {
                    say(&format!("{}: {what}", self.address));
                    break "the other side closed";
                }
                Got::Left(what) => say(&format!("{}: {what}; waiting for it to come back", self.address)),
                Got::End => break "end of input",
            }
        };
        if let Some(one) = ingest.finish(why)? {
            done(&one);
            received.push(one);
        }
        Ok(received)
    }
}

/// Cuts a stream into sessions and writes them.
struct Ingest<'p> {
    into: &'p Path,
    from: String,
    scanner: Scanner,
    seconds: Seconds,
    tally: Tally,
    writer: Option<SessionWriter>,
    /// Box, boot and session of the `Hello` that named the present session.
    sender: Option<[u64; 3]>,
    /// Bytes that are not written yet, from `written` on.
    waiting: Vec<u8>,
    written: u64,
}

impl<'p> Ingest<'p> {
    fn new(into: &'p Path, from: String) -> Self {
        Self {
            into,
            from,
            scanner: Scanner::default(),
            seconds: Seconds::default(),
            tally: Tally::default(),
            writer: None,
            sender: None,
            waiting: Vec::new(),
            written: 0,
        }
    }

    /// Whether the box said that its session ended.
    fn is_ended(&self) -> bool {
        self.tally.ended
    }

    /// Whether much has come on this line and no record.
    fn is_strange(&self) -> bool {
        let counts = self.scanner.counts();
        self.sender.is_none() && self.written > STRANGE && counts.records + counts.newer == 0
    }

    /// Takes bytes as they came.
    fn take(&mut self, bytes: &[u8], done: &mut dyn FnMut(Received)) -> Result<(), StoreError> {
        let mut entries = Vec::new();
        let mut rest = bytes;
        while !rest.is_empty() {
            let before = *self.scanner.counts();
            let (found, behind) = self.scanner.feed(rest);
            self.waiting.extend_from_slice(&rest[..rest.len() - behind.len()]);
            rest = behind;
            let Some(found) = found else { continue };
            if let Decoded::Record { record: Record::Hello(hello), .. } = &found.decoded {
                let named = [hello.box_id, hello.boot_id, hello.session_id];
                let wire_version = hello.wire_version;
                match (self.sender.replace(named), &mut self.writer) {
                    (Some(known), _) if known == named => {}
                    (None, Some(writer)) => writer.introduce(hello)?,
                    (None, none) => *none = Some(SessionWriter::create(self.into, &self.from, Some(hello))?),
                    (Some(_), _) => {
                        let next = SessionWriter::create(self.into, &self.from, Some(hello))?;
                        // The old session ends before this record; the new one begins with it, counted from
                        // zero.
                        let line = self.waiting.split_off((found.start - self.written) as usize);
                        self.write(self.waiting.len(), &mut entries)?;
                        if let Some(one) = self.close("another session began", before, 0)? {
                            done(one);
                        }
                        self.begin(next, line);
                    }
                }
                self.tally.wire_version = self.tally.wire_version.max(wire_version);
                continue;
            }
            note(&found, &before, &mut self.seconds, &mut self.tally, &mut entries);
        }
        let unfinished = self.unfinished();
        let whole = self.waiting.len().saturating_sub(unfinished);
        self.write(if unfinished > MAX_WAITING { self.waiting.len() } else { whole }, &mut entries)
    }

    /// Bytes behind the last delimiter.
    fn unfinished(&self) -> usize {
        (self.written + self.waiting.len() as u64 - self.scanner.frame()) as usize
    }

    /// Writes the first `count` bytes that wait, then their index: the stream is never behind its index.
    fn write(&mut self, count: usize, entries: &mut Vec<Entry>) -> Result<(), StoreError> {
        if count > 0 {
            let writer = match &mut self.writer {
                Some(writer) => writer,
                none => none.insert(SessionWriter::create(self.into, &self.from, None)?),
            };
            writer.append(&self.waiting[..count])?;
            for entry in entries.drain(..) {
                writer.mark(entry)?;
            }
            self.waiting.drain(..count);
            self.written += count as u64;
        }
        Ok(())
    }

    /// Somebody connected: a record that the last connection left unfinished ends here. The delimiter is the
    /// one byte in a stream that was not received; without it the next record would be lost with the
    /// unfinished one.
    fn separate(&mut self) -> Result<(), StoreError> {
        if self.unfinished() > 0 {
            self.take(&[0], &mut |_| ())?;
        }
        Ok(())
    }

    /// Ends the present session, all of whose bytes are written.
    fn close(&mut self, why: &str, wire: Counts, unfinished: u64) -> Result<Option<Received>, StoreError> {
        let Some(writer) = self.writer.take() else { return Ok(None) };
        let tally = Tally { bytes: writer.bytes(), unfinished, wire, ..self.tally };
        let folder = writer.finish(why, &tally)?;
        Ok(Some(Received { folder, tally, why: why.to_owned() }))
    }

    /// Begins a session with its first record, which the decoder before it has taken.
    fn begin(&mut self, writer: SessionWriter, line: Vec<u8>) {
        self.writer = Some(writer);
        self.scanner = Scanner::default();
        self.seconds = Seconds::default();
        self.tally = Tally::default();
        self.written = 0;
        let _ = self.scanner.feed(&line);
        self.waiting = line;
    }

    fn finish(mut self, why: &str) -> Result<Option<Received>, StoreError> {
        let unfinished = self.unfinished() as u64;
        self.write(self.waiting.len(), &mut Vec::new())?;
        self.close(why, *self.scanner.counts(), unfinished)
    }
}

/// Counts what was found and says where a second begins.
fn note(
    found: &Found<'_>,
    before: &Counts,
    seconds: &mut Seconds,
    tally: &mut Tally,
    entries: &mut Vec<Entry>,
) {
    tally.note(&found.decoded);
    let Decoded::Record { record, .. } = &found.decoded else { return };
    if let Some((frame, time_ns)) = moment(record)
        && seconds.begins(time_ns)
    {
        let records = before.records + before.newer;
        entries.push(Entry { offset: found.start, records, time_ns, frame });
    }
}

#[cfg(test)]
mod tests;
