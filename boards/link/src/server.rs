//! The box listens on TCP; several hosts may be connected, each at its own pace.

use std::fmt;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use gangway_device::Link;
use gangway_wire::FRAME_LIMIT;
use socket2::{Domain, Protocol, SockRef, Socket, TcpKeepalive, Type};

use crate::address::resolve;
use crate::error::is_busy;
use crate::{Address, Error};

/// Hosts that may be connected at a time; more are turned away.
pub const MAX_CLIENTS: usize = 8;
/// What may wait for one of several hosts, bytes. For a single one nothing waits here but the record being
/// sent: what stays in the outbox outlives the connection.
const BACKLOG: usize = 256 * 1024;
/// A host that takes nothing for so long while others listen is disconnected.
const PATIENCE: Duration = Duration::from_secs(2);

/// Listens; sends the same records to everybody who is connected.
///
/// A host that has no room misses whole records while another has room (it sees the gap in the running
/// numbers); with [`TcpServer::set_lossless`] the others wait for it instead. A host that closes its end,
/// also only the sending half, has left.
#[derive(Debug)]
pub struct TcpServer {
    listener: Option<TcpListener>,
    local: SocketAddr,
    clients: Vec<Client>,
    connections: u32,
    is_lossless: bool,
    /// The client that is heard first the next time.
    turn: usize,
}

impl TcpServer {
    /// Listens at a name or address of this machine; port 0 takes any free one.
    ///
    /// # Errors
    /// [`Error::InUse`] and [`Error::Open`].
    pub fn bind(host: &str, port: u16) -> Result<Self, Error> {
        let line = Address::Listen { host: host.to_owned(), port }.to_string();
        let at = resolve(host, port, &line)?;
        let listen = || -> std::io::Result<TcpListener> {
            let socket = Socket::new(Domain::for_address(at), Type::STREAM, Some(Protocol::TCP))?;
            socket.set_reuse_address(true)?;
            socket.bind(&at.into())?;
            socket.listen(MAX_CLIENTS as i32)?;
            socket.set_nonblocking(true)?;
            Ok(socket.into())
        };
        let open = |why: String| Error::Open { line: line.clone(), why };
        let listener = listen().map_err(|error| match error.kind() {
            ErrorKind::AddrInUse => Error::InUse { host: host.to_owned(), port },
            ErrorKind::AddrNotAvailable => {
                open(format!("{host} is no address of this machine; 0.0.0.0 listens on all of them"))
            }
            ErrorKind::PermissionDenied => open(format!("port {port} is reserved; give one above 1023")),
            _ => open(error.to_string()),
        })?;
        let local = listener.local_addr().map_err(|error| open(error.to_string()))?;
        Ok(Self {
            listener: Some(listener),
            local,
            clients: Vec::new(),
            connections: 0,
            is_lossless: false,
            turn: 0,
        })
    }

    /// Where it listens, with the port that it got.
    pub fn local_addr(&self) -> SocketAddr {
        self.local
    }

    /// Whether the slowest host holds up the others instead of missing records.
    pub fn set_lossless(&mut self, is_lossless: bool) {
        self.is_lossless = is_lossless;
    }

    fn not_connected(&self) -> Error {
        Error::NotConnected { line: self.to_string() }
    }

    fn accept(&mut self) {
        while let Some(Ok((stream, _))) = self.listener.as_ref().map(TcpListener::accept) {
            if self.clients.len() >= MAX_CLIENTS {
                continue;
            }
            if let Ok(client) = Client::new(stream) {
                self.clients.push(client);
                self.connections = self.connections.wrapping_add(1);
            }
        }
    }

    /// Sends what waits for each client and lets those go that are gone or hold the others up.
    fn push(&mut self) {
        let is_sole = self.clients.len() == 1;
        self.clients.retain_mut(|client| {
            client.push() && (is_sole || client.has_room(false) || client.moved.elapsed() < PATIENCE)
        });
    }
}

impl fmt::Display for TcpServer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "tcp://{}", self.local)
    }
}

impl Link for TcpServer {
    type Error = Error;

    fn send(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.accept();
        self.push();
        let is_sole = self.clients.len() == 1;
        let mut ready = self.clients.iter().map(|client| client.has_room(is_sole));
        let goes = if self.is_lossless { ready.all(|ready| ready) } else { ready.any(|ready| ready) };
        if self.clients.is_empty() {
            return Err(self.not_connected());
        }
        if !goes {
            return Ok(0);
        }
        let mut taken = false;
        self.clients.retain_mut(|client| {
            let keeps = !client.has_room(is_sole) || client.write(bytes);
            taken |= keeps;
            keeps
        });
        if taken { Ok(bytes.len()) } else { Err(self.not_connected()) }
    }

    fn receive(&mut self, into: &mut [u8]) -> Result<usize, Error> {
        self.accept();
        for _ in 0..self.clients.len() {
            self.turn = (self.turn + 1) % self.clients.len().max(1);
            let Some(client) = self.clients.get_mut(self.turn) else { continue };
            let count = client.hear(into);
            if count > 0 {
                return Ok(count);
            }
        }
        self.clients.retain(|client| !client.is_gone);
        if self.clients.is_empty() && self.listener.is_some() {
            return Err(self.not_connected());
        }
        Ok(0)
    }

    /// Sends what waits, then closes the sending half of every connection and waits for the hosts to close
    /// theirs: a close with commands unread would take records back that are still under way.
    fn finish(&mut self) -> Result<bool, Error> {
        self.listener = None;
        self.clients.retain_mut(|client| {
            if !client.push() {
                return false;
            }
            if client.out.is_empty() && !client.is_closing {
                client.is_closing = true;
                if client.stream.shutdown(std::net::Shutdown::Write).is_err() {
                    return false;
                }
            }
            !client.is_closing || !is_closed(&client.stream)
        });
        Ok(self.clients.is_empty())
    }

    fn connections(&self) -> u32 {
        self.connections
    }
}

/// One connected host.
#[derive(Debug)]
struct Client {
    stream: TcpStream,
    /// What it has not taken yet.
    out: Vec<u8>,
    /// What came from it and is not handed on yet.
    input: Vec<u8>,
    /// When it last took something.
    moved: Instant,
    is_gone: bool,
    is_closing: bool,
}

impl Client {
    fn new(stream: TcpStream) -> std::io::Result<Self> {
        stream.set_nonblocking(true)?;
        tune(&stream)?;
        // A leading delimiter: whatever listens begins anew.
        Ok(Self {
            stream,
            out: vec![0],
            input: Vec::new(),
            moved: Instant::now(),
            is_gone: false,
            is_closing: false,
        })
    }

    fn has_room(&self, is_sole: bool) -> bool {
        self.out.len() < if is_sole { 1 } else { BACKLOG }
    }

    /// Sends what waits; `false` when the connection is gone.
    fn push(&mut self) -> bool {
        while !self.out.is_empty() {
            match self.stream.write(&self.out) {
                Ok(0) => return false,
                Ok(count) => {
                    self.out.drain(..count);
                    self.moved = Instant::now();
                }
                Err(error) if is_busy(&error) => return true,
                Err(_) => return false,
            }
        }
        self.moved = Instant::now();
        true
    }

    fn write(&mut self, bytes: &[u8]) -> bool {
        self.out.extend_from_slice(bytes);
        self.push()
    }

    /// Whole records that came, so that those of several hosts never mix.
    fn hear(&mut self, into: &mut [u8]) -> usize {
        let mut portion = [0; 1024];
        while !self.is_gone && self.input.len() < FRAME_LIMIT {
            match self.stream.read(&mut portion) {
                Ok(0) => self.is_gone = true,
                Ok(count) => self.input.extend_from_slice(portion.get(..count).unwrap_or_default()),
                Err(error) if is_busy(&error) => break,
                Err(_) => self.is_gone = true,
            }
        }
        let ends_here = self.is_gone || self.input.len() >= FRAME_LIMIT;
        if ends_here && !self.input.is_empty() && !self.input.contains(&0) {
            // Cut off or no record at all: ended here, so that the decoder counts it.
            self.input.push(0);
        }
        let head = self.input.get(..into.len()).unwrap_or(&self.input);
        let count = match head.iter().rposition(|&byte| byte == 0) {
            Some(last) => last + 1,
            None if head.len() == into.len() => head.len(),
            None => 0,
        };
        if let (Some(into), Some(from)) = (into.get_mut(..count), self.input.get(..count)) {
            into.copy_from_slice(from);
            self.input.drain(..count);
        }
        count
    }
}

/// Small records go at once; a host that is gone without a word is noticed after some ten seconds.
pub(crate) fn tune(stream: &TcpStream) -> std::io::Result<()> {
    stream.set_nodelay(true)?;
    let socket = SockRef::from(stream);
    let keepalive = TcpKeepalive::new()
        .with_time(Duration::from_secs(5))
        .with_interval(Duration::from_secs(2))
        .with_retries(3);
    socket.set_tcp_keepalive(&keepalive)?;
    #[cfg(target_os = "linux")]
    socket.set_tcp_user_timeout(Some(Duration::from_secs(10)))?;
    Ok(())
}

/// Passes over what still comes; true when the other end has closed.
pub(crate) fn is_closed(mut stream: &TcpStream) -> bool {
    let mut passed_over = [0; 1024];
    loop {
        match stream.read(&mut passed_over) {
            Ok(0) => return true,
            Ok(_) => {}
            Err(error) => return !is_busy(&error),
        }
    }
}

#[cfg(test)]
mod tests {
    use gangway_device::{LinkError, LinkErrorKind};

    use super::*;

    fn server() -> TcpServer {
        TcpServer::bind("127.0.0.1", 0).unwrap()
    }

    fn connect(server: &mut TcpServer) -> TcpStream {
        let before = server.connections();
        let stream = TcpStream::connect(server.local_addr()).unwrap();
        while server.connections() == before {
            server.accept();
        }
        stream
    }

    fn hear(server: &mut TcpServer) -> Vec<u8> {
        let mut into = [0; 4096];
        loop {
            match server.receive(&mut into) {
                Ok(0) => std::thread::yield_now(),
                Ok(count) => return into[..count].to_vec(),
                Err(_) => return Vec::new(),
            }
        }
    }

    #[test]
    fn records_wait_until_somebody_connects_and_a_delimiter_leads() {
        let mut server = server();
        assert_eq!(server.send(b"a\0").unwrap_err().kind(), LinkErrorKind::NotConnected);
        let mut host = connect(&mut server);
        assert_eq!(server.send(b"a\0").unwrap(), 2);
        let mut got = [9; 3];
        host.read_exact(&mut got).unwrap();
        assert_eq!(&got, b"\0a\0");
    }

    #[test]
    fn a_port_in_use_is_one_sentence() {
        let first = server();
        let port = first.local_addr().port();
        let said = TcpServer::bind("127.0.0.1", port).unwrap_err().to_string();
        assert_eq!(
            said,
            format!("port {port} of 127.0.0.1 is in use; end the program that has it or give another port")
        );
    }

    #[test]
    fn a_foreign_address_is_refused() {
        // 192.0.2.0/24 is set aside for documentation: no machine has it.
        let said = TcpServer::bind("192.0.2.1", 0).unwrap_err().to_string();
        assert!(said.contains("192.0.2.1 is no address of this machine"), "{said}");
    }

    #[test]
    fn a_host_that_does_not_read_fills_up_and_delays_nobody() {
        let mut server = server();
        let _deaf = connect(&mut server);
        let record = [&[7; 599][..], &[0]].concat();
        // Alone it holds its records back: they stay in the outbox.
        while server.send(&record).unwrap() > 0 {}
        let mut keen = connect(&mut server);
        keen.set_nonblocking(true).unwrap();
        let (mut sent, mut got) = (0, 0);
        let mut into = vec![0; 65_536];
        while got < 4 * BACKLOG {
            sent += server.send(&record).unwrap();
            got += keen.read(&mut into).unwrap_or(0);
        }
        assert!(sent >= 4 * BACKLOG, "the keen host gets everything: {sent}");
    }

    #[test]
    fn without_loss_the_slowest_host_is_waited_for_until_it_leaves() {
        let mut server = server();
        server.set_lossless(true);
        let deaf = connect(&mut server);
        let _other = connect(&mut server);
        let record = [&[7; 599][..], &[0]].concat();
        let mut sent = 0usize;
        while server.send(&record).unwrap() > 0 {
            sent += 1;
        }
        assert!(sent > BACKLOG / 600);
        drop(deaf);
        assert_eq!(server.clients.len(), 2);
        hear_nothing(&mut server);
        assert!(server.clients.len() < 2, "who has left is not waited for");
    }

    fn hear_nothing(server: &mut TcpServer) {
        let mut into = [0; 64];
        while server.clients.len() == 2 {
            assert_eq!(server.receive(&mut into).unwrap(), 0);
        }
    }

    #[test]
    fn commands_of_two_hosts_never_mix() {
        let mut server = server();
        let mut one = connect(&mut server);
        let mut two = connect(&mut server);
        one.write_all(b"aa").unwrap();
        two.write_all(b"bb\0").unwrap();
        assert_eq!(hear(&mut server), b"bb\0");
        one.write_all(b"cc\0").unwrap();
        assert_eq!(hear(&mut server), b"aacc\0");
    }

    #[test]
    fn a_command_cut_off_by_the_hosts_leaving_is_ended() {
        let mut server = server();
        let mut host = connect(&mut server);
        host.write_all(b"aa").unwrap();
        drop(host);
        assert_eq!(hear(&mut server), b"aa\0");
        assert_eq!(hear(&mut server), b"", "nobody is connected any more");
        assert!(server.clients.is_empty());
    }

    #[test]
    fn a_flood_without_delimiter_is_cut_into_portions() {
        let mut server = server();
        let mut host = connect(&mut server);
        host.write_all(&vec![5; 3 * FRAME_LIMIT]).unwrap();
        assert_eq!(hear(&mut server).last(), Some(&0));
    }

    #[test]
    fn finishing_sends_everything_and_waits_for_the_host_to_close() {
        let mut server = server();
        let mut host = connect(&mut server);
        assert_eq!(server.send(b"a\0").unwrap(), 2);
        host.write_all(b"unread").unwrap();
        assert!(!server.finish().unwrap());
        let mut got = Vec::new();
        host.read_to_end(&mut got).unwrap();
        assert_eq!(got, b"\0a\0");
        drop(host);
        while !server.finish().unwrap() {
            std::thread::yield_now();
        }
    }
}
