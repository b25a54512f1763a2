use std::fmt;

use serde::Deserialize;

/// A value that a mapping or a user gives: a number or a text.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "a number or a text")]
pub enum Value {
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
}

impl Value {
    /// Returns true if a cell holds this value: the same text, or a number equal to it.
    pub(super) fn is(&self, cell: &str) -> bool {
        match self {
            Self::Text(text) => text == cell,
            Self::Number(number) => {
                cell.parse::<f64>().is_ok_and(|c| c.partial_cmp(number).is_some_and(|o| o.is_eq()))
            }
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_compared_as_numbers() {
        assert!(Value::from(-9999.0).is("-9999.0"));
        assert!(Value::from(5.0).is("5"));
        assert!(!Value::from(5.0).is("5.1") && !Value::from(5.0).is("five"));
        assert!(Value::from("none").is("none") && !Value::from("none").is("None"));
        assert!(!Value::from(f64::NAN).is("NaN"));
    }
}
