use core::f64::consts::LN_10;

use super::{Propagation, SQUARES, clamp, many_log_distance};
use foxhunt_core::{
    elementary,
    parameter::{self, ParameterError},
};

/// The log-distance law, P(d) = P₀ − 10 γ log₁₀(d / 1 m) (Pritzl 2018, eq. 3.7).
///
/// Followed from 1 mm on; nearer, the power stays what it is there.
///
/// ```
/// use foxhunt_sensors::{LogDistance, Propagation};
/// # fn main() -> Result<(), foxhunt_sensors::ParameterError> {
/// let law = LogDistance::new(-30.0, 2.0)?;
/// assert!((law.rss_dbm(10.0) + 50.0).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Fields", into = "Fields"))]
pub struct LogDistance {
    reference_dbm: f64,
    exponent: f64,
}

impl LogDistance {
    /// P₀ = 0, γ = 1: the effect of one unit of the exponent.
    pub(crate) const UNIT: Self = Self { reference_dbm: 0.0, exponent: 1.0 };

    /// The law with the power P₀ at one metre, in dBm, and the exponent γ: 2 in free space, more
    /// near the ground.
    ///
    /// # Errors
    ///
    /// Names the parameter that is not finite, or the exponent that is not positive.
    pub fn new(reference_dbm: f64, exponent: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            reference_dbm: parameter::finite("reference_dbm", reference_dbm)?,
            exponent: parameter::positive("exponent", exponent)?,
        })
    }

    /// The law identified in the open field: P₀ = −29.06 dBm, γ = 2.765 (Pritzl 2018, §7.1).
    #[must_use]
    pub fn pritzl2018_field() -> Self {
        Self { reference_dbm: -29.06, exponent: 2.765 }
    }

    /// The law identified between houses: P₀ = −33.96 dBm, γ = 3 (Pritzl 2018, §7.2).
    #[must_use]
    pub fn pritzl2018_urban() -> Self {
        Self { reference_dbm: -33.96, exponent: 3.0 }
    }

    /// P₀: the power at one metre, in dBm.
    #[must_use]
    pub fn reference_dbm(&self) -> f64 {
        self.reference_dbm
    }

    /// γ: the fall of the power for each tenfold range, in tens of dB.
    #[must_use]
    pub fn exponent(&self) -> f64 {
        self.exponent
    }

    /// Sets P₀ = 0: the loss alone.
    pub(crate) fn without_reference(self) -> Self {
        Self { reference_dbm: 0.0, ..self }
    }
}

impl Propagation for LogDistance {
    #[inline]
    fn rss_dbm(&self, range: f64) -> f64 {
        self.reference_dbm - 10.0 / LN_10 * self.exponent * elementary::ln(clamp(range).0)
    }

    #[inline]
    fn slope(&self, range: f64) -> f64 {
        let (range, inside) = clamp(range);
        if inside { -10.0 * self.exponent / (LN_10 * range) } else { 0.0 }
    }

    #[inline]
    fn square_slope(&self, square: f64) -> f64 {
        let inside = SQUARES.contains(&square);
        if inside { -5.0 / LN_10 * self.exponent / square } else { 0.0 }
    }

    #[inline]
    fn log_slope(&self) -> Option<f64> {
        Some(-5.0 / LN_10 * self.exponent)
    }

    #[inline(always)]
    fn many_rss_dbm(&self, squares: &mut [f64]) {
        many_log_distance(squares, self.reference_dbm, self.exponent);
    }
}

/// The fields as they stand in a file; read back only through [`LogDistance::new`].
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Fields {
    reference_dbm: f64,
    exponent: f64,
}

#[cfg(feature = "serde")]
impl TryFrom<Fields> for LogDistance {
    type Error = ParameterError;

    fn try_from(fields: Fields) -> Result<Self, ParameterError> {
        Self::new(fields.reference_dbm, fields.exponent)
    }
}

#[cfg(feature = "serde")]
impl From<LogDistance> for Fields {
    fn from(law: LogDistance) -> Self {
        Self { reference_dbm: law.reference_dbm, exponent: law.exponent }
    }
}
