//! UTC as people write it, from the system's clock.

use std::time::{SystemTime, UNIX_EPOCH};

/// Now, ns since 1970.
pub(crate) fn now_ns() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
}

/// Year, month, day, hour, minute, second (proleptic Gregorian calendar; days counted from March, so that the
/// leap day is a year's last).
fn civil(seconds: u64) -> [u64; 6] {
    let days = seconds / 86_400 + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day_of_year = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day_of_month = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = era * 400 + year + u64::from(month <= 2);
    let second = seconds % 86_400;
    [year, month, day_of_month, second / 3600, second / 60 % 60, second % 60]
}

/// `20260131T235959Z`, for names.
pub(crate) fn compact(ns: u64) -> String {
    let [year, month, day, hour, minute, second] = civil(ns / 1_000_000_000);
    format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z")
}

/// `2026-01-31T23:59:59.123Z`.
pub(crate) fn readable(ns: u64) -> String {
    let [year, month, day, hour, minute, second] = civil(ns / 1_000_000_000);
    let milli = ns / 1_000_000 % 1000;
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{milli:03}Z")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_moments_have_their_dates() {
        // The values are those of `date -u -d @SECONDS`.
        for (seconds, date) in [
            (0, "19700101T000000Z"),
            (951_782_399, "20000228T235959Z"),
            (951_782_400, "20000229T000000Z"),
            (1_735_689_599, "20241231T235959Z"),
            (4_107_542_400, "21000301T000000Z"),
        ] {
            assert_eq!(compact(seconds * 1_000_000_000), date);
        }
        assert_eq!(readable(1_735_689_599_042_999_999), "2024-12-31T23:59:59.042Z");
    }
}
