use chrono::DateTime;

/// Seconds since 1970 as `YYYY-MM-DD HH:MM:SS.fff`, without the fraction where it is nothing;
/// empty where there is no such date.
pub(crate) fn utc(seconds: f64) -> String {
    #[expect(clippy::cast_possible_truncation, reason = "casts saturate, to no date")]
    let date = DateTime::from_timestamp_millis((seconds * 1e3).round() as i64);
    date.map_or_else(String::new, |date| date.naive_utc().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_dates() {
        assert_eq!(utc(1_616_345_508.25), "2021-03-21 16:51:48.250");
        assert_eq!(utc(-1.0), "1969-12-31 23:59:59");
        assert_eq!(utc(f64::INFINITY), "");
    }
}
