//! A serial device as a line: any rate, 8N1, for this program alone; opened again when it was unplugged.

use std::fmt;
use std::io::{self, Read, Write};
use std::os::fd::{AsRawFd, BorrowedFd};
use std::time::{Duration, Instant};

use gangway_device::Link;
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use serialport::{ClearBuffer, DataBits, ErrorKind, FlowControl, Parity, SerialPort, StopBits, TTYPort};

use crate::error::is_busy;
use crate::{Address, Error};

/// A rate may be off by this share, %: over the ten bits of a byte half a bit is 5 %, for both ends together.
const TOLERANCE_PERCENT: u32 = 2;
/// Wait before a device that failed is opened again.
const WAIT: Duration = Duration::from_millis(500);

/// A serial device.
#[derive(Debug)]
pub struct Serial {
    device: String,
    baud: u32,
    port: Option<TTYPort>,
    next_try: Instant,
    connections: u32,
    /// A delimiter leads, so that noise from before ends there.
    begins: bool,
}

impl Serial {
    /// Opens the device.
    ///
    /// # Errors
    /// [`Error::Open`]: no such device, another program has it, no right to it, or it cannot do the rate.
    pub fn open(device: &str, baud: u32) -> Result<Self, Error> {
        let port = open(device, baud).map_err(|error| {
            let line = Address::Serial { device: device.to_owned(), baud }.to_string();
            Error::Open { line, why: why(&error, baud) }
        })?;
        Ok(Self {
            device: device.to_owned(),
            baud,
            port: Some(port),
            next_try: Instant::now(),
            connections: 0,
            begins: true,
        })
    }

    fn lose(&mut self) -> Error {
        self.port = None;
        self.next_try = Instant::now() + WAIT;
        Error::NotConnected { line: self.to_string() }
    }

    fn port(&mut self) -> Result<&mut TTYPort, Error> {
        if self.port.is_none() && Instant::now() >= self.next_try {
            match open(&self.device, self.baud) {
                Ok(port) => {
                    self.port = Some(port);
                    self.connections = self.connections.wrapping_add(1);
                    self.begins = true;
                }
                Err(_) => return Err(self.lose()),
            }
        }
        let line = Address::Serial { device: self.device.clone(), baud: self.baud };
        self.port.as_mut().ok_or_else(|| Error::NotConnected { line: line.to_string() })
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        match self.port()?.write(bytes) {
            Ok(count) => Ok(count),
            Err(error) if is_busy(&error) => Ok(0),
            Err(_) => Err(self.lose()),
        }
    }
}

fn open(device: &str, baud: u32) -> serialport::Result<TTYPort> {
    let port = serialport::new(device, baud)
        .data_bits(DataBits::Eight)
        .parity(Parity::None)
        .stop_bits(StopBits::One)
        .flow_control(FlowControl::None)
        .timeout(Duration::ZERO)
        .open_native()?;
    // A driver takes the nearest rate that it has, and only tells so.
    if !is_same_rate(port.baud_rate()?, baud) {
        return Err(serialport::Error::new(ErrorKind::InvalidInput, "it took another rate"));
    }
    port.clear(ClearBuffer::Input)?;
    // SAFETY: the descriptor belongs to `port`, which outlives this borrow.
    let fd = unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) };
    // A write of more than the driver has room for would wait otherwise.
    let flags = fcntl_getfl(fd).map_err(io::Error::from)?;
    fcntl_setfl(fd, flags | OFlags::NONBLOCK).map_err(io::Error::from)?;
    Ok(port)
}

fn is_same_rate(told: u32, wanted: u32) -> bool {
    u64::from(told.abs_diff(wanted)) * 100 <= u64::from(wanted) * u64::from(TOLERANCE_PERCENT)
}

fn why(error: &serialport::Error, baud: u32) -> String {
    match error.kind() {
        ErrorKind::Io(io::ErrorKind::NotFound) => {
            "there is no such device; check its name and its plug".into()
        }
        ErrorKind::NoDevice if error.description.contains("No such") => {
            "there is no such device; check its name and its plug".into()
        }
        ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::ResourceBusy | io::ErrorKind::WouldBlock) => {
            "another program has it; end that program first".into()
        }
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
            "this user may not use it; add the user to the group 'dialout'".into()
        }
        ErrorKind::InvalidInput => {
            format!("it cannot do {baud} baud; give a rate that it has, such as 115200")
        }
        _ => format!("{}; is it a serial device?", error.description),
    }
}

impl fmt::Display for Serial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Address::Serial { device: self.device.clone(), baud: self.baud }.fmt(f)
    }
}

impl Link for Serial {
    type Error = Error;

    fn send(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.port()?;
        if self.begins && self.write(&[0])? == 0 {
            return Ok(0);
        }
        self.begins = false;
        self.write(bytes)
    }

    fn receive(&mut self, into: &mut [u8]) -> Result<usize, Error> {
        match self.port()?.read(into) {
            Ok(count) => Ok(count),
            Err(error) if is_busy(&error) => Ok(0),
            Err(_) => Err(self.lose()),
        }
    }

    /// True when the driver has sent everything.
    fn finish(&mut self) -> Result<bool, Error> {
        let Some(port) = &self.port else { return Ok(true) };
        Ok(port.bytes_to_write().is_ok_and(|left| left == 0))
    }

    fn connections(&self) -> u32 {
        self.connections
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair() -> (TTYPort, String) {
        let (mut host, slave) = TTYPort::pair().unwrap();
        host.set_timeout(Duration::from_secs(10)).unwrap();
        let name = slave.name().unwrap();
        (host, name)
    }

    #[test]
    fn records_and_commands_pass_a_terminal_unchanged() {
        let (mut host, name) = pair();
        let mut link = Serial::open(&name, 230_400).unwrap();
        // Every byte value: a terminal that translates any of them shows here.
        let record: Vec<u8> = (1..=255).chain([0]).collect();
        let mut sent = 0;
        while sent < record.len() {
            sent += link.send(&record[sent..]).unwrap();
        }
        let mut got = vec![9; 257];
        host.read_exact(&mut got).unwrap();
        assert_eq!(got[0], 0, "a delimiter leads");
        assert_eq!(got[1..], record);

        host.write_all(&record).unwrap();
        let mut got = Vec::new();
        let mut into = [0; 64];
        while got.len() < record.len() {
            let count = link.receive(&mut into).unwrap();
            got.extend_from_slice(&into[..count]);
        }
        assert_eq!(got, record);
    }

    #[test]
    fn a_host_that_does_not_read_makes_the_line_busy_and_nobody_waits() {
        let (_host, name) = pair();
        let mut link = Serial::open(&name, 115_200).unwrap();
        let record = [&[7; 599][..], &[0]].concat();
        // A terminal's buffer is some KiB: a write that waits would hang this test.
        while link.send(&record).unwrap() > 0 {}
    }

    #[test]
    fn a_rate_off_any_list_is_taken_and_one_that_the_driver_rounds_away_is_not() {
        let (_host, name) = pair();
        for baud in [50, 115_201, 250_000, 12_345_678] {
            let link = Serial::open(&name, baud).unwrap();
            assert_eq!(link.port.unwrap().baud_rate().unwrap(), baud);
        }
        assert!(is_same_rate(3_000_000, 3_000_000) && is_same_rate(115_942, 115_200));
        assert!(!is_same_rate(3_000_000, 50_000_000) && !is_same_rate(9_600, 10_000) && !is_same_rate(0, 50));
    }

    #[test]
    fn a_second_program_is_refused() {
        let (_host, name) = pair();
        let _first = Serial::open(&name, 115_200).unwrap();
        let said = Serial::open(&name, 115_200).unwrap_err().to_string();
        assert!(said.contains("another program has it"), "{said}");
    }

    #[test]
    fn a_missing_device_is_one_sentence() {
        let said = Serial::open("/dev/no-such-device", 115_200).unwrap_err().to_string();
        assert_eq!(
            said,
            "cannot open serial:/dev/no-such-device@115200: there is no such device; check its name and its plug"
        );
    }
}
