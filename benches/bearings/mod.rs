//! A target of constant velocity in the plane, bearings of it with outliers (Isaacs et al. 2014,
//! eq. 30), a particle filter for them and the loop that one would write instead, one particle
//! after the other.

use std::f64::consts::{PI, TAU};

use foxhunt_core::{
    Covariance, Estimate, Estimator, MeasurementModel, MotionModel, Observation, Pose, Quantity,
    State, angle, elementary,
    nalgebra::{Matrix1, Matrix4, Vector1, Vector4},
};
use foxhunt_filters::{ParticleFilter, Resampling};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Exp1, StandardNormal};

pub(crate) const SHARE: f64 = 0.19;
pub(crate) const BIAS: f64 = 0.0929;
pub(crate) const SIGMA: f64 = 0.2468;
pub(crate) const NOISE: f64 = 0.05;
pub(crate) const PRIOR: [f64; 4] = [10.0, -5.0, 0.1, -0.1];
pub(crate) const SPREAD: [f64; 4] = [10.0, 10.0, 0.3, 0.3];

/// The models as a user writes them, for one state.
#[derive(Clone, Copy)]
struct States;

impl MotionModel<4> for States {
    fn propagate(&self, x: &State<4>, dt: f64) -> State<4> {
        Vector4::new(x[0] + dt * x[2], x[1] + dt * x[3], x[2], x[3])
    }
    fn noise_factor(&self, _: &State<4>, dt: f64) -> Matrix4<f64> {
        Matrix4::from_diagonal_element(NOISE * dt.sqrt())
    }
}

impl MeasurementModel<4, 1> for States {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::BEARING]
    }
    fn expected(&self, x: &State<4>, receiver: &Pose) -> Vector1<f64> {
        Vector1::new((x[1] - receiver.position.y).atan2(x[0] - receiver.position.x) + BIAS)
    }
    fn log_likelihood(&self, x: &State<4>, observation: &Observation<1>) -> f64 {
        let expected = self.expected(x, observation.receiver());
        density(observation.value()[0] - expected[0]).ln()
    }
}

/// The models of [`States`], with loops over columns besides.
#[derive(Clone, Copy)]
pub(crate) struct Columns;

impl MotionModel<4> for Columns {
    fn propagate(&self, x: &State<4>, dt: f64) -> State<4> {
        States.propagate(x, dt)
    }
    fn noise_factor(&self, x: &State<4>, dt: f64) -> Matrix4<f64> {
        States.noise_factor(x, dt)
    }
    #[inline(always)]
    fn move_columns(&self, columns: [&mut [f64]; 4], white: [&[f64]; 4], dt: f64) {
        let noise = NOISE * dt.sqrt();
        let [east, north, east_rate, north_rate] = columns;
        for (x, v, ahead, turn) in
            [(east, east_rate, white[0], white[2]), (north, north_rate, white[1], white[3])]
        {
            for (((x, v), ahead), turn) in x.iter_mut().zip(v).zip(ahead).zip(turn) {
                *x += *v * dt + noise * ahead;
                *v += noise * turn;
            }
        }
    }
}

impl MeasurementModel<4, 1> for Columns {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::BEARING]
    }
    fn expected(&self, x: &State<4>, receiver: &Pose) -> Vector1<f64> {
        States.expected(x, receiver)
    }
    fn log_likelihood(&self, x: &State<4>, observation: &Observation<1>) -> f64 {
        States.log_likelihood(x, observation)
    }
    #[inline(always)]
    fn log_likelihoods(&self, columns: [&[f64]; 4], observation: &Observation<1>, out: &mut [f64]) {
        let place = observation.receiver().position;
        let bearing = angle::wrap(observation.value()[0] - BIAS);
        let peak = (1.0 - SHARE) / (SIGMA * TAU.sqrt());
        let slope = -0.5 / (SIGMA * SIGMA);
        for ((out, east), north) in out.iter_mut().zip(columns[0]).zip(columns[1]) {
            let off = bearing - elementary::atan2(north - place.y, east - place.x);
            let off = if off > PI { off - TAU } else { off };
            let off = if off < -PI { off + TAU } else { off };
            *out = elementary::ln(peak * elementary::exp(slope * off * off) + SHARE / TAU);
        }
    }
}

/// The density of a bearing that is `off` from what is expected.
fn density(off: f64) -> f64 {
    let off = off - TAU * (off / TAU).round();
    let normal = (-0.5 * (off / SIGMA) * (off / SIGMA)).exp() / (SIGMA * TAU.sqrt());
    (1.0 - SHARE) * normal + SHARE / TAU
}

/// Bearings of a still target from a drone that flies round it.
pub(crate) fn observations() -> Vec<Observation<1>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
    let observation = |step: u32| {
        let around = 2.1 * f64::from(step);
        let place = [10.0 + 60.0 * around.cos(), -5.0 + 60.0 * around.sin()];
        let white: f64 = rng.sample(StandardNormal);
        let sound = rng.random::<f64>() >= SHARE;
        let error = if sound { BIAS + SIGMA * white } else { rng.random_range(-PI..PI) };
        let z = angle::wrap((-5.0 - place[1]).atan2(10.0 - place[0]) + error);
        let pose = Pose::at(place[0], place[1], 0.0);
        Observation::new(0.0, pose, Vector1::new(z), Matrix1::new(SIGMA * SIGMA)).expect("proper")
    };
    (0..64).map(observation).collect()
}

fn prior() -> Estimate<4> {
    let covariance = Matrix4::from_diagonal(&Vector4::from(SPREAD.map(|s| s * s)));
    Estimate { mean: Vector4::from(PRIOR), covariance }
}

/// One step after the other, and what it believes then.
pub(crate) type Step = Box<dyn FnMut(&Observation<1>) -> Estimate<4>>;

type Filter<H> = ParticleFilter<H, H, Xoshiro256PlusPlus, 4, 1>;

fn filter<H>(model: H, scheme: Resampling, particles: usize, seed: u64) -> Filter<H>
where
    H: MotionModel<4> + MeasurementModel<4, 1> + Copy,
{
    let rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let threshold = if scheme == Resampling::Multinomial { 1.0 } else { 0.5 };
    ParticleFilter::new(model, model, prior(), particles, rng)
        .and_then(|filter| filter.with_kernel_bandwidth(0.0))
        .and_then(|filter| filter.with_progressive_correction(0.0))
        .and_then(|filter| filter.with_resampling_threshold(threshold))
        .expect("proper")
        .with_resampling(scheme)
}

/// The filter that works by columns.
pub(crate) fn columns(scheme: Resampling, particles: usize, seed: u64) -> Filter<Columns> {
    filter(Columns, scheme, particles, seed)
}

pub(crate) fn steps(mut filter: impl Estimator<4, 1> + 'static) -> Step {
    Box::new(move |observation| {
        filter.predict(1.0).expect("a proper step");
        let _ = filter.update(observation).expect("possible");
        filter.estimate()
    })
}

#[derive(Clone, Copy)]
struct Particle {
    state: [f64; 4],
    weight: f64,
}

/// The loop that one would write instead.
#[expect(clippy::cast_precision_loss, reason = "counts of particles")]
fn plain_loop(scheme: Resampling, particles: usize, seed: u64) -> Step {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let count = particles as f64;
    let mut draw = |i: usize| PRIOR[i] + SPREAD[i] * rng.sample::<f64, _>(StandardNormal);
    let mut cloud: Vec<Particle> = (0..particles)
        .map(|_| Particle { state: core::array::from_fn(&mut draw), weight: 1.0 / count })
        .collect();
    let mut spare = cloud.clone();
    let mut marks = vec![0.0; particles];
    Box::new(move |observation| {
        let size = 1.0 / cloud.iter().map(|p| p.weight * p.weight).sum::<f64>();
        if scheme == Resampling::Multinomial || size < 0.5 * count {
            if scheme == Resampling::Multinomial {
                let mut sum = 0.0;
                for mark in &mut marks {
                    sum += rng.sample::<f64, _>(Exp1);
                    *mark = sum;
                }
                sum += rng.sample::<f64, _>(Exp1);
                marks.iter_mut().for_each(|mark| *mark /= sum);
            } else {
                let start: f64 = rng.random();
                for (i, mark) in marks.iter_mut().enumerate() {
                    *mark = (i as f64 + start) / count;
                }
            }
            let mut at = 0;
            let mut reach = cloud[0].weight;
            for (copy, mark) in spare.iter_mut().zip(&marks) {
                while reach <= *mark && at + 1 < particles {
                    at += 1;
                    reach += cloud[at].weight;
                }
                *copy = Particle { weight: 1.0 / count, ..cloud[at] };
            }
            core::mem::swap(&mut cloud, &mut spare);
        }
        let place = observation.receiver().position;
        let z = observation.value()[0];
        let mut total = 0.0;
        for Particle { state: x, weight } in &mut cloud {
            for row in 0..2 {
                x[row] += x[row + 2] + NOISE * rng.sample::<f64, _>(StandardNormal);
                x[row + 2] += NOISE * rng.sample::<f64, _>(StandardNormal);
            }
            *weight *= density(z - (x[1] - place.y).atan2(x[0] - place.x) - BIAS);
            total += *weight;
        }
        let mut mean = State::zeros();
        for Particle { state, weight } in &mut cloud {
            *weight /= total;
            mean += State::from(*state) * *weight;
        }
        let mut covariance = Covariance::zeros();
        for Particle { state, weight } in &cloud {
            let off = State::from(*state) - mean;
            covariance += off * (off * *weight).transpose();
        }
        Estimate { mean, covariance }
    })
}

pub(crate) fn of(what: &str, scheme: Resampling, particles: usize, seed: u64) -> Step {
    match what {
        "columns" => steps(columns(scheme, particles, seed)),
        "states" => steps(filter(States, scheme, particles, seed)),
        "loop" => plain_loop(scheme, particles, seed),
        other => panic!("no {other} to measure"),
    }
}
