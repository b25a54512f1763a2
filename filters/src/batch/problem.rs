use core::f64::consts::TAU;

use foxhunt_core::{Axis, Covariance, MeasurementModel, Observation, State};
use nalgebra::{SMatrix, SVector};

use super::Loss;
use crate::{Gaussian, count::number};

/// An observation with its noise factored.
#[derive(Clone, Debug)]
pub(super) struct Heard<const M: usize> {
    pub(super) observation: Observation<M>,
    root: SMatrix<f64, M, M>,
}

impl<const M: usize> Heard<M> {
    pub(super) fn new(observation: Observation<M>) -> Self {
        let root = observation.noise().cholesky();
        let root = root.expect("an observation is only made with a positive definite noise");
        Self { observation, root: root.unpack() }
    }

    /// The same without its angles.
    pub(super) fn without_angles<H, const N: usize>(&self, model: &H) -> Self
    where
        H: MeasurementModel<N, M>,
    {
        let angles = model.axes().map(|axis| axis == Axis::Angle);
        Self::new((0..M).filter(|i| angles[*i]).fold(self.observation, Observation::without))
    }

    /// The residual at `x` in units of its noise, zero where a component is missing.
    fn white<H, const N: usize>(&self, model: &H, x: &State<N>) -> SVector<f64, M>
    where
        H: MeasurementModel<N, M>,
    {
        let expected = model.expected(x, self.observation.receiver());
        let residual = model.residual(self.observation.value(), &expected);
        let residual = self.observation.mask(residual.transpose()).transpose();
        self.root.solve_lower_triangular_unchecked(&residual)
    }

    /// The Gaussian's normaliser: −½ m ln 2π − ln |R|^½.
    fn normaliser(&self) -> f64 {
        let log_root: f64 = self.root.diagonal().iter().map(|d| libm::log(*d)).sum();
        -0.5 * number(self.observation.len()) * libm::log(TAU) - log_root
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
    pub(super) heard: &'a [Heard<M>],
    pub(super) prior: Option<&'a Gaussian<N>>,
    pub(super) loss: Loss,
    /// What all observations' covariances are multiplied by.
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
        let misfit = |heard: &Heard<M>| {
            let m = number(heard.observation.len());
            self.loss.of(heard.white(self.model, x).norm_squared(), m).0
        };
        let sum: f64 = self.heard.iter().map(misfit).sum();
        let apart = self.apart_from_mean(x).map_or(0.0, |w| w.norm_squared());
        0.5 * (sum / self.scale + apart)
    }

    pub(super) fn local(&self, x: &State<N>) -> Local<N> {
        let (mut cost, mut gradient) = (0.0, State::<N>::zeros());
        let mut information = Covariance::<N>::zeros();
        for heard in self.heard {
            let white = heard.white(self.model, x);
            let m = number(heard.observation.len());
            let (misfit, weight) = self.loss.of(white.norm_squared(), m);
            let jacobian = self.model.jacobian(x, heard.observation.receiver());
            let jacobian = heard.observation.mask(jacobian.transpose()).transpose();
            let slope = heard.root.solve_lower_triangular_unchecked(&jacobian);
            cost += misfit;
            gradient -= slope.transpose() * white * weight;
            information += slope.transpose() * slope * weight;
        }
        cost /= self.scale;
        gradient /= self.scale;
        information /= self.scale;
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

    /// What turns a cost into a log-density: the sum of all normalisers.
    pub(super) fn normaliser(&self) -> f64 {
        let heard: f64 = self.heard.iter().map(Heard::normaliser).sum();
        let components = number(self.components());
        let prior = self.prior.map_or(0.0, |prior| {
            let log_root: f64 = prior.factor().diagonal().iter().map(|d| libm::log(*d)).sum();
            -0.5 * number(N) * libm::log(TAU) - log_root
        });
        heard - 0.5 * components * libm::log(self.scale) + prior
    }

    /// Whether an angle was heard.
    pub(super) fn has_angle(&self, heard: &Heard<M>) -> bool {
        let axes = self.model.axes();
        (0..M).any(|i| axes[i] == Axis::Angle && heard.observation.has(i))
    }

    /// How many numbers were heard.
    pub(super) fn components(&self) -> usize {
        self.heard.iter().map(|heard| heard.observation.len()).sum()
    }

    /// Each observation's weight, and its squared residual in its own standard deviations.
    pub(super) fn weights(&self, x: &State<N>) -> impl Iterator<Item = (f64, f64)> {
        self.heard.iter().map(move |heard| {
            let q = heard.white(self.model, x).norm_squared();
            (self.loss.of(q, number(heard.observation.len())).1, q)
        })
    }
}
