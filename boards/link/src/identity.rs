//! Who speaks on a line: the numbers that a session begins with, from the system that it runs on.

use std::time::{SystemTime, UNIX_EPOCH};

use gangway_engine::Identity;

/// A box's identity for a session that begins now: its number is the time, ns since 1970; the boot's number
/// is the system's, 0 where that has none.
pub fn identity(box_id: u64, firmware: &'static str) -> Identity {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Identity { box_id, boot_id: boot_id().unwrap_or(0), session_id: now.as_nanos() as u64, firmware }
}

/// The first half of the number that Linux gives every boot.
fn boot_id() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    let digits: String = text.chars().filter(char::is_ascii_hexdigit).take(16).collect();
    u64::from_str_radix(&digits, 16).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sessions_of_one_boot_differ_in_their_number_only() {
        let one = identity(7, "test");
        std::thread::sleep(std::time::Duration::from_millis(1));
        let other = identity(7, "test");
        assert_eq!((one.box_id, one.boot_id, one.firmware), (7, other.boot_id, "test"));
        assert!(one.session_id < other.session_id);
    }
}
