//! The draws of one run of a trial: where the receiver and the target are, and what is received.

use foxhunt_core::{
    Bearing, ConstantVelocity, Measured, MeasuredList, MotionModel, Pose, Quantity, Reception,
};
use foxhunt_wire::geodesy::compass_deg_to_radians;
use nalgebra::{Matrix4, Vector2, Vector4};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::{BearingsConfig, DifferencesConfig, ReceiverConfig, TargetConfig, Trial, prior::Prior};

/// The draws of one run, the same for every estimator.
#[derive(Clone, Debug)]
pub(super) struct Draw {
    /// The target's state at each bearing.
    pub truth: Vec<Vector4<f64>>,
    /// The bearings.
    pub receptions: Vec<Reception>,
    /// The prior, before the first bearing.
    pub prior: Prior,
}

impl Draw {
    pub(super) fn new(trial: &Trial, seed: u64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let bearings = &trial.bearings;
        let receiver = receiver_at(&trial.receiver, bearings);
        // Where the target is drawn from the prior, that is a room and needs no first bearing.
        let room = |rng: &mut Xoshiro256PlusPlus| {
            let origin = Vector4::zeros();
            let none = (0.0, bearings.sigma_rad);
            Prior::new(&trial.prior, &origin, Vector2::zeros(), none, rng).draw(rng)
        };
        let truth = target_at(&trial.target, bearings, room, &mut rng);
        let receptions: Vec<Reception> = truth
            .iter()
            .zip(&receiver)
            .enumerate()
            .map(|(k, (target, at))| {
                let reception = Reception {
                    time: bearings.interval_s * f64::from(u32::try_from(k).unwrap_or(u32::MAX)),
                    receiver: Pose::at(at.x, at.y, 0.0),
                    ..Reception::default()
                };
                if let Some(config) = &trial.differences {
                    let measured = difference(config, target.xy(), *at, &mut rng);
                    return Reception { measured, ..reception };
                }
                let angle = bearing(bearings, target.xy() - at, &mut rng);
                let sigma = bearings.sigma_rad;
                Reception { bearing: Some(Bearing { angle, sigma, confidence: 1.0 }), ..reception }
            })
            .collect();
        let first = receptions.first().and_then(|reception| reception.bearing);
        let first = first.map_or(0.0, |bearing| bearing.angle) - bearings.bias_rad;
        let first = (first, bearings.sigma_rad);
        let prior = Prior::new(&trial.prior, &truth[0], receiver[0], first, &mut rng);
        Self { truth, receptions, prior }
    }
}

/// The receiver's place at each bearing.
fn receiver_at(receiver: &ReceiverConfig, bearings: &BearingsConfig) -> Vec<Vector2<f64>> {
    match receiver {
        ReceiverConfig::Stations { places_m, bearings_at_each } => {
            let each = usize::try_from(*bearings_at_each).unwrap_or(usize::MAX);
            let places = places_m.iter().flat_map(|p| std::iter::repeat_n(Vector2::from(*p), each));
            places.cycle().zip(0..bearings.count).map(|(place, _)| place).collect()
        }
        ReceiverConfig::Legs { legs } => {
            let place_at = |time: f64| {
                let mut place = Vector2::zeros();
                let mut begun = 0.0;
                for (i, leg) in legs.iter().enumerate() {
                    let left = time - begun;
                    let last = i + 1 == legs.len();
                    let spent = if last { left } else { left.min(leg.duration_s) };
                    place += velocity(leg.speed_mps, leg.course_deg_compass) * spent;
                    begun += leg.duration_s;
                    if left <= leg.duration_s {
                        break;
                    }
                }
                place
            };
            (0..bearings.count).map(|k| place_at(f64::from(k) * bearings.interval_s)).collect()
        }
    }
}

/// The target's state at each bearing; `drawn` is the beginning of one from the prior.
fn target_at(
    target: &TargetConfig,
    bearings: &BearingsConfig,
    drawn: impl FnOnce(&mut Xoshiro256PlusPlus) -> Vector4<f64>,
    rng: &mut Xoshiro256PlusPlus,
) -> Vec<Vector4<f64>> {
    let times = (0..bearings.count).map(|k| f64::from(k) * bearings.interval_s);
    let (start, density) = match *target {
        TargetConfig::Line { east_m, north_m, speed_mps, course_deg_compass, spectral_density } => {
            let v = velocity(speed_mps, course_deg_compass);
            (Vector4::new(east_m, north_m, v.x, v.y), spectral_density)
        }
        TargetConfig::FromPrior => (drawn(rng), 0.0),
        TargetConfig::Circle { radius_m, period_s } => {
            let rate = core::f64::consts::TAU / period_s;
            let at = |time: f64| {
                let (sin, cos) = (rate * time).sin_cos();
                Vector4::new(cos, sin, -sin * rate, cos * rate) * radius_m
            };
            return times.map(at).collect();
        }
    };
    let motion = ConstantVelocity { spectral_density: density };
    let factor: Matrix4<f64> = motion.noise_factor(&start, bearings.interval_s);
    let mut state = start;
    let mut states = vec![start];
    for _ in 1..bearings.count {
        let noise = factor * Vector4::from_fn(|_, _| rng.sample(StandardNormal));
        state = motion.propagate(&state, bearings.interval_s) + noise;
        states.push(state);
    }
    states
}

/// East and North of a velocity from its speed and its course, in degrees clockwise from North.
fn velocity(speed: f64, course_deg_compass: f64) -> Vector2<f64> {
    let (sin, cos) = compass_deg_to_radians(course_deg_compass).sin_cos();
    Vector2::new(cos, sin) * speed
}

/// Range difference of a target between a receiver and the second one.
fn difference(
    config: &DifferencesConfig,
    target: Vector2<f64>,
    at: Vector2<f64>,
    rng: &mut Xoshiro256PlusPlus,
) -> MeasuredList {
    let DifferencesConfig { reference_m, sigma_m } = *config;
    let error: f64 = rng.sample(StandardNormal);
    let farther = (target - at).norm() - (target - Vector2::from(reference_m)).norm();
    let measured = Measured::new(Quantity::RANGE_DIFFERENCE, farther + sigma_m * error, sigma_m);
    let measured = measured.expect("the places of a trial are finite, and its sigma is positive");
    MeasuredList::new(&[measured]).expect("there is room for one")
}

/// A bearing of what lies at `offset` from the receiver.
fn bearing(config: &BearingsConfig, offset: Vector2<f64>, rng: &mut Xoshiro256PlusPlus) -> f64 {
    // Both are drawn whichever is used, so that a share of outliers moves no other draw.
    let (any, which): (f64, f64) = (rng.random(), rng.random());
    let error: f64 = rng.sample(StandardNormal);
    if which < config.outlier_share {
        return foxhunt_core::angle::wrap(core::f64::consts::TAU * any);
    }
    let value = offset.y.atan2(offset.x) + config.bias_rad + config.sigma_rad * error;
    foxhunt_core::angle::wrap(value)
}

#[cfg(test)]
mod tests {
    use super::super::Leg;
    use super::*;

    const BEARINGS: BearingsConfig = BearingsConfig {
        count: 8,
        interval_s: 10.0,
        sigma_rad: 0.1,
        bias_rad: 0.0,
        outlier_share: 0.0,
    };

    #[test]
    fn legs_follow_one_another_and_the_last_goes_on() {
        let leg =
            |course_deg_compass, duration_s| Leg { speed_mps: 2.0, course_deg_compass, duration_s };
        let legs = vec![leg(0.0, 15.0), leg(90.0, 20.0), leg(180.0, 1.0)];
        let places = receiver_at(&ReceiverConfig::Legs { legs }, &BEARINGS);
        let expected =
            [[0, 0], [0, 20], [10, 30], [30, 30], [40, 20], [40, 0], [40, -20], [40, -40]];
        for (place, [east, north]) in places.iter().zip(expected) {
            let expected = Vector2::new(f64::from(east), f64::from(north));
            assert!((place - expected).norm() < 1e-12, "{place}, not {expected}");
        }
    }

    #[test]
    fn stations_are_visited_in_turn() {
        let places_m = vec![[1.0, 0.0], [2.0, 0.0]];
        let stations = ReceiverConfig::Stations { places_m, bearings_at_each: 3 };
        let east: Vec<f64> = receiver_at(&stations, &BEARINGS).iter().map(|p| p.x).collect();
        assert_eq!(east, [1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 1.0, 1.0]);
    }

    #[test]
    fn a_circle_closes_and_its_velocity_is_its_slope() {
        let circle = TargetConfig::Circle { radius_m: 1.5, period_s: 70.0 };
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let states = target_at(&circle, &BEARINGS, |_| Vector4::zeros(), &mut rng);
        assert!((states[0] - states[7]).norm() < 1e-12);
        let slope = 1.5 * core::f64::consts::TAU / 70.0;
        assert!((states[0] - Vector4::new(1.5, 0.0, 0.0, slope)).norm() < 1e-12);
        assert!(states[1].y > 0.0, "counter-clockwise");
    }
}
