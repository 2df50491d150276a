//! Bytes from a line, a socket or a file. A source never waits longer than [`WAIT`], says when somebody comes
//! or goes, and goes on trying by itself where that makes sense.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs, UdpSocket};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::sockopt;
use serialport::SerialPort;

use crate::{Address, StoreError};

/// Longest wait of one [`Source::read`].
pub(crate) const WAIT: Duration = Duration::from_millis(100);
/// Pause between two tries to reach the box.
const RETRY: Duration = Duration::from_millis(500);
/// A connection is given up when the box's system does not answer for about this long.
const KEEP_ALIVE: Duration = Duration::from_secs(3);
/// A sender of datagrams that was silent for this long can be followed by another one.
const SILENCE: Duration = Duration::from_secs(3);
/// Room for datagrams that wait, bytes: two seconds at 1 MB/s.
const UDP_ROOM: usize = 2 << 20;

/// What a read gave.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Got {
    /// This many bytes.
    Bytes(usize),
    /// Nothing within [`WAIT`].
    Nothing,
    /// Nothing yet, and something that a person should know.
    Said(String),
    /// Somebody is there: what an earlier connection left unfinished stays so.
    Joined(String),
    /// Nobody is there any more; the source goes on trying.
    Left(String),
    /// There will be no more.
    End,
}

/// An open source.
#[derive(Debug)]
pub(crate) enum Source {
    Tcp(Client),
    Listen(Listener),
    Udp(Datagrams),
    Serial(Line),
    File(File),
    Stdin,
}

impl Source {
    /// Opens, binds or gets ready to connect.
    pub(crate) fn open(address: &Address) -> Result<Self, StoreError> {
        let refused = |what: &str, error: io::Error| StoreError::Connect {
            what: address.to_string(),
            why: match error.kind() {
                io::ErrorKind::AddrInUse => {
                    format!("{what}: another program has this port; choose another one")
                }
                _ => format!("{what}: {error}"),
            },
        };
        Ok(match address {
            Address::Tcp(place) => {
                Self::Tcp(Client { place: place.clone(), stream: None, next: Instant::now(), told: false })
            }
            Address::TcpListen(place) => {
                let socket = TcpListener::bind(place)
                    .and_then(|socket| socket.set_nonblocking(true).map(|()| socket))
                    .map_err(|e| refused("cannot listen there", e))?;
                Self::Listen(Listener { socket, stream: None })
            }
            Address::Udp(place) => {
                let socket = UdpSocket::bind(place)
                    .and_then(|socket| socket.set_read_timeout(Some(WAIT)).map(|()| socket))
                    .map_err(|e| refused("cannot receive there", e))?;
                // A wish: the system may give less.
                let _ = sockopt::set_socket_recv_buffer_size(&socket, UDP_ROOM);
                Self::Udp(Datagrams { socket, from: None, waiting: Vec::new(), others: 0 })
            }
            Address::Serial { device, baud } => Self::Serial(Line {
                device: device.clone(),
                baud: *baud,
                port: None,
                next: Instant::now(),
                told: false,
            }),
            Address::File(path) => Self::File(File::open(path).map_err(|e| StoreError::io("open", path, e))?),
            Address::Stdin => Self::Stdin,
        })
    }

    /// Where a listening source listens.
    pub(crate) fn local_address(&self) -> Option<SocketAddr> {
        match self {
            Self::Listen(listener) => listener.socket.local_addr().ok(),
            Self::Udp(datagrams) => datagrams.socket.local_addr().ok(),
            _ => None,
        }
    }

    /// Whether it goes on for ever by itself, so that only the box or a person ends it.
    pub(crate) fn is_live(&self) -> bool {
        !matches!(self, Self::File(_) | Self::Stdin)
    }

    /// Reads into `buffer`, which has room for a datagram.
    pub(crate) fn read(&mut self, buffer: &mut [u8]) -> io::Result<Got> {
        match self {
            Self::Tcp(client) => client.read(buffer),
            Self::Listen(listener) => listener.read(buffer),
            Self::Udp(datagrams) => datagrams.read(buffer),
            Self::Serial(line) => Ok(line.read(buffer)),
            Self::File(file) => Ok(end_or_bytes(file.read(buffer)?)),
            Self::Stdin => read_stdin(buffer),
        }
    }
}

fn end_or_bytes(count: usize) -> Got {
    if count == 0 { Got::End } else { Got::Bytes(count) }
}

/// Whether an error says only that nothing came in time.
fn is_timeout(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

fn read_stdin(buffer: &mut [u8]) -> io::Result<Got> {
    let stdin = io::stdin();
    let wait = Timespec { tv_sec: 0, tv_nsec: i64::from(WAIT.subsec_nanos()) };
    match poll(&mut [PollFd::new(&stdin, PollFlags::IN)], Some(&wait)) {
        Ok(0) | Err(rustix::io::Errno::INTR) => Ok(Got::Nothing),
        Ok(_) => Ok(end_or_bytes(stdin.lock().read(buffer)?)),
        Err(error) => Err(error.into()),
    }
}

/// Readies an accepted or made connection: short reads, and an end when the other side is gone.
pub(crate) fn prepare(stream: &TcpStream) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(WAIT))?;
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, KEEP_ALIVE)?;
    sockopt::set_tcp_keepintvl(stream, Duration::from_secs(1))?;
    sockopt::set_tcp_keepcnt(stream, 3)?;
    Ok(())
}

/// Reads from a connection; it is dropped when it is over.
fn read_stream(stream: &mut Option<TcpStream>, buffer: &mut [u8]) -> Got {
    let Some(open) = stream else { return Got::Nothing };
    let why = match open.read(buffer) {
        Ok(0) => "the box closed the connection".to_owned(),
        Ok(count) => return Got::Bytes(count),
        Err(error) if is_timeout(&error) => return Got::Nothing,
        Err(error) => format!("the connection is lost ({error})"),
    };
    *stream = None;
    Got::Left(why)
}

/// A connection that we make, again and again.
#[derive(Debug)]
pub(crate) struct Client {
    place: String,
    stream: Option<TcpStream>,
    next: Instant,
    told: bool,
}

impl Client {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<Got> {
        if self.stream.is_some() {
            let got = read_stream(&mut self.stream, buffer);
            if self.stream.is_none() {
                self.next = Instant::now() + RETRY;
            }
            return Ok(got);
        }
        let left = self.next.saturating_duration_since(Instant::now());
        if !left.is_zero() {
            std::thread::sleep(left.min(WAIT));
            return Ok(Got::Nothing);
        }
        self.next = Instant::now() + RETRY;
        match connect(&self.place).and_then(|stream| prepare(&stream).map(|()| stream)) {
            Ok(stream) => {
                self.stream = Some(stream);
                self.told = false;
                Ok(Got::Joined("connected".to_owned()))
            }
            Err(_) if self.told => Ok(Got::Nothing),
            Err(error) => {
                self.told = true;
                Ok(Got::Said(format!("the box is not there yet ({error}); trying on")))
            }
        }
    }
}

/// Connects to the first address that answers within half a second.
pub(crate) fn connect(place: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::new(ErrorKind::NotFound, "the name has no address");
    for address in place.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, RETRY) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// A socket that the box connects to; one box at a time, others wait.
#[derive(Debug)]
pub(crate) struct Listener {
    socket: TcpListener,
    stream: Option<TcpStream>,
}

impl Listener {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<Got> {
        if self.stream.is_some() {
            return Ok(read_stream(&mut self.stream, buffer));
        }
        match self.socket.accept() {
            Ok((stream, from)) => {
                prepare(&stream)?;
                self.stream = Some(stream);
                Ok(Got::Joined(format!("{from} connected")))
            }
            Err(error) if is_timeout(&error) => {
                let wait = Timespec { tv_sec: 0, tv_nsec: i64::from(WAIT.subsec_nanos()) };
                // An error here comes back from `accept`.
                let _ = poll(&mut [PollFd::new(&self.socket, PollFlags::IN)], Some(&wait));
                Ok(Got::Nothing)
            }
            Err(error) if error.kind() == ErrorKind::ConnectionAborted => Ok(Got::Nothing),
            Err(error) => Err(error),
        }
    }
}

/// Datagrams from one sender at a time.
#[derive(Debug)]
pub(crate) struct Datagrams {
    socket: UdpSocket,
    from: Option<(SocketAddr, Instant)>,
    /// The first datagram of a new sender, kept until it was announced.
    waiting: Vec<u8>,
    others: u64,
}

impl Datagrams {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<Got> {
        if !self.waiting.is_empty() {
            let count = self.waiting.len();
            buffer[..count].copy_from_slice(&self.waiting);
            self.waiting.clear();
            return Ok(Got::Bytes(count));
        }
        let (count, from) = match self.socket.recv_from(buffer) {
            Ok(got) => got,
            Err(error) if is_timeout(&error) => return Ok(Got::Nothing),
            Err(error) => return Err(error),
        };
        let now = Instant::now();
        match &mut self.from {
            Some((known, last)) if *known == from => *last = now,
            Some((_, last)) if now.duration_since(*last) < SILENCE => {
                self.others += 1;
                return Ok(match self.others {
                    1 => Got::Said(format!("{from} sends here too; its datagrams are left out")),
                    _ => Got::Nothing,
                });
            }
            _ => {
                self.from = Some((from, now));
                self.others = 0;
                self.waiting.extend_from_slice(&buffer[..count]);
                return Ok(Got::Joined(format!("{from} sends")));
            }
        }
        Ok(if count == 0 { Got::Nothing } else { Got::Bytes(count) })
    }
}

/// A serial device, opened again when it was unplugged.
pub(crate) struct Line {
    device: PathBuf,
    baud: u32,
    port: Option<Box<dyn SerialPort>>,
    next: Instant,
    told: bool,
}

impl std::fmt::Debug for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Line({}@{})", self.device.display(), self.baud)
    }
}

/// Opens a serial device with 8 bits, no parity, one stop bit.
pub(crate) fn open_serial(device: &Path, baud: u32) -> Result<Box<dyn SerialPort>, serialport::Error> {
    serialport::new(device.to_string_lossy(), baud).timeout(WAIT).open()
}

impl Line {
    fn read(&mut self, buffer: &mut [u8]) -> Got {
        if let Some(port) = &mut self.port {
            let why = match port.read(buffer) {
                Ok(0) => "the device is gone".to_owned(),
                Ok(count) => return Got::Bytes(count),
                Err(error) if is_timeout(&error) => return Got::Nothing,
                Err(error) => format!("the device is gone ({error})"),
            };
            self.port = None;
            self.next = Instant::now() + RETRY;
            return Got::Left(why);
        }
        let left = self.next.saturating_duration_since(Instant::now());
        if !left.is_zero() {
            std::thread::sleep(left.min(WAIT));
            return Got::Nothing;
        }
        self.next = Instant::now() + RETRY;
        match open_serial(&self.device, self.baud) {
            Ok(port) => {
                self.port = Some(port);
                self.told = false;
                Got::Joined("open".to_owned())
            }
            Err(_) if self.told => Got::Nothing,
            Err(error) => {
                self.told = true;
                Got::Said(format!("cannot open the device yet ({error}); trying on"))
            }
        }
    }
}
