use foxhunt_core::{columns, parameter::ParameterError};

use crate::{LogDistance, Propagation};

/// The law of the received level where some of its parameters are unknown: these, `P` of them, are
/// the last components of the state.
///
/// Every [`Propagation`] is such a law without unknown parameters.
///
/// ```
/// use foxhunt_core::{MeasurementModel, Pose, nalgebra::Vector3};
/// use foxhunt_sensors::{Friis, LevelBearing, LevelLaw, Propagation};
///
/// /// Free space with an obstacle of unknown loss in dB before the receiver.
/// struct Obstructed(Friis);
///
/// impl LevelLaw<1> for Obstructed {
///     fn level_dbm(&self, [loss]: &[f64; 1], range: f64) -> f64 {
///         self.0.rss_dbm(range) - loss
///     }
///
///     fn range_slope(&self, _: &[f64; 1], range: f64, along: f64) -> f64 {
///         along * self.0.slope(range)
///     }
///
///     fn sensitivity(&self, _: &[f64; 1], _: f64) -> [f64; 1] {
///         [-1.0]
///     }
/// }
///
/// # fn main() -> Result<(), foxhunt_sensors::ParameterError> {
/// let law = Obstructed(Friis::new(20.0, 0.0, 0.0, 0.125)?);
/// let model = LevelBearing::<_, 1>::with_law(law);
/// let state = Vector3::new(30.0, 40.0, 6.0);
/// let jacobian = model.jacobian(&state, &Pose::default());
/// assert!((jacobian[(0, 2)] + 1.0).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
///
/// # Laws
///
/// All methods are finite at every range for finite parameters; `range_slope` and `sensitivity` are
/// the derivatives of `level_dbm`; `levels_dbm` agrees with it. Checked with the model:
/// `laws::measurement_model`.
pub trait LevelLaw<const P: usize> {
    /// The mean received power in dBm at `range` metres.
    fn level_dbm(&self, parameters: &[f64; P], range: f64) -> f64;

    /// Returns the derivative of the level over a coordinate with which the range grows by `along`
    /// metres per metre, in dB per metre: `along` ∂P/∂d.
    fn range_slope(&self, parameters: &[f64; P], range: f64, along: f64) -> f64;

    /// Returns the derivative of the level over the square of the range where that is `square` m²,
    /// not 0, in dB per m².
    fn square_slope(&self, parameters: &[f64; P], square: f64) -> f64 {
        let range = libm::sqrt(square);
        self.range_slope(parameters, range, 0.5 / range)
    }

    /// Returns the derivative of the level over ln d² in dB where that is the same at every range
    /// and for all parameters: the law is then linear in the logarithm and in the parameters.
    fn log_slope(&self) -> Option<f64> {
        None
    }

    /// Returns the derivatives of the level over the parameters.
    fn sensitivity(&self, parameters: &[f64; P], range: f64) -> [f64; P];

    /// The levels in dBm at many ranges, in the place of the squares of these in m²; a column for
    /// each parameter. Overridden as [`Propagation::many_rss_dbm`] is.
    #[inline(always)]
    fn levels_dbm(&self, parameters: [&[f64]; P], squares: &mut [f64]) {
        for (i, x) in squares.iter_mut().enumerate() {
            *x = self.level_dbm(&columns::row(&parameters, i), libm::sqrt(*x));
        }
    }
}

/// A law that is known.
impl<L: Propagation> LevelLaw<0> for L {
    fn level_dbm(&self, _: &[f64; 0], range: f64) -> f64 {
        self.rss_dbm(range)
    }

    fn range_slope(&self, _: &[f64; 0], range: f64, along: f64) -> f64 {
        along * self.slope(range)
    }

    fn square_slope(&self, _: &[f64; 0], square: f64) -> f64 {
        Propagation::square_slope(self, square)
    }

    fn log_slope(&self) -> Option<f64> {
        Propagation::log_slope(self)
    }

    fn sensitivity(&self, _: &[f64; 0], _: f64) -> [f64; 0] {
        []
    }

    #[inline(always)]
    fn levels_dbm(&self, _: [&[f64]; 0], squares: &mut [f64]) {
        self.many_rss_dbm(squares);
    }
}

/// The log-distance law P₀ − 10 γ log₁₀ d with an unknown P₀ in dBm and a known γ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreePower {
    /// The law with P₀ = 0.
    loss: LogDistance,
}

impl FreePower {
    /// The law with the path-loss exponent γ.
    ///
    /// # Errors
    ///
    /// If the exponent is not a positive number.
    pub fn new(exponent: f64) -> Result<Self, ParameterError> {
        Ok(Self { loss: LogDistance::new(0.0, exponent)? })
    }
}

/// The law with its reference power forgotten.
impl From<LogDistance> for FreePower {
    fn from(law: LogDistance) -> Self {
        Self { loss: law.without_reference() }
    }
}

impl LevelLaw<1> for FreePower {
    fn level_dbm(&self, [power]: &[f64; 1], range: f64) -> f64 {
        power + self.loss.rss_dbm(range)
    }

    fn range_slope(&self, _: &[f64; 1], range: f64, along: f64) -> f64 {
        along * self.loss.slope(range)
    }

    fn square_slope(&self, _: &[f64; 1], square: f64) -> f64 {
        Propagation::square_slope(&self.loss, square)
    }

    fn log_slope(&self) -> Option<f64> {
        Propagation::log_slope(&self.loss)
    }

    fn sensitivity(&self, _: &[f64; 1], _: f64) -> [f64; 1] {
        [1.0]
    }

    #[inline(always)]
    fn levels_dbm(&self, [powers]: [&[f64]; 1], squares: &mut [f64]) {
        self.loss.many_rss_dbm(squares);
        squares.iter_mut().zip(powers).for_each(|(level, power)| *level += power);
    }
}

/// The log-distance law P₀ − 10 γ log₁₀ d with an unknown P₀ in dBm and an unknown γ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FreePathLoss;

impl LevelLaw<2> for FreePathLoss {
    fn level_dbm(&self, [power, exponent]: &[f64; 2], range: f64) -> f64 {
        power + exponent * LogDistance::UNIT.rss_dbm(range)
    }

    fn range_slope(&self, [_, exponent]: &[f64; 2], range: f64, along: f64) -> f64 {
        exponent * (along * LogDistance::UNIT.slope(range))
    }

    fn sensitivity(&self, _: &[f64; 2], range: f64) -> [f64; 2] {
        [1.0, LogDistance::UNIT.rss_dbm(range)]
    }

    #[inline(always)]
    fn levels_dbm(&self, [powers, exponents]: [&[f64]; 2], squares: &mut [f64]) {
        LogDistance::UNIT.many_rss_dbm(squares);
        for ((level, power), exponent) in squares.iter_mut().zip(powers).zip(exponents) {
            *level = power + exponent * *level;
        }
    }
}
