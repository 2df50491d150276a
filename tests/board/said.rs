//! What a box said, read from its records.

use std::collections::BTreeMap;

use gangway_wire::{Decoded, Decoder, Latency, Record, What};

/// What a box said: the bodies of what its frames caused, and its events.
#[derive(Default)]
pub(crate) struct Said {
    pub(crate) poses: BTreeMap<u32, (u64, bool, Vec<u8>)>,
    pub(crate) markers: BTreeMap<u32, Vec<u8>>,
    pub(crate) rests: Vec<Vec<u8>>,
    pub(crate) events: Vec<(u32, String)>,
    /// Frames that an event says are missing.
    pub(crate) missed: u32,
    pub(crate) damaged: u64,
    /// All latencies of the health records.
    pub(crate) latency: Latency,
}

impl Said {
    pub(crate) fn of(stream: &[u8]) -> Self {
        let mut said = Self::default();
        let mut decoder = Box::new(Decoder::new());
        let mut bytes = stream;
        while !bytes.is_empty() {
            let (decoded, rest) = decoder.feed(bytes);
            bytes = rest;
            let Some(Decoded::Record { body, record, .. }) = decoded else { continue };
            match record {
                Record::Pose(pose) => {
                    let motion = pose.motion.is_some();
                    said.poses.insert(pose.frame, (pose.time_ns, motion, body.to_vec()));
                }
                Record::Markers(markers) => {
                    said.markers.insert(markers.frame, body.to_vec());
                }
                // A rest pose comes again with every announcement.
                Record::Rest(_) if !said.rests.contains(&body.to_vec()) => said.rests.push(body.to_vec()),
                Record::Event(event) => {
                    if let What::FramesMissed { count } = event.what {
                        said.missed += count;
                    }
                    said.events.push((event.frame, format!("{:?}", event.what)));
                }
                Record::Health(health) => {
                    let Latency { wake_up, exposure_to_line } = health.latency.unwrap_or_default();
                    said.latency.wake_up.merge(&wake_up);
                    said.latency.exposure_to_line.merge(&exposure_to_line);
                }
                _ => {}
            }
        }
        said.damaged = decoder.counts().damaged;
        said
    }

    pub(crate) fn has(&self, what: &str) -> bool {
        self.events.iter().any(|(_, event)| event.contains(what))
    }

    /// Every frame from the first to the last one has its record, or is told to be missing.
    pub(crate) fn assert_accounted(&self) {
        let (first, last) = (self.poses.keys().next(), self.poses.keys().last());
        let (Some(first), Some(last)) = (first, last) else { panic!("no frame was measured") };
        assert_eq!(self.poses.len() as u32 + self.missed, last - first + 1, "{:?}", self.events);
        assert_eq!(self.damaged, 0);
    }
}
