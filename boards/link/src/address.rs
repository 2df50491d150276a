//! Addresses of lines as they are written on the command line: `tcp://HOST:PORT` and its relatives.

use std::fmt;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;

use crate::{Error, FileLink, Line, Serial, TcpClient, TcpServer, Udp};

/// Rate of a serial line where none is given, baud.
pub const DEFAULT_BAUD: u32 = 115_200;

/// Where the records go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// `tcp://HOST:PORT`: the box listens there.
    Listen {
        /// Name or address of the interface.
        host: String,
        /// Port; 0 takes any free one.
        port: u16,
    },
    /// `tcp-connect://HOST:PORT`: the box connects there.
    Connect {
        /// Name or address of the host.
        host: String,
        /// Port.
        port: u16,
    },
    /// `udp://HOST:PORT`: datagrams go there.
    Udp {
        /// Name or address of the host.
        host: String,
        /// Port.
        port: u16,
    },
    /// `serial:DEVICE@BAUD`, 8N1.
    Serial {
        /// The device.
        device: String,
        /// Rate, baud.
        baud: u32,
    },
    /// `file:PATH`.
    File(PathBuf),
}

impl Address {
    /// Reads an address.
    ///
    /// # Errors
    /// [`Error::Address`] says what is wrong and how it is written.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let wrong = |why: String| Error::Address { text: text.to_owned(), why };
        if let Some(rest) = text.strip_prefix("tcp://") {
            let (host, port) = host_and_port(rest).map_err(wrong)?;
            return Ok(Self::Listen { host, port });
        }
        for (scheme, is_udp) in [("tcp-connect://", false), ("udp://", true)] {
            let Some(rest) = text.strip_prefix(scheme) else { continue };
            let (host, port) = host_and_port(rest).map_err(wrong)?;
            if port == 0 {
                return Err(wrong("port 0 is for listening only; give the host's port, 1 to 65535".into()));
            }
            return Ok(if is_udp { Self::Udp { host, port } } else { Self::Connect { host, port } });
        }
        if let Some(rest) = text.strip_prefix("serial:") {
            return serial(rest).map_err(wrong);
        }
        if let Some(path) = text.strip_prefix("file:") {
            if path.is_empty() {
                return Err(wrong("the path is missing; write file:PATH".into()));
            }
            return Ok(Self::File(PathBuf::from(path)));
        }
        Err(wrong(
            "write tcp://HOST:PORT (listen there), tcp-connect://HOST:PORT, udp://HOST:PORT, \
             serial:DEVICE@BAUD or file:PATH"
                .into(),
        ))
    }

    /// Opens the line as [`Address::open`] does, but a file as a new one.
    ///
    /// # Errors
    /// As [`Address::open`], and as [`FileLink::create`].
    pub fn open_new(&self) -> Result<Line, Error> {
        match self {
            Self::File(path) => Ok(Line::File(FileLink::create(path)?)),
            _ => self.open(),
        }
    }

    /// Opens the line; a file is appended to. A [`Line::Client`] opens even where nobody listens yet: it goes
    /// on trying.
    ///
    /// # Errors
    /// What [`TcpServer::bind`], [`Udp::open`], [`Serial::open`] and [`FileLink::append`] say.
    pub fn open(&self) -> Result<Line, Error> {
        Ok(match self {
            Self::Listen { host, port } => Line::Server(TcpServer::bind(host, *port)?),
            Self::Connect { host, port } => Line::Client(TcpClient::new(host, *port)),
            Self::Udp { host, port } => Line::Udp(Udp::open(host, *port)?),
            Self::Serial { device, baud } => Line::Serial(Serial::open(device, *baud)?),
            Self::File(path) => Line::File(FileLink::append(path)?),
        })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Listen { host, port } => write!(f, "tcp://{}:{port}", bracketed(host)),
            Self::Connect { host, port } => write!(f, "tcp-connect://{}:{port}", bracketed(host)),
            Self::Udp { host, port } => write!(f, "udp://{}:{port}", bracketed(host)),
            Self::Serial { device, baud } => write!(f, "serial:{device}@{baud}"),
            Self::File(path) => write!(f, "file:{}", path.display()),
        }
    }
}

fn bracketed(host: &str) -> String {
    if host.contains(':') { format!("[{host}]") } else { host.to_owned() }
}

fn host_and_port(text: &str) -> Result<(String, u16), String> {
    let (host, port) = text.rsplit_once(':').ok_or("the port is missing; write HOST:PORT")?;
    let inner = host.strip_prefix('[').and_then(|host| host.strip_suffix(']'));
    if inner.is_none() && host.contains(':') {
        return Err("an IPv6 address stands in brackets; write [::1]:PORT".into());
    }
    let host = inner.unwrap_or(host);
    if host.is_empty() {
        return Err("the host is missing; write HOST:PORT, 0.0.0.0 for every interface".into());
    }
    let port = port.parse().map_err(|_| format!("'{port}' is no port; a port is 0 to 65535"))?;
    Ok((host.to_owned(), port))
}

fn serial(text: &str) -> Result<Address, String> {
    let (device, baud) = match text.rsplit_once('@') {
        Some((device, baud)) => match baud.parse() {
            Ok(baud) if baud > 0 => (device, baud),
            _ => return Err(format!("'{baud}' is no baud rate; write a number such as {DEFAULT_BAUD}")),
        },
        None => (text, DEFAULT_BAUD),
    };
    if device.is_empty() {
        return Err("the device is missing; write serial:DEVICE@BAUD".into());
    }
    Ok(Address::Serial { device: device.to_owned(), baud })
}

/// Looks a host up; may wait for a name server.
pub(crate) fn resolve(host: &str, port: u16, line: &str) -> Result<SocketAddr, Error> {
    let open = |why: String| Error::Open { line: line.to_owned(), why };
    let mut found = (host, port)
        .to_socket_addrs()
        .map_err(|_| open(format!("the host '{host}' is not known; check its name")))?;
    found.next().ok_or_else(|| open(format!("the host '{host}' has no address; check its name")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_address_is_read_and_written_back() {
        for text in [
            "tcp://127.0.0.1:7007",
            "tcp://[::1]:0",
            "tcp-connect://tester.local:7007",
            "udp://10.0.0.7:9000",
            "serial:/dev/ttyUSB0@230400",
            "file:rides/a b.gw",
        ] {
            assert_eq!(Address::parse(text).unwrap().to_string(), text);
        }
        assert_eq!(
            Address::parse("serial:/dev/ttyS0").unwrap(),
            Address::Serial { device: "/dev/ttyS0".into(), baud: 115_200 }
        );
    }

    #[test]
    fn a_wrong_address_is_named_with_what_is_right() {
        for (text, says) in [
            ("", "write tcp://HOST:PORT"),
            ("http://a:1", "write tcp://HOST:PORT"),
            ("tcp://127.0.0.1", "the port is missing"),
            ("tcp://:7007", "the host is missing"),
            ("tcp://a:70000", "'70000' is no port"),
            ("tcp://::1:7007", "in brackets"),
            ("udp://a:0", "port 0 is for listening"),
            ("tcp-connect://a:0", "port 0 is for listening"),
            ("serial:", "the device is missing"),
            ("serial:/dev/ttyS0@fast", "'fast' is no baud rate"),
            ("serial:/dev/ttyS0@0", "'0' is no baud rate"),
            ("file:", "the path is missing"),
        ] {
            let said = Address::parse(text).unwrap_err().to_string();
            assert!(said.contains(says), "{text}: {said}");
            assert!(!said.contains('\n') && said.starts_with('\''), "{said}");
        }
    }
}
