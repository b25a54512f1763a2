use std::borrow::Cow;

/// Units that may stand behind a number and leave it as it is.
const UNITS: [&str; 6] = ["dbfs", "dbm", "db", "°", "m", "s"];

/// The number in a cell that no program wrote for another: with another minus, its unit behind it,
/// or its digits in groups of three. A comma alone is a decimal one where `comma_is_decimal`.
pub(super) fn number(text: &str, comma_is_decimal: impl Fn(&str) -> bool) -> Option<f64> {
    let text = match text.strip_prefix(['−', '–']) {
        Some(rest) => Cow::Owned(format!("-{rest}")),
        None => Cow::Borrowed(text),
    };
    let text = without_unit(&text);
    if let Ok(number) = text.parse() {
        return Some(number);
    }
    if let Some(whole) = ungrouped(text) {
        return whole.parse().ok();
    }
    (is_decimal(text, ',') && comma_is_decimal(text))
        .then(|| text.replace(',', ".").parse().ok())?
}

/// Returns true for digits with a sign in front of them and a point between them.
pub(super) fn is_decimal(text: &str, point: char) -> bool {
    let parts = text.trim_start_matches(['-', '+']).split_once(point);
    parts.is_some_and(|(whole, part)| are_digits(whole) && are_digits(part))
}

fn are_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// A text without the unit behind its last digit.
fn without_unit(text: &str) -> &str {
    let end = text.rfind(|c: char| c.is_ascii_digit()).map_or(0, |at| at + 1);
    let (number, unit) = text.split_at_checked(end).unwrap_or((text, ""));
    let unit = unit.trim();
    if UNITS.iter().any(|known| unit.eq_ignore_ascii_case(known)) { number } else { text }
}

/// Digits in groups of three with the groups joined and a decimal point: 5.339.437,0; 5,339,437.0;
/// 5 339 437,0. A single sign may be a decimal one, and is not taken for a group's.
fn ungrouped(text: &str) -> Option<String> {
    let body = text.trim_start_matches(['-', '+']);
    let sign = text.get(..text.len() - body.len())?;
    for (group, point) in [('.', ','), (',', '.'), (' ', ','), ('\u{a0}', ','), ('\u{202f}', ',')] {
        let (whole, part) = body.split_once(point).map_or((body, None), |(w, p)| (w, Some(p)));
        let mut groups = whole.split(group);
        let is_first = groups.next().is_some_and(|of| are_digits(of) && of.len() <= 3);
        let rest: Vec<&str> = groups.collect();
        let are_groups = rest.iter().all(|of| are_digits(of) && of.len() == 3);
        let is_clear = rest.len() > 1 || part.is_some() || group.is_whitespace();
        if is_first && are_groups && !rest.is_empty() && is_clear && part.is_none_or(are_digits) {
            let part = part.map_or(String::new(), |part| format!(".{part}"));
            return Some(format!("{sign}{}{part}", whole.replace(group, "")));
        }
    }
    None
}

/// The two numbers of a cell, as of a place: 48.2, 16.37, or 48,2; 16,37, or 48,2 16,37.
pub(super) fn pair(text: &str) -> Option<[&str; 2]> {
    let halves = |between: &str| {
        let mut parts = text.split(between).map(str::trim).filter(|part| !part.is_empty());
        let pair = [parts.next()?, parts.next()?];
        let have_digits = pair.iter().all(|half| half.contains(|c: char| c.is_ascii_digit()));
        (parts.next().is_none() && have_digits).then_some(pair)
    };
    [";", "/", ", ", " ", ","].into_iter().find_map(halves)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn numbers_of_people_are_numbers() {
        for (text, expected) in [
            ("−94.4", -94.4),
            ("-94,4 dBm", -94.4),
            ("-94.4dBm", -94.4),
            ("–60 dB", -60.0),
            ("601.799,0", 601_799.0),
            ("-5.339.437", -5_339_437.0),
            ("5,339,437.5", 5_339_437.5),
            ("601\u{a0}799,25", 601_799.25),
            ("48,2000000", 48.2),
        ] {
            let read = number(text, |_| true).unwrap_or(f64::NAN);
            assert_abs_diff_eq!(read, expected, epsilon = 1e-9);
        }
        for text in ["", "dBm", "94 km", "1.2.3", "12,34,567", "--4", "a,b"] {
            assert_eq!(number(text, |_| true), None, "{text}");
        }
        assert_eq!(number("1,234", |_| false), None);
    }

    #[test]
    fn a_cell_may_hold_a_place() {
        for text in ["48.2, 16.37", "48.2,16.37", "48.2;16.37", "48.2 16.37", "48.2 / 16.37"] {
            assert_eq!(pair(text), Some(["48.2", "16.37"]), "{text}");
        }
        assert_eq!(pair("48,2 16,37"), Some(["48,2", "16,37"]));
        assert_eq!(pair("48.2° N, 16.37° E"), Some(["48.2° N", "16.37° E"]));
        for text in ["", "48.2", "roof", "1,2,3", "a, b"] {
            assert_eq!(pair(text), None, "{text}");
        }
    }
}
