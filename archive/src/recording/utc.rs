use chrono::{DateTime, NaiveDateTime};

/// Seconds since 1970 as `YYYY-MM-DD HH:MM:SS.fff`, without a fraction of zero; empty if there is
/// no such date.
#[must_use]
pub fn utc(seconds: f64) -> String {
    #[expect(clippy::cast_possible_truncation, reason = "casts saturate, to no date")]
    let date = DateTime::from_timestamp_millis((seconds * 1e3).round() as i64);
    date.map_or_else(String::new, |date| date.naive_utc().to_string())
}

/// The seconds since 1970 of `YYYY-MM-DD HH:MM:SS`, with a `T` for the space, a fraction, and a `Z`
/// or an offset from UTC such as `+02:00` where given; `None` for any other text.
#[must_use]
pub fn utc_seconds(text: &str) -> Option<f64> {
    let text = text.strip_suffix('Z').unwrap_or(text).replacen('T', " ", 1);
    let in_utc = NaiveDateTime::parse_from_str(&text, "%Y-%m-%d %H:%M:%S%.f");
    let time = match in_utc {
        Ok(time) => time.and_utc(),
        Err(_) => DateTime::parse_from_str(&text, "%Y-%m-%d %H:%M:%S%.f%:z").ok()?.to_utc(),
    };
    #[expect(clippy::cast_precision_loss, reason = "chrono's years end long before 2^53 seconds")]
    let whole = time.timestamp() as f64;
    Some(whole + f64::from(time.timestamp_subsec_nanos()) * 1e-9)
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

    #[test]
    fn times_are_utc_seconds() {
        // `date -u -d '2021-03-21 16:51:48' +%s`
        assert_eq!(utc_seconds("2021-03-21 16:51:48"), Some(1_616_345_508.0));
        assert_eq!(utc_seconds("2021-03-21T16:51:48.25Z"), Some(1_616_345_508.25));
        for east in ["2021-03-21 18:51:48+02:00", "2021-03-21T11:51:48.000-05:00"] {
            assert_eq!(utc_seconds(east), Some(1_616_345_508.0), "{east}");
        }
        assert_eq!(utc_seconds("1969-12-31 23:59:59"), Some(-1.0));
        for wrong in ["2021-02-30 00:00:00", "2021-03-21", "16:51:48", "2021-03-21 16:51:48 x"] {
            assert_eq!(utc_seconds(wrong), None, "{wrong}");
        }
    }
}
