//! Controls of a camera: everything automatic off, exposure, gain and focus as the setup says, each read
//! back.

use gangway_device::Exposure;
use gangway_setup::Capture;

/// What a control takes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Range {
    pub(crate) name: String,
    pub(crate) least: i64,
    pub(crate) greatest: i64,
    pub(crate) step: u64,
}

/// A device's controls, by their V4L2 numbers.
pub(crate) trait Controls {
    /// What a control takes; `None` where the device has no such control, or it cannot be written.
    fn range(&self, id: u32) -> Option<Range>;
    /// Reads one.
    fn get(&self, id: u32) -> Result<i64, String>;
    /// Writes one.
    fn set(&self, id: u32, value: i64) -> Result<(), String>;
}

// Numbers of linux/v4l2-controls.h.
const AUTO_WHITE_BALANCE: u32 = 0x0098_090c;
const AUTO_GAIN: u32 = 0x0098_0912;
const GAIN: u32 = 0x0098_0913;
const HUE_AUTO: u32 = 0x0098_0919;
const AUTO_BRIGHTNESS: u32 = 0x0098_0920;
const EXPOSURE_AUTO: u32 = 0x009a_0901;
const EXPOSURE_ABSOLUTE: u32 = 0x009a_0902;
const EXPOSURE_AUTO_PRIORITY: u32 = 0x009a_0903;
const FOCUS_ABSOLUTE: u32 = 0x009a_090a;
const FOCUS_AUTO: u32 = 0x009a_090c;
const WIDE_DYNAMIC_RANGE: u32 = 0x009a_0915;
const IMAGE_STABILIZATION: u32 = 0x009a_0916;
const ISO_SENSITIVITY_AUTO: u32 = 0x009a_0918;
const ANALOGUE_GAIN: u32 = 0x009e_0903;

/// What moves by itself - gains, lens, even the picture - and the value that stops it: `V4L2_EXPOSURE_MANUAL`
/// is 1, everything else a switch.
const AUTOMATIC: [(u32, i64); 10] = [
    (EXPOSURE_AUTO, 1),
    (EXPOSURE_AUTO_PRIORITY, 0),
    (AUTO_GAIN, 0),
    (AUTO_BRIGHTNESS, 0),
    (AUTO_WHITE_BALANCE, 0),
    (HUE_AUTO, 0),
    (FOCUS_AUTO, 0),
    (ISO_SENSITIVITY_AUTO, 0),
    (WIDE_DYNAMIC_RANGE, 0),
    (IMAGE_STABILIZATION, 0),
];
/// The unit of `EXPOSURE_ABSOLUTE`, us.
const EXPOSURE_UNIT_US: f64 = 100.0;

/// Writes what the setup says and reads it back. Gives the exposure, ns, 0 where nobody tells it: a device
/// without a control for it is taken to expose as the setup says.
///
/// # Errors
/// One sentence with the control's name and range.
pub(crate) fn apply(device: &impl Controls, wanted: &Capture, exposure_ms: f64) -> Result<u64, String> {
    for (id, off) in AUTOMATIC {
        if let Some(range) = device.range(id) {
            write(device, id, &range, off)?;
        }
    }
    let exposure = 1e3 * exposure_ms / EXPOSURE_UNIT_US;
    if exposure_ms > 0.0 && has_exposure(device) {
        set(device, &[EXPOSURE_ABSOLUTE], "camera.exposure_ms", exposure.max(1.0))?;
    }
    if wanted.gain >= 0.0 {
        set(device, &[GAIN, ANALOGUE_GAIN], "capture.gain", wanted.gain)?;
    }
    if wanted.focus >= 0.0 {
        set(device, &[FOCUS_ABSOLUTE], "capture.focus", wanted.focus)?;
    }
    if !has_exposure(device) {
        return Ok((1e6 * exposure_ms) as u64);
    }
    let exposure = device.get(EXPOSURE_ABSOLUTE).unwrap_or(0);
    Ok(u64::try_from(exposure).unwrap_or(0) * (EXPOSURE_UNIT_US * 1e3) as u64)
}

/// The controls as they stand, each with what it takes, for a person.
pub(crate) fn describe(device: &impl Controls) -> String {
    let found = |id: &u32| Some((*id, device.range(*id)?));
    let by_hand = [EXPOSURE_ABSOLUTE, GAIN, ANALOGUE_GAIN, FOCUS_ABSOLUTE].iter().filter_map(found);
    let mut told: Vec<String> = by_hand
        .filter_map(|(id, Range { name, least, greatest, .. })| {
            Some(format!("'{name}' {} of {least} to {greatest}", device.get(id).ok()?))
        })
        .collect();
    let automatic: Vec<String> = AUTOMATIC
        .iter()
        .filter_map(|(id, off)| found(id).filter(|_| device.get(*id) == Ok(*off)))
        .map(|(_, range)| format!("'{}'", range.name))
        .collect();
    if !automatic.is_empty() {
        told.push(format!("off: {}", automatic.join(", ")));
    }
    if told.is_empty() { "the camera has none of those that matter here".to_owned() } else { told.join("; ") }
}

/// Whether a device can be told an exposure.
pub(crate) fn has_exposure(device: &impl Controls) -> bool {
    device.range(EXPOSURE_ABSOLUTE).is_some()
}

/// Writes another exposure and gain, each to the nearest that the device takes; gives what it then has,
/// `None` where it has no control for the exposure. A gain's units are known only where they begin above 0:
/// there that is 1.
pub(crate) fn expose(device: &impl Controls, wanted: Exposure) -> Option<Exposure> {
    let nearest = |id: u32, range: &Range, value: f64| -> Option<i64> {
        let step = i64::try_from(range.step.max(1)).ok()?;
        let steps = ((value.round() as i64).clamp(range.least, range.greatest) - range.least) / step;
        let value = range.least + steps * step;
        if device.get(id) != Ok(value) {
            device.set(id, value).ok()?;
        }
        device.get(id).ok()
    };
    let range = device.range(EXPOSURE_ABSOLUTE)?;
    let units = nearest(EXPOSURE_ABSOLUTE, &range, 1e6 * wanted.time_s / EXPOSURE_UNIT_US)?;
    let gain = [GAIN, ANALOGUE_GAIN].into_iter().find_map(|id| Some((id, device.range(id)?)));
    let gain = match gain {
        Some((id, range)) if range.least > 0 => {
            let one = range.least as f64;
            nearest(id, &range, wanted.gain * one)? as f64 / one
        }
        _ => 1.0,
    };
    Some(Exposure { time_s: units as f64 * EXPOSURE_UNIT_US / 1e6, gain })
}

/// Sets the first of several controls that the device has.
fn set(device: &impl Controls, ids: &[u32], key: &str, value: f64) -> Result<(), String> {
    let found = ids.iter().find_map(|id| Some((*id, device.range(*id)?)));
    let Some((id, range)) = found else {
        return Err(format!("the camera has no control for {key}; leave that key out of the setup"));
    };
    write(device, id, &range, value.round() as i64)
}

fn write(device: &impl Controls, id: u32, range: &Range, value: i64) -> Result<(), String> {
    let Range { name, least, greatest, step } = range;
    let takes = format!("it takes {least} to {greatest} in steps of {step}");
    if device.get(id) == Ok(value) {
        return Ok(());
    }
    device.set(id, value).map_err(|why| format!("the control '{name}' refused {value} ({why}); {takes}"))?;
    match device.get(id) {
        Ok(found) if found == value => Ok(()),
        Ok(found) => Err(format!("the control '{name}' is {found} after {value} was written; {takes}")),
        Err(why) => Err(format!("the control '{name}' cannot be read back ({why}); {takes}")),
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::collections::BTreeMap;

    use super::*;

    /// A camera that takes even numbers from 0 to 1,000 and drops the last bit of odd ones.
    struct Fake(RefCell<BTreeMap<u32, i64>>);

    impl Fake {
        fn with(ids: &[u32]) -> Self {
            Self(RefCell::new(ids.iter().map(|id| (*id, 3)).collect()))
        }
    }

    impl Controls for Fake {
        fn range(&self, id: u32) -> Option<Range> {
            let range = Range { name: format!("Control {id:x}"), least: 0, greatest: 1_000, step: 2 };
            self.0.borrow().contains_key(&id).then_some(range)
        }
        fn get(&self, id: u32) -> Result<i64, String> {
            self.0.borrow().get(&id).copied().ok_or_else(|| "no such control".to_owned())
        }
        fn set(&self, id: u32, value: i64) -> Result<(), String> {
            if !(0..=1_000).contains(&value) {
                return Err("out of range".to_owned());
            }
            let kept = if value == 1 { 1 } else { value & !1 };
            self.0.borrow_mut().insert(id, kept);
            Ok(())
        }
    }

    #[test]
    fn everything_automatic_is_off_and_the_exposure_known() {
        let camera = Fake::with(&[EXPOSURE_AUTO, AUTO_GAIN, EXPOSURE_ABSOLUTE, ANALOGUE_GAIN]);
        let wanted = Capture { gain: 8.0, ..Capture::default() };
        assert_eq!(apply(&camera, &wanted, 4.0), Ok(4_000_000));
        let values = camera.0.borrow();
        assert_eq!((values[&EXPOSURE_AUTO], values[&AUTO_GAIN]), (1, 0));
        assert_eq!((values[&EXPOSURE_ABSOLUTE], values[&ANALOGUE_GAIN]), (40, 8));
    }

    #[test]
    fn a_camera_that_shifts_its_picture_by_itself_is_kept_from_it() {
        // HUE_AUTO, WIDE_DYNAMIC_RANGE, IMAGE_STABILIZATION and ISO_SENSITIVITY_AUTO of
        // linux/v4l2-controls.h.
        let switches = [0x0098_0900 + 25, 0x009a_0900 + 21, 0x009a_0900 + 22, 0x009a_0900 + 24];
        let camera = Fake::with(&switches);
        apply(&camera, &Capture::default(), 0.0).unwrap();
        assert_eq!(switches.map(|id| camera.0.borrow()[&id]), [0; 4]);
    }

    #[test]
    fn a_control_that_did_not_take_is_told_with_its_name_and_range() {
        let camera = Fake::with(&[GAIN]);
        let wanted = |gain: f64| Capture { gain, ..Capture::default() };
        assert_eq!(
            apply(&camera, &wanted(7.0), 0.0).unwrap_err(),
            "the control 'Control 980913' is 6 after 7 was written; it takes 0 to 1000 in steps of 2"
        );
        assert_eq!(
            apply(&camera, &wanted(2_000.0), 0.0).unwrap_err(),
            "the control 'Control 980913' refused 2000 (out of range); it takes 0 to 1000 in steps of 2"
        );
    }

    #[test]
    fn a_control_that_is_not_there_is_told_with_its_key() {
        let wanted = Capture { focus: 0.0, ..Capture::default() };
        assert_eq!(
            apply(&Fake::with(&[]), &wanted, 0.0).unwrap_err(),
            "the camera has no control for capture.focus; leave that key out of the setup"
        );
        assert_eq!(apply(&Fake::with(&[]), &Capture::default(), 0.0), Ok(0));
    }

    #[test]
    fn a_camera_that_cannot_be_told_an_exposure_has_that_of_the_setup() {
        assert_eq!(apply(&Fake::with(&[]), &Capture::default(), 4.0), Ok(4_000_000));
    }

    #[test]
    fn an_exposure_is_taken_to_the_devices_own_steps() {
        let camera = Fake::with(&[EXPOSURE_ABSOLUTE, GAIN]);
        // 3.3 ms are 33 units of 0.1 ms, and only even ones are taken. The gain begins at 0: its unit is not
        // known.
        let taken = expose(&camera, Exposure { time_s: 3.3e-3, gain: 4.0 });
        assert_eq!(taken, Some(Exposure { time_s: 3.2e-3, gain: 1.0 }));
        assert_eq!(expose(&Fake::with(&[GAIN]), Exposure { time_s: 1e-3, gain: 1.0 }), None);
    }

    #[test]
    fn controls_are_told_with_what_they_take_and_what_is_off() {
        let camera = Fake::with(&[EXPOSURE_AUTO, AUTO_GAIN, EXPOSURE_ABSOLUTE]);
        apply(&camera, &Capture::default(), 4.0).unwrap();
        assert_eq!(
            describe(&camera),
            "'Control 9a0902' 40 of 0 to 1000; off: 'Control 9a0901', 'Control 980912'"
        );
        assert_eq!(describe(&Fake::with(&[])), "the camera has none of those that matter here");
    }
}
