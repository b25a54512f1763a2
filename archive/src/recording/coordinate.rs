//! Numbers and coordinates as the cells of a table have them.

use std::borrow::Cow;

use super::{FieldProblem, utm};

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
fn numbers(text: &str) -> Option<[&str; 2]> {
    let halves = |between: &str| {
        let mut parts = text.split(between).map(str::trim).filter(|part| !part.is_empty());
        let numbers = [parts.next()?, parts.next()?];
        let have_digits = numbers.iter().all(|half| half.contains(|c: char| c.is_ascii_digit()));
        (parts.next().is_none() && have_digits).then_some(numbers)
    };
    [";", "/", ", ", " ", ","].into_iter().find_map(halves)
}

/// Returns the two numbers of a cell that holds a place: as they are written, or latitude and
/// longitude where the place is one of UTM or a grid reference.
///
/// # Errors
///
/// [`FieldProblem::NotAPair`], or [`FieldProblem::NotAZone`] for a zone without a hemisphere.
pub(super) fn pair(cell: &str) -> Result<[Cow<'_, str>; 2], FieldProblem> {
    match utm::place(cell) {
        Some(place) => place.map(|degrees| degrees.map(|degree| Cow::Owned(degree.to_string()))),
        None => numbers(cell).map(|pair| pair.map(Cow::Borrowed)).ok_or(FieldProblem::NotAPair),
    }
}

/// Degrees of a latitude or longitude that is written with minutes, seconds or a hemisphere:
/// 48°12′3″N, N48 12.05, 16.3725 E.
pub(super) fn degrees(text: &str, is_latitude: bool) -> Result<f64, FieldProblem> {
    let letters: Vec<char> = text.chars().filter(|c| c.is_alphabetic() && *c != 'º').collect();
    let south = match letters.as_slice() {
        [] => None,
        [letter] => Some(is_negative(*letter, is_latitude)?),
        _ => return Err(FieldProblem::NotDegrees),
    };
    let trimmed = text.trim();
    let is_outside = |c: Option<char>| c.is_some_and(|c| letters.contains(&c));
    if south.is_some() && !is_outside(trimmed.chars().next()) && !is_outside(trimmed.chars().last())
    {
        return Err(FieldProblem::NotDegrees);
    }
    let has_sign = trimmed.chars().any(|c| "°º˚'’′\"”″".contains(c) || c.is_alphabetic());
    let is_between = |c: char| c.is_alphabetic() || c.is_whitespace() || "°º˚'’′\"”″:".contains(c);
    let numbers: Vec<&str> = trimmed.split(is_between).filter(|part| !part.is_empty()).collect();
    if numbers.len() > 3 || numbers.is_empty() || (numbers.len() == 1 && !has_sign) {
        return Err(FieldProblem::NotANumber);
    }
    let is_negative = numbers.first().is_some_and(|first| first.starts_with('-'));
    let mut degrees = 0.0;
    for (index, text) in numbers.iter().enumerate() {
        let is_last = index + 1 == numbers.len();
        let text = if index == 0 { text.trim_start_matches(['-', '+']) } else { text };
        let is_number = text.bytes().all(|byte| byte.is_ascii_digit() || b".,".contains(&byte));
        let number = text.replace(',', ".").parse::<f64>().ok().filter(|_| is_number);
        let number = number.ok_or(FieldProblem::NotDegrees)?;
        let is_part = index == 0 || number < 60.0;
        if !is_part || (!is_last && number.fract() > 0.0) {
            return Err(FieldProblem::NotDegrees);
        }
        degrees += number / [1.0, 60.0, 3600.0].get(index).copied().unwrap_or(1.0);
    }
    match south {
        // A sign beside a hemisphere would be counted twice, or not at all.
        Some(_) if is_negative => Err(FieldProblem::NotDegrees),
        Some(true) => Ok(-degrees),
        _ if is_negative => Ok(-degrees),
        _ => Ok(degrees),
    }
}

/// Returns true for the name of a column of longitudes that is German.
pub(super) fn is_german(name: &str) -> bool {
    let name = name.to_lowercase();
    ["länge", "laenge", "ost"].iter().any(|word| name.contains(word))
}

/// True for South and West.
fn is_negative(letter: char, is_latitude: bool) -> Result<bool, FieldProblem> {
    match (letter.to_ascii_uppercase(), is_latitude) {
        ('N', true) | ('E', false) => Ok(false),
        ('S', true) | ('W', false) => Ok(true),
        // Ost, but oeste and ouest.
        ('O', false) => Err(FieldProblem::EastOrWest),
        ('N' | 'S' | 'E' | 'W' | 'O', _) => Err(FieldProblem::OtherHemisphere),
        _ => Err(FieldProblem::NotDegrees),
    }
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    use super::*;

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
            assert_eq!(numbers(text), Some(["48.2", "16.37"]), "{text}");
        }
        assert_eq!(numbers("48,2 16,37"), Some(["48,2", "16,37"]));
        assert_eq!(numbers("48.2° N, 16.37° E"), Some(["48.2° N", "16.37° E"]));
        for text in ["", "48.2", "roof", "1,2,3", "a, b"] {
            assert_eq!(numbers(text), None, "{text}");
        }
    }

    #[test]
    fn degrees_minutes_and_seconds_are_degrees() {
        let expected = 48.0 + 12.0 / 60.0 + 3.0 / 3600.0;
        for text in [
            "48°12′3″N",
            "48° 12' 3\" N",
            "N 48 12 3",
            "48°12'03''N",
            "48º12.05'n",
            "48°12,05'N",
            "N48 12.05",
            "48:12:3",
            "48.200833333333333 N",
            "48,200833333333333°",
        ] {
            let read = degrees(text, true).unwrap_or(f64::NAN);
            assert!(abs_diff_eq!(read, expected, epsilon = 1e-9), "{text}: {read}");
        }
        assert_eq!(degrees("16°30'W", false), Ok(-16.5));
        assert_eq!(degrees("-16°30'", false), Ok(-16.5));
        assert_eq!(degrees("33.5S", true), Ok(-33.5));
    }

    #[test]
    fn what_is_no_place_is_refused() {
        for (text, problem) in [
            ("48°12'3\"E", FieldProblem::OtherHemisphere),
            ("48°61'N", FieldProblem::NotDegrees),
            ("48.5°12'N", FieldProblem::NotDegrees),
            ("-48°12'S", FieldProblem::NotDegrees),
            ("48°N12'", FieldProblem::NotDegrees),
            ("north", FieldProblem::NotDegrees),
            ("48.2.1", FieldProblem::NotANumber),
            ("1 2 3 4", FieldProblem::NotANumber),
            ("", FieldProblem::NotANumber),
        ] {
            assert_eq!(degrees(text, true), Err(problem), "{text}");
        }
        assert_eq!(degrees("16°30'O", false), Err(FieldProblem::EastOrWest));
    }
}
