use std::str::FromStr;

/// A number of the propagation law that is known, or to be found along with the place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Parameter {
    Free,
    Value(f64),
}

impl FromStr for Parameter {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "free" {
            return Ok(Self::Free);
        }
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Self::Value(value)),
            _ => Err("it must be a number or `free`".to_owned()),
        }
    }
}
