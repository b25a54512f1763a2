use approx::abs_diff_eq;
use foxhunt_core::{BeaconId, Bearing, Correction, Estimate, Level, Outcome, Pose, Reception};
use foxhunt_hunt::{
    config::ModelConfig,
    hunt::Fix,
    log::{LOG_VERSION, LoggedBeacon},
    registry::Registry,
};
use foxhunt_sim::BeaconCourse;
use nalgebra::{Matrix2, Vector2};

use super::*;

fn header(truth: Option<Vector2<f64>>) -> LogHeader {
    LogHeader {
        foxhunt_log: LOG_VERSION,
        scenario: "a field".to_owned(),
        seed: 7,
        estimator_name: "ekf".to_owned(),
        estimator: Registry::builtin()
            .estimator("ekf")
            .expect("it is built in")
            .settings()
            .copied(),
        model: ModelConfig {
            reference_dbm: -29.06,
            exponent: 2.765,
            target_up_m: 0.0,
            antenna: None,
            reference_m: None,
            pulses: None,
            terrain: None,
        },
        planner: None,
        beacons: vec![LoggedBeacon {
            name: "<fox & co>".to_owned(),
            truth,
            course: None,
            others: Vec::new(),
        }],
        epoch_unix_s: None,
        homes: Vec::new(),
        origin: None,
    }
}

fn believed(sigma: f64) -> Estimate<2> {
    Estimate::isotropic(Vector2::new(3.0, 4.0), sigma)
}

/// One drone receives the beacon twice; the second bearing is kept out.
fn hunt(estimate: Estimate<2>, angle: f64, outcome: Outcome) -> Vec<Event> {
    let reception = |time: f64| Reception {
        beacon: BeaconId(0),
        time,
        receiver: Pose::at(-5.0, time, 4.0),
        level: Some(Level { rss_dbm: -60.0, sigma_db: 4.0 }),
        bearing: Some(Bearing { angle, sigma: 0.3, confidence: 0.8 }),
        ..Reception::default()
    };
    let received = |time: f64| Event::Received {
        time,
        drone: 0,
        first_position: true,
        reception: reception(time),
    };
    let fused = Correction::Fused { nis: None, log_evidence: 0.0, effective_sample_size: None };
    let rejected = Correction::Rejected { nis: 30.0, limit: 24.0 };
    let corrected = |time: f64, correction| Event::Corrected {
        time,
        drone: 0,
        beacon: Some(BeaconId(0)),
        correction,
        degrees_of_freedom: Some(2),
        estimate,
    };
    let name = "<fox & co>".to_owned();
    let fix = Fix {
        beacon: BeaconId(0),
        name: name.clone(),
        estimate,
        steps: 2,
        formation_positions: 1,
        outcome,
        transmitters: None,
    };
    let prior = Estimate::isotropic(Vector2::zeros(), 8.0);
    vec![
        Event::BeaconStarted { time: 0.0, beacon: BeaconId(0), name, prior, hunt_prior: None },
        received(1.0),
        corrected(1.0, fused),
        received(2.0),
        corrected(2.0, rejected),
        Event::BeaconFinished { time: 3.0, fix },
    ]
}

fn lines_of(svg: &str, colour: &str) -> usize {
    svg.lines().filter(|l| l.starts_with("<polyline") && l.contains(colour)).count()
}

#[test]
fn a_hunt_in_a_picture() {
    let events = hunt(believed(1.0), 0.7, Outcome::Converged);
    let svg = hunt_svg(&header(Some(Vector2::new(3.5, 4.0))), &events).expect("it can be drawn");
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    // A quarter of the units that it is drawn in.
    assert!(svg.contains("width=\"1120\" height=\"860\" viewBox=\"0 0 4480 3440\""), "its size");
    for text in ["a field · ekf · seed 7", "0.50 m off", "converged, 2 steps", "drone 1"] {
        assert!(svg.contains(text), "{text} is missing");
    }
    assert!(svg.contains("&lt;fox &amp; co&gt;") && !svg.contains("<fox"), "names are escaped");
    assert!(!svg.contains("NaN") && !svg.contains("inf"));

    // Without the rejection there are fewer dashes: each dash is a line of the drone's colour.
    let mut all_fused = events.clone();
    all_fused.remove(4);
    let fused = hunt_svg(&header(None), &all_fused).expect("it can be drawn");
    assert!(lines_of(&svg, "#0072B2") > lines_of(&fused, "#0072B2") + 5);
    // Without a truth no star and no error.
    assert!(!fused.contains("m off") && !fused.contains("truly"));
}

#[test]
fn a_round_belief_is_a_round_ellipse() {
    let events = hunt(believed(1.0), 0.7, Outcome::Converged);
    let svg = hunt_svg(&header(None), &events).expect("it can be drawn");
    // The first filled area of the belief's colour is the inside of the ellipse.
    let inside = svg
        .lines()
        .find(|l| l.starts_with("<polygon") && l.contains("#C8143C"))
        .expect("the ellipse is drawn");
    let points = inside.split("points=\"").nth(1).and_then(|p| p.split('"').next());
    let corners: Vec<(i32, i32)> = points
        .expect("a polygon has points")
        .split_whitespace()
        .map(|pair| {
            let (x, y) = pair.split_once(',').expect("two numbers");
            (x.parse().expect("a whole number"), y.parse().expect("a whole number"))
        })
        .collect();
    let span = |pick: fn(&(i32, i32)) -> i32| {
        let values = corners.iter().map(pick);
        values.clone().max().expect("corners") - values.min().expect("corners")
    };
    // Each end is rounded to a whole unit.
    assert!(abs_diff_eq!(span(|c| c.0), span(|c| c.1), epsilon = 2), "{corners:?}");
    assert!(span(|c| c.0) > 100);
}

#[test]
fn what_is_not_finite_is_left_out() {
    let nowhere = Estimate { mean: Vector2::repeat(f64::NAN), covariance: Matrix2::zeros() };
    let far = Estimate::isotropic(Vector2::repeat(1e300), f64::MAX);
    let flat = Estimate { mean: Vector2::zeros(), covariance: Matrix2::repeat(f64::INFINITY) };
    let vast = Estimate::isotropic(Vector2::zeros(), 1e5);
    for estimate in [nowhere, far, flat, vast] {
        for angle in [f64::NAN, f64::INFINITY, 1e300] {
            for truth in [None, Some(Vector2::repeat(f64::NAN)), Some(Vector2::repeat(1e300))] {
                let events = hunt(estimate, angle, Outcome::NoSignal);
                let svg = hunt_svg(&header(truth), &events).expect("it can be drawn");
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{estimate:?} {angle}");
                assert!(svg.len() < 100_000);
            }
        }
    }
}

#[test]
fn a_hunt_that_never_began_is_an_empty_field() {
    let svg = hunt_svg(&header(None), &[]).expect("an empty field can be drawn");
    assert!(svg.contains("East in metres") && !svg.contains("drone"));
    let endless = usize::MAX;
    let mut events = hunt(believed(1.0), 0.7, Outcome::Converged);
    for event in &mut events {
        if let Event::Received { drone, .. } = event {
            *drone = endless;
        }
    }
    assert!(hunt_svg(&header(None), &events).is_ok(), "the drone of a broken log");
}

#[test]
fn the_ellipse_keeps_inside_the_field() {
    let long =
        Estimate { mean: Vector2::new(3.0, 4.0), covariance: Matrix2::new(1e6, 0.0, 0.0, 1.0) };
    let svg = hunt_svg(&header(None), &hunt(long, 0.7, Outcome::MoveLimit)).expect("drawn");
    let outline = svg.lines().filter(|l| l.contains("#C8143C") && l.contains("points="));
    for line in outline {
        let points = line.split("points=\"").nth(1).and_then(|p| p.split('"').next());
        for pair in points.expect("it has points").split_whitespace() {
            let x: i32 = pair.split(',').next().and_then(|x| x.parse().ok()).expect("a number");
            assert!((0..=canvas::LEGEND.right).contains(&x), "{line}");
        }
    }
}

#[test]
fn clouds_and_courses_are_drawn() {
    let mut events = hunt(believed(1.0), 0.7, Outcome::PathDone);
    let dots = |svg: &str| svg.matches("<circle").count();
    let plain = hunt_svg(&header(Some(Vector2::new(3.5, 4.0))), &events).expect("drawn");
    let beside = |i: u16| Vector2::new(3.0 + 0.01 * f64::from(i), 4.0);
    let mut places: Vec<_> = (0..200).map(beside).collect();
    // One that is far outside, and one that is nowhere.
    places.extend([Vector2::new(900.0, 0.0), Vector2::repeat(f64::NAN)]);
    let cloud = Event::Cloud { time: 3.0, beacon: BeaconId(0), places };
    events.insert(5, cloud);
    let mut header = header(Some(Vector2::new(3.5, 4.0)));
    header.beacons[0].course = Some(BeaconCourse::Circle { radius_m: 2.0, period_s: 4.0 });
    let svg = hunt_svg(&header, &events).expect("drawn");
    // 200 places, and 6 in the legend.
    assert_eq!(dots(&svg), dots(&plain) + 206);
    assert!(svg.contains("where the beacon went") && !plain.contains("where the beacon went"));
    assert!(!svg.contains("NaN") && svg.contains("truly in the end"));
    // It was last received after half a round of 4 s: 4 m to the West of where it began.
    assert!(svg.contains("3.50 m off"), "from (3, 4) to (-0.5, 4)");
}
