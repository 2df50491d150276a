//! What stands beside a stream in `session.json`: where it came from, whose it is and how it ended.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use gangway_wire::Hello;
use serde::{Deserialize, Serialize};

use crate::{StoreError, Tally};

/// Name of the file in a session's folder.
pub(crate) const META: &str = "session.json";

/// About a session. Numbers of 64 bits that are names are written in hexadecimal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Meta {
    /// Version of this folder's layout.
    pub layout: u32,
    /// Where the bytes came from.
    pub from: String,
    /// When the first byte came, UTC.
    pub started: String,
    /// Number of the process that received it.
    pub process: u32,
    /// Who sent it, once known.
    pub sender: Option<Sender>,
    /// How it ended; absent as long as it is being received and where receiving was cut off.
    pub end: Option<End>,
}

/// Who sent a session.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sender {
    /// Name of the box.
    pub name: String,
    /// Serial number of the box.
    pub box_id: String,
    /// Number of the boot.
    pub boot_id: String,
    /// Number of the session.
    pub session_id: String,
    /// Version of the firmware.
    pub firmware: String,
    /// Version of the wire.
    pub wire_version: u16,
    /// Digest of the setup.
    pub setup_digest: String,
}

/// How a session ended, and what it held then.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct End {
    /// Why.
    pub why: String,
    /// When, UTC.
    pub at: String,
    /// Bytes in the stream.
    pub bytes: u64,
    /// Records.
    pub records: u64,
    /// Records damaged.
    pub damaged: u64,
    /// Records missing.
    pub missing: u64,
    /// Time of the last frame on the box's clock, ns.
    pub last_time_ns: Option<u64>,
}

impl Sender {
    pub(crate) fn new(hello: &Hello<'_>) -> Self {
        Self {
            name: hello.name.to_owned(),
            box_id: format!("{:x}", hello.box_id),
            boot_id: format!("{:x}", hello.boot_id),
            session_id: format!("{:x}", hello.session_id),
            firmware: hello.firmware.to_owned(),
            wire_version: hello.wire_version,
            setup_digest: hex(&hello.setup_digest),
        }
    }
}

impl End {
    pub(crate) fn new(why: &str, at: String, tally: &Tally) -> Self {
        Self {
            why: why.to_owned(),
            at,
            bytes: tally.bytes,
            records: tally.wire.records + tally.wire.newer,
            damaged: tally.wire.damaged,
            missing: tally.wire.missing,
            last_time_ns: tally.last.map(|(_, time)| time),
        }
    }
}

/// Bytes in hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

impl Meta {
    /// What is written, or what can be said where it is missing or damaged.
    pub(crate) fn read(folder: &Path) -> Option<Self> {
        serde_json::from_slice(&fs::read(folder.join(META)).ok()?).ok()
    }

    pub(crate) fn write(&self, folder: &Path) -> Result<(), StoreError> {
        let mut text = serde_json::to_vec_pretty(self).unwrap_or_default();
        text.push(b'\n');
        replace(&folder.join(META), |file| file.write_all(&text))
    }
}

/// Writes a file under a temporary name and gives it its own when it is complete and on disk.
pub(crate) fn replace(
    path: &Path,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> Result<(), StoreError> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let part: PathBuf = path.with_file_name(name);
    let done = File::create(&part).and_then(|mut file| {
        write(&mut file)?;
        file.sync_all()
    });
    match done.and_then(|()| fs::rename(&part, path)).and_then(|()| sync_folder(path.parent())) {
        Ok(()) => Ok(()),
        Err(error) => {
            // The first error is the one to report; a leftover may not have come into being at all.
            let _ = fs::remove_file(&part);
            Err(StoreError::io("write", path, error))
        }
    }
}

/// Makes names in a folder survive a power cut.
pub(crate) fn sync_folder(folder: Option<&Path>) -> io::Result<()> {
    match folder {
        Some(folder) if !folder.as_os_str().is_empty() => File::open(folder)?.sync_all(),
        _ => File::open(".")?.sync_all(),
    }
}
