use foxhunt_core::{
    Covariance, Estimate, Measured, MeasurementModel, Observation, Pose, Quantity, Receptions,
    State,
};
use foxhunt_filters::{BatchFix, BatchSolver, SlantRangeDifference, spherical_intersection};
use foxhunt_sensors::RangeDifference;
use nalgebra::{Matrix1, RowVector3, Vector1, Vector3};

use super::{
    LocateConfig, LocateError, Located, Locator,
    ranges::{Consistent, LEAST_PROBABILITY, averaged, consistent, posterior},
};

/// Locator by range differences to a reference receiver: spherical intersection, from where least
/// squares go on (`filters::spherical_intersection`).
///
/// The error of the reference's own arrival is in all differences alike. How much of each σ it is,
/// nobody states: none of its square and half of it are averaged by their evidence.
#[derive(Clone, Copy, Debug)]
pub struct RangeDifferences;

impl Locator for RangeDifferences {
    fn locate(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let reference = config.reference_m.ok_or(LocateError::NoReference)?;
        let up = config.target_up_m;
        let differences = Differences::of(receptions, reference, up)?;
        let starts = spherical_intersection(reference, &differences.measured, up)?;
        let apart = differences.apart(&starts)?;
        let mut located = apart.located();
        if let Some(in_common) = differences.in_common(&starts) {
            let gain = in_common.log_evidence - apart.log_evidence;
            let probability = posterior(SHARE_IN_COMMON, gain);
            if probability > LEAST_PROBABILITY {
                let near = in_common.mode_near(&apart.fix.estimate.mean);
                located = averaged(located, &near, probability);
            }
        }
        Ok(Located {
            observations: differences.measured.len(),
            rejected: differences.impossible.len(),
            left_out: differences.impossible,
            ..located
        })
    }
}

/// Share of recordings whose differences have the reference's error in common, as a prior.
const SHARE_IN_COMMON: f64 = 0.5;

/// Least number of differences that show whether an error is in all of them.
const LEAST_IN_COMMON: usize = 3;

/// Measured differences to the reference, with the receptions that they come from.
struct Differences {
    reference: Vector3<f64>,
    up: f64,
    model: RangeDifference,
    measured: Vec<SlantRangeDifference>,
    /// Index, time and receiver of each one's reception.
    from: Vec<(usize, f64, Pose)>,
    /// Receptions whose difference no place has, which the examination tells.
    impossible: Vec<usize>,
}

/// Differences beyond the receiver's distance from the reference by more than this many σ are of
/// no place.
const IMPOSSIBLE: f64 = 5.0;

impl Differences {
    fn of(receptions: &Receptions, reference: Vector3<f64>, up: f64) -> Result<Self, LocateError> {
        let quantity = Quantity::RANGE_DIFFERENCE;
        let model = RangeDifference::new(reference)?.with_target_up(up)?;
        let mut measured = Vec::new();
        let mut from = Vec::new();
        let mut impossible = Vec::new();
        for (index, reception) in receptions.iter().enumerate() {
            let Some(&Measured { value, sigma, .. }) = reception.measured.get(quantity) else {
                continue;
            };
            let receiver = reception.receiver.position;
            if value.abs() > (receiver - reference).norm() + IMPOSSIBLE * sigma {
                impossible.push(index);
                continue;
            }
            measured.push(SlantRangeDifference { receiver, difference: value, sigma });
            from.push((index, reception.time, reception.receiver));
        }
        if measured.is_empty() && impossible.is_empty() {
            return Err(LocateError::NoQuantity { quantity });
        }
        Ok(Self { reference, up, model, measured, from, impossible })
    }

    /// Builds the observations, each with the variance that `variance` makes of its σ².
    fn observations(
        &self,
        variance: impl Fn(f64) -> f64,
    ) -> Result<Vec<Observation<1>>, LocateError> {
        let made = self.measured.iter().zip(&self.from).map(|(of, (index, time, receiver))| {
            let noise = Matrix1::new(variance(of.sigma * of.sigma));
            let made = Observation::new(*time, *receiver, Vector1::new(of.difference), noise);
            made.map_err(|source| LocateError::Reception {
                index: *index,
                time: *time,
                source: source.into(),
            })
        });
        made.collect()
    }

    /// Difference of the distances of a place from a receiver and from the reference, in metres.
    fn expected(&self, place: Vector3<f64>, receiver: Vector3<f64>) -> f64 {
        (place - receiver).norm() - (place - self.reference).norm()
    }

    /// Solves with errors that no two differences share.
    fn apart(&self, starts: &[State<2>]) -> Result<Consistent<2>, LocateError> {
        let solver = BatchSolver::new(self.model);
        let solve = |spread: f64| -> Result<BatchFix<2>, LocateError> {
            Ok(solver.solve(&self.observations(|own| own + spread)?, starts)?)
        };
        let residuals = |mean: &State<2>| {
            let place = mean.push(self.up);
            let residual = |of: &SlantRangeDifference| {
                (of.difference - self.expected(place, of.receiver), of.sigma * of.sigma)
            };
            self.measured.iter().map(residual).collect()
        };
        consistent(solve, residuals)
    }

    /// Solves with half of the least σ² in common: the reference's. `None` for too few
    /// differences to show that, and where there is no solution.
    fn in_common(&self, starts: &[State<2>]) -> Option<Consistent<3>> {
        if self.measured.len() < LEAST_IN_COMMON {
            return None;
        }
        let reach = self.measured.iter().map(|of| (of.receiver - self.reference).norm());
        let wide = 100.0 * reach.fold(1.0, f64::max);
        let squares = self.measured.iter().map(|of| of.sigma * of.sigma);
        let shared = 0.5 * squares.fold(f64::INFINITY, f64::min);
        let prior = Estimate {
            mean: State::<3>::new(self.reference.x, self.reference.y, 0.0),
            covariance: Covariance::<3>::from_diagonal(&State::<3>::new(
                wide * wide,
                wide * wide,
                shared,
            )),
        };
        let solver = BatchSolver::new(WithReference(self.model)).with_prior(prior).ok()?;
        let starts: Vec<State<3>> = starts.iter().map(|at| at.push(0.0)).collect();
        let solve = |spread: f64| -> Result<BatchFix<3>, LocateError> {
            Ok(solver.solve(&self.observations(|own| own - shared + spread)?, &starts)?)
        };
        let residuals = |mean: &State<3>| {
            let place = mean.xy().push(self.up);
            let residual = |of: &SlantRangeDifference| {
                let expected = self.expected(place, of.receiver) + mean.z;
                (of.difference - expected, of.sigma * of.sigma - shared)
            };
            self.measured.iter().map(residual).collect()
        };
        let mut solution = consistent(solve, residuals).ok()?;
        let error = solution.fix.estimate.mean.z;
        solution.log_evidence -=
            0.5 * (libm::log(std::f64::consts::TAU * shared) + error * error / shared);
        Some(solution)
    }
}

/// Difference of ranges with the error of the reference's arrival as the third coordinate, in
/// metres.
#[derive(Clone, Copy, Debug)]
struct WithReference(RangeDifference);

impl MeasurementModel<3, 1> for WithReference {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RANGE_DIFFERENCE]
    }

    fn expected(&self, state: &State<3>, receiver: &Pose) -> Vector1<f64> {
        self.0.expected(&state.xy(), receiver).add_scalar(state.z)
    }

    fn jacobian(&self, state: &State<3>, receiver: &Pose) -> RowVector3<f64> {
        let place = self.0.jacobian(&state.xy(), receiver);
        RowVector3::new(place[0], place[1], 1.0)
    }
}
