//! Bytes of the host to commands for the frame loop.

use gangway_engine::Command;
use gangway_wire::{Counts, Damage, Decoded, Decoder, Record, kind};
use heapless::String;

/// Decodes what the host sends.
#[derive(Debug, Default)]
pub struct Commands {
    decoder: Decoder,
}

impl Commands {
    /// Takes bytes up to the next command; to be called until the bytes given back are empty.
    ///
    /// What the loop cannot follow - a kind that this version does not know, a record that only a box sends,
    /// a text that is too long or no text - is a [`Command::Refused`]. Damage is only counted.
    pub fn feed<'b>(&mut self, bytes: &'b [u8]) -> (Option<Command>, &'b [u8]) {
        let mut bytes = bytes;
        while !bytes.is_empty() {
            let (decoded, rest) = self.decoder.feed(bytes);
            bytes = rest;
            if let Some(command) = decoded.as_ref().and_then(command) {
                return (Some(command), bytes);
            }
        }
        (None, bytes)
    }

    /// What was met so far, damage among it.
    pub fn counts(&self) -> &Counts {
        self.decoder.counts()
    }
}

fn command(decoded: &Decoded<'_>) -> Option<Command> {
    Some(match decoded {
        Decoded::Record { record: Record::SetRest, .. } => Command::SetRest,
        Decoded::Record { record: Record::Mark(mark), .. } => match String::try_from(mark.text) {
            Ok(text) => Command::Mark(text),
            Err(_) => Command::Refused { kind: kind::MARK },
        },
        Decoded::Record { record: Record::Ping(ping), .. } => {
            Command::Ping { number: ping.number, host_time_ns: ping.host_time_ns }
        }
        Decoded::Record { kind, .. }
        | Decoded::Newer { kind, .. }
        | Decoded::Damaged(Damage::Body { kind, .. }) => Command::Refused { kind: *kind },
        Decoded::Damaged(_) => return None,
    })
}

#[cfg(test)]
mod tests {
    use gangway_wire::{MAX_FRAME, Mark, Ping, encode, frame};

    use super::*;

    fn line(record: &Record<'_>) -> Vec<u8> {
        let mut bytes = vec![0; MAX_FRAME];
        let length = encode(record, 0, &mut bytes).unwrap();
        bytes.truncate(length);
        bytes
    }

    fn commands(bytes: &[u8]) -> (Vec<Command>, Counts) {
        let mut decoder = Commands::default();
        let mut found = Vec::new();
        let mut rest = bytes;
        while !rest.is_empty() {
            let (command, behind) = decoder.feed(rest);
            rest = behind;
            found.extend(command);
        }
        (found, *decoder.counts())
    }

    #[test]
    fn every_command_of_the_wire_is_understood() {
        let bytes = [
            line(&Record::SetRest),
            line(&Record::Mark(Mark { text: "tunnel" })),
            line(&Record::Ping(Ping { number: 3, host_time_ns: 77 })),
        ]
        .concat();
        let (found, _) = commands(&bytes);
        assert_eq!(
            found,
            [
                Command::SetRest,
                Command::Mark(String::try_from("tunnel").unwrap()),
                Command::Ping { number: 3, host_time_ns: 77 }
            ]
        );
    }

    #[test]
    fn a_garbled_command_is_counted_and_the_next_one_understood() {
        let mut bytes = line(&Record::Ping(Ping { number: 3, host_time_ns: 77 }));
        bytes[4] ^= 0x55;
        bytes.extend(line(&Record::SetRest));
        let (found, counts) = commands(&bytes);
        assert_eq!(found, [Command::SetRest]);
        assert_eq!(counts.damaged, 1);
    }

    #[test]
    fn what_cannot_be_followed_is_refused_with_its_kind() {
        let mut unknown = vec![0; MAX_FRAME];
        let length = frame(200, &[1, 2, 3], 0, &mut unknown).unwrap();
        unknown.truncate(length);
        let mut long = vec![0; MAX_FRAME];
        let body = [&[65][..], &[b'a'; 65]].concat();
        let length = frame(kind::MARK, &body, 0, &mut long).unwrap();
        long.truncate(length);
        let (found, _) = commands(&[unknown, long].concat());
        assert_eq!(found, [Command::Refused { kind: 200 }, Command::Refused { kind: kind::MARK }]);
    }
}
