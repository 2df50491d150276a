//! systemd is told when the box is ready, when it stops, and by every turn of the frame loop that it is alive
//! (sd_notify(3): datagrams to the socket that the environment names).

use std::env;
use std::ffi::OsStr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};

/// The line to systemd; does nothing where nobody listens.
#[derive(Debug, Default)]
pub struct Watchdog {
    socket: Option<UnixDatagram>,
    /// Time between two signs of life; `None` where systemd wants none.
    period: Option<Duration>,
    fed: Option<Instant>,
}

impl Watchdog {
    /// What the environment of this process asks for.
    pub fn from_environment() -> Self {
        let usec = env::var("WATCHDOG_USEC").ok().and_then(|text| text.parse().ok());
        let is_ours = env::var("WATCHDOG_PID").ok().is_none_or(|pid| pid == std::process::id().to_string());
        let timeout = usec.filter(|usec| is_ours && *usec > 0).map(Duration::from_micros);
        Self::new(env::var_os("NOTIFY_SOCKET").as_deref(), timeout)
    }

    /// Tells the socket of this name (a path, or `@` and an abstract name); within `timeout` it wants signs
    /// of life.
    pub fn new(socket: Option<&OsStr>, timeout: Option<Duration>) -> Self {
        let socket = socket.and_then(connect);
        // Four times as often as asked, so that one that comes late does no harm.
        Self { socket, period: timeout.map(|timeout| timeout / 4), fed: None }
    }

    /// A sign of life from the frame loop, if it is time for one. Never waits.
    pub fn feed(&mut self) {
        let (Some(socket), Some(period)) = (&self.socket, self.period) else { return };
        let now = Instant::now();
        if self.fed.is_none_or(|fed| now - fed >= period) {
            self.fed = Some(now);
            let _ = socket.send(b"WATCHDOG=1");
        }
    }

    /// The box measures, or waits for its camera.
    pub fn ready(&self) {
        self.tell(b"READY=1");
    }

    /// The session ends.
    pub fn stopping(&self) {
        self.tell(b"STOPPING=1");
    }

    fn tell(&self, state: &[u8]) {
        if let Some(socket) = &self.socket {
            // A manager that has gone away is no reason to stop.
            let _ = socket.send(state);
        }
    }
}

fn connect(name: &OsStr) -> Option<UnixDatagram> {
    let address = match name.as_bytes().strip_prefix(b"@") {
        Some(name) => SocketAddr::from_abstract_name(name).ok()?,
        None => SocketAddr::from_pathname(name).ok()?,
    };
    let socket = UnixDatagram::unbound().ok()?;
    socket.connect_addr(&address).ok()?;
    socket.set_nonblocking(true).ok()?;
    Some(socket)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(socket: &UnixDatagram) -> Vec<String> {
        socket.set_nonblocking(true).unwrap();
        let mut heard = Vec::new();
        let mut bytes = [0; 64];
        while let Ok(count) = socket.recv(&mut bytes) {
            heard.push(String::from_utf8_lossy(&bytes[..count]).into_owned());
        }
        heard
    }

    #[test]
    fn systemd_hears_that_the_box_is_ready_alive_and_stopping() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("notify");
        let socket = UnixDatagram::bind(&path).unwrap();
        let mut watchdog = Watchdog::new(Some(path.as_os_str()), Some(Duration::from_nanos(4)));
        watchdog.ready();
        watchdog.feed();
        watchdog.feed();
        watchdog.stopping();
        assert_eq!(heard(&socket), ["READY=1", "WATCHDOG=1", "WATCHDOG=1", "STOPPING=1"]);
    }

    #[test]
    fn signs_of_life_come_no_more_often_than_needed() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("notify");
        let socket = UnixDatagram::bind(&path).unwrap();
        let mut watchdog = Watchdog::new(Some(path.as_os_str()), Some(Duration::from_secs(3600)));
        for _ in 0..100 {
            watchdog.feed();
        }
        assert_eq!(heard(&socket), ["WATCHDOG=1"]);
    }

    #[test]
    fn nobody_who_listens_and_a_full_socket_hold_nothing_up() {
        Watchdog::new(None, None).ready();
        Watchdog::new(Some(OsStr::new("/no/such/socket")), Some(Duration::from_secs(1))).feed();
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("notify");
        let _deaf = UnixDatagram::bind(&path).unwrap();
        let mut watchdog = Watchdog::new(Some(path.as_os_str()), Some(Duration::ZERO));
        for _ in 0..10_000 {
            watchdog.feed();
        }
    }
}
