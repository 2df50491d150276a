//! Reads pictures in a thread of its own, a little ahead, so that reading is no part of the loop time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::source::{FrameSource, Shape, SourceError};

/// Pictures that are read and wait.
const AHEAD: usize = 1;
/// How often a wait looks whether it shall end.
const GLANCE: Duration = Duration::from_millis(50);
/// How long a source may take to end; one that hangs in its input is left to the end of the process.
const PATIENCE: Duration = Duration::from_secs(1);

/// One picture and its place in the recording.
pub(crate) struct Picture {
    pub(crate) bytes: Vec<u8>,
    /// Index in its pass, from 0.
    pub(crate) index: u64,
    /// Pass of a recording that is repeated, from 0.
    pub(crate) pass: u32,
}

/// The reading thread's end in the loop.
pub(crate) struct ReadAhead {
    pub(crate) shape: Shape,
    pictures: Option<Receiver<Result<Picture, SourceError>>>,
    spare: Sender<Vec<u8>>,
    thread: Option<JoinHandle<()>>,
}

impl ReadAhead {
    /// Starts to read; the whole recording `passes` times.
    pub(crate) fn start(source: Box<dyn FrameSource>, passes: u32) -> Self {
        let shape = source.shape();
        let (give, pictures) = sync_channel(AHEAD);
        let (spare, returned) = channel();
        let thread = thread::spawn(move || {
            if let Err(error) = read(source, passes, &give, &returned) {
                // Nobody is left to be told where the loop has ended.
                let _ = give.send(Err(error));
            }
        });
        Self { shape, pictures: Some(pictures), spare, thread: Some(thread) }
    }

    /// The next picture; `None` at the end or when `stop` is set. `used` goes back to be filled again.
    pub(crate) fn next(&mut self, used: Vec<u8>, stop: &AtomicBool) -> Option<Result<Picture, SourceError>> {
        // The thread may have ended: it needs no more.
        let _ = self.spare.send(used);
        let pictures = self.pictures.as_ref()?;
        while !stop.load(Ordering::Acquire) {
            match pictures.recv_timeout(GLANCE) {
                Ok(picture) => return Some(picture),
                Err(RecvTimeoutError::Disconnected) => return None,
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
        None
    }
}

impl Drop for ReadAhead {
    fn drop(&mut self) {
        // Its next picture finds nobody, and the thread ends with its source.
        self.pictures = None;
        let since = Instant::now();
        while self.thread.as_ref().is_some_and(|thread| !thread.is_finished()) && since.elapsed() < PATIENCE {
            thread::sleep(Duration::from_millis(1));
        }
    }
}

fn read(
    mut source: Box<dyn FrameSource>,
    passes: u32,
    give: &SyncSender<Result<Picture, SourceError>>,
    returned: &Receiver<Vec<u8>>,
) -> Result<(), SourceError> {
    for pass in 0..passes {
        if pass > 0 {
            source.rewind()?;
        }
        for index in 0.. {
            let mut bytes = returned.try_recv().unwrap_or_default();
            if !source.read(&mut bytes)? {
                break;
            }
            if give.send(Ok(Picture { bytes, index, pass })).is_err() {
                return Ok(());
            }
        }
    }
    Ok(())
}
