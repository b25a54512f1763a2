use core::f64::consts::TAU;

use foxhunt_core::{Axis, Covariance, MeasurementModel, Observation, State, numeric_jacobian};
use nalgebra::{SMatrix, SVector, Vector1};

use super::Loss;
use crate::{Gaussian, count::number};

/// An observation, and apart from it what a censored one adds.
#[derive(Clone, Debug)]
pub(super) struct Datum<const M: usize> {
    pub(super) observation: Observation<M>,
    /// The observation reduced to components that lay below a limit, if any.
    silence: Option<Observation<M>>,
    /// Number of independent observations that it stands for.
    pub(super) count: f64,
}

impl<const M: usize> Datum<M> {
    pub(super) fn new(observation: Observation<M>) -> Self {
        let silence =
            (0..M).filter(|i| observation.has(*i)).fold(observation, Observation::without);
        let silence = observation.is_censored().then_some(silence);
        Self { observation, silence, count: 1.0 }
    }

    /// Returns the datum without its angles.
    pub(super) fn without_angles<H, const N: usize>(&self, model: &H) -> Self
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
    pub(super) fn is_silent(&self) -> bool {
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
    pub(super) fn normaliser(&self) -> f64 {
        let log_root: f64 =
            self.observation.noise_factor().diagonal().iter().map(|d| libm::log(*d)).sum();
        self.count * (-0.5 * number(self.observation.len()) * libm::log(TAU) - log_root)
    }
}

/// A cost and how it changes about a state.
#[derive(Clone, Debug)]
pub(super) struct Local<const N: usize> {
    pub(super) cost: f64,
    pub(super) gradient: State<N>,
    /// Gauss and Newton's approximation of the Hessian: the information.
    pub(super) information: Covariance<N>,
}

/// −ln p(Z | x) − ln p(x), less its constants.
#[derive(Debug)]
pub(super) struct Problem<'a, H, const N: usize, const M: usize> {
    pub(super) model: &'a H,
    pub(super) data: &'a [Datum<M>],
    pub(super) prior: Option<&'a Gaussian<N>>,
    pub(super) loss: Loss,
    /// Factor of all observations' covariances.
    pub(super) scale: f64,
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

    pub(super) fn cost(&self, x: &State<N>) -> f64 {
        let misfit = |datum: &Datum<M>| {
            let m = number(datum.observation.len());
            datum.count * self.loss.of(datum.white(self.model, x).norm_squared(), m).0
        };
        let sum: f64 = self.data.iter().map(misfit).sum();
        let apart = self.apart_from_mean(x).map_or(0.0, |w| w.norm_squared());
        let silence: f64 = self.data.iter().map(|datum| datum.log_silence(self.model, x)).sum();
        0.5 * (sum / self.scale + apart) - silence
    }

    pub(super) fn local(&self, x: &State<N>) -> Local<N> {
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
    pub(super) fn normaliser(&self) -> f64 {
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
    pub(super) fn has_angle(&self, datum: &Datum<M>) -> bool {
        let axes = self.model.axes();
        (0..M).any(|i| axes[i] == Axis::Angle && datum.observation.has(i))
    }

    /// Returns the number of observations with a component below a limit.
    pub(super) fn silent(&self) -> usize {
        self.data.iter().filter(|datum| datum.is_silent()).count()
    }

    /// Returns the number of components present.
    pub(super) fn components(&self) -> usize {
        self.data.iter().map(|datum| datum.observation.len()).sum()
    }

    /// Each observation's weight, and its squared residual in its own standard deviations.
    pub(super) fn weights(&self, x: &State<N>) -> impl Iterator<Item = (f64, f64)> {
        self.data.iter().map(move |datum| {
            let q = datum.white(self.model, x).norm_squared();
            (self.loss.of(q, number(datum.observation.len())).1, q)
        })
    }
}
