//! The limits of a quadrotor that turns while it flies.

use approx::assert_abs_diff_eq;
use foxhunt_core::Pose;
use foxhunt_sim::{Dynamics, Piloting, Quadrotor, QuadrotorConfig, SimError, WindConfig};
use nalgebra::Vector3;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

const SPIN: f64 = std::f64::consts::FRAC_PI_2;

fn quadrotor(config: QuadrotorConfig) -> Quadrotor {
    let gusts = Xoshiro256PlusPlus::seed_from_u64(3);
    Quadrotor::new(config, Pose { heading: 2.5, ..Pose::at(0.0, 0.0, 4.0) }, gusts)
        .expect("the configuration is in order")
}

/// Either piloting of either body.
fn all() -> [QuadrotorConfig; 4] {
    let of =
        |piloting, dynamics| QuadrotorConfig { piloting, dynamics, ..QuadrotorConfig::default() };
    [
        of(Piloting::Forces, Dynamics::Isaacs2014),
        of(Piloting::Velocities, Dynamics::Isaacs2014),
        of(Piloting::Forces, Dynamics::RigidBody),
        of(Piloting::Velocities, Dynamics::RigidBody),
    ]
}

#[test]
fn it_hovers_on_its_spot_while_it_turns() {
    for config in all() {
        for rate in [SPIN, -SPIN] {
            let mut drone = quadrotor(config);
            drone.spin(Some(rate)).expect("finite");
            drone.advance(15.0);
            for _ in 0..400 {
                drone.advance(0.01);
                let (place, heading) = drone.reference();
                let lag = (drone.heading() - heading).abs().to_degrees();
                assert!(lag < 0.05, "{lag}° behind the ramp");
                assert!((drone.pose().position - place).norm() < 1e-3);
            }
            assert_abs_diff_eq!(drone.heading() - 2.5, rate * 19.0, epsilon = 1e-3);
        }
    }
}

#[test]
fn it_translates_while_it_turns() {
    for config in all() {
        for spin in [None, Some(SPIN), Some(-SPIN)] {
            let mut drone = quadrotor(config);
            drone.spin(spin).expect("finite");
            let mut squares = 0.0;
            let mut count = 0.0;
            let mut highest = 0.0_f64;
            for (east, north, up) in
                [(8.0, 0.0, 4.0), (8.0, 8.0, 4.0), (-3.0, 5.0, 4.0), (0.0, 0.0, 4.0)]
            {
                drone.go_to(Vector3::new(east, north, up)).expect("a place");
                for _ in 0..800 {
                    drone.advance(0.01);
                    let error = drone.pose().position - drone.reference().0;
                    squares += error.xy().norm_squared();
                    count += 1.0;
                    highest = highest.max(error.z.abs());
                }
            }
            let rms = f64::sqrt(squares / count);
            println!(
                "{:?} {:?} {spin:?}: {rms:.4} m rms, {:.3} mm high",
                config.piloting,
                config.dynamics,
                highest * 1e3
            );
            assert!(rms < 0.20, "{rms} m rms from its reference");
            assert!(highest < 1e-3, "{highest} m from its altitude");
        }
    }
}

#[test]
fn it_climbs_and_sinks_without_drifting() {
    for config in all() {
        let mut drone = quadrotor(config);
        drone.spin(Some(SPIN)).expect("finite");
        for up in [9.0, 3.0] {
            drone.go_to(Vector3::new(0.0, 0.0, up)).expect("a place");
            drone.advance(10.0);
            assert!((drone.pose().position - Vector3::new(0.0, 0.0, up)).norm() < 1e-3);
            assert!(drone.velocity().norm() < 1e-3);
        }
    }
}

#[test]
fn its_tilt_keeps_within_the_limit() {
    // A goal that needs more than the tilt can give.
    let config =
        QuadrotorConfig { acceleration_mps2: 50.0, speed_mps: 30.0, ..QuadrotorConfig::default() };
    let mut drone = quadrotor(config);
    drone.spin(Some(SPIN)).expect("finite");
    drone.go_to(Vector3::new(60.0, 0.0, 4.0)).expect("a place");
    let mut steepest = 0.0_f64;
    for _ in 0..6000 {
        drone.advance(0.01);
        let pose = drone.pose();
        let level = (pose.pitch.cos() * pose.roll.cos()).acos().to_degrees();
        steepest = steepest.max(level);
    }
    // The attitude's own controller overshoots what is commanded.
    assert!((19.0..23.0).contains(&steepest), "{steepest}°");
    assert!((drone.pose().position - Vector3::new(60.0, 0.0, 4.0)).norm() < 0.1);
}

#[test]
fn it_leans_into_the_wind_and_survives_gusts() {
    let wind = WindConfig { east_mps: -5.0, gust_sigma_mps: 1.5, ..WindConfig::default() };
    for config in all() {
        let mut drone = quadrotor(QuadrotorConfig { wind, ..config });
        drone.spin(Some(SPIN)).expect("finite");
        drone.advance(20.0);
        let mut squares = 0.0;
        let mut lean = Vector3::zeros();
        let mut sunk = 0.0_f64;
        for _ in 0..10_000 {
            drone.advance(0.01);
            let pose = drone.pose();
            let offset = pose.position - Vector3::new(0.0, 0.0, 4.0);
            squares += offset.xy().norm_squared();
            sunk = sunk.max(offset.z.abs());
            let up = Pose { position: Vector3::zeros(), ..pose };
            let axis = |world: Vector3<f64>| up.to_body(&world).z;
            lean += Vector3::new(axis(Vector3::x()), axis(Vector3::y()), 0.0) / 10_000.0;
        }
        let rms = f64::sqrt(squares / 10_000.0);
        println!(
            "{:?} {:?}: {rms:.3} m rms, {sunk:.3} m up or down",
            config.piloting, config.dynamics
        );
        assert!(rms < 0.3 && sunk < 0.3, "{rms} m rms, {sunk} m up or down");
        // Drag of 0.2 per second and 5 m/s against gravity: 0.102 of the up axis to the East,
        // whichever way the nose points.
        assert_abs_diff_eq!(lean.x, 0.102, epsilon = 0.02);
        assert_abs_diff_eq!(lean.y, 0.0, epsilon = 0.02);
    }
}

/// Unlike moments couple the axes of a tilted body that turns; equations 3 to 8 know none of it.
/// Its controllers make up for nearly all.
#[test]
fn the_inertia_shows_in_a_flight_and_does_no_harm() {
    let fly = |dynamics, inertia_kg_m2| {
        let config = QuadrotorConfig { dynamics, inertia_kg_m2, ..QuadrotorConfig::default() };
        let mut drone = quadrotor(config);
        drone.spin(Some(SPIN)).expect("finite");
        drone.go_to(Vector3::new(8.0, 0.0, 4.0)).expect("a place");
        (0..300)
            .map(|_| {
                drone.advance(0.01);
                drone.pose().position
            })
            .collect::<Vec<_>>()
    };
    let apart = |a: &[Vector3<f64>], b: &[Vector3<f64>]| {
        a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0_f64, f64::max)
    };
    let simplified = fly(Dynamics::Isaacs2014, None);
    let rigid = fly(Dynamics::RigidBody, None);
    let flat = fly(Dynamics::RigidBody, Some([1e-3, 5e-3, 6e-3]));
    println!("{} m, {} m", apart(&simplified, &rigid), apart(&rigid, &flat));
    assert!((1e-6..0.05).contains(&apart(&simplified, &rigid)));
    assert!((1e-6..0.05).contains(&apart(&rigid, &flat)));
}

#[test]
fn the_tick_makes_no_difference() {
    let fly = |tick: f64, ticks: u32| {
        let mut drone = quadrotor(QuadrotorConfig::default());
        drone.spin(Some(SPIN)).expect("finite");
        drone.go_to(Vector3::new(5.0, 5.0, 6.0)).expect("a place");
        (0..ticks).for_each(|_| drone.advance(tick));
        drone
    };
    let fine = fly(0.003, 700);
    let coarse = fly(0.7, 3);
    assert!((fine.pose().position - coarse.pose().position).norm() < 1e-9);
    assert_abs_diff_eq!(fine.heading(), coarse.heading(), epsilon = 1e-9);
    // Between two of its own steps it coasts.
    let late = fly(0.0012, 1750);
    assert_abs_diff_eq!(late.heading(), coarse.heading(), epsilon = 1e-9);
}

#[test]
fn a_spin_that_ends_holds_the_nose() {
    let mut drone = quadrotor(QuadrotorConfig::default());
    drone.spin(Some(SPIN)).expect("finite");
    drone.advance(7.0);
    let stopped = drone.heading();
    drone.spin(None).expect("a stop");
    drone.advance(10.0);
    assert!((drone.heading() - stopped).abs() < 1e-3, "{} rad past", drone.heading() - stopped);
    assert!(matches!(drone.spin(Some(f64::NAN)), Err(SimError::SpinRate { .. })));
    assert!(drone.go_to(Vector3::new(f64::INFINITY, 0.0, 0.0)).is_err());
    drone.advance(1.0);
    assert_abs_diff_eq!(drone.heading(), stopped, epsilon = 1e-3);
}

#[test]
fn numbers_out_of_range_are_named() {
    let base = QuadrotorConfig::default();
    let refused = |config| {
        let gusts = Xoshiro256PlusPlus::seed_from_u64(3);
        match Quadrotor::new(config, Pose::default(), gusts) {
            Err(SimError::Field(error)) => error.field,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(QuadrotorConfig { rate_hz: 5.0, ..base }), "rate_hz");
    assert_eq!(refused(QuadrotorConfig { speed_mps: f64::NAN, ..base }), "speed_mps");
    let mut gains = base.gains;
    gains.yaw_d = -1.0;
    assert_eq!(refused(QuadrotorConfig { gains, ..base }), "gains.yaw_d");
    let inertia =
        |dynamics, moments| QuadrotorConfig { dynamics, inertia_kg_m2: Some(moments), ..base };
    let fit = [0.01, 0.02, 0.025];
    let unused = refused(inertia(Dynamics::Isaacs2014, fit));
    assert_eq!(unused, "inertia_kg_m2");
    for moments in [[0.0, 0.02, 0.02], [f64::NAN, 0.02, 0.02], [0.01, 0.01, 0.021]] {
        assert_eq!(refused(inertia(Dynamics::RigidBody, moments)), "inertia_kg_m2");
    }
    let gusts = Xoshiro256PlusPlus::seed_from_u64(3);
    let taken = inertia(Dynamics::RigidBody, fit);
    Quadrotor::new(taken, Pose::default(), gusts).expect("moments of a body");
    let json = serde_json::to_string(&base).expect("it can be written");
    assert_eq!(serde_json::from_str::<QuadrotorConfig>(&json).expect("its own output"), base);
}
