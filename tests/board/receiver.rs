//! The receiver on this side of the board's network.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use e2e::gangway;

use crate::said::Said;

/// `gangway receive` in a folder, from the address that the box is to be told.
pub(crate) struct Receiver {
    program: Child,
    folder: PathBuf,
}

impl Receiver {
    pub(crate) fn start(folder: &Path, from: &str) -> Self {
        let program = gangway()
            .args(["receive", "--from", from, "--into"])
            .arg(folder.join("rides"))
            .stderr(Stdio::null())
            .spawn()
            .expect("the receiver starts");
        Self { program, folder: folder.join("rides") }
    }

    /// The session's folder and bytes so far.
    fn stream(&self) -> Option<(PathBuf, Vec<u8>)> {
        let sessions = std::fs::read_dir(&self.folder).ok()?;
        let session =
            sessions.flatten().map(|entry| entry.path()).find(|path| path.join("stream.gw").exists())?;
        let bytes = std::fs::read(session.join("stream.gw")).ok()?;
        Some((session, bytes))
    }

    /// Frames that the box has measured so far.
    pub(crate) fn frames(&self) -> usize {
        self.stream().map_or(0, |(_, bytes)| Said::of(&bytes).poses.len())
    }

    /// Waits until the box has measured so many frames.
    pub(crate) fn wait_for(&self, frames: usize) {
        let since = Instant::now();
        while self.frames() < frames {
            assert!(since.elapsed() < Duration::from_secs(300), "no {frames} frames came");
            std::thread::sleep(Duration::from_millis(200));
        }
    }

    pub(crate) fn end(mut self) -> (PathBuf, Said) {
        self.program.wait().expect("the receiver ends with the session");
        let (session, bytes) = self.stream().expect("a session");
        (session, Said::of(&bytes))
    }
}

impl Drop for Receiver {
    fn drop(&mut self) {
        let _ = self.program.kill();
    }
}

pub(crate) fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a port").port()
}
