use foxhunt_core::{ConstantVelocity, MotionModel};
use nalgebra::{Matrix4, Vector2, Vector4};
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::{BearingsConfig, ReceiverConfig, TargetConfig};
use foxhunt_wire::geodesy::compass_deg_to_radians;

/// The receiver's place at each bearing.
pub(super) fn receiver_at(
    receiver: &ReceiverConfig,
    bearings: &BearingsConfig,
) -> Vec<Vector2<f64>> {
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
pub(super) fn target_at(
    target: &TargetConfig,
    bearings: &BearingsConfig,
    drawn: impl FnOnce(&mut Xoshiro256PlusPlus) -> Vector4<f64>,
    rng: &mut Xoshiro256PlusPlus,
) -> Vec<Vector4<f64>> {
    let times = (0..bearings.count).map(|k| f64::from(k) * bearings.interval_s);
    let (start, density) = match *target {
        TargetConfig::Line {
            east_m,
            north_m,
            speed_mps,
            course_deg_compass,
            acceleration_density,
        } => {
            let v = velocity(speed_mps, course_deg_compass);
            (Vector4::new(east_m, north_m, v.x, v.y), acceleration_density)
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
    let motion = ConstantVelocity { acceleration_density: density };
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

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::trial::Leg;

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
