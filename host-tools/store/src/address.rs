//! Where bytes come from, as a person writes it: `tcp://`, `tcp-listen://`, `udp://`, `serial:`, `file:`,
//! `-`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use crate::StoreError;

/// Line speed of a serial address that names none, baud.
pub const DEFAULT_BAUD: u32 = 115_200;

/// A source of bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// `tcp://HOST:PORT`: the box is the server.
    Tcp(String),
    /// `tcp-listen://HOST:PORT`: the box connects to us.
    TcpListen(String),
    /// `udp://HOST:PORT`: the box sends datagrams to us.
    Udp(String),
    /// `serial:/dev/ttyX@BAUD`.
    Serial {
        /// The device.
        device: PathBuf,
        /// Line speed, baud.
        baud: u32,
    },
    /// `file:PATH`.
    File(PathBuf),
    /// `-`.
    Stdin,
}

impl FromStr for Address {
    type Err = StoreError;

    fn from_str(text: &str) -> Result<Self, StoreError> {
        let wrong = |why: &str| StoreError::Address { text: text.to_owned(), why: why.to_owned() };
        if text == "-" {
            return Ok(Self::Stdin);
        }
        for (scheme, make) in [
            ("tcp://", Self::Tcp as fn(String) -> Self),
            ("tcp-listen://", Self::TcpListen),
            ("udp://", Self::Udp),
        ] {
            if let Some(place) = text.strip_prefix(scheme) {
                return match place.rsplit_once(':') {
                    Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => {
                        Ok(make(place.to_owned()))
                    }
                    _ => Err(wrong("needs a host and a port from 0 to 65535, as in tcp://192.168.7.2:7007")),
                };
            }
        }
        if let Some(line) = text.strip_prefix("serial:") {
            let (device, baud) = match line.rsplit_once('@') {
                None => (line, DEFAULT_BAUD),
                Some((device, baud)) => match baud.parse() {
                    Ok(baud @ 300..=4_000_000) => (device, baud),
                    _ => return Err(wrong("the speed behind @ is a number from 300 to 4000000 baud")),
                },
            };
            if device.is_empty() {
                return Err(wrong("needs a device, as in serial:/dev/ttyUSB0@115200"));
            }
            return Ok(Self::Serial { device: device.into(), baud });
        }
        match text.strip_prefix("file:") {
            Some("") => Err(wrong("needs a path, as in file:ride.gw")),
            Some(path) => Ok(Self::File(path.into())),
            None => Err(wrong(
                "is no address; allowed are tcp://HOST:PORT, tcp-listen://HOST:PORT, udp://HOST:PORT, \
                 serial:DEVICE@BAUD, file:PATH and - (standard input)",
            )),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(place) => write!(f, "tcp://{place}"),
            Self::TcpListen(place) => write!(f, "tcp-listen://{place}"),
            Self::Udp(place) => write!(f, "udp://{place}"),
            Self::Serial { device, baud } => write!(f, "serial:{}@{baud}", device.display()),
            Self::File(path) => write!(f, "file:{}", path.display()),
            Self::Stdin => f.write_str("-"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_read_as_they_are_written() {
        for text in [
            "tcp://127.0.0.1:7007",
            "tcp-listen://[::]:7007",
            "udp://0.0.0.0:7007",
            "serial:/dev/ttyUSB0@230400",
            "file:rides/a b.gw",
            "-",
        ] {
            assert_eq!(text.parse::<Address>().unwrap().to_string(), text);
        }
        assert_eq!(
            "serial:/dev/ttyS0".parse::<Address>().unwrap(),
            Address::Serial { device: "/dev/ttyS0".into(), baud: DEFAULT_BAUD }
        );
    }

    #[test]
    fn a_wrong_address_says_what_is_allowed() {
        for (text, word) in [
            ("127.0.0.1:7007", "allowed are tcp://"),
            ("tcp://:7007", "a host and a port"),
            ("udp://box:seven", "a host and a port"),
            ("serial:", "needs a device"),
            ("serial:/dev/ttyS0@fast", "baud"),
            ("file:", "needs a path"),
        ] {
            let said = text.parse::<Address>().unwrap_err().to_string();
            assert!(said.starts_with(text) && said.contains(word), "{said}");
        }
    }
}
