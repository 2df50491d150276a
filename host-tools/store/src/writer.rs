//! A session as it is being received: bytes appended, both files on disk every second, one process at a time.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender as Notify, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use gangway_wire::Hello;

use crate::index::{self, Entry};
use crate::meta::{End, Meta, Sender, sync_folder};
use crate::session::{INDEX, STREAM};
use crate::{StoreError, Tally, utc};

/// The files are brought to disk this often.
pub const SYNC_PERIOD: Duration = Duration::from_secs(1);
/// Version of a session folder's layout.
const LAYOUT: u32 = 1;
/// Tries for a name that nobody has.
const NAMES: u32 = 10_000;

/// Writes one session. Dropped without [`SessionWriter::finish`], it leaves what a kill would leave.
#[derive(Debug)]
pub struct SessionWriter {
    into: PathBuf,
    folder: PathBuf,
    stream: File,
    index: File,
    entries: usize,
    bytes: u64,
    started_ns: u64,
    meta: Meta,
    syncer: Syncer,
}

/// Makes sure that sessions can be made in `into`: what refuses is better told before the ride than when the
/// box comes.
///
/// # Errors
/// No permission, or not a folder.
pub(crate) fn check_folder(into: &Path) -> Result<(), StoreError> {
    fs::create_dir_all(into).map_err(|e| StoreError::io("create", into, e))?;
    let trial = unique(into, &format!(".trial-{}", std::process::id()), |path| fs::create_dir(path))?;
    fs::remove_dir(&trial).map_err(|e| StoreError::io("write", into, e))
}

impl SessionWriter {
    /// Makes a folder of its own in `into` for what comes from `from`, and locks it.
    ///
    /// # Errors
    /// No room, or no permission.
    pub fn create(into: &Path, from: &str, hello: Option<&Hello<'_>>) -> Result<Self, StoreError> {
        fs::create_dir_all(into).map_err(|e| StoreError::io("create", into, e))?;
        let started_ns = utc::now_ns();
        let folder = unique(into, &name(started_ns, hello), |path| fs::create_dir(path))?;
        Self::begin(into, &folder, from, started_ns, hello).inspect_err(|_| {
            // Nothing was received into it: a folder of empty files would only pass for a session.
            let _ = fs::remove_dir_all(&folder);
        })
    }

    fn begin(
        into: &Path,
        folder: &Path,
        from: &str,
        started_ns: u64,
        hello: Option<&Hello<'_>>,
    ) -> Result<Self, StoreError> {
        let open = |name: &str| {
            let path = folder.join(name);
            let file = OpenOptions::new().append(true).create_new(true).open(&path);
            file.map_err(|e| StoreError::io("create", &path, e))
        };
        let stream = open(STREAM)?;
        // Nobody else knows the folder yet: where locks are not supported there is nothing to be said.
        let _ = stream.try_lock();
        let mut index = open(INDEX)?;
        index.write_all(&index::header()).map_err(|e| StoreError::io("write", &folder.join(INDEX), e))?;
        let meta = Meta {
            layout: LAYOUT,
            from: from.to_owned(),
            started: utc::readable(started_ns),
            process: std::process::id(),
            sender: hello.map(Sender::new),
            end: None,
        };
        meta.write(folder)?;
        sync_folder(Some(into)).map_err(|e| StoreError::io("write", into, e))?;
        let syncer = Syncer::start(&stream, &index).map_err(|e| StoreError::io("write", folder, e))?;
        let (into, folder) = (into.to_owned(), folder.to_owned());
        Ok(Self { into, folder, stream, index, entries: 0, bytes: 0, started_ns, meta, syncer })
    }

    /// The session's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Bytes written so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The sender made itself known only now: the folder gets its name.
    ///
    /// # Errors
    /// No room, or no permission.
    pub fn introduce(&mut self, hello: &Hello<'_>) -> Result<(), StoreError> {
        self.meta.sender = Some(Sender::new(hello));
        self.meta.write(&self.folder)?;
        let old = self.folder.clone();
        // An empty folder holds the name; renaming onto it is atomic and fails if it has been filled.
        self.folder = unique(&self.into, &name(self.started_ns, Some(hello)), |path| {
            fs::create_dir(path)?;
            fs::rename(&old, path).inspect_err(|_| {
                // It is empty, and nobody's.
                let _ = fs::remove_dir(path);
            })
        })?;
        sync_folder(Some(&self.into)).map_err(|e| StoreError::io("write", &self.into, e))
    }

    /// Appends bytes as they came.
    ///
    /// # Errors
    /// A full disk, or one that does not take what it was given within the last second.
    pub fn append(&mut self, bytes: &[u8]) -> Result<(), StoreError> {
        if let Some(error) = self.syncer.failed() {
            return Err(StoreError::io("write", &self.folder, error));
        }
        self.stream.write_all(bytes).map_err(|e| StoreError::io("write", &self.folder, e))?;
        self.bytes += bytes.len() as u64;
        Ok(())
    }

    /// Appends an entry to the index.
    ///
    /// # Errors
    /// As [`SessionWriter::append`].
    pub fn mark(&mut self, entry: Entry) -> Result<(), StoreError> {
        let bytes = entry.to_bytes(self.entries);
        self.index.write_all(&bytes).map_err(|e| StoreError::io("write", &self.folder, e))?;
        self.entries += 1;
        Ok(())
    }

    /// Brings everything to disk and writes down how it ended. The session's folder.
    ///
    /// # Errors
    /// A full disk.
    pub fn finish(mut self, why: &str, tally: &Tally) -> Result<PathBuf, StoreError> {
        let io = |e| StoreError::io("write", &self.folder, e);
        self.syncer.failed().map_or(Ok(()), Err).map_err(io)?;
        self.stream.sync_data().map_err(io)?;
        self.index.sync_data().map_err(io)?;
        self.meta.end = Some(End::new(why, utc::readable(utc::now_ns()), tally));
        self.meta.write(&self.folder)?;
        Ok(self.folder.clone())
    }
}

/// `20260131T235959Z-ride-1f`.
fn name(started_ns: u64, hello: Option<&Hello<'_>>) -> String {
    let time = utc::compact(started_ns);
    let Some(hello) = hello else { return format!("{time}-unknown") };
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
    let name: String = hello.name.chars().map(plain).collect();
    let name = if name.is_empty() { "box" } else { &name };
    format!("{time}-{name}-{:x}", hello.session_id)
}

/// Makes `name`, or `name-2` and so on, whichever does not exist yet.
fn unique(into: &Path, name: &str, make: impl Fn(&Path) -> io::Result<()>) -> Result<PathBuf, StoreError> {
    let mut path = into.join(name);
    for number in 2..NAMES {
        match make(&path) {
            Ok(()) => return Ok(path),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                path = into.join(format!("{name}-{number}"));
            }
            Err(error) => return Err(StoreError::io("create", &path, error)),
        }
    }
    Err(StoreError::io("create", &path, io::ErrorKind::AlreadyExists.into()))
}

/// A thread that brings both files to disk, so that a slow disk does not hold up receiving.
#[derive(Debug)]
struct Syncer {
    stop: Option<Notify<()>>,
    failed: Arc<Mutex<Option<io::Error>>>,
    thread: Option<JoinHandle<()>>,
}

impl Syncer {
    fn start(stream: &File, index: &File) -> io::Result<Self> {
        let (stream, index) = (stream.try_clone()?, index.try_clone()?);
        let (stop, stopped) = channel();
        let failed = Arc::new(Mutex::new(None));
        let report = Arc::clone(&failed);
        let run = move || {
            while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(SYNC_PERIOD) {
                // The stream first: an index that knows less than the stream is simply continued.
                if let Err(error) = stream.sync_data().and_then(|()| index.sync_data()) {
                    *report.lock().unwrap_or_else(|e| e.into_inner()) = Some(error);
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("sync".into()).spawn(run)?;
        Ok(Self { stop: Some(stop), failed, thread: Some(thread) })
    }

    fn failed(&self) -> Option<io::Error> {
        self.failed.lock().unwrap_or_else(|e| e.into_inner()).take()
    }
}

impl Drop for Syncer {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            // It has nothing to return; an error was left in `failed`.
            let _ = thread.join();
        }
    }
}
