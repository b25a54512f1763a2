//! A place together with what the receivers that find it get wrong.

use foxhunt_core::{
    BearingModes, Correction, Covariance, Estimate, Estimator, EstimatorError, MeasurementModel,
    Observation, Pose, Quantity, RandomWalk, Reception, Smooth, State, absorb_receiver_noise,
    angle, parameter::positive,
};
use foxhunt_filters::{GridConfig, GridFilter};
use nalgebra::{SMatrix, SVector, Vector2};
use serde::{Deserialize, Serialize};

use crate::AnyModel;

/// Largest number of receivers whose offsets are estimated.
pub const MOST_RECEIVERS: usize = 8;

/// Place, reference power, and two offsets of each receiver.
const STATE: usize = 3 + 2 * MOST_RECEIVERS;

/// The random walks of the offsets per √second: a receiver warms up, a compass drifts, so that
/// nothing freezes.
const LEVEL_DRIFT_DB: f64 = 0.01;
const BEARING_DRIFT: f64 = 0.001;

/// Number of receptions that the stated σ of a receiver counts for when its own is learned.
const STATED_FOR: f64 = 4.0;

/// Ratio of a receiver's σ to the σ with which its receptions were used, from which on all of them
/// are used again.
const OTHER_SIGMA: f64 = 1.25;

/// Number of receptions that are kept to be used again; once there are more, none is.
const KEPT: usize = 1000;

/// Receivers of different makes that find one transmitter together. Each has offsets of its own,
/// about zero, which are estimated along with the place, and a σ of its own, which is learned.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReceiversConfig {
    /// σ of the offset of a receiver's levels, in dB.
    pub level_sigma_db: f64,
    /// σ of the offset of a receiver's bearings, in degrees: that of its compass.
    pub bearing_sigma_deg: f64,
}

/// Errors of a receiver, as they were learned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnedReceiver {
    /// Offset of its levels in dB, and σ of that; positive where it reads too high.
    pub level_offset_db: [f64; 2],
    /// Difference of that from the mean offset of the other receivers in dB, and σ of that; absent
    /// where there is no other one. It does not depend on the transmitter's power.
    pub level_from_others_db: Option<[f64; 2]>,
    /// Offset of its bearings in radians, and σ of that; positive counter-clockwise.
    pub bearing_offset: [f64; 2],
    /// The factors by which its levels and its bearings scatter more than their σ says.
    pub scatter: [f64; 2],
    /// Number of receptions by it.
    pub receptions: u32,
}

impl LearnedReceiver {
    /// The receiver's reception without its offsets, with the σ that was learned. Directions that
    /// compete are left out: the estimator takes them by their moments.
    #[must_use]
    pub fn corrected(&self, reception: &Reception) -> Reception {
        let mut corrected = *reception;
        let [level_scatter, bearing_scatter] = self.scatter;
        corrected.covariance *= level_scatter * bearing_scatter;
        if let Some(level) = &mut corrected.level {
            level.rss_dbm -= self.level_offset_db[0];
            level.sigma_db *= level_scatter;
        }
        if let Some(bearing) = &mut corrected.bearing {
            bearing.angle = angle::wrap(bearing.angle - self.bearing_offset[0]);
            bearing.sigma *= bearing_scatter;
        }
        corrected.modes = BearingModes::default();
        corrected
    }
}

/// The model of one of several receivers: that of a receiver without faults, and its offsets.
#[derive(Clone)]
struct OfReceiver {
    model: AnyModel<3, 2>,
    receiver: usize,
}

impl OfReceiver {
    /// The first component of its offsets: the level's, and the bearing's behind it.
    fn first(&self) -> usize {
        3 + 2 * self.receiver
    }

    /// The part of a state that a receiver without faults knows.
    fn shared(state: &State<STATE>) -> State<3> {
        state.fixed_rows::<3>(0).into_owned()
    }
}

impl MeasurementModel<STATE, 2> for OfReceiver {
    fn quantities(&self) -> [Quantity; 2] {
        self.model.quantities()
    }

    fn expected(&self, state: &State<STATE>, receiver: &Pose) -> Vector2<f64> {
        let offsets = state.fixed_rows::<2>(self.first());
        self.model.expected(&Self::shared(state), receiver) + offsets
    }

    fn jacobian(&self, state: &State<STATE>, receiver: &Pose) -> SMatrix<f64, 2, STATE> {
        let mut slope = SMatrix::<f64, 2, STATE>::zeros();
        let shared = self.model.jacobian(&Self::shared(state), receiver);
        slope.fixed_view_mut::<2, 3>(0, 0).copy_from(&shared);
        (0..2).for_each(|component| slope[(component, self.first() + component)] = 1.0);
        slope
    }

    fn residuals(
        &self,
        columns: [&[f64]; STATE],
        z: &SVector<f64, 2>,
        receiver: &Pose,
        out: [&mut [f64]; 2],
    ) {
        let [level, bearing] = out;
        let shared = [columns[0], columns[1], columns[2]];
        self.model.residuals(shared, z, receiver, [level, bearing]);
        let first = self.first();
        let axes = self.model.axes();
        for (component, out) in [level, bearing].into_iter().enumerate() {
            for (residual, offset) in out.iter_mut().zip(columns[first + component]) {
                *residual = axes[component].minus(*residual, *offset);
            }
        }
    }
}

/// Errors of one component of a receiver: the sum of their squares over their variances, and their
/// number.
#[derive(Clone, Copy, Debug, Default)]
struct Scatter {
    squares: f64,
    count: f64,
}

impl Scatter {
    /// The factor on the stated σ: as stated before the first error.
    fn factor(&self) -> f64 {
        ((STATED_FOR + self.squares) / (STATED_FOR + self.count)).sqrt()
    }
}

type Grid = GridFilter<RandomWalk<STATE>, OfReceiver, STATE, 2>;

/// A reception that was used.
#[derive(Clone, Copy)]
struct Kept {
    receiver: usize,
    /// Time since the one before, in seconds.
    after_s: f64,
    observation: Observation<2>,
}

/// The place of a transmitter over a grid, with the reference power and each receiver's offsets of
/// level and bearing integrated out (Rao-Blackwell), and each receiver's σ learned from its
/// residuals (Särkkä & Nummenmaa 2009). When that differs from the σ that was used, all of them
/// are used again: the first ones counted for more than they were worth.
///
/// The noise that a receiver's own uncertain place adds is taken at the belief's distance, the same
/// for all cells. Directions that compete for a bearing are taken by their moments.
#[derive(Clone)]
pub(crate) struct Team {
    grid: Grid,
    /// The grid before the first reception.
    start: Grid,
    kept: Vec<Kept>,
    /// Time since the last reception, in seconds.
    since_s: f64,
    scatter: [[Scatter; 2]; MOST_RECEIVERS],
    /// The factors on σ with which the receptions were used, about.
    used: [[f64; 2]; MOST_RECEIVERS],
    receptions: [u32; MOST_RECEIVERS],
    /// The receiver of the next observation; one that there is no room for is refused.
    receiver: usize,
}

impl Team {
    /// A team from a prior of the place and the reference power, over the model of a receiver
    /// without faults; `walk` is the random walk of these three.
    pub(crate) fn new(
        config: &ReceiversConfig,
        model: AnyModel<3, 2>,
        walk: &RandomWalk<3>,
        prior: &Estimate<3>,
        cells: GridConfig,
    ) -> Result<Self, EstimatorError> {
        let level = positive("level_sigma_db", config.level_sigma_db)?;
        let bearing = positive("bearing_sigma_deg", config.bearing_sigma_deg)?.to_radians();
        let of_each = |shared: &State<3>, offsets: [f64; 2]| {
            State::<STATE>::from_fn(|row, _| {
                shared.get(row).copied().unwrap_or(offsets[(row + 1) % 2])
            })
        };
        let drift = of_each(&walk.drift, [LEVEL_DRIFT_DB, BEARING_DRIFT]);
        let sigmas = of_each(&State::zeros(), [level, bearing]);
        let mut covariance = Covariance::<STATE>::from_diagonal(&sigmas.component_mul(&sigmas));
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&prior.covariance);
        let prior = Estimate { mean: of_each(&prior.mean, [0.0, 0.0]), covariance };
        let model = OfReceiver { model, receiver: 0 };
        let grid = GridFilter::new(RandomWalk { drift }, model, prior, cells)?;
        Ok(Self {
            start: grid.clone(),
            grid,
            kept: Vec::new(),
            since_s: 0.0,
            scatter: Default::default(),
            used: [[1.0; 2]; MOST_RECEIVERS],
            receptions: [0; MOST_RECEIVERS],
            receiver: 0,
        })
    }

    /// Sets the receiver of the next observation, counted from 0.
    pub(crate) fn heard_by(&mut self, receiver: usize) {
        self.receiver = receiver;
    }

    /// Errors that were learned of each receiver that has received.
    pub(crate) fn learned(&self) -> Vec<(usize, LearnedReceiver)> {
        let Estimate { mean, covariance } = self.grid.estimate();
        let heard: Vec<_> = (0..MOST_RECEIVERS).filter(|r| self.receptions[*r] > 0).collect();
        let along = |direction: &State<STATE>| {
            let variance = direction.dot(&(covariance * direction));
            [direction.dot(&mean), variance.max(0.0).sqrt()]
        };
        let learned = |receiver: &usize| {
            let first = 3 + 2 * receiver;
            let unit = |row: usize| State::<STATE>::from_fn(|i, _| f64::from(u8::from(i == row)));
            let others = heard.iter().filter(|other| *other != receiver);
            let sum = others.clone().map(|other| unit(3 + 2 * other)).sum::<State<STATE>>();
            let count = sum.sum();
            let learned = LearnedReceiver {
                level_offset_db: along(&unit(first)),
                level_from_others_db: (count > 0.0).then(|| along(&(unit(first) - sum / count))),
                bearing_offset: along(&unit(first + 1)),
                scatter: self.scatter[*receiver].map(|scatter| scatter.factor()),
                receptions: self.receptions[*receiver],
            };
            (*receiver, learned)
        };
        heard.iter().map(learned).collect()
    }

    /// The factors on a receiver's stated σ.
    fn factors(&self, receiver: usize) -> [f64; 2] {
        self.scatter[receiver].map(|scatter| scatter.factor())
    }

    /// Updates the grid with a receiver's observation: with its own σ, and with what its uncertain
    /// place adds at the distance at which the target is believed.
    fn fuse(
        &mut self,
        receiver: usize,
        observation: &Observation<2>,
    ) -> Result<Correction, EstimatorError> {
        self.grid.measurement_mut().receiver = receiver;
        let [level, bearing] = self.factors(receiver);
        let scaled = observation.with_noise_scaled(0, level).with_noise_scaled(1, bearing);
        let belief = self.grid.estimate();
        let from = observation.receiver().position.xy();
        let way = belief.position().mean - from;
        let spread = belief.position().covariance.trace();
        let distance = (way.norm_squared() + spread).sqrt();
        let direction = way.try_normalize(0.0).unwrap_or_else(Vector2::x);
        let mut state = belief.mean;
        state.fixed_rows_mut::<2>(0).copy_from(&(from + direction * distance));
        let weighed = absorb_receiver_noise(&*self.grid.measurement_mut(), &state, &scaled);
        self.grid.update(&weighed)
    }

    /// Learns a receiver's σ from what its observation leaves over: the squared residual at the
    /// belief after it, and what that does not know.
    fn learn(&mut self, receiver: usize, observation: &Observation<2>) {
        let Estimate { mean, covariance } = self.grid.estimate();
        let model = self.grid.measurement_mut();
        model.receiver = receiver;
        let pose = observation.receiver();
        let residual = model.residual(observation.value(), &model.expected(&mean, pose));
        let slope = model.jacobian(&mean, pose);
        let unknown = slope * covariance * slope.transpose();
        let noise = observation.noise();
        for (component, scatter) in self.scatter[receiver].iter_mut().enumerate() {
            if !observation.has(component) {
                continue;
            }
            let square = residual[component] * residual[component];
            let ratio = (square + unknown[(component, component)]) / noise[(component, component)];
            if ratio.is_finite() {
                scatter.squares += ratio;
                scatter.count += 1.0;
            }
        }
    }

    /// True if a receiver's σ differs from that with which its receptions were used.
    fn is_outdated(&self) -> bool {
        let differs = |(now, used): (f64, &f64)| {
            let ratio = now / used;
            !(1.0 / OTHER_SIGMA..OTHER_SIGMA).contains(&ratio)
        };
        (0..MOST_RECEIVERS).any(|receiver| {
            self.factors(receiver).into_iter().zip(&self.used[receiver]).any(differs)
        })
    }

    /// Uses all receptions again with what is known of σ now, and learns σ again from the belief
    /// after all of them.
    fn use_again(&mut self) -> Result<(), EstimatorError> {
        let mut again = self.clone();
        again.grid = self.start.clone();
        for Kept { receiver, after_s, observation } in &self.kept {
            again.grid.predict(*after_s)?;
            let _ = again.fuse(*receiver, observation)?;
        }
        again.used = std::array::from_fn(|receiver| self.factors(receiver));
        again.scatter = Default::default();
        for Kept { receiver, observation, .. } in &self.kept {
            again.learn(*receiver, observation);
        }
        *self = again;
        Ok(())
    }
}

impl Estimator<2, 2> for Team {
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        self.grid.predict(dt)?;
        self.since_s += dt;
        Ok(())
    }

    fn update(&mut self, observation: &Observation<2>) -> Result<Correction, EstimatorError> {
        let receiver = self.receiver;
        if receiver >= MOST_RECEIVERS {
            return Err(EstimatorError::Unsupported {
                what: "more than 8 receivers with offsets of their own",
            });
        }
        let correction = self.fuse(receiver, observation)?;
        if !matches!(correction, Correction::Fused { .. }) {
            return Ok(correction);
        }
        self.receptions[receiver] += 1;
        self.learn(receiver, observation);
        if self.kept.len() < KEPT {
            let after_s = std::mem::take(&mut self.since_s);
            self.kept.push(Kept { receiver, after_s, observation: *observation });
            if self.is_outdated() {
                // What cannot be done again stays as it is.
                let _ = self.use_again();
            }
        }
        Ok(correction)
    }

    fn estimate(&self) -> Estimate<2> {
        self.grid.estimate().position()
    }

    fn quantities(&self) -> [Quantity; 2] {
        self.grid.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<2>, f64)) {
        self.grid.visit_samples(&mut |state, weight| {
            visit(&state.fixed_rows::<2>(0).into_owned(), weight);
        });
    }
}

impl Smooth<2, 2> for Team {
    fn smooth(&mut self, _: &Self, _: f64) -> Result<(), EstimatorError> {
        Err(EstimatorError::Unsupported { what: "smoothing a place with offsets of receivers" })
    }
}
