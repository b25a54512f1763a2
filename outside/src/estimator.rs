//! Your own estimator: the ensemble Kalman filter with perturbed observations (Evensen 1994;
//! Burgers, van Leeuwen & Evensen 1998).

use foxhunt::core::nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};
use foxhunt::prelude::*;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use crate::model::TdoaDopplerBearing;

/// An ensemble of places.
#[derive(Clone, Debug)]
pub struct EnsembleKalman {
    model: TdoaDopplerBearing,
    members: Vec<Vector2<f64>>,
    rng: Xoshiro256PlusPlus,
}

/// The random walk of the beacon, in m/√s.
const DRIFT: f64 = 0.02;

impl EnsembleKalman {
    /// An ensemble of `count` places drawn from a prior.
    pub fn new(
        model: TdoaDopplerBearing,
        prior: &Estimate<2>,
        count: usize,
        seed: u64,
    ) -> Result<Self, EstimatorError> {
        let factor = prior.covariance.cholesky();
        let role = foxhunt::core::Role::Prior;
        let factor = factor.ok_or(EstimatorError::NotPositiveDefinite { role })?.unpack();
        let rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut ensemble = Self { model, members: Vec::new(), rng };
        for _ in 0..count {
            let normal = Vector2::from_fn(|_, _| ensemble.normal());
            ensemble.members.push(prior.mean + factor * normal);
        }
        Ok(ensemble)
    }

    fn normal(&mut self) -> f64 {
        self.rng.sample(StandardNormal)
    }

    fn count(&self) -> f64 {
        self.members.iter().map(|_| 1.0).sum()
    }
}

impl Estimator<2, 3> for EnsembleKalman {
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        let sigma = DRIFT * dt.sqrt();
        for index in 0..self.members.len() {
            let step = Vector2::from_fn(|_, _| self.normal()) * sigma;
            self.members[index] += step;
        }
        Ok(())
    }

    fn update(&mut self, observation: &Observation<3>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let count = self.count();
        let mean = self.estimate().mean;
        let centre = self.model.expected(&mean, observation.receiver());
        let off = |x: &Vector2<f64>| {
            let expected = self.model.expected(x, observation.receiver());
            self.model.residual(&expected, &centre)
        };
        let offsets: Vec<Vector3<f64>> = self.members.iter().map(off).collect();
        let shift = offsets.iter().sum::<Vector3<f64>>() / count;
        let mut pzz = Matrix3::zeros();
        let mut pxz = Matrix2x3::zeros();
        for (x, z) in self.members.iter().zip(&offsets) {
            pzz += (z - shift) * (z - shift).transpose() / (count - 1.0);
            pxz += (x - mean) * (z - shift).transpose() / (count - 1.0);
        }
        let pzz = observation.mask(observation.mask(pzz).transpose());
        let innovation = pzz + observation.noise();
        let role = foxhunt::core::Role::Innovation;
        let factor = innovation.cholesky();
        let factor = factor.ok_or(EstimatorError::NotPositiveDefinite { role })?;
        let gain = factor.solve(&observation.mask(pxz).transpose()).transpose();
        let residual = |expected: &Vector3<f64>, noise: &Vector3<f64>| {
            let off = self.model.residual(observation.value(), &centre) - expected + noise;
            observation.mask(self.model.residual(&off, &Vector3::zeros()).transpose()).transpose()
        };
        let first = residual(&shift, &Vector3::zeros());
        let nis = first.dot(&factor.solve(&first));
        let root = observation.noise().cholesky().map(|root| root.unpack()).unwrap_or_default();
        let moves: Vec<Vector2<f64>> = offsets
            .iter()
            .map(|offset| {
                let normal: [f64; 3] = std::array::from_fn(|_| self.rng.sample(StandardNormal));
                gain * residual(offset, &(root * Vector3::from(normal)))
            })
            .collect();
        for (member, step) in self.members.iter_mut().zip(moves) {
            *member += step;
        }
        let degrees = observation.len() as f64;
        let log_evidence = -0.5 * (nis + degrees * std::f64::consts::TAU.ln())
            - factor.unpack().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Ok(Correction::Fused { nis: Some(nis), log_evidence, effective_sample_size: None })
    }

    fn estimate(&self) -> Estimate<2> {
        let count = self.count();
        let mean = self.members.iter().sum::<Vector2<f64>>() / count;
        let spread = |x: &Vector2<f64>| (x - mean) * (x - mean).transpose() / (count - 1.0);
        Estimate { mean, covariance: self.members.iter().map(spread).sum::<Matrix2<f64>>() }
    }

    fn quantities(&self) -> [Quantity; 3] {
        MeasurementModel::<2, 3>::quantities(&self.model)
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<2>, f64)) {
        for member in &self.members {
            visit(member, 1.0 / self.count());
        }
    }
}
