use std::str::FromStr;

use serde::Deserialize;

use super::Value;

/// North from which a recording's angles are counted: bearings, headings and boresights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(try_from = "Value")]
#[non_exhaustive]
pub enum North {
    /// True North, that of the meridian; North of the frame for places in metres.
    #[default]
    True,
    /// North of a compass, by the World Magnetic Model of place and day
    /// ([`foxhunt_wire::declination`]).
    Magnetic,
    /// North of the UTM grid, as on maps; North of the frame for places in metres.
    Grid,
    /// This many degrees east of true North: a declination that is known otherwise.
    Stated(f64),
}

impl TryFrom<Value> for North {
    type Error = String;

    fn try_from(value: Value) -> Result<Self, String> {
        match value {
            Value::Number(deg) if deg.abs() <= 180.0 => Ok(Self::Stated(deg)),
            Value::Text(text) if text == "true" => Ok(Self::True),
            Value::Text(text) if text == "magnetic" => Ok(Self::Magnetic),
            Value::Text(text) if text == "grid" => Ok(Self::Grid),
            value => Err(format!(
                "{value} is no North: true, magnetic, grid, or degrees east of true North from \
                 -180 to 180"
            )),
        }
    }
}

impl FromStr for North {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.parse().map_or_else(|_| Value::from(text), Value::Number).try_into()
    }
}
