//! Quantities that are measured, their values, and the geometry of a vector's components.

use core::fmt;

use nalgebra::SVector;

use crate::angle;

/// The geometry of a vector's component: the real line, or the circle of angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// A component on the real line.
    Linear,
    /// A component on the circle, in radians.
    Angle,
}

impl Axis {
    /// `a ⊖ b` on each axis: the short way round on a circle.
    #[must_use]
    pub fn difference<const D: usize>(
        axes: &[Axis; D],
        a: &SVector<f64, D>,
        b: &SVector<f64, D>,
    ) -> SVector<f64, D> {
        SVector::from_fn(|i, _| axes[i].minus(a[i], b[i]))
    }

    /// `a ⊖ b` of one component: the short way round on a circle.
    #[must_use]
    #[inline(always)]
    pub fn minus(self, a: f64, b: f64) -> f64 {
        match self {
            Axis::Linear => a - b,
            Axis::Angle => angle::wrap(a - b),
        }
    }
}

/// A physical quantity that a receiver measures: one component of a measurement, by its name and
/// its geometry.
///
/// Two quantities are the same if name and geometry are. The name carries the unit. It is what
/// joins a measurement model to what is fed to it: a model of ranges in metres is never given
/// levels in dBm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quantity {
    name: &'static str,
    axis: Axis,
}

impl Quantity {
    /// The received power, in dBm.
    pub const RSS: Self = Self::linear("rss_dbm");
    /// The direction of arrival, in radians counter-clockwise from East.
    pub const BEARING: Self = Self::angle("bearing_rad");
    /// The direction of a directional antenna while a level was received, in radians
    /// counter-clockwise from East.
    pub const BORESIGHT: Self = Self::angle("boresight_rad");
    /// The distance from the receiver to the target, in metres.
    pub const RANGE: Self = Self::linear("range_m");
    /// The target's distance from the receiver less that from a reference, in metres.
    pub const RANGE_DIFFERENCE: Self = Self::linear("range_difference_m");
    /// The target's level at the receiver less that at a reference, in dB.
    pub const RSS_DIFFERENCE: Self = Self::linear("rss_difference_db");

    /// A quantity on the real line, of a name that carries its unit, such as `doppler_hz`.
    #[must_use]
    pub const fn linear(name: &'static str) -> Self {
        Self { name, axis: Axis::Linear }
    }

    /// A quantity on the circle, in radians.
    #[must_use]
    pub const fn angle(name: &'static str) -> Self {
        Self { name, axis: Axis::Angle }
    }

    /// Returns the name of the quantity, with its unit.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the geometry of the quantity.
    #[must_use]
    pub const fn axis(&self) -> Axis {
        self.axis
    }

    /// Returns the geometry of each.
    #[must_use]
    pub fn axes<const M: usize>(quantities: &[Self; M]) -> [Axis; M] {
        core::array::from_fn(|i| quantities[i].axis)
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name)
    }
}

/// One measured value of a quantity that is neither level nor bearing, as receptions carry it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The name of the quantity.
    pub name: QuantityName,
    /// The value, in the unit of the name.
    pub value: f64,
    /// Standard deviation of the value, in the same unit.
    pub sigma: f64,
}

impl Measured {
    /// A measured value of a quantity.
    ///
    /// # Errors
    ///
    /// [`MeasuredError`] when the name is too long, the value not finite or σ not positive.
    pub fn new(quantity: Quantity, value: f64, sigma: f64) -> Result<Self, MeasuredError> {
        Self::named(quantity.name(), value, sigma)
    }

    /// A measured value of a quantity of this name.
    ///
    /// # Errors
    ///
    /// [`MeasuredError`] when the name is too long, the value not finite or σ not positive.
    pub fn named(name: &str, value: f64, sigma: f64) -> Result<Self, MeasuredError> {
        let name = QuantityName::new(name)?;
        if !value.is_finite() {
            return Err(MeasuredError::Value { name, value });
        }
        if !(sigma > 0.0 && (sigma * sigma).is_finite() && sigma * sigma > 0.0) {
            return Err(MeasuredError::Sigma { name, sigma });
        }
        Ok(Self { name, value, sigma })
    }
}

/// The name of a quantity as it stands in a log: up to 31 bytes, kept in place.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct QuantityName {
    bytes: [u8; QuantityName::CAPACITY],
    length: u8,
}

impl QuantityName {
    /// Maximum length of a name, in bytes.
    pub const CAPACITY: usize = 31;

    /// A name of 1 to 31 bytes.
    ///
    /// # Errors
    ///
    /// [`MeasuredError::Name`] for one that is empty or longer.
    pub fn new(name: &str) -> Result<Self, MeasuredError> {
        let count = name.len();
        let mut bytes = [0; Self::CAPACITY];
        let error = MeasuredError::Name { length: count };
        let place = bytes.get_mut(..count).filter(|_| count > 0).ok_or(error)?;
        place.copy_from_slice(name.as_bytes());
        let length = u8::try_from(count).map_err(|_| error)?;
        Ok(Self { bytes, length })
    }

    /// The name as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let bytes = self.bytes.get(..usize::from(self.length)).unwrap_or(&[]);
        core::str::from_utf8(bytes).unwrap_or("")
    }
}

impl fmt::Debug for QuantityName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

impl fmt::Display for QuantityName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

/// Reason for refusing a measured value.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasuredError {
    /// The name has no letter, or too many.
    #[error("the name of a quantity has {length} bytes; it must have 1 to 31")]
    Name {
        /// Length of the name in bytes.
        length: usize,
    },
    /// The value is NaN or infinite.
    #[error("{name} is {value}, not a finite number")]
    Value {
        /// Name of the quantity.
        name: QuantityName,
        /// The value.
        value: f64,
    },
    /// The standard deviation is not positive, or its square is not finite.
    #[error("the standard deviation of {name} is {sigma}, not a positive number")]
    Sigma {
        /// Name of the quantity.
        name: QuantityName,
        /// The standard deviation.
        sigma: f64,
    },
    /// There are too many values.
    #[error("{count} values besides level and bearing; there is room for {capacity}")]
    TooMany {
        /// The number of values.
        count: usize,
        /// The maximum number of values.
        capacity: usize,
    },
}

/// Values of a reception besides level and bearing: up to four, kept in place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "alloc::vec::Vec<Written>"))]
#[cfg_attr(feature = "serde", serde(into = "alloc::vec::Vec<Written>"))]
pub struct MeasuredList {
    values: [Option<Measured>; MeasuredList::CAPACITY],
}

impl MeasuredList {
    /// Maximum number of values.
    pub const CAPACITY: usize = 4;

    /// A list of these values.
    ///
    /// # Errors
    ///
    /// [`MeasuredError::TooMany`] where there is no room for all.
    pub fn new(values: &[Measured]) -> Result<Self, MeasuredError> {
        let count = values.len();
        let capacity = Self::CAPACITY;
        if count > capacity {
            return Err(MeasuredError::TooMany { count, capacity });
        }
        let mut list = Self::default();
        for (place, value) in list.values.iter_mut().zip(values) {
            *place = Some(*value);
        }
        Ok(list)
    }

    /// The values.
    pub fn iter(&self) -> impl Iterator<Item = &Measured> {
        self.values.iter().flatten()
    }

    /// The value of a quantity, if there is one.
    #[must_use]
    pub fn get(&self, quantity: Quantity) -> Option<&Measured> {
        self.iter().find(|measured| measured.name.as_str() == quantity.name())
    }

    /// Returns true if there is no value.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.iter().next().is_none()
    }
}

#[cfg(feature = "serde")]
impl TryFrom<alloc::vec::Vec<Written>> for MeasuredList {
    type Error = MeasuredError;

    fn try_from(written: alloc::vec::Vec<Written>) -> Result<Self, MeasuredError> {
        let count = written.len();
        let capacity = Self::CAPACITY;
        if count > capacity {
            return Err(MeasuredError::TooMany { count, capacity });
        }
        let mut list = Self::default();
        for (place, Written { name, value, sigma }) in list.values.iter_mut().zip(written) {
            *place = Some(Measured::named(&name, value, sigma)?);
        }
        Ok(list)
    }
}

/// A measured value as it stands in a file.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    name: alloc::string::String,
    value: f64,
    sigma: f64,
}

#[cfg(feature = "serde")]
impl From<MeasuredList> for alloc::vec::Vec<Written> {
    fn from(list: MeasuredList) -> Self {
        let write = |measured: &Measured| Written {
            name: measured.name.as_str().into(),
            value: measured.value,
            sigma: measured.sigma,
        };
        list.iter().map(write).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_gives_back_what_it_was_made_of() {
        let range = Measured::new(Quantity::RANGE, 12.5, 0.5).expect("proper");
        let doppler = Quantity::linear("doppler_hz");
        let shift = Measured::new(doppler, -3.0, 1.0).expect("proper");
        let list = MeasuredList::new(&[range, shift]).expect("there is room");
        assert_eq!(list.get(doppler), Some(&shift));
        assert_eq!(list.get(Quantity::RANGE_DIFFERENCE), None);
        assert_eq!(list.iter().count(), 2);
        assert!(MeasuredList::new(&[range; 5]).is_err());
        assert!(MeasuredList::default().is_empty() && !list.is_empty());
    }

    #[test]
    fn what_is_no_measurement_is_refused() {
        assert!(Measured::new(Quantity::linear(""), 1.0, 1.0).is_err());
        assert!(Measured::new(Quantity::RANGE, f64::NAN, 1.0).is_err());
        assert!(Measured::new(Quantity::RANGE, 1.0, 0.0).is_err());
        assert!(Measured::new(Quantity::RANGE, 1.0, 1e200).is_err());
        let long = Quantity::linear("a_name_that_is_longer_than_thirty_one_bytes");
        assert!(Measured::new(long, 1.0, 1.0).is_err());
    }

    #[cfg(feature = "serde")]
    #[test]
    fn a_list_in_a_file_is_the_same_one() {
        let range = Measured::new(Quantity::RANGE, 12.5, 0.5).expect("proper");
        let list = MeasuredList::new(&[range]).expect("there is room");
        let text = serde_json::to_string(&list).expect("plain data");
        assert_eq!(text, r#"[{"name":"range_m","value":12.5,"sigma":0.5}]"#);
        assert_eq!(serde_json::from_str::<MeasuredList>(&text).expect("as written"), list);
        let bad = text.replace("0.5", "-0.5");
        assert!(serde_json::from_str::<MeasuredList>(&bad).is_err(), "σ is negative");
    }
}
