//! Commands to the box: each is sent once and its answer waited for.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use gangway_wire::{Decoded, Decoder, MAX_FRAME, MAX_MARK, Mark, Ping, Record, What, encode, kind};

use crate::source::{connect, open_serial, prepare};
use crate::{Address, StoreError, utc};

/// What the box is asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Command {
    /// Wait for rest again and set a new rest pose.
    SetRest,
    /// Put this text into the records, at most [`MAX_MARK`] bytes.
    Mark(String),
    /// Answer with its clock.
    Ping,
}

/// What the box answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The command was taken at this frame.
    Taken {
        /// The frame.
        frame: u32,
        /// The box's clock, ns.
        time_ns: u64,
    },
    /// Both clocks.
    Pong {
        /// UTC of the host when it asked, ns since 1970.
        host_time_ns: u64,
        /// The box's clock when it answered, ns.
        time_ns: u64,
        /// From asking to the answer.
        round_trip: Duration,
    },
}

trait Line: Read + Write {}
impl<T: Read + Write + ?Sized> Line for T {}

/// Sends a command and waits for the answer, at most `wait`.
///
/// # Errors
/// Nobody there, no answer in time, a refusal, a text that is too long.
pub fn send(to: &Address, command: &Command, wait: Duration) -> Result<Answer, StoreError> {
    let error = |why: String| StoreError::Command { what: to.to_string(), why };
    let host_time_ns = utc::now_ns();
    let number = host_time_ns as u32;
    let record = match command {
        Command::SetRest => Record::SetRest,
        Command::Mark(text) if text.len() > MAX_MARK => {
            return Err(error(format!("a mark has at most {MAX_MARK} bytes, this one has {}", text.len())));
        }
        Command::Mark(text) => Record::Mark(Mark { text }),
        Command::Ping => Record::Ping(Ping { number, host_time_ns }),
    };
    let mut bytes = [0; MAX_FRAME];
    let length =
        encode(&record, 0, &mut bytes).map_err(|_| error("the command cannot be encoded".to_owned()))?;

    let mut line = open(to)?;
    let asked = Instant::now();
    // A delimiter first: what noise left on a serial line is not glued to the command.
    let sent = line.write_all(&[0]).and_then(|()| line.write_all(&bytes[..length]));
    sent.and_then(|()| line.flush()).map_err(|e| error(format!("the command could not be sent ({e})")))?;

    let mut decoder = Decoder::new();
    let mut buffer = [0; 4096];
    while asked.elapsed() < wait {
        let count = match line.read(&mut buffer) {
            Ok(0) => return Err(error("the box closed the connection before it answered".to_owned())),
            Ok(count) => count,
            Err(e)
                if matches!(
                    e.kind(),
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                ) =>
            {
                continue;
            }
            Err(e) => return Err(error(format!("the connection is lost before the answer ({e})"))),
        };
        let mut rest = &buffer[..count];
        while !rest.is_empty() {
            let (decoded, behind) = decoder.feed(rest);
            rest = behind;
            let Some(Decoded::Record { record: answer, .. }) = decoded else { continue };
            match answer {
                Record::Pong(pong) if pong.number == number && pong.host_time_ns == host_time_ns => {
                    return Ok(Answer::Pong {
                        host_time_ns,
                        time_ns: pong.time_ns,
                        round_trip: asked.elapsed(),
                    });
                }
                Record::Event(event) => match (event.what, command) {
                    (What::RestRequested, Command::SetRest) => {
                        return Ok(Answer::Taken { frame: event.frame, time_ns: event.time_ns });
                    }
                    (What::Mark { text }, Command::Mark(asked)) if text == asked => {
                        return Ok(Answer::Taken { frame: event.frame, time_ns: event.time_ns });
                    }
                    (What::CommandRefused { kind }, _)
                        if kind == record.kind() && kind >= kind::FIRST_TO_BOX =>
                    {
                        return Err(error("the box refused the command".to_owned()));
                    }
                    _ => {}
                },
                _ => {}
            }
        }
    }
    Err(error(format!("the box did not answer within {} s", wait.as_secs_f64())))
}

fn open(to: &Address) -> Result<Box<dyn Line>, StoreError> {
    let error = |why: String| StoreError::Command { what: to.to_string(), why };
    match to {
        Address::Tcp(place) => {
            let open = |stream: TcpStream| -> io::Result<TcpStream> {
                prepare(&stream)?;
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(Duration::from_secs(2)))?;
                Ok(stream)
            };
            let stream = connect(place).and_then(open);
            Ok(Box::new(stream.map_err(|e| error(format!("no box answers there ({e}); is it running?")))?))
        }
        Address::Serial { device, baud } => {
            let port = open_serial(device, *baud);
            Ok(Box::new(port.map_err(|e| error(format!("cannot open the device ({e})")))?))
        }
        _ => Err(error("commands go to tcp://HOST:PORT or serial:DEVICE@BAUD".to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;
    use std::thread;

    use gangway_wire::{Event, Pong};

    use super::*;
    use crate::testing::{put, ride};

    /// A box that answers the first command, behind some records and a few bytes at a time.
    fn a_box(answer: impl Fn(&Record<'_>) -> Option<Vec<u8>> + Send + 'static) -> Address {
        let server = TcpListener::bind("127.0.0.1:0").unwrap();
        let to = Address::Tcp(server.local_addr().unwrap().to_string());
        thread::spawn(move || {
            let mut stream = server.accept().unwrap().0;
            stream.write_all(&ride(1, 3)).unwrap();
            let (mut decoder, mut buffer) = (Decoder::new(), [0; 512]);
            loop {
                let count = stream.read(&mut buffer).unwrap_or(0);
                if count == 0 {
                    return;
                }
                let mut rest = &buffer[..count];
                while !rest.is_empty() {
                    let (found, behind) = decoder.feed(rest);
                    rest = behind;
                    if let Some(Decoded::Record { record, .. }) = found
                        && let Some(bytes) = answer(&record)
                    {
                        bytes.chunks(5).for_each(|part| stream.write_all(part).unwrap());
                    }
                }
            }
        });
        to
    }

    fn event(what: What<'_>) -> Vec<u8> {
        let mut bytes = Vec::new();
        put(&mut bytes, &mut 9, &Record::Event(Event { frame: 40, time_ns: 800, what }));
        bytes
    }

    const WAIT: Duration = Duration::from_secs(20);

    #[test]
    fn a_ping_comes_back_with_both_clocks() {
        let to = a_box(|record| {
            let Record::Ping(ping) = record else { return None };
            let mut bytes = Vec::new();
            for number in [ping.number.wrapping_add(1), ping.number] {
                let pong = Pong { number, host_time_ns: ping.host_time_ns, time_ns: number.into() };
                put(&mut bytes, &mut 9, &Record::Pong(pong));
            }
            Some(bytes)
        });
        let Answer::Pong { host_time_ns, time_ns, .. } = send(&to, &Command::Ping, WAIT).unwrap() else {
            panic!("another answer")
        };
        assert_eq!(time_ns, u64::from(host_time_ns as u32), "somebody else's answer is passed over");
    }

    #[test]
    fn marks_and_rest_are_confirmed_by_their_events() {
        let answer = |record: &Record<'_>| match record {
            Record::Mark(mark) => {
                Some([event(What::Mark { text: "x" }), event(What::Mark { text: mark.text })].concat())
            }
            Record::SetRest => Some(event(What::RestRequested)),
            _ => None,
        };
        let taken = Answer::Taken { frame: 40, time_ns: 800 };
        assert_eq!(send(&a_box(answer), &Command::SetRest, WAIT).unwrap(), taken);
        assert_eq!(send(&a_box(answer), &Command::Mark("bridge".into()), WAIT).unwrap(), taken);
    }

    #[test]
    fn what_goes_wrong_is_said_in_one_sentence() {
        let refuse = a_box(|record| Some(event(What::CommandRefused { kind: record.kind() })));
        let silent = a_box(|_| None);
        let nobody =
            Address::Tcp(TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string());
        let short = Duration::from_millis(300);
        for (to, command, words) in [
            (refuse, Command::SetRest, "refused"),
            (silent, Command::Ping, "did not answer within"),
            (nobody, Command::Ping, "no box answers there"),
            (Address::Stdin, Command::Ping, "commands go to"),
            (Address::Stdin, Command::Mark("x".repeat(65)), "at most 64 bytes"),
        ] {
            let said = send(&to, &command, short).unwrap_err().to_string();
            assert!(said.contains(words) && said.starts_with(&to.to_string()), "{said}");
        }
    }
}
