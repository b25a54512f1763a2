use foxhunt_core::{
    EstimatorError,
    parameter::{not_negative, require},
};

/// Limits to the linearisations of an update, each about the posterior of the one before.
///
/// ```
/// # use foxhunt_filters::Iterations;
/// # fn main() -> Result<(), foxhunt_core::EstimatorError> {
/// let iterations = Iterations::at_most(10)?.with_tolerance(1e-6)?;
/// assert_eq!(iterations.max(), 10);
/// assert_eq!(Iterations::once().max(), 1);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iterations {
    max: u32,
    tolerance: f64,
}

impl Iterations {
    /// About the prior, and that is all: the textbook's update.
    #[must_use]
    pub const fn once() -> Self {
        Self { max: 1, tolerance: 1e-3 }
    }

    /// At most `max` linearisations, fewer when two posteriors in a row differ by less than 10⁻³
    /// nats, which is a shift of 0.045 standard deviations.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when `max` is not in 1..=1000: what has not come to rest by
    /// then goes round in circles.
    pub fn at_most(max: u32) -> Result<Self, EstimatorError> {
        require((1..=1000).contains(&max), "iterations", f64::from(max), "in 1..=1000")?;
        Ok(Self { max, ..Self::once() })
    }

    /// Sets the tolerance: the Kullback-Leibler divergence in nats of a posterior from the one
    /// before it, below which there is no further iteration.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is negative or not finite.
    pub fn with_tolerance(self, tolerance: f64) -> Result<Self, EstimatorError> {
        Ok(Self { tolerance: not_negative("iteration tolerance", tolerance)?, ..self })
    }

    /// The most linearisations of one update.
    #[must_use]
    pub const fn max(&self) -> u32 {
        self.max
    }

    /// The divergence, in nats, that ends the iteration.
    #[must_use]
    pub const fn tolerance(&self) -> f64 {
        self.tolerance
    }
}

impl Default for Iterations {
    /// [`Iterations::once`].
    fn default() -> Self {
        Self::once()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_out_of_range_are_refused() {
        assert!(Iterations::at_most(0).is_err() && Iterations::at_most(1001).is_err());
        for tolerance in [-1e-9, f64::NAN, f64::INFINITY] {
            assert!(Iterations::once().with_tolerance(tolerance).is_err(), "{tolerance}");
        }
        assert_eq!(Iterations::at_most(1), Ok(Iterations::once()));
    }
}
