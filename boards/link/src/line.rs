//! Any of the lines behind one type, for programs that learn the address at run time.

use std::fmt;

use gangway_device::Link;

use crate::{Error, FileLink, Serial, TcpClient, TcpServer, Udp};

/// One of the lines.
#[derive(Debug)]
pub enum Line {
    /// Listens on TCP.
    Server(TcpServer),
    /// Connects over TCP.
    Client(TcpClient),
    /// Sends datagrams.
    Udp(Udp),
    /// A serial device.
    Serial(Serial),
    /// A file.
    File(FileLink),
}

impl Line {
    /// Nothing may be lost: clients of a server that are slower than others hold all of them up, instead of
    /// missing records. Other lines know one listener and never lose while the outbox can wait.
    pub fn lossless(mut self) -> Self {
        if let Self::Server(server) = &mut self {
            server.set_lossless(true);
        }
        self
    }

    fn link(&mut self) -> &mut dyn Link<Error = Error> {
        match self {
            Self::Server(link) => link,
            Self::Client(link) => link,
            Self::Udp(link) => link,
            Self::Serial(link) => link,
            Self::File(link) => link,
        }
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Server(link) => link.fmt(f),
            Self::Client(link) => link.fmt(f),
            Self::Udp(link) => link.fmt(f),
            Self::Serial(link) => link.fmt(f),
            Self::File(link) => link.fmt(f),
        }
    }
}

impl Link for Line {
    type Error = Error;

    fn send(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.link().send(bytes)
    }

    fn receive(&mut self, into: &mut [u8]) -> Result<usize, Error> {
        self.link().receive(into)
    }

    fn finish(&mut self) -> Result<bool, Error> {
        self.link().finish()
    }

    fn connections(&self) -> u32 {
        match self {
            Self::Server(link) => link.connections(),
            Self::Client(link) => link.connections(),
            Self::Udp(link) => link.connections(),
            Self::Serial(link) => link.connections(),
            Self::File(link) => link.connections(),
        }
    }
}
