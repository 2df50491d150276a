//! Signals: the end of the session, and a setup to be read again. They only set flags, and never interrupt
//! the frame thread in its wait for the camera.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;

/// What signals have asked for.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    stop: Arc<AtomicBool>,
    reload: Arc<AtomicBool>,
}

impl Signals {
    /// Takes SIGTERM, SIGINT and SIGHUP over. A second SIGTERM or SIGINT - a shell and its terminal send one
    /// each - changes nothing: lamps are still to be put out, and what is left to be sent, within seconds.
    ///
    /// # Errors
    /// The system's.
    pub fn take_over() -> io::Result<Self> {
        let signals = Self::default();
        for signal in [SIGINT, SIGTERM] {
            flag::register(signal, Arc::clone(&signals.stop))?;
        }
        flag::register(SIGHUP, Arc::clone(&signals.reload))?;
        Ok(signals)
    }

    /// Whether the session is to end.
    pub fn stops(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Ends the session from within.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Release);
    }

    /// Whether the setup is to be read again; asked once, it is forgotten.
    pub fn takes_reload(&self) -> bool {
        self.reload.swap(false, Ordering::AcqRel)
    }
}

/// Blocks these signals for the calling thread: another one handles them, and no wait here ends early.
pub(crate) fn block() {
    // SAFETY: the set is made empty before it is used, and lives through the calls.
    unsafe {
        let mut set: libc::sigset_t = std::mem::zeroed();
        libc::sigemptyset(&raw mut set);
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            libc::sigaddset(&raw mut set, signal);
        }
        libc::pthread_sigmask(libc::SIG_BLOCK, &raw const set, std::ptr::null_mut());
    }
}
