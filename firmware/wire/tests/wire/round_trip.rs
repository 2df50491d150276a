//! Whatever a record holds comes back; whatever bytes come, nothing panics.

use gangway_wire::*;
use proptest::array::{uniform3, uniform4, uniform6, uniform16, uniform32};
use proptest::option;
use proptest::prelude::*;

/// Over the line and back: the same body again, and what `judge` says of the record.
fn over_the_line(
    sent: &Record,
    sequence: u32,
    judge: impl FnOnce(&Record) -> bool,
) -> Result<(), TestCaseError> {
    let mut body = [0; MAX_FRAME];
    let length = encode_body(sent, &mut body).unwrap();
    let mut line = [0; MAX_FRAME];
    let end = encode(sent, sequence, &mut line).unwrap();
    let mut decoder = Decoder::new();
    let (decoded, rest) = decoder.feed(&line[..end]);
    prop_assert!(rest.is_empty());
    let Some(Decoded::Record { sequence: number, kind, body: got, record, newer }) = decoded else {
        return Err(TestCaseError::fail(format!("{decoded:?}")));
    };
    prop_assert_eq!((number, kind, newer), (sequence, sent.kind(), false));
    prop_assert_eq!(got, &body[..length]);
    prop_assert!(judge(&record), "{:?} came back as {:?}", sent, record);
    let mut again = [0; MAX_FRAME];
    let length = encode_body(&record, &mut again).unwrap();
    prop_assert_eq!(&again[..length], got);
    Ok(())
}

/// Same number, NaN and all.
fn same(a: &[f32], b: &[f32]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Same to 0.2 %, the precision of the short float.
fn close(sent: f32, got: f32) -> bool {
    (sent - got).abs() <= sent * (1.0001 / 512.0)
}

fn any_text(limit: usize) -> impl Strategy<Value = String> {
    proptest::collection::vec(any::<char>(), 0..=limit / 4).prop_map(String::from_iter)
}

fn any_what() -> impl Strategy<Value = (u8, u8, u32, String)> {
    (0..21_u8, any::<u8>(), any::<u32>(), any_text(MAX_MARK))
}

fn what<'t>((choice, small, count, text): &'t (u8, u8, u32, String)) -> What<'t> {
    let (circle, count) = (*small, *count);
    match choice {
        0 => What::Started,
        1 => What::Ended,
        2 => What::MarkerLost { circle, reason: LostReason::Neighbour },
        3 => What::MarkerFound { circle },
        4 => What::MarkerStillLost { circle, reason: LostReason::Saturated },
        5 => What::FramesMissed { count },
        6 => What::FrameRepeated,
        7 => What::FrameCorrupt,
        8 => What::RestSet { frames: count as u16 },
        9 => What::RestRequested,
        10 => What::LightChanged { percent: *small },
        11 => What::QueueOverflow { count },
        12 => What::CameraStalled,
        13 => What::CameraLost,
        14 => What::CameraReopened,
        15 => What::Mark { text },
        16 => What::CommandRefused { kind: *small },
        17 => What::ExposureChanged { exposure_us: count, gain_permille: count / 3 },
        18 => What::SetupChanged,
        19 => What::CameraMoved {
            evidence: MoveEvidence::Shock,
            shift_mm: count as f32,
            turn_deg: f32::from(*small),
        },
        _ => What::CameraShaking { shift_mm: count as f32, turn_deg: f32::from(*small) },
    }
}

proptest! {
    #[test]
    fn a_hello_comes_back(
        ids in uniform3(any::<u64>()), name in any_text(MAX_NAME), firmware in any_text(MAX_FIRMWARE),
        setup_digest in uniform16(any::<u8>()), wire_version: u16, sequence: u32,
    ) {
        let [box_id, boot_id, session_id] = ids;
        let (name, firmware) = (&name[..], &firmware[..]);
        let sent =
            Record::Hello(Hello { wire_version, box_id, boot_id, session_id, name, firmware, setup_digest });
        over_the_line(&sent, sequence, |got| got == &sent)?;
    }

    #[test]
    fn a_piece_of_the_setup_comes_back(
        digest in uniform16(any::<u8>()), index: u16, count: u16, text in any_text(MAX_SETUP_PIECE),
    ) {
        let sent = Record::Setup(SetupPiece { digest, index, count, text: &text });
        over_the_line(&sent, 0, |got| got == &sent)?;
    }

    #[test]
    fn a_rest_pose_comes_back_bit_by_bit(
        frames: (u32, u32, u16), rotation in uniform4(any::<f64>()), translation_mm in uniform3(any::<f64>()),
        floats in uniform32(any::<f32>()),
    ) {
        let mut covariance = [0.0; 21];
        covariance.copy_from_slice(&floats[..21]);
        let sent = Rest {
            first_frame: frames.0,
            last_frame: frames.1,
            frames: frames.2,
            rotation,
            translation_mm,
            covariance,
        };
        over_the_line(&Record::Rest(sent.clone()), 0, |got| got == &Record::Rest(sent.clone()))?;
    }

    #[test]
    fn a_pose_comes_back_with_its_sigmas_to_two_tenths_of_a_percent(
        frame: u32, time_ns: u64, flags: u16, markers: u8, there: bool,
        place in uniform6(any::<f32>()), sigma in uniform6(1e-30..1e30_f32), residual_px in 1e-30..1e30_f32,
    ) {
        let [x, y, z, roll, pitch, yaw] = place;
        let motion = there.then_some(Motion {
            displacement_mm: [x, y, z],
            rotation_deg: [roll, pitch, yaw],
            sigma,
            residual_px,
        });
        let sent = Pose { frame, time_ns, flags: PoseFlags(flags), markers, motion };
        over_the_line(&Record::Pose(sent), 0, |got| {
            let Record::Pose(got) = got else { return false };
            let motion_is_same = match (&sent.motion, &got.motion) {
                (Some(sent), Some(got)) => {
                    same(&sent.displacement_mm, &got.displacement_mm)
                        && same(&sent.rotation_deg, &got.rotation_deg)
                        && sent.sigma.iter().zip(got.sigma).all(|(sent, got)| close(*sent, got))
                        && close(sent.residual_px, got.residual_px)
                }
                (None, None) => true,
                _ => false,
            };
            motion_is_same && Pose { motion: None, ..sent } == Pose { motion: None, ..*got }
        })?;
    }

    #[test]
    fn markers_come_back(
        frame: u32, visible: u64, used: u64,
        places in proptest::collection::vec((-1.0..4096.0_f32, -1.0..4096.0_f32, 0.001..10.0_f32), 64),
    ) {
        let mut centres = Centres::new();
        let mut sent = Vec::new();
        for circle in (0..64).filter(|circle| visible >> circle & 1 == 1) {
            let (u, v, sigma) = places[circle as usize];
            let marker = Marker { at_px: [u, v], sigma_px: [sigma, 2.0 * sigma], correlation: sigma / 10.0 };
            prop_assert!(centres.push(circle, &marker, used >> circle & 1 == 1));
            sent.push((circle, marker));
        }
        let markers = centres.markers(frame);
        prop_assert_eq!((markers.visible, markers.used), (visible, used & visible));
        over_the_line(&Record::Markers(markers), 0, |got| {
            let Record::Markers(got) = got else { return false };
            let got: Vec<_> = got.iter().collect();
            got.len() == sent.len() && got.iter().zip(&sent).all(|((circle, got), (sent_circle, sent))| {
                // Half a step of each scale: 1/2048 px, a 32nd of an octave (2.2 %), 1/256.
                circle == sent_circle
                    && (0..2).all(|i| {
                        (got.at_px[i] - sent.at_px[i]).abs() <= 0.5 / 1024.0
                            && (got.sigma_px[i] >= 14.0 || (got.sigma_px[i] / sent.sigma_px[i] - 1.0).abs() < 0.022)
                    })
                    && (got.correlation - sent.correlation).abs() <= 1.0 / 128.0
            })
        })?;
    }

    #[test]
    fn an_event_comes_back(frame: u32, time_ns: u64, choice in any_what()) {
        let sent = Record::Event(Event { frame, time_ns, what: what(&choice) });
        over_the_line(&sent, 0, |got| got == &sent)?;
    }

    #[test]
    fn health_and_clocks_come_back(
        times in uniform4(any::<u64>()), counts in uniform4(any::<u32>()), queue_high_water: u16,
        loop_time in uniform16(any::<u16>()), temperature_centi_c in option::of(any::<i16>()),
        free_bytes in option::of(any::<u64>()), utc_offset_ns in option::of(any::<i64>()),
        longest in option::of(any::<u32>()),
    ) {
        let [time_ns, host_time_ns, uncertainty_ns, _] = times;
        let [frames, frames_missed, records_lost, loop_time_max_ns] = counts;
        let health = Record::Health(Health {
            time_ns,
            frames,
            frames_missed,
            records_lost,
            queue_high_water,
            loop_time,
            loop_time_max_ns,
            temperature_centi_c,
            free_bytes,
            latency: longest.map(|longest_ns| {
                let histogram = Histogram { counts: loop_time, longest_ns };
                Latency { wake_up: Histogram::default(), exposure_to_line: histogram }
            }),
        });
        over_the_line(&health, frames, |got| got == &health)?;
        let sync = Record::TimeSync(TimeSync { time_ns, utc_offset_ns, uncertainty_ns });
        over_the_line(&sync, frames, |got| got == &sync)?;
        let pong = Record::Pong(Pong { number: frames, host_time_ns, time_ns });
        over_the_line(&pong, frames, |got| got == &pong)?;
        let ping = Record::Ping(Ping { number: frames, host_time_ns });
        over_the_line(&ping, frames, |got| got == &ping)?;
    }

    #[test]
    fn any_body_is_a_record_or_an_error_and_never_a_panic(
        kind in prop_oneof![0..12_u8, 126..132_u8], body in proptest::collection::vec(any::<u8>(), 0..250),
    ) {
        if let Ok((record, _)) = decode_body(kind, &body) {
            // What was read can be written and is then read as the same: compared as bytes, for NaN is in it
            // too.
            let mut once = [0; MAX_FRAME];
            let length = encode_body(&record, &mut once).unwrap();
            let (again, newer) = decode_body(kind, &once[..length]).unwrap();
            prop_assert!(!newer);
            let mut twice = [0; MAX_FRAME];
            let length_again = encode_body(&again, &mut twice).unwrap();
            prop_assert_eq!(&once[..length], &twice[..length_again]);
        }
    }

    #[test]
    fn any_marker_is_packed_and_comes_back_as_itself_from_then_on(packed in uniform16(any::<u8>())) {
        let mut nine = [0; PACKED_MARKER];
        nine.copy_from_slice(&packed[..PACKED_MARKER]);
        let once = Marker::unpack(nine).pack();
        prop_assert_eq!(Marker::unpack(once).pack(), once);
    }

    #[test]
    fn any_float_makes_a_marker(fields in uniform6(any::<f32>())) {
        let [u, v, sigma_u, sigma_v, correlation, _] = fields;
        let marker = Marker { at_px: [u, v], sigma_px: [sigma_u, sigma_v], correlation };
        let back = Marker::unpack(marker.pack());
        prop_assert!(back.sigma_px.iter().all(|sigma| *sigma > 0.0));
        prop_assert!(back.correlation.abs() < 1.0);
    }
}
