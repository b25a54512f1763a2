use std::{borrow::Cow, str::FromStr};

use chrono::NaiveDate;

/// Day 0 of a spreadsheet's dates is this many days before 1970.
const SERIAL_1970: f64 = 25_569.0;

/// Serial days of the years 1982 to 2064.
const SERIALS: std::ops::Range<f64> = 30_000.0..60_000.0;

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;

/// The farthest offset from UTC in seconds.
const MOST_ZONE_S: f64 = 14.0 * 3600.0;

/// Names of months begin with these letters in English, German, French and Spanish.
const MONTHS: [&[&str]; 12] = [
    &["jan", "jän", "ene"],
    &["feb", "fév", "fev"],
    &["mar", "mär", "mrz"],
    &["apr", "avr", "abr"],
    &["may", "mai"],
    &["jun", "juin"],
    &["jul", "juil"],
    &["aug", "aoû", "aou", "ago"],
    &["sep"],
    &["oct", "okt"],
    &["nov"],
    &["dec", "dez", "déc", "dic"],
];

/// The way in which a table writes its times, where the cells leave it open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TimeFormat {
    /// Day, month, year: 3/4/2026 is in April.
    Dmy,
    /// Month, day, year: 3/4/2026 is in March.
    Mdy,
    /// Year, month, day, with two digits of the year: 26/4/3.
    Ymd,
    /// Days of a spreadsheet: 46194.58 is a time of 2026-06-21.
    Excel,
    /// Numbers are seconds, of whatever size they are.
    Seconds,
}

impl TimeFormat {
    /// Every format, with its name.
    const NAMES: [(&str, Self); 5] = [
        ("dmy", Self::Dmy),
        ("mdy", Self::Mdy),
        ("ymd", Self::Ymd),
        ("excel", Self::Excel),
        ("seconds", Self::Seconds),
    ];
}

impl FromStr for TimeFormat {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let named = Self::NAMES.into_iter().find(|(name, _)| *name == text);
        named.map(|(_, format)| format).ok_or("it must be dmy, mdy, ymd, excel or seconds")
    }
}

/// The offset from UTC of times that state none, in seconds; East is positive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TimeZone {
    east_s: f64,
}

impl FromStr for TimeZone {
    type Err = &'static str;

    /// `UTC`, `Z`, `+02:00`, `+0530` or `-5`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        zone(text.trim()).map(|east_s| Self { east_s }).ok_or(
            "it must be an offset from UTC such as +02:00 or -5; names of zones are not known, as \
             their offset changes in summer",
        )
    }
}

/// The order of day and month that a date shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// The date can be read, or cannot be read, in any case.
    Clear,
    /// Only as this format.
    Shown(TimeFormat),
    /// As several.
    Open,
}

/// Times of a file: the stated or found format, and the offset of times without one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Times {
    pub format: Option<TimeFormat>,
    pub zone: TimeZone,
}

impl Times {
    /// The seconds since 1970 of a number that is a time.
    pub(super) fn of_number(&self, number: f64) -> Option<f64> {
        let is_serial = match self.format {
            Some(TimeFormat::Excel) => true,
            Some(TimeFormat::Seconds) => false,
            _ => is_serial(number),
        };
        if is_serial && !is_serial_range(number) {
            return None;
        }
        if is_serial {
            // To the microsecond, as a day's fraction is rarely a whole number of seconds.
            let seconds = ((number - SERIAL_1970) * DAY_S * 1e6).round() / 1e6;
            return Some(seconds - self.zone.east_s);
        }
        (0.0..1e11).contains(&number).then_some(number)
    }

    /// The seconds since 1970 of a date and time.
    pub(super) fn of_text(&self, text: &str) -> Option<f64> {
        let written = Written::read(text)?;
        let clock_s = written.clock_s?;
        let date = written.date(self.format)?;
        let midnight = date.and_hms_opt(0, 0, 0)?.and_utc().timestamp();
        #[expect(clippy::cast_precision_loss, reason = "chrono's years end before 2^53 seconds")]
        let midnight = midnight as f64;
        Some(midnight + clock_s - written.zone_s.unwrap_or(self.zone.east_s))
    }
}

/// Returns true for a number that may be a spreadsheet's date and time.
pub(super) fn is_serial(number: f64) -> bool {
    is_serial_range(number) && number.fract().abs() > 1e-9
}

fn is_serial_range(number: f64) -> bool {
    SERIALS.contains(&number)
}

/// Returns true for a date and time, in whatever order.
pub(super) fn is_date(text: &str) -> bool {
    Written::read(text).is_some_and(|of| of.clock_s.is_some() && of.parts.len() == 3)
}

/// Returns true for a date without a time.
pub(super) fn is_day(text: &str) -> bool {
    Written::read(text).is_some_and(|of| of.clock_s.is_none() && of.parts.len() == 3)
}

/// The seconds since midnight of a time without a date, such as 14:03 or 2:03:07.5 PM.
pub(super) fn clock_seconds(text: &str) -> Option<f64> {
    let written = Written::read(text)?;
    written.clock_s.filter(|_| written.parts.is_empty() && written.zone_s.is_none())
}

/// The order of day and month that a text shows.
pub(super) fn order(text: &str) -> Order {
    let Some(written) = Written::read(text) else { return Order::Clear };
    if written.date(None).is_some() {
        return match written.needs_order() {
            true => written.shown(),
            false => Order::Clear,
        };
    }
    if written.needs_order() { written.shown() } else { Order::Clear }
}

/// A part of a date.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    /// A number, and the number of its digits.
    Number(u32, usize),
    /// A month's name.
    Month(u32),
}

/// A date and time in parts.
#[derive(Debug, Default, PartialEq)]
struct Written {
    parts: Vec<Part>,
    /// True if dots separate the parts.
    dotted: bool,
    /// Seconds since midnight.
    clock_s: Option<f64>,
    zone_s: Option<f64>,
}

impl Written {
    /// Reads the parts; `None` for a text that is neither a date nor a time.
    fn read(text: &str) -> Option<Self> {
        let mut written = Self::default();
        let mut is_afternoon = None;
        let is_space = |c: char| c.is_whitespace() || c == ',' || c == '\u{202f}';
        let text = &joined_meridiem(text);
        for word in text.split(is_space).flat_map(split_t) {
            if word.is_empty() {
                continue;
            }
            if let Some(afternoon) = meridiem(word) {
                is_afternoon = Some(afternoon);
            } else if written.clock_s.is_some() && zone(word).is_some() {
                written.zone_s = zone(word);
            } else if let Some((hour, minute)) = hour_and_minute(word) {
                written.clock_s = Some(clock_of(&format!("{hour}:{minute}"))?);
            } else if word.contains(':') {
                let (rest, afternoon) = glued_meridiem(word);
                is_afternoon = afternoon.or(is_afternoon);
                let end = rest.find(['+', '-', 'Z', 'z']).unwrap_or(rest.len());
                let (clock, offset) = rest.split_at_checked(end)?;
                if !offset.is_empty() {
                    written.zone_s = Some(zone(offset)?);
                }
                written.clock_s = Some(clock_of(clock)?);
            } else {
                written.dotted |= word.contains('.');
                for part in word.split(['-', '/', '.']).filter(|part| !part.is_empty()) {
                    written.parts.push(part_of(part)?);
                }
            }
        }
        if let Some(afternoon) = is_afternoon {
            let clock = written.clock_s?;
            // 12:03 AM is three minutes past midnight.
            let hour = clock / 3600.0;
            if !(1.0..13.0).contains(&hour) {
                return None;
            }
            let morning = if hour >= 12.0 { clock - DAY_S / 2.0 } else { clock };
            written.clock_s = Some(if afternoon { morning + DAY_S / 2.0 } else { morning });
        }
        let is_whole = matches!(written.parts.len(), 0 | 3);
        (is_whole && (written.clock_s.is_some() || written.parts.len() == 3)).then_some(written)
    }

    /// True if neither a year in front, a month's name nor dots tell the order.
    fn needs_order(&self) -> bool {
        matches!(
            (self.parts.as_slice(), self.dotted),
            ([Part::Number(_, 1 | 2), Part::Number(..), Part::Number(..)], false)
        )
    }

    /// The order that is the only one possible.
    fn shown(&self) -> Order {
        let [Part::Number(first, _), Part::Number(second, _), Part::Number(_, digits)] =
            self.parts.as_slice()
        else {
            return Order::Clear;
        };
        if *digits != 4 {
            return Order::Open;
        }
        match (*first > 12, *second > 12) {
            (true, true) => Order::Clear,
            (true, false) => Order::Shown(TimeFormat::Dmy),
            (false, true) => Order::Shown(TimeFormat::Mdy),
            (false, false) if first == second => Order::Clear,
            (false, false) => Order::Open,
        }
    }

    fn date(&self, format: Option<TimeFormat>) -> Option<NaiveDate> {
        let [a, b, c] = self.parts.as_slice() else { return None };
        let number = |part: &Part| match part {
            Part::Number(number, _) => *number,
            Part::Month(month) => *month,
        };
        let month = |part: &Part| matches!(part, Part::Month(_));
        let is_year = |part: &Part| matches!(part, Part::Number(_, 4));
        let [year, month, day] = match format {
            _ if is_year(a) => [a, b, c],
            _ if month(b) => [c, b, a],
            _ if month(a) => [c, a, b],
            _ if self.dotted => [c, b, a],
            Some(TimeFormat::Dmy) => [c, b, a],
            Some(TimeFormat::Mdy) => [c, a, b],
            Some(TimeFormat::Ymd) => [a, b, c],
            _ => match self.shown() {
                Order::Shown(TimeFormat::Mdy) => [c, a, b],
                Order::Shown(_) | Order::Clear => [c, b, a],
                Order::Open => return None,
            },
        };
        let year = match year {
            Part::Number(number, 4) => *number,
            Part::Number(number, 2) => 2000 + number,
            _ => return None,
        };
        NaiveDate::from_ymd_opt(i32::try_from(year).ok()?, number(month), number(day))
    }
}

/// A text whose Spanish `p. m.` is one word.
fn joined_meridiem(text: &str) -> Cow<'_, str> {
    // Most texts are dates that end with a digit.
    if !text.ends_with(['m', '.']) {
        return Cow::Borrowed(text);
    }
    let spaces = [". m", ".\u{a0}m", ".\u{202f}m"];
    match spaces.into_iter().find(|space| text.contains(space)) {
        Some(space) => Cow::Owned(text.replace(space, ".m")),
        None => Cow::Borrowed(text),
    }
}

/// The hour and minute of a French time: 14h03.
fn hour_and_minute(word: &str) -> Option<(&str, &str)> {
    let is_short =
        |part: &str| matches!(part.len(), 1 | 2) && part.bytes().all(|byte| byte.is_ascii_digit());
    word.split_once(['h', 'H']).filter(|(hour, minute)| is_short(hour) && is_short(minute))
}

/// A word of ISO 8601 in two: date and time.
fn split_t(word: &str) -> [&str; 2] {
    let between = |at: &usize| {
        let digit = |at: usize| word.as_bytes().get(at).is_some_and(u8::is_ascii_digit);
        at.checked_sub(1).is_some_and(digit) && digit(at + 1)
    };
    match word.find('T').filter(between) {
        Some(at) => [word.get(..at).unwrap_or_default(), word.get(at + 1..).unwrap_or_default()],
        None => [word, ""],
    }
}

fn part_of(part: &str) -> Option<Part> {
    if part.bytes().all(|byte| byte.is_ascii_digit()) {
        return Some(Part::Number(part.parse().ok()?, part.len()));
    }
    let lower = part.to_lowercase();
    let is = |names: &[&str]| names.iter().any(|name| lower.starts_with(name));
    let month = MONTHS.iter().position(|names| is(names))?;
    Some(Part::Month(u32::try_from(month).ok()? + 1))
}

/// True for PM, false for AM.
fn meridiem(word: &str) -> Option<bool> {
    // Most words are numbers.
    if word.len() > 4 || !word.starts_with(['a', 'A', 'p', 'P']) {
        return None;
    }
    let letters: String = word.chars().filter(|c| *c != '.').collect();
    match letters.to_ascii_lowercase().as_str() {
        "am" => Some(false),
        "pm" => Some(true),
        _ => None,
    }
}

/// A clock without AM or PM at its end.
fn glued_meridiem(word: &str) -> (&str, Option<bool>) {
    let at = word.find(['a', 'A', 'p', 'P']);
    let parts = at.and_then(|at| word.split_at_checked(at));
    match parts.and_then(|(clock, end)| Some((clock, meridiem(end)?))) {
        Some((clock, afternoon)) => (clock, Some(afternoon)),
        None => (word, None),
    }
}

/// The seconds since midnight of hours, minutes and, if there are any, seconds.
fn clock_of(text: &str) -> Option<f64> {
    let mut parts = text.split(':');
    let whole = |part: &str, limit: u32| {
        let is_short = matches!(part.len(), 1 | 2) && part.bytes().all(|b| b.is_ascii_digit());
        part.parse::<u32>().ok().filter(|number| is_short && *number < limit)
    };
    let hour = whole(parts.next()?, 24)?;
    let minute = whole(parts.next()?, 60)?;
    let second = match parts.next() {
        None => 0.0,
        Some(text) => {
            let is_number = text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
            text.parse::<f64>().ok().filter(|second| is_number && (0.0..61.0).contains(second))?
        }
    };
    if parts.next().is_some() {
        return None;
    }
    Some(f64::from(hour * 3600 + minute * 60) + second)
}

/// An offset from UTC in seconds.
fn zone(text: &str) -> Option<f64> {
    if ["z", "utc", "gmt"].contains(&text.to_ascii_lowercase().as_str()) {
        return Some(0.0);
    }
    let (sign, digits) = match text.strip_prefix('+') {
        Some(digits) => (1.0, digits),
        None => (-1.0, text.strip_prefix('-')?),
    };
    let (hours, minutes) = match digits.split_once(':') {
        Some(parts) => parts,
        None if digits.len() > 2 => digits.split_at_checked(digits.len() - 2)?,
        None => (digits, "0"),
    };
    let is_whole = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit()) && part.len() < 3;
    if !is_whole(hours) || !is_whole(minutes) {
        return None;
    }
    let minutes = minutes.parse::<u32>().ok().filter(|minutes| *minutes < 60)?;
    let seconds = f64::from(hours.parse::<u32>().ok()? * 3600 + minutes * 60);
    (seconds <= MOST_ZONE_S).then_some(sign * seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `date -u -d '2026-06-21 14:03' +%s`
    const SUMMER: f64 = 1_782_050_580.0;

    fn seconds(text: &str, format: Option<TimeFormat>) -> Option<f64> {
        Times { format, zone: TimeZone::default() }.of_text(text)
    }

    #[test]
    fn dates_are_read_as_spreadsheets_write_them() {
        for text in [
            "2026-06-21 14:03:00",
            "2026-06-21T14:03Z",
            "2026-06-21T16:03:00.000+02:00",
            "2026-06-21 16:03+0200",
            "2026-06-21 09:03 -05:00",
            "2026/06/21 14:03",
            "21.06.2026 14:03",
            "21.6.26, 14:03:00",
            "6/21/2026 2:03 PM",
            "6/21/2026 2:03:00PM",
            "06/21/2026, 2:03 p.m.",
            "21/06/2026 14:03",
            "21-Jun-2026 14:03",
            "21 juin 2026 14:03",
            "Jun 21, 2026 2:03 PM",
            "21-06-2026 14:03:00 UTC",
        ] {
            assert_eq!(seconds(text, None), Some(SUMMER), "{text}");
        }
        for wrong in [
            "21.13.2026 14:03",
            "2026-06-21",
            "14:03",
            "21.06.2026 24:03",
            "21.06.2026 14:60",
            "6/21/2026 14:03 PM",
            "6/21/2026 0:03 PM",
            "21.06 14:03",
            "1.2.3",
            "noon",
            "",
            "3/4/2026 14:03",
            "13/13/2026 14:03",
            "6/21/26 14:03",
        ] {
            assert_eq!(seconds(wrong, None), None, "{wrong}");
        }
        assert_eq!(seconds("6/21/26 14:03", Some(TimeFormat::Mdy)), Some(SUMMER));
        assert_eq!(seconds("26/6/21 14:03", Some(TimeFormat::Ymd)), Some(SUMMER));
        let half_past_midnight = seconds("6/21/2026 12:30 AM", None);
        assert_eq!(half_past_midnight, seconds("2026-06-21 00:30", None));
    }

    #[test]
    fn the_order_is_the_only_one_possible_or_stated() {
        let april = seconds("2026-04-03 10:00", None);
        assert_eq!(seconds("3/4/2026 10:00", Some(TimeFormat::Dmy)), april);
        assert_eq!(seconds("4/3/2026 10:00", Some(TimeFormat::Mdy)), april);
        assert_eq!(order("3/4/2026 10:00"), Order::Open);
        assert_eq!(order("4/4/2026 10:00"), Order::Clear);
        assert_eq!(order("13/4/2026 10:00"), Order::Shown(TimeFormat::Dmy));
        assert_eq!(order("4/13/2026 10:00"), Order::Shown(TimeFormat::Mdy));
        for clear in ["2026-04-03 10:00", "3.4.2026 10:00", "1782050580", "noon"] {
            assert_eq!(order(clear), Order::Clear, "{clear}");
        }
    }

    #[test]
    fn serial_days_and_zones_are_seconds() {
        let times = Times::default();
        // 2026-06-21 is day 46194; 14:03 is 0.585416… of it.
        assert_eq!(times.of_number(46_194.0 + 14.05 / 24.0), Some(SUMMER));
        assert_eq!(times.of_number(46_194.0), Some(46_194.0));
        let zone = "+02:00".parse().expect("an offset");
        let local = Times { format: Some(TimeFormat::Excel), zone };
        assert_eq!(local.of_number(46_194.0 + 16.05 / 24.0), Some(SUMMER));
        assert_eq!(local.of_number(7.0), None);
        assert_eq!(local.of_text("21.06.2026 16:03"), Some(SUMMER));
        assert_eq!(local.of_text("21.06.2026 14:03Z"), Some(SUMMER));
        let seconds = Times { format: Some(TimeFormat::Seconds), ..times };
        assert_eq!(seconds.of_number(46_194.5), Some(46_194.5));
        for (text, east_s) in [("UTC", 0.0), ("+0530", 19_800.0), ("-5", -18_000.0)] {
            assert_eq!(text.parse(), Ok(TimeZone { east_s }), "{text}");
        }
        for wrong in ["Europe/Prague", "+15", "2", "+1:70", ""] {
            assert!(wrong.parse::<TimeZone>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn clocks_alone_are_seconds_of_the_day() {
        for (text, expected) in [("14:03", 50_580.0), ("2:03:07.5 PM", 50_587.5), ("0:00", 0.0)] {
            assert_eq!(clock_seconds(text), Some(expected), "{text}");
        }
        for wrong in ["14", "21.06.2026 14:03", "14:03:61", "14:03+02:00"] {
            assert_eq!(clock_seconds(wrong), None, "{wrong}");
        }
    }
}
