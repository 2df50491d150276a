//! The device that the setup names: a path, or the serial number of what is plugged in, wherever that came
//! up.

use std::path::{Path, PathBuf};

use super::OpenError;

/// Where the kernel lists video devices.
pub(crate) const CLASS: &str = "/sys/class/video4linux";
/// A USB device's number stands at most so many directories above its video device.
const HEIGHT: usize = 4;

/// The path of the named device.
pub(crate) fn find(name: &str, class: &Path) -> Result<PathBuf, OpenError> {
    let Some(serial) = name.strip_prefix("serial:") else { return Ok(PathBuf::from(name)) };
    let devices = std::fs::read_dir(class).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = devices
        .map(|entry| entry.path())
        // A camera has several nodes; the first one delivers pictures.
        .filter(|node| said(&node.join("index")).is_none_or(|index| index == "0"))
        .filter(|node| serial_of(node).is_some_and(|of| of == serial))
        .filter_map(|node| Some(Path::new("/dev").join(node.file_name()?)))
        .collect();
    found.sort();
    found.into_iter().next().ok_or_else(|| {
        OpenError::absent(format!("no camera with the serial number {serial} is plugged in; check its plug"))
    })
}

fn said(file: &Path) -> Option<String> {
    std::fs::read_to_string(file).ok().map(|text| text.trim().to_owned())
}

/// The serial number of the device that a video node belongs to.
fn serial_of(node: &Path) -> Option<String> {
    let device = node.join("device").canonicalize().ok()?;
    device.ancestors().take(HEIGHT).find_map(|place| said(&place.join("serial")))
}

#[cfg(test)]
mod tests {
    use std::fs::{create_dir_all, write};
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_camera_is_found_by_its_number_wherever_it_came_up() {
        let place = tempfile::tempdir().unwrap();
        let class = place.path().join("class");
        for (node, index, usb, serial) in
            [("video4", "0", "1-1", "A1"), ("video6", "1", "1-2", "B2"), ("video7", "0", "1-2", "B2")]
        {
            let interface = place.path().join(usb).join("interface");
            create_dir_all(&interface).unwrap();
            write(place.path().join(usb).join("serial"), format!("{serial}\n")).unwrap();
            create_dir_all(class.join(node)).unwrap();
            write(class.join(node).join("index"), index).unwrap();
            symlink(&interface, class.join(node).join("device")).unwrap();
        }
        assert_eq!(find("serial:B2", &class).unwrap(), Path::new("/dev/video7"));
        let said = find("serial:C3", &class).unwrap_err();
        assert_eq!(said.to_string(), "no camera with the serial number C3 is plugged in; check its plug");
        assert_eq!(find("/dev/v4l/by-id/x", &class).unwrap(), Path::new("/dev/v4l/by-id/x"));
    }
}
