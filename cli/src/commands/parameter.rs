use std::str::FromStr;

use foxhunt::nalgebra::Vector3;

/// A number of the propagation law that is known, or estimated along with the place.
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

/// A place in the local frame, as the command line has it: East, North and Up in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EastNorthUp([f64; 3]);

impl FromStr for EastNorthUp {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<f64>, _> =
            text.split(',').map(|part| part.trim().parse()).collect();
        match numbers.as_deref() {
            Ok([east, north, up]) if [east, north, up].iter().all(|v| v.is_finite()) => {
                Ok(Self([*east, *north, *up]))
            }
            _ => Err("it must be E,N,U in metres, such as 0,0,1.5".to_owned()),
        }
    }
}

impl From<EastNorthUp> for Vector3<f64> {
    fn from(EastNorthUp(place): EastNorthUp) -> Self {
        place.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_three_numbers() {
        assert_eq!("-1, 2,0.5".parse(), Ok(EastNorthUp([-1.0, 2.0, 0.5])));
        for text in ["1,2", "1,2,3,4", "1,2,x", "1,2,inf"] {
            assert!(text.parse::<EastNorthUp>().is_err(), "{text}");
        }
    }
}
