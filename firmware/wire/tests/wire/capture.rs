//! Made-up captures: every kind of record with random fields, and what stands where in the bytes.

use std::ops::Range;

use gangway_wire::*;

/// A small random source (splitmix64), the same on every machine.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number below `end`.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// A number of any length: as often short as long.
    fn number(&mut self) -> u64 {
        let shift = self.below(64);
        self.next() >> shift
    }

    fn float(&mut self) -> f32 {
        (self.next() as i32) as f32 / 1e7
    }
}

/// One frame of a capture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Sent {
    pub(crate) sequence: u32,
    pub(crate) kind: u8,
    pub(crate) body: Vec<u8>,
}

/// Bytes of a line, and the frames in them.
pub(crate) struct Capture {
    pub(crate) bytes: Vec<u8>,
    pub(crate) frames: Vec<(Range<usize>, Sent)>,
}

impl Capture {
    /// `count` records of all kinds.
    pub(crate) fn random(count: u32, random: &mut Random) -> Self {
        let mut capture = Self { bytes: Vec::new(), frames: Vec::new() };
        for sequence in 0..count {
            with_random_record(random, |record| capture.push(record, sequence));
        }
        capture
    }

    fn push(&mut self, record: &Record, sequence: u32) {
        let mut body = [0; MAX_FRAME];
        let length = encode_body(record, &mut body).unwrap();
        let mut line = [0; MAX_FRAME];
        let end = encode(record, sequence, &mut line).unwrap();
        let start = self.bytes.len();
        self.bytes.extend_from_slice(&line[..end]);
        let sent = Sent { sequence, kind: record.kind(), body: body[..length].to_vec() };
        self.frames.push((start..start + end, sent));
    }
}

fn with_random_record(random: &mut Random, take: impl FnOnce(&Record)) {
    let text: String = (0..random.below(33)).map(|_| char::from(b' ' + random.below(95) as u8)).collect();
    let mut centres = Centres::new();
    let record = match random.below(12) {
        0 => Record::Hello(Hello {
            wire_version: WIRE_VERSION,
            box_id: random.next(),
            boot_id: random.next(),
            session_id: 12,
            name: &text,
            firmware: "0.1.0",
            setup_digest: [random.next() as u8; 16],
        }),
        1 => Record::Setup(SetupPiece {
            digest: [random.next() as u8; 16],
            index: random.number() as u16,
            count: random.number() as u16,
            text: &text,
        }),
        2 => Record::Rest(Rest {
            first_frame: random.number() as u32,
            last_frame: random.number() as u32,
            frames: random.number() as u16,
            rotation: [(); 4].map(|()| f64::from(random.float())),
            translation_mm: [(); 3].map(|()| f64::from(random.float())),
            covariance: [(); 21].map(|()| random.float()),
        }),
        3 => Record::TimeSync(TimeSync {
            time_ns: random.number(),
            utc_offset_ns: random.next().is_multiple_of(2).then(|| random.number() as i64),
            uncertainty_ns: random.number(),
        }),
        4 => Record::Event(Event {
            frame: random.number() as u32,
            time_ns: random.number(),
            what: What::Mark { text: &text },
        }),
        5 => Record::Event(Event {
            frame: random.number() as u32,
            time_ns: random.number(),
            what: What::FramesMissed { count: random.number() as u32 },
        }),
        6 => Record::Health(Health {
            time_ns: random.number(),
            frames: random.number() as u32,
            loop_time: [(); LOOP_TIME_BUCKETS].map(|()| random.number() as u16),
            free_bytes: Some(random.number()),
            ..Health::default()
        }),
        7 => [Record::SetRest, Record::Mark(Mark { text: &text })][random.below(2)].clone(),
        8 => Record::Ping(Ping { number: random.number() as u32, host_time_ns: random.number() }),
        9 | 10 => {
            for circle in 0..random.below(65) as u8 {
                let marker = Marker {
                    at_px: [random.float(), random.float()],
                    sigma_px: [random.float(), random.float()],
                    correlation: random.float(),
                };
                if random.below(4) > 0 {
                    assert!(centres.push(circle, &marker, random.below(8) > 0));
                }
            }
            Record::Markers(centres.markers(random.number() as u32))
        }
        _ => Record::Pose(Pose {
            frame: random.number() as u32,
            time_ns: random.number(),
            flags: PoseFlags(random.number() as u16),
            markers: random.number() as u8,
            motion: (random.below(4) > 0).then(|| Motion {
                displacement_mm: [(); 3].map(|()| random.float()),
                rotation_deg: [(); 3].map(|()| random.float()),
                sigma: [(); 6].map(|()| random.float()),
                residual_px: random.float(),
            }),
        }),
    };
    take(&record);
}

/// What a decoder made of some bytes.
#[derive(Debug, PartialEq)]
pub(crate) enum Found {
    Record(Sent),
    Newer(Sent),
    Damaged(Damage),
}

/// Decodes everything, handed over in the portions that `portion` gives.
pub(crate) fn decode(bytes: &[u8], mut portion: impl FnMut() -> usize) -> (Vec<Found>, Counts) {
    let mut decoder = Decoder::new();
    let mut all = Vec::new();
    let mut left = bytes;
    while !left.is_empty() {
        let (mut now, later) = left.split_at(portion().clamp(1, left.len()));
        left = later;
        while !now.is_empty() {
            let (decoded, behind) = decoder.feed(now);
            assert!(behind.len() < now.len(), "a call takes at least one byte");
            now = behind;
            all.extend(decoded.map(|decoded| match decoded {
                Decoded::Record { sequence, kind, body, record, .. } => {
                    assert_eq!(record.kind(), kind);
                    Found::Record(Sent { sequence, kind, body: body.to_vec() })
                }
                Decoded::Newer { sequence, kind, body } => {
                    Found::Newer(Sent { sequence, kind, body: body.to_vec() })
                }
                Decoded::Damaged(damage) => Found::Damaged(damage),
            }));
        }
    }
    all.extend(decoder.finish().map(Found::Damaged));
    let counts = *decoder.counts();
    assert_eq!(
        counts.records + counts.newer + counts.damaged,
        all.len() as u64,
        "everything is counted once"
    );
    (all, counts)
}
