//! The program with your own estimator: it is in `--help`, in `list estimators`, and flies in
//! `hunt`, `campaign`, `compare`, `replay` and `locate` like those that the library brings.
//!
//! ```text
//! cargo run -p foxhunt-cli --example own_program -- \
//!     campaign --runs 4 --estimator lattice --estimator grid
//! ```

use std::process::ExitCode;

use foxhunt::{
    nalgebra::{Matrix2, Vector2},
    prelude::*,
    registry::{Need, Needs, TrackRequest},
};

/// Weights on a lattice of places, 1 m apart, that are multiplied by each likelihood.
struct Lattice<H> {
    model: H,
    places: Vec<(Vector2<f64>, f64)>,
}

impl<H: MeasurementModel<2, 2>> Lattice<H> {
    fn new(model: H, prior: &Estimate<2>) -> Self {
        let precision = 1.0 / prior.covariance[(0, 0)];
        let mut places = Vec::new();
        for east in -40..=40 {
            for north in -40..=40 {
                let place = prior.mean + Vector2::new(f64::from(east), f64::from(north));
                let square = (place - prior.mean).norm_squared();
                places.push((place, (-0.5 * precision * square).exp()));
            }
        }
        let mut lattice = Self { model, places };
        lattice.normalise();
        lattice
    }

    fn normalise(&mut self) -> f64 {
        let total: f64 = self.places.iter().map(|(_, weight)| weight).sum();
        self.places.iter_mut().for_each(|(_, weight)| *weight /= total);
        total
    }
}

// ANCHOR: estimator
impl<H: MeasurementModel<2, 2>> Estimator<2, 2> for Lattice<H> {
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)
    }

    fn update(&mut self, observation: &Observation<2>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        for (place, weight) in &mut self.places {
            *weight *= self.model.log_likelihood(place, observation).exp();
        }
        let log_evidence = self.normalise().ln();
        Ok(Correction::Fused { nis: None, log_evidence, effective_sample_size: None })
    }

    fn estimate(&self) -> Estimate<2> {
        let mean: Vector2<f64> = self.places.iter().map(|(place, weight)| place * *weight).sum();
        let mut covariance = Matrix2::identity() / 12.0;
        for (place, weight) in &self.places {
            covariance += (place - mean) * (place - mean).transpose() * *weight;
        }
        Estimate { mean, covariance }
    }

    fn quantities(&self) -> [Quantity; 2] {
        self.model.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<2>, f64)) {
        self.places.iter().for_each(|(place, weight)| visit(place, *weight));
    }
}
// ANCHOR_END: estimator

// ANCHOR: name
fn main() -> ExitCode {
    let needs = Needs {
        level: Need::Used,
        bearing: Need::Used,
        others: Vec::new(),
        moving: false,
        all_at_once: false,
    };
    let make = |request: &TrackRequest<'_>| {
        let lattice = Lattice::new(request.model.clone(), &request.search.prior);
        Ok(Track::new::<2, 2>(lattice, TrackConfig::default()))
    };
    let registry = Registry::builtin().with_estimator(EstimatorEntry::own(
        "lattice",
        "weights on a lattice of places",
        "Bucy & Senne 1971",
        needs,
        make,
    ));
    foxhunt_cli::run(registry)
}
// ANCHOR_END: name
