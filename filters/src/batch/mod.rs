//! Estimates from all observations of a still target at once: the cost that all of them have, and
//! the errors of everything that minimises it.

mod dependence;
mod descent;
mod estimator;
mod solver;

use core::f64::consts::TAU;

use foxhunt_core::{
    Axis, Covariance, MeasurementModel, Observation, State, numeric_jacobian,
    parameter::{ParameterError, finite, positive},
};
use nalgebra::{SMatrix, SVector, Vector1};

use crate::{Gaussian, count::number};

pub use dependence::independent_share;
pub use estimator::BatchEstimator;
pub use solver::{BatchFix, BatchSolver};

/// Reason that observations were not turned into an estimate.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BatchError {
    /// There is too little to go by.
    #[error("there are {have} {what}, and {need} are needed")]
    TooFew {
        /// Name of the entries, in the plural.
        what: &'static str,
        /// Number present.
        have: usize,
        /// Number needed.
        need: usize,
    },
    /// A number that came in is NaN, infinite or, where it must be, not positive.
    #[error("entry {index}: {error}")]
    Value {
        /// Index of the entry in its list, from 0.
        index: usize,
        /// The number, and what it must be.
        error: ParameterError,
    },
    /// Times do not ascend.
    #[error("time {index}: {seconds} s after the one before; it must be later")]
    Order {
        /// Index of the time, from 0.
        index: usize,
        /// Time since the one before, in seconds.
        seconds: f64,
    },
    /// A setting is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The model or its Jacobian is not finite at a start, or the prior has no factor.
    #[error("the {what} is not finite or not positive definite")]
    Improper {
        /// Name of the part.
        what: &'static str,
    },
    /// The likelihood is flat: the observations leave a direction of the state undetermined.
    #[error("the likelihood is flat: the reciprocal condition of the information is {rcond:e}")]
    Flat {
        /// The least over the largest eigenvalue of the information, each component in its own
        /// unit; 0 where it has none.
        rcond: f64,
    },
    /// The iterates ran out of every bounded region: the likelihood grows towards infinity.
    #[error("the estimate ran away to {distance_m:e} m, beyond {limit_m:e} m")]
    RanAway {
        /// Distance from the middle of the receivers, in metres.
        distance_m: f64,
        /// Largest distance allowed, in metres.
        limit_m: f64,
    },
    /// The iteration did not settle.
    #[error("no convergence after {iterations} iterations")]
    NotConverged {
        /// Number of iterations.
        iterations: u32,
    },
    /// The iteration settled where the directions contradict the place: no maximum.
    #[error("the bearings contradict the place that they meet in: mean cosine {mean_cosine}")]
    Contradiction {
        /// The mean cosine of the bearings' errors.
        mean_cosine: f64,
    },
}

/// The loss of an observation's whitened residual, by its squared norm q: half of ρ(q).
///
/// The robust ones are minimised by reweighting: each observation counts ρ′(q). With one
/// component present, √q is the residual in standard deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Loss {
    /// ρ = q: Gaussian noise, least squares.
    #[default]
    Gaussian,
    /// ρ = q up to k², then 2k√q − k² (Huber 1964): bounded influence, convex.
    Huber {
        /// Number of standard deviations from which on the cost grows linearly; 1.345 keeps 95 %
        /// efficiency for Gaussian noise.
        k: f64,
    },
    /// ρ = c² ln(1 + q/c²) (Holland & Welsch 1977): far outliers do not count.
    Cauchy {
        /// The scale in standard deviations; 2.385 keeps 95 % efficiency for Gaussian noise.
        c: f64,
    },
    /// ρ = (ν + m) ln(1 + q/ν), m the components present: the noise is Student's t with the
    /// observation's covariance for its scale matrix (Lange, Little & Taylor 1989).
    StudentT {
        /// ν: 4 is usual.
        degrees: f64,
    },
}

impl Loss {
    fn check(self) -> Result<Self, BatchError> {
        match self {
            Self::Gaussian => {}
            Self::Huber { k } => {
                positive("k", k)?;
            }
            Self::Cauchy { c } => {
                positive("c", c)?;
            }
            Self::StudentT { degrees } => {
                positive("degrees", degrees)?;
            }
        }
        Ok(self)
    }

    /// ρ(q) and its derivative for `m` components.
    fn of(&self, q: f64, m: f64) -> (f64, f64) {
        match *self {
            Self::Huber { k } if q > k * k => {
                let root = libm::sqrt(q);
                (2.0 * k * root - k * k, k / root)
            }
            Self::Gaussian | Self::Huber { .. } => (q, 1.0),
            Self::Cauchy { c } => (c * c * libm::log1p(q / (c * c)), 1.0 / (1.0 + q / (c * c))),
            Self::StudentT { degrees } => {
                ((degrees + m) * libm::log1p(q / degrees), (degrees + m) / (degrees + q))
            }
        }
    }
}

/// An observation, and apart from it what a censored one adds.
#[derive(Clone, Debug)]
struct Datum<const M: usize> {
    observation: Observation<M>,
    /// The observation reduced to components that lay below a limit, if any.
    silence: Option<Observation<M>>,
    /// Number of independent observations that it stands for.
    count: f64,
}

impl<const M: usize> Datum<M> {
    fn new(observation: Observation<M>) -> Self {
        let silence =
            (0..M).filter(|i| observation.has(*i)).fold(observation, Observation::without);
        let silence = observation.is_censored().then_some(silence);
        Self { observation, silence, count: 1.0 }
    }

    /// Returns the datum without its angles.
    fn without_angles<H, const N: usize>(&self, model: &H) -> Self
    where
        H: MeasurementModel<N, M>,
    {
        let angles = model.axes().map(|axis| axis == Axis::Angle);
        let rest = (0..M).filter(|i| angles[*i]).fold(self.observation, Observation::without);
        Self { count: self.count, ..Self::new(rest) }
    }

    /// The residual at `x` in units of its noise, zero where a component is missing.
    fn white<H, const N: usize>(&self, model: &H, x: &State<N>) -> SVector<f64, M>
    where
        H: MeasurementModel<N, M>,
    {
        let expected = model.expected(x, self.observation.receiver());
        let residual = model.residual(self.observation.value(), &expected);
        let residual = self.observation.strike(residual);
        self.observation.noise_factor().solve_lower_triangular_unchecked(&residual)
    }

    /// Returns true if some component lay below a limit.
    fn is_silent(&self) -> bool {
        self.silence.is_some()
    }

    /// The model's log-likelihood of the components below their limits, as often as it counts.
    fn log_silence<H, const N: usize>(&self, model: &H, x: &State<N>) -> f64
    where
        H: MeasurementModel<N, M>,
    {
        self.silence.as_ref().map_or(0.0, |silence| self.count * model.log_likelihood(x, silence))
    }

    /// The Gaussian's normaliser: −½ m ln 2π − ln |R|^½.
    fn normaliser(&self) -> f64 {
        let log_root: f64 =
            self.observation.noise_factor().diagonal().iter().map(|d| libm::log(*d)).sum();
        self.count * (-0.5 * number(self.observation.len()) * libm::log(TAU) - log_root)
    }
}

/// A cost and how it changes about a state.
#[derive(Clone, Debug)]
struct Local<const N: usize> {
    cost: f64,
    gradient: State<N>,
    /// Gauss and Newton's approximation of the Hessian: the information.
    information: Covariance<N>,
}

/// −ln p(Z | x) − ln p(x), less its constants.
#[derive(Debug)]
struct Problem<'a, H, const N: usize, const M: usize> {
    model: &'a H,
    data: &'a [Datum<M>],
    prior: Option<&'a Gaussian<N>>,
    loss: Loss,
    /// Factor of all observations' covariances.
    scale: f64,
}

impl<H, const N: usize, const M: usize> Problem<'_, H, N, M>
where
    H: MeasurementModel<N, M>,
{
    /// The whitened difference from the prior's mean.
    fn apart_from_mean(&self, x: &State<N>) -> Option<State<N>> {
        let prior = self.prior?;
        Some(prior.factor().solve_lower_triangular_unchecked(&(x - prior.mean())))
    }

    fn cost(&self, x: &State<N>) -> f64 {
        let misfit = |datum: &Datum<M>| {
            let m = number(datum.observation.len());
            datum.count * self.loss.of(datum.white(self.model, x).norm_squared(), m).0
        };
        let sum: f64 = self.data.iter().map(misfit).sum();
        let apart = self.apart_from_mean(x).map_or(0.0, |w| w.norm_squared());
        let silence: f64 = self.data.iter().map(|datum| datum.log_silence(self.model, x)).sum();
        0.5 * (sum / self.scale + apart) - silence
    }

    fn local(&self, x: &State<N>) -> Local<N> {
        let mut cost = 0.0;
        let mut gradient = State::<N>::zeros();
        let mut information = Covariance::<N>::zeros();
        for datum in self.data {
            let white = datum.white(self.model, x);
            let m = number(datum.observation.len());
            let (misfit, weight) = self.loss.of(white.norm_squared(), m);
            let misfit = datum.count * misfit;
            let weight = datum.count * weight;
            let jacobian = self.model.jacobian(x, datum.observation.receiver());
            let jacobian = datum.observation.strike(jacobian);
            let slope =
                datum.observation.noise_factor().solve_lower_triangular_unchecked(&jacobian);
            cost += misfit;
            gradient -= slope.transpose() * white * weight;
            information += slope.transpose() * slope * weight;
        }
        cost /= self.scale;
        gradient /= self.scale;
        information /= self.scale;
        for datum in self.data.iter().filter(|datum| datum.is_silent()) {
            let log = |x: &State<N>| Vector1::new(datum.log_silence(self.model, x));
            let score = numeric_jacobian(x, log, |a, b| a - b);
            cost -= 2.0 * datum.log_silence(self.model, x);
            gradient -= score.transpose();
            // The outer product of the score has the information's mean.
            information += score.transpose() * score;
        }
        if let (Some(prior), Some(white)) = (self.prior, self.apart_from_mean(x)) {
            let back = prior.factor().transpose();
            cost += white.norm_squared();
            gradient += back.solve_upper_triangular_unchecked(&white);
            let whitener = SMatrix::<f64, N, N>::identity();
            let whitener = prior.factor().solve_lower_triangular_unchecked(&whitener);
            information += whitener.transpose() * whitener;
        }
        Local { cost: 0.5 * cost, gradient, information }
    }

    /// Returns the sum of all normalisers, which turns a cost into a log-density.
    fn normaliser(&self) -> f64 {
        let own: f64 = self.data.iter().map(Datum::normaliser).sum();
        let each = self.data.iter().map(|datum| datum.count * number(datum.observation.len()));
        let components: f64 = each.sum();
        let prior = self.prior.map_or(0.0, |prior| {
            let log_root: f64 = prior.factor().diagonal().iter().map(|d| libm::log(*d)).sum();
            -0.5 * number(N) * libm::log(TAU) - log_root
        });
        own - 0.5 * components * libm::log(self.scale) + prior
    }

    /// Returns true if an angle is present.
    fn has_angle(&self, datum: &Datum<M>) -> bool {
        let axes = self.model.axes();
        (0..M).any(|i| axes[i] == Axis::Angle && datum.observation.has(i))
    }

    /// Returns the number of observations with a component below a limit.
    fn silent(&self) -> usize {
        self.data.iter().filter(|datum| datum.is_silent()).count()
    }

    /// Returns the number of components present.
    fn components(&self) -> usize {
        self.data.iter().map(|datum| datum.observation.len()).sum()
    }

    /// Each observation's weight, and its squared residual in its own standard deviations.
    fn weights(&self, x: &State<N>) -> impl Iterator<Item = (f64, f64)> {
        self.data.iter().map(move |datum| {
            let q = datum.white(self.model, x).norm_squared();
            (self.loss.of(q, number(datum.observation.len())).1, q)
        })
    }
}

/// Refuses an entry's number that is not finite.
pub(crate) fn finite_entry(
    name: &'static str,
    index: usize,
    value: f64,
) -> Result<f64, BatchError> {
    finite(name, value).map_err(|error| BatchError::Value { index, error })
}

/// Refuses an entry's number that is not positive and finite.
pub(crate) fn positive_entry(
    name: &'static str,
    index: usize,
    value: f64,
) -> Result<f64, BatchError> {
    positive(name, value).map_err(|error| BatchError::Value { index, error })
}

/// Refuses fewer entries than it takes.
pub(crate) fn at_least(what: &'static str, have: usize, need: usize) -> Result<(), BatchError> {
    if have < need { Err(BatchError::TooFew { what, have, need }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_derivatives() {
        let losses = [
            Loss::Gaussian,
            Loss::Huber { k: 1.345 },
            Loss::Cauchy { c: 2.385 },
            Loss::StudentT { degrees: 4.0 },
        ];
        for loss in losses {
            for q in [0.1, 1.0, 1.8, 1.82, 9.0, 400.0] {
                let step = 1e-6 * q;
                let numeric = (loss.of(q + step, 2.0).0 - loss.of(q - step, 2.0).0) / (2.0 * step);
                assert!((loss.of(q, 2.0).1 - numeric).abs() < 1e-7, "{loss:?} at {q}");
            }
        }
        assert!(Loss::Huber { k: 0.0 }.check().is_err());
        assert!(Loss::Cauchy { c: f64::NAN }.check().is_err());
        assert!(Loss::StudentT { degrees: -1.0 }.check().is_err());
    }
}
