use foxhunt_core::{EstimatorError, parameter::require};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::count::number;

/// Up to this many degrees of freedom the quantiles are worked out once.
const TABLE: usize = 8;

/// Keeps out an observation whose normalised innovation squared (NIS) is too large.
///
/// ```
/// # use foxhunt_filters::Gate;
/// # fn main() -> Result<(), foxhunt_core::EstimatorError> {
/// // Let in 99.9 % of what a consistent filter sees, but never shut out more than five in a row.
/// let gate = Gate::probability(0.999)?.with_most_rejections(5);
/// assert!((gate.limit(2) - 13.816).abs() < 1e-3);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    limit: GateLimit,
    /// The limits for 1 … `TABLE` components.
    table: [f64; TABLE],
    free_steps: u32,
    most_rejections: u32,
}

/// Rule for a [`Gate`]'s limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GateLimit {
    /// Everything is let in.
    Open,
    /// The χ² quantile at this probability, of as many degrees of freedom as components are
    /// present: the share of its observations that a consistent filter lets in.
    Probability(f64),
    /// This NIS, however many components are present.
    Nis(f64),
}

impl Gate {
    /// A gate with this limit and no exceptions.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when a probability is not in (0, 1) or a NIS not positive.
    pub fn new(limit: GateLimit) -> Result<Self, EstimatorError> {
        match limit {
            GateLimit::Open => return Ok(Self::open()),
            GateLimit::Probability(p) => {
                require(p > 0.0 && p < 1.0, "gate probability", p, "in (0, 1)")?
            }
            GateLimit::Nis(nis) => require(nis > 0.0, "gate limit", nis, "positive")?,
        };
        let table = core::array::from_fn(|i| limit.of(i + 1));
        Ok(Self { limit, table, ..Self::open() })
    }

    /// Lets everything in.
    #[must_use]
    pub const fn open() -> Self {
        let table = [f64::INFINITY; TABLE];
        Self { limit: GateLimit::Open, table, free_steps: 0, most_rejections: u32::MAX }
    }

    /// Lets in this share of what a consistent filter sees.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is not in (0, 1).
    pub fn probability(probability: f64) -> Result<Self, EstimatorError> {
        Self::new(GateLimit::Probability(probability))
    }

    /// The reference's rule (Pritzl 2018, §4.4): limit 4 · χ²₂(0.95) however many components are
    /// present, at most 3 rejections in a row, none in the first 3 steps.
    #[must_use]
    pub fn pritzl2018() -> Self {
        // χ²₂ has the quantile −2 ln(1 − p).
        let limit = 4.0 * -2.0 * libm::log1p(-0.95);
        let table = [limit; TABLE];
        Self { limit: GateLimit::Nis(limit), table, free_steps: 3, most_rejections: 3 }
    }

    /// Opens the gate for the first `steps` updates.
    #[must_use]
    pub const fn with_free_steps(self, steps: u32) -> Self {
        Self { free_steps: steps, ..self }
    }

    /// Sets the number of rejections in a row after which the next observation is let in, whatever
    /// its NIS: a filter that shuts out all that it receives is wrong itself.
    #[must_use]
    pub const fn with_most_rejections(self, rejections: u32) -> Self {
        Self { most_rejections: rejections, ..self }
    }

    /// The limit for an observation of `dof` components.
    #[must_use]
    #[inline]
    pub fn limit(&self, dof: usize) -> f64 {
        match dof {
            0 => f64::INFINITY,
            1..=TABLE => self.table[dof - 1],
            _ => self.limit.of(dof),
        }
    }
}

impl Default for Gate {
    /// [`Gate::open`].
    fn default() -> Self {
        Self::open()
    }
}

impl GateLimit {
    fn of(self, dof: usize) -> f64 {
        match self {
            Self::Open => f64::INFINITY,
            Self::Nis(nis) => nis,
            // A χ² needs a positive number of degrees of freedom, which this is.
            Self::Probability(p) => ChiSquared::new(number(dof))
                .map_or(f64::INFINITY, |chi_squared| chi_squared.inverse_cdf(p)),
        }
    }
}

/// Record of a gate's updates so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Record {
    steps: u32,
    rejections: u32,
}

impl Record {
    /// The limit that keeps this NIS out, if it is kept out, and the record afterwards.
    #[inline]
    pub(crate) fn judge(self, gate: &Gate, nis: f64, dof: usize) -> (Option<f64>, Self) {
        let limit = gate.limit(dof);
        let out =
            nis > limit && self.steps >= gate.free_steps && self.rejections < gate.most_rejections;
        let steps = self.steps.saturating_add(1);
        let rejections = if out { self.rejections.saturating_add(1) } else { 0 };
        (out.then_some(limit), Self { steps, rejections })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        let gate = Gate::probability(0.95).expect("in range");
        // Abramowitz & Stegun 1964, table 26.8, and −2 ln 0.05; statrs stops at 1e-9.
        for (dof, quantile) in [
            (1, 3.841_458_820_694),
            (2, 5.991_464_547_108),
            (3, 7.814_727_903_251),
            (10, 18.307_038_053_275),
        ] {
            let error = gate.limit(dof) - quantile;
            assert!(error.abs() < 1e-8, "{dof} degrees of freedom: off by {error}");
        }
        for dof in [1, 2, 9] {
            let error = Gate::pritzl2018().limit(dof) - 23.965_858_188_431_916;
            assert_abs_diff_eq!(error, 0.0, epsilon = 1e-13);
            assert!(Gate::open().limit(dof).is_infinite());
        }
        assert!(gate.limit(0).is_infinite());
    }

    #[test]
    fn limits_out_of_range_are_refused() {
        for p in [0.0, 1.0, -0.5, f64::NAN] {
            assert!(matches!(Gate::probability(p), Err(EstimatorError::Parameter(_))), "{p}");
        }
        for nis in [0.0, -1.0, f64::NAN] {
            assert!(matches!(Gate::new(GateLimit::Nis(nis)), Err(EstimatorError::Parameter(_))));
        }
    }

    #[test]
    fn the_reference_has_two_exceptions() {
        let judged = |outliers: &[bool]| {
            let mut record = Record::default();
            outliers
                .iter()
                .map(|&outlier| {
                    let nis = if outlier { 24.0 } else { 23.9 };
                    let (limit, next) = record.judge(&Gate::pritzl2018(), nis, 2);
                    record = next;
                    limit.is_some()
                })
                .eq(EXPECTED.iter().copied().take(outliers.len()))
        };
        // Three free steps; three rejections; the fourth is let in and the count starts anew.
        const EXPECTED: [bool; 9] = [false, false, false, true, true, true, false, true, false];
        assert!(judged(&[true, true, true, true, true, true, true, true, false]));
    }
}
