//! Records as lines: `pose frame=12 x_mm=0.5 ...`, or one JSON object a line with the same names and values.

use std::fmt::Write as _;

use gangway_wire::{Decoded, Event, Health, Hello, Latency, Markers, Motion, Pose, Record, Rest, What, kind};

use crate::meta::hex;
use crate::rows::flag_words;
use crate::scan::Found;

/// Names and values of one line; a value is JSON.
#[derive(Debug, Default)]
struct Fields(Vec<(&'static str, String)>);

impl Fields {
    /// Whole numbers and truth values: their text is JSON as it is.
    fn plain(&mut self, name: &'static str, value: impl ToString) {
        self.0.push((name, value.to_string()));
    }

    fn text(&mut self, name: &'static str, value: &str) {
        self.0.push((name, quoted(value)));
    }

    fn real(&mut self, name: &'static str, value: f32) {
        self.0.push((name, real(value.into(), value)));
    }

    fn list(&mut self, name: &'static str, values: impl Iterator<Item = String>) {
        self.0.push((name, format!("[{}]", values.collect::<Vec<_>>().join(","))));
    }

    fn optional(&mut self, name: &'static str, value: Option<impl ToString>) {
        self.0.push((name, value.map_or("null".to_owned(), |value| value.to_string())));
    }

    fn object(&self) -> String {
        let fields: Vec<_> = self.0.iter().map(|(name, value)| format!("\"{name}\":{value}")).collect();
        format!("{{{}}}", fields.join(","))
    }
}

fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// The shortest digits that give the same number again; JSON knows no infinity.
fn real(value: f64, shortest: impl ToString) -> String {
    if value.is_finite() { shortest.to_string() } else { "null".to_owned() }
}

/// What was found, as a line for people or as a JSON object.
pub fn line(found: &Found<'_>, json: bool) -> String {
    let mut fields = Fields::default();
    let (name, sequence) = match &found.decoded {
        Decoded::Record { sequence, kind, record, newer, .. } => {
            describe(record, &mut fields);
            if *newer {
                fields.plain("newer_fields", true);
            }
            (kind_name(*kind), Some(*sequence))
        }
        Decoded::Newer { sequence, kind, body } => {
            fields.plain("number", kind);
            fields.text("body", &hex(body));
            ("newer", Some(*sequence))
        }
        Decoded::Damaged(damage) => {
            fields.text("what", &damage.to_string());
            fields.plain("bytes", found.end - found.start);
            ("damaged", None)
        }
    };
    if json {
        let mut all = Fields::default();
        all.text("kind", name);
        all.optional("sequence", sequence);
        all.plain("offset", found.start);
        all.0.append(&mut fields.0);
        return all.object();
    }
    let mut line = match sequence {
        Some(sequence) => format!("{sequence:>7} {name}"),
        None => format!("{:>7} {name}", "-"),
    };
    for (name, value) in fields.0 {
        // Writing into a string cannot fail.
        let _ = write!(line, " {name}={value}");
    }
    line
}

/// Name of a kind.
fn kind_name(number: u8) -> &'static str {
    match number {
        kind::HELLO => "hello",
        kind::SETUP => "setup",
        kind::REST => "rest",
        kind::POSE => "pose",
        kind::MARKERS => "markers",
        kind::EVENT => "event",
        kind::HEALTH => "health",
        kind::TIME_SYNC => "time-sync",
        kind::PONG => "pong",
        kind::SET_REST => "set-rest",
        kind::MARK => "mark",
        kind::PING => "ping",
        _ => "other",
    }
}

fn describe(record: &Record<'_>, fields: &mut Fields) {
    match record {
        Record::Hello(hello) => describe_hello(hello, fields),
        Record::Setup(piece) => {
            fields.text("digest", &hex(&piece.digest));
            fields.plain("index", piece.index);
            fields.plain("count", piece.count);
            fields.text("text", piece.text);
        }
        Record::Rest(rest) => describe_rest(rest, fields),
        Record::Pose(pose) => describe_pose(pose, fields),
        Record::Markers(markers) => describe_markers(markers, fields),
        Record::Event(event) => describe_event(event, fields),
        Record::Health(health) => describe_health(health, fields),
        Record::TimeSync(sync) => {
            fields.plain("time_ns", sync.time_ns);
            fields.optional("utc_offset_ns", sync.utc_offset_ns);
            fields.plain("uncertainty_ns", sync.uncertainty_ns);
        }
        Record::Pong(pong) => {
            fields.plain("number", pong.number);
            fields.plain("host_time_ns", pong.host_time_ns);
            fields.plain("time_ns", pong.time_ns);
        }
        Record::SetRest => {}
        Record::Mark(mark) => fields.text("text", mark.text),
        Record::Ping(ping) => {
            fields.plain("number", ping.number);
            fields.plain("host_time_ns", ping.host_time_ns);
        }
    }
}

fn describe_hello(hello: &Hello<'_>, fields: &mut Fields) {
    fields.plain("wire_version", hello.wire_version);
    fields.text("box_id", &format!("{:x}", hello.box_id));
    fields.text("boot_id", &format!("{:x}", hello.boot_id));
    fields.text("session_id", &format!("{:x}", hello.session_id));
    fields.text("name", hello.name);
    fields.text("firmware", hello.firmware);
    fields.text("setup_digest", &hex(&hello.setup_digest));
}

fn describe_rest(rest: &Rest, fields: &mut Fields) {
    fields.plain("first_frame", rest.first_frame);
    fields.plain("last_frame", rest.last_frame);
    fields.plain("frames", rest.frames);
    fields.list("rotation_wxyz", rest.rotation.iter().map(|value| real(*value, value)));
    fields.list("translation_mm", rest.translation_mm.iter().map(|value| real(*value, value)));
    fields.list("covariance_mm_deg", rest.covariance.iter().map(|value| real((*value).into(), value)));
}

fn describe_pose(pose: &Pose, fields: &mut Fields) {
    fields.plain("frame", pose.frame);
    fields.plain("time_ns", pose.time_ns);
    if let Some(Motion { displacement_mm, rotation_deg, sigma, residual_px }) = pose.motion {
        for (name, value) in ["x_mm", "y_mm", "z_mm"].into_iter().zip(displacement_mm) {
            fields.real(name, value);
        }
        for (name, value) in ["roll_deg", "pitch_deg", "yaw_deg"].into_iter().zip(rotation_deg) {
            fields.real(name, value);
        }
        let names =
            ["x_sigma_mm", "y_sigma_mm", "z_sigma_mm", "roll_sigma_deg", "pitch_sigma_deg", "yaw_sigma_deg"];
        for (name, value) in names.into_iter().zip(sigma) {
            fields.real(name, value);
        }
        fields.real("residual_px", residual_px);
    }
    fields.plain("markers", pose.markers);
    fields.text("flags", &flag_words(pose.flags));
}

fn describe_markers(markers: &Markers<'_>, fields: &mut Fields) {
    fields.plain("frame", markers.frame);
    let centres = markers.iter().map(|(circle, marker)| {
        let mut centre = Fields::default();
        centre.plain("circle", circle);
        centre.real("u_px", marker.at_px[0]);
        centre.real("v_px", marker.at_px[1]);
        centre.real("u_sigma_px", marker.sigma_px[0]);
        centre.real("v_sigma_px", marker.sigma_px[1]);
        centre.real("correlation", marker.correlation);
        centre.plain("used", markers.is_used(circle));
        centre.object()
    });
    fields.list("centres", centres);
}

fn describe_event(event: &Event<'_>, fields: &mut Fields) {
    fields.plain("frame", event.frame);
    fields.plain("time_ns", event.time_ns);
    let what = match event.what {
        What::Started => "started",
        What::Ended => "ended",
        What::MarkerLost { .. } => "marker-lost",
        What::MarkerFound { .. } => "marker-found",
        What::MarkerStillLost { .. } => "marker-still-lost",
        What::FramesMissed { .. } => "frames-missed",
        What::FrameRepeated => "frame-repeated",
        What::FrameCorrupt => "frame-corrupt",
        What::RestSet { .. } => "rest-set",
        What::RestRequested => "rest-requested",
        What::LightChanged { .. } => "light-changed",
        What::QueueOverflow { .. } => "queue-overflow",
        What::CameraStalled => "camera-stalled",
        What::CameraLost => "camera-lost",
        What::CameraReopened => "camera-reopened",
        What::Mark { .. } => "mark",
        What::CommandRefused { .. } => "command-refused",
        What::SetupChanged => "setup-changed",
        What::ExposureChanged { .. } => "exposure-changed",
        What::CameraMoved { .. } => "camera-moved",
        What::CameraShaking { .. } => "camera-shaking",
    };
    fields.text("what", what);
    match event.what {
        What::MarkerLost { circle, reason } | What::MarkerStillLost { circle, reason } => {
            fields.plain("circle", circle);
            fields.text("reason", reason_words(reason));
        }
        What::MarkerFound { circle } => fields.plain("circle", circle),
        What::FramesMissed { count } | What::QueueOverflow { count } => fields.plain("count", count),
        What::RestSet { frames } => fields.plain("frames", frames),
        What::LightChanged { percent } => fields.plain("percent", percent),
        What::Mark { text } => fields.text("text", text),
        What::CommandRefused { kind } => fields.text("command", kind_name(kind)),
        What::ExposureChanged { exposure_us, gain_permille } => {
            fields.plain("exposure_us", exposure_us);
            fields.plain("gain_permille", gain_permille);
        }
        What::CameraMoved { evidence, shift_mm, turn_deg } => {
            fields.text("evidence", evidence_words(evidence));
            fields.plain("shift_mm", shift_mm);
            fields.plain("turn_deg", turn_deg);
        }
        What::CameraShaking { shift_mm, turn_deg } => {
            fields.plain("shift_mm", shift_mm);
            fields.plain("turn_deg", turn_deg);
        }
        _ => {}
    }
}

fn evidence_words(evidence: gangway_wire::MoveEvidence) -> &'static str {
    use gangway_wire::MoveEvidence::*;
    match evidence {
        References => "references",
        Shock => "shock",
        Standing => "standing",
        Other => "other",
    }
}

fn reason_words(reason: gangway_wire::LostReason) -> &'static str {
    use gangway_wire::LostReason::*;
    match reason {
        OutsidePicture => "outside-picture",
        LowContrast => "low-contrast",
        NotFound => "not-found",
        CutByPicture => "cut-by-picture",
        CutByWindow => "cut-by-window",
        Saturated => "saturated",
        Outline => "outline",
        Neighbour => "neighbour",
        Residual => "residual",
        Unlit => "unlit",
        Other => "other",
    }
}

fn describe_health(health: &Health, fields: &mut Fields) {
    fields.plain("time_ns", health.time_ns);
    fields.plain("frames", health.frames);
    fields.plain("frames_missed", health.frames_missed);
    fields.plain("records_lost", health.records_lost);
    fields.plain("queue_high_water", health.queue_high_water);
    fields.list("loop_time_counts", health.loop_time.iter().map(ToString::to_string));
    fields.plain("loop_time_max_ns", health.loop_time_max_ns);
    fields.optional("temperature_c", health.temperature_centi_c.map(|centi| f64::from(centi) / 100.0));
    fields.optional("free_bytes", health.free_bytes);
    if let Some(latency) = &health.latency {
        let Latency { wake_up, exposure_to_line } = latency;
        fields.list("wake_up_counts", wake_up.counts.iter().map(ToString::to_string));
        fields.plain("wake_up_max_ns", wake_up.longest_ns);
        fields.list("exposure_to_line_counts", exposure_to_line.counts.iter().map(ToString::to_string));
        fields.plain("exposure_to_line_max_ns", exposure_to_line.longest_ns);
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use gangway_wire::{LostReason, Mark, Ping, Pong, SetupPiece, TimeSync};
    use serde_json::Value;

    use super::*;
    use crate::testing::{pose, put, ride};
    use crate::walk;

    fn lines(bytes: &[u8], json: bool) -> Vec<String> {
        let mut lines = Vec::new();
        walk(bytes, |found| {
            lines.push(line(found, json));
            ControlFlow::Continue(())
        })
        .unwrap();
        lines
    }

    /// One of every kind of record.
    fn every_kind() -> Vec<u8> {
        let (mut bytes, mut sequence) = (ride(1, 1), 100);
        let rest = Rest {
            first_frame: 0,
            last_frame: 9,
            frames: 10,
            rotation: [1.0, 0.0, 0.0, 0.0],
            translation_mm: [0.5, -1.0, 4100.0],
            covariance: [0.25; 21],
        };
        let lost = What::MarkerLost { circle: 3, reason: LostReason::Neighbour };
        let latency = Some(Latency::default());
        let health = Health { temperature_centi_c: Some(4150), latency, ..Health::default() };
        for record in [
            Record::Setup(SetupPiece { digest: [1; 16], index: 0, count: 1, text: "a = \"b\"\n" }),
            Record::Rest(rest),
            Record::Pose(pose(7)),
            Record::Event(Event { frame: 7, time_ns: 8, what: lost }),
            Record::Health(health),
            Record::TimeSync(TimeSync { time_ns: 1, utc_offset_ns: None, uncertainty_ns: 2 }),
            Record::Pong(Pong { number: 1, host_time_ns: 2, time_ns: 3 }),
            Record::SetRest,
            Record::Mark(Mark { text: "bridge" }),
            Record::Ping(Ping { number: 1, host_time_ns: 2 }),
        ] {
            put(&mut bytes, &mut sequence, &record);
        }
        bytes.extend([3, 1, 2, 0]);
        bytes
    }

    #[test]
    fn every_line_of_json_reads_back_and_names_its_kind() {
        let bytes = every_kind();
        let kinds: Vec<String> = lines(&bytes, true)
            .iter()
            .map(|line| {
                let value: Value = serde_json::from_str(line).unwrap();
                value["kind"].as_str().unwrap().to_owned()
            })
            .collect();
        for kind in [
            "hello",
            "setup",
            "rest",
            "pose",
            "markers",
            "event",
            "health",
            "time-sync",
            "pong",
            "set-rest",
            "mark",
            "ping",
            "damaged",
        ] {
            assert!(kinds.iter().any(|k| k == kind), "{kind} in {kinds:?}");
        }
    }

    #[test]
    fn values_are_given_in_the_digits_that_they_have() {
        let value = |line: &str| serde_json::from_str::<Value>(line).unwrap();
        let all = lines(&every_kind(), true);
        let pose = all.iter().map(|line| value(line)).find(|v| v["frame"] == 7).unwrap();
        assert_eq!(
            (&pose["x_mm"], &pose["roll_deg"], &pose["flags"]),
            (&3.5.into(), &0.5.into(), &"".into())
        );
        let event = all.iter().map(|line| value(line)).find(|v| v["what"] == "marker-lost").unwrap();
        assert_eq!((&event["circle"], &event["reason"]), (&3.into(), &"neighbour".into()));
        let health = all.iter().map(|line| value(line)).find(|v| v["kind"] == "health").unwrap();
        assert_eq!((&health["temperature_c"], &health["free_bytes"]), (&41.5.into(), &Value::Null));
        assert_eq!(health["exposure_to_line_counts"].as_array().map(Vec::len), Some(16));
    }

    #[test]
    fn a_record_is_one_line_whatever_its_text_holds() {
        let text = lines(&every_kind(), false);
        assert!(text.iter().all(|line| !line.contains('\n')));
        assert!(text[0].ends_with("setup_digest=\"00000000000000000000000000000000\""), "{}", text[0]);
        assert!(text.iter().any(|line| line.contains("pose frame=7 time_ns=140000000 x_mm=3.5 ")));
        assert!(text.last().unwrap().contains("damaged what="));
    }
}
