//! The box connects out over TCP and goes on trying, ever more slowly, until the host is there.

use std::fmt;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use gangway_device::Link;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use socket2::{Domain, Protocol, Socket, Type};

use crate::address::resolve;
use crate::error::is_busy;
use crate::server::{is_closed, tune};
use crate::{Address, Error};

/// Wait after the first failure; doubled after each further one.
const FIRST_WAIT: Duration = Duration::from_millis(100);
/// Longest wait between two tries.
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// A try that has no answer by then is given up.
const PATIENCE: Duration = Duration::from_secs(5);

/// Connects to a host, again and again.
///
/// A name that has to be looked up may hold up the link's thread while it is not connected; the frame loop
/// never.
#[derive(Debug)]
pub struct TcpClient {
    host: String,
    port: u16,
    state: State,
    wait: Duration,
    connections: u32,
    /// A delimiter leads every connection.
    begins: bool,
}

#[derive(Debug)]
enum State {
    Waiting { until: Instant },
    Connecting { socket: Socket, since: Instant },
    Connected { stream: TcpStream },
    Closing { stream: TcpStream },
}

impl TcpClient {
    /// A client of that host; the first try comes with the first use.
    pub fn new(host: &str, port: u16) -> Self {
        Self {
            host: host.to_owned(),
            port,
            state: State::Waiting { until: Instant::now() },
            wait: FIRST_WAIT,
            connections: 0,
            begins: true,
        }
    }

    fn lose(&mut self) -> Error {
        self.state = State::Waiting { until: Instant::now() + self.wait };
        self.wait = (self.wait * 2).min(LONGEST_WAIT);
        Error::NotConnected { line: self.to_string() }
    }

    fn try_connect(&self) -> std::io::Result<Socket> {
        let to =
            resolve(&self.host, self.port, "").map_err(|error| std::io::Error::other(error.to_string()))?;
        let socket = Socket::new(Domain::for_address(to), Type::STREAM, Some(Protocol::TCP))?;
        socket.set_nonblocking(true)?;
        match socket.connect(&to.into()) {
            Err(error) if error.raw_os_error() == Some(rustix::io::Errno::INPROGRESS.raw_os_error()) => {}
            other => other?,
        }
        Ok(socket)
    }

    /// Goes on with connecting; the stream when it stands.
    fn stream(&mut self) -> Result<&mut TcpStream, Error> {
        match &self.state {
            State::Waiting { until } if Instant::now() >= *until => match self.try_connect() {
                Ok(socket) => self.state = State::Connecting { socket, since: Instant::now() },
                Err(_) => return Err(self.lose()),
            },
            State::Connecting { socket, since } => match outcome(socket) {
                None if since.elapsed() < PATIENCE => {}
                Some(true) => {
                    let stream = socket.try_clone().map(TcpStream::from);
                    let tuned = stream.and_then(|stream| tune(&stream).map(|()| stream));
                    let Ok(stream) = tuned else { return Err(self.lose()) };
                    self.state = State::Connected { stream };
                    self.wait = FIRST_WAIT;
                    self.connections = self.connections.wrapping_add(1);
                    self.begins = true;
                }
                _ => return Err(self.lose()),
            },
            _ => {}
        }
        let line = Address::Connect { host: self.host.clone(), port: self.port };
        match &mut self.state {
            State::Connected { stream } => Ok(stream),
            _ => Err(Error::NotConnected { line: line.to_string() }),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        match self.stream()?.write(bytes) {
            Ok(0) if !bytes.is_empty() => Err(self.lose()),
            Ok(count) => Ok(count),
            Err(error) if is_busy(&error) => Ok(0),
            Err(_) => Err(self.lose()),
        }
    }
}

/// Whether a connection came about; `None` as long as that is open.
fn outcome(socket: &Socket) -> Option<bool> {
    let mut fds = [PollFd::new(socket, PollFlags::OUT)];
    let now = Timespec { tv_sec: 0, tv_nsec: 0 };
    match poll(&mut fds, Some(&now)) {
        Ok(0) | Err(rustix::io::Errno::INTR) => None,
        Ok(_) => Some(matches!(socket.take_error(), Ok(None)) && socket.peer_addr().is_ok()),
        Err(_) => Some(false),
    }
}

impl fmt::Display for TcpClient {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Address::Connect { host: self.host.clone(), port: self.port }.fmt(f)
    }
}

impl Link for TcpClient {
    type Error = Error;

    fn send(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.stream()?;
        if self.begins && self.write(&[0])? == 0 {
            return Ok(0);
        }
        self.begins = false;
        self.write(bytes)
    }

    fn receive(&mut self, into: &mut [u8]) -> Result<usize, Error> {
        match self.stream()?.read(into) {
            Ok(0) => Err(self.lose()),
            Ok(count) => Ok(count),
            Err(error) if is_busy(&error) => Ok(0),
            Err(_) => Err(self.lose()),
        }
    }

    /// As [`crate::TcpServer`]: closes the sending half and waits for the host to close its own.
    fn finish(&mut self) -> Result<bool, Error> {
        if let State::Connected { stream } = &self.state {
            let Ok(stream) = stream.try_clone() else { return Ok(true) };
            if stream.shutdown(Shutdown::Write).is_err() {
                return Ok(true);
            }
            self.state = State::Closing { stream };
        }
        Ok(match &self.state {
            State::Closing { stream } => is_closed(stream),
            _ => true,
        })
    }

    fn connections(&self) -> u32 {
        self.connections
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    /// Sends until the record is taken.
    fn send(client: &mut TcpClient, record: &[u8]) {
        while client.send(record).unwrap_or(0) == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn the_client_waits_for_a_host_and_finds_it_again() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let at = listener.local_addr().unwrap();
        drop(listener);
        let mut client = TcpClient::new("127.0.0.1", at.port());
        for _ in 0..3 {
            assert!(matches!(client.send(b"a\0"), Err(Error::NotConnected { .. })));
            std::thread::sleep(Duration::from_millis(2));
        }
        assert_eq!(client.connections(), 0);

        let socket = Socket::new(Domain::IPV4, Type::STREAM, None).unwrap();
        socket.set_reuse_address(true).unwrap();
        socket.bind(&at.into()).unwrap();
        socket.listen(1).unwrap();
        let listener: TcpListener = socket.into();
        for round in 1..3 {
            send(&mut client, b"a\0");
            assert_eq!(client.connections(), round);
            let (mut host, _) = listener.accept().unwrap();
            let mut got = [9; 3];
            host.read_exact(&mut got).unwrap();
            assert_eq!(&got, b"\0a\0", "a delimiter leads every connection");
            drop(host);
            // Its end is noticed without sending anything.
            let mut into = [0; 8];
            while client.receive(&mut into).is_ok() {
                std::thread::yield_now();
            }
        }
    }
}
