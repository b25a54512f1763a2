use std::borrow::Cow;

use super::{FieldProblem, number, utm};

/// Returns the two numbers of a cell that holds a place: as they are written, or latitude and
/// longitude where the place is one of UTM or a grid reference.
///
/// # Errors
///
/// [`FieldProblem::NotAPair`], or [`FieldProblem::NotAZone`] for a zone without a hemisphere.
pub(super) fn pair(cell: &str) -> Result<[Cow<'_, str>; 2], FieldProblem> {
    match utm::place(cell) {
        Some(place) => place.map(|degrees| degrees.map(|degree| Cow::Owned(degree.to_string()))),
        None => {
            number::pair(cell).map(|pair| pair.map(Cow::Borrowed)).ok_or(FieldProblem::NotAPair)
        }
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
    use super::*;
    use approx::abs_diff_eq;

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
