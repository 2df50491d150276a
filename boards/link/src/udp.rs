//! UDP as a line: a datagram carries whole records, and nobody answers for it.
//!
//! A datagram that the network or a slow receiver drops is lost; the host sees that in the running numbers. A
//! socket that fails - the board has another address, a firewall on the way refuses - is opened again.

use std::fmt;
use std::io::ErrorKind;
use std::net::UdpSocket;
use std::time::{Duration, Instant};

use gangway_device::Link;

use crate::address::resolve;
use crate::error::is_busy;
use crate::{Address, Error};

/// Largest datagram, bytes: fits into an Ethernet frame with IPv6 and UDP heads. A single longer record has a
/// datagram of its own.
pub const MAX_DATAGRAM: usize = 1_400;

/// Wait before a socket that failed is opened again.
const WAIT: Duration = Duration::from_millis(500);

/// Sends datagrams to one host and takes its commands.
///
/// A name that has to be looked up again may hold up the link's thread, as for [`crate::TcpClient`].
#[derive(Debug)]
pub struct Udp {
    host: String,
    port: u16,
    socket: Option<UdpSocket>,
    next_try: Instant,
    connections: u32,
}

impl Udp {
    /// Opens a socket towards the host.
    ///
    /// # Errors
    /// [`Error::Open`] where the host is not known or cannot be reached from here.
    pub fn open(host: &str, port: u16) -> Result<Self, Error> {
        let socket = Some(open(host, port)?);
        Ok(Self { host: host.to_owned(), port, socket, next_try: Instant::now(), connections: 0 })
    }

    fn lose(&mut self) -> Error {
        self.socket = None;
        self.next_try = Instant::now() + WAIT;
        Error::NotConnected { line: self.to_string() }
    }

    fn socket(&mut self) -> Result<&UdpSocket, Error> {
        if self.socket.is_none() && Instant::now() >= self.next_try {
            match open(&self.host, self.port) {
                Ok(socket) => {
                    self.socket = Some(socket);
                    self.connections = self.connections.wrapping_add(1);
                }
                Err(_) => return Err(self.lose()),
            }
        }
        self.socket.as_ref().ok_or_else(|| Error::NotConnected { line: self.to_string() })
    }
}

fn open(host: &str, port: u16) -> Result<UdpSocket, Error> {
    let line = Address::Udp { host: host.to_owned(), port }.to_string();
    let to = resolve(host, port, &line)?;
    let any = if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
    UdpSocket::bind(any)
        .and_then(|socket| socket.connect(to).map(|()| socket))
        .and_then(|socket| socket.set_nonblocking(true).map(|()| socket))
        .map_err(|error| Error::Open { line, why: error.to_string() })
}

impl fmt::Display for Udp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Address::Udp { host: self.host.clone(), port: self.port }.fmt(f)
    }
}

/// As many whole records as a datagram takes; the first one always.
fn datagram(bytes: &[u8]) -> &[u8] {
    let head = bytes.get(..MAX_DATAGRAM).unwrap_or(bytes);
    let end = match head.iter().rposition(|&byte| byte == 0) {
        Some(last) => last + 1,
        None => bytes.iter().position(|&byte| byte == 0).map_or(bytes.len(), |first| first + 1),
    };
    bytes.get(..end).unwrap_or(bytes)
}

impl Link for Udp {
    type Error = Error;

    fn send(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        if bytes.is_empty() {
            return Ok(0);
        }
        let datagram = datagram(bytes);
        match self.socket()?.send(datagram) {
            Ok(_) => Ok(datagram.len()),
            Err(error) if is_busy(&error) => Ok(0),
            // An earlier datagram found nobody; this one is as lost as it would be on the way.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => Ok(datagram.len()),
            Err(_) => Err(self.lose()),
        }
    }

    fn receive(&mut self, into: &mut [u8]) -> Result<usize, Error> {
        match self.socket()?.recv(into) {
            Ok(count) => Ok(count),
            Err(error) if is_busy(&error) || error.kind() == ErrorKind::ConnectionRefused => Ok(0),
            Err(_) => Err(self.lose()),
        }
    }

    fn connections(&self) -> u32 {
        self.connections
    }
}

#[cfg(test)]
mod tests {
    use gangway_device::{LinkError as _, LinkErrorKind};

    use super::*;

    #[test]
    fn a_datagram_carries_whole_records() {
        let host = UdpSocket::bind("127.0.0.1:0").unwrap();
        let mut link = Udp::open("127.0.0.1", host.local_addr().unwrap().port()).unwrap();
        let mut records = vec![1; 999];
        records.push(0);
        records.extend([2; 500]);
        records.push(0);
        assert_eq!(link.send(&records).unwrap(), 1_000);
        assert_eq!(link.send(&records[1_000..]).unwrap(), 501);
        let mut into = [9; 2_000];
        assert_eq!(host.recv(&mut into).unwrap(), 1_000);
        assert_eq!(into[999], 0);
        assert_eq!(host.recv(&mut into).unwrap(), 501);
    }

    #[test]
    fn commands_come_back_from_the_host() {
        let host = UdpSocket::bind("127.0.0.1:0").unwrap();
        let mut link = Udp::open("127.0.0.1", host.local_addr().unwrap().port()).unwrap();
        link.send(b"a\0").unwrap();
        let mut into = [9; 64];
        let (_, from) = host.recv_from(&mut into).unwrap();
        assert_eq!(link.receive(&mut into).unwrap(), 0);
        host.send_to(b"xyz\0", from).unwrap();
        while link.receive(&mut into).unwrap() == 0 {
            std::thread::yield_now();
        }
        assert_eq!(&into[..4], b"xyz\0");
    }

    #[test]
    fn a_host_that_does_not_listen_holds_nobody_up() {
        let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let mut link = Udp::open("127.0.0.1", port).unwrap();
        for _ in 0..5 {
            assert_eq!(link.send(b"a\0").unwrap(), 2);
        }
    }

    #[test]
    fn a_socket_that_fails_is_opened_again() {
        let host = UdpSocket::bind("127.0.0.1:0").unwrap();
        let mut link = Udp::open("127.0.0.1", host.local_addr().unwrap().port()).unwrap();
        // One that leads nowhere fails in every send, as one of an address that the board no longer has.
        link.socket = Some(UdpSocket::bind("127.0.0.1:0").unwrap());
        assert_eq!(link.send(b"a\0").unwrap_err().kind(), LinkErrorKind::NotConnected);
        while link.send(b"b\0").is_err() {
            std::thread::sleep(Duration::from_millis(1));
        }
        let mut into = [9; 8];
        assert_eq!(host.recv(&mut into).unwrap(), 2);
        assert_eq!((&into[..2], link.connections()), (&b"b\0"[..], 1), "and the box announces itself");
    }
}
