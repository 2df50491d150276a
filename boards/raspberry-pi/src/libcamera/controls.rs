//! What the setup says in the units of libcamera's controls, and whether the camera takes and keeps it.

/// The exposure that a frame tells may differ from the one asked for by this share: sensors count in lines.
const EXPOSURE_TOLERANCE: f64 = 0.02;

/// The setup's exposure as `ExposureTime`, us.
pub(super) fn exposure_us(exposure_ms: f64) -> f64 {
    (1e3 * exposure_ms).round()
}

/// The setup's rate as both of `FrameDurationLimits`, us.
pub(super) fn frame_us(rate_hz: f64) -> f64 {
    (1e6 / rate_hz).round()
}

/// From the first line to the last one of `height`, ns.
pub(super) fn readout_ns(height: u16, line_time_us: f64) -> u64 {
    ((f64::from(height) - 1.0) * line_time_us.abs() * 1e3).round() as u64
}

/// Whether a frame tells another exposure than the one asked for, both us; never where none was asked for.
pub(super) fn is_other_exposure(told_us: i32, wanted_us: f64) -> bool {
    wanted_us > 0.0 && (f64::from(told_us) - wanted_us).abs() > EXPOSURE_TOLERANCE * wanted_us
}

/// The camera takes this value of a control, in the control's own unit. A range that is no number, or empty,
/// says nothing.
///
/// # Errors
/// One sentence with the control's name, the setup's key and the range.
pub(super) fn within(
    camera: &str,
    control: &str,
    key: &str,
    value: f64,
    range: (Option<f64>, Option<f64>),
) -> Result<(), String> {
    match range {
        (Some(least), Some(greatest)) if least < greatest && !(least..=greatest).contains(&value) => {
            Err(format!(
                "the control '{control}' of the camera {camera} does not take {value}, from {key}; it takes {least} to {greatest}"
            ))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_and_rate_are_told_in_whole_microseconds() {
        assert_eq!(exposure_us(4.0), 4_000.0);
        assert_eq!(exposure_us(0.0126), 13.0);
        assert_eq!(frame_us(50.0), 20_000.0);
        assert_eq!(frame_us(29.97), 33_367.0);
    }

    #[test]
    fn the_readout_lasts_a_line_less_than_there_are_in_either_direction() {
        assert_eq!(readout_ns(1_001, 14.5), 14_500_000);
        assert_eq!(readout_ns(1_001, -14.5), 14_500_000);
        for (height, line_time_us) in [(1, 14.5), (0, 14.5), (1_001, 0.0), (1_001, f64::NAN)] {
            assert_eq!(readout_ns(height, line_time_us), 0, "{height} {line_time_us}");
        }
    }

    #[test]
    fn an_exposure_in_whole_lines_is_the_one_asked_for_and_one_further_off_is_not() {
        for (told, wanted, is_other) in [
            (4_080, 4_000.0, false),
            (3_920, 4_000.0, false),
            (4_081, 4_000.0, true),
            (3_919, 4_000.0, true),
            (9_000, 0.0, false),
        ] {
            assert_eq!(is_other_exposure(told, wanted), is_other, "{told} for {wanted}");
        }
    }

    #[test]
    fn a_value_out_of_the_cameras_range_is_told_with_control_key_and_range() {
        let gain = |value, range| within("imx296", "AnalogueGain", "capture.gain", value, range);
        let range = (Some(1.0), Some(16.0));
        assert_eq!(gain(1.0, range), Ok(()));
        assert_eq!(gain(16.0, range), Ok(()));
        let refusal = "the control 'AnalogueGain' of the camera imx296 does not take 16.5, from capture.gain; it takes 1 to 16";
        assert_eq!(gain(16.5, range), Err(refusal.to_owned()));
        assert!(gain(0.5, range).is_err());
        assert!(gain(f64::NAN, range).is_err());
    }

    #[test]
    fn a_range_that_is_empty_or_no_number_refuses_nothing() {
        let range =
            [(None, Some(1.0)), (Some(1.0), None), (Some(0.0), Some(0.0)), (Some(f64::NAN), Some(1.0))];
        for range in range {
            assert_eq!(within("imx296", "AnalogueGain", "capture.gain", 8.0, range), Ok(()), "{range:?}");
        }
    }
}
