//! The information-driven planner and its baseline, as a user sees them.

use foxhunt_core::{
    BeaconId, Belief, Decision, Estimate, FormationPlanner, Outcome, PlanError, Pose, Station,
    Target, laws,
};
use foxhunt_formation::{
    AltitudeRule, Criterion, ExpectedReading, Information, InformationConfig, SteepestDescent,
    SteepestDescentConfig,
};
use nalgebra::{Matrix2, Vector2, Vector3};
use proptest::prelude::*;

/// Places of equal weight.
struct Cloud(Vec<Vector2<f64>>);

impl Cloud {
    /// Rings about some middles, of this radius.
    fn about(middles: &[[f64; 2]], radius: f64) -> Self {
        let offset = |i: u8| {
            let angle = 2.4 * f64::from(i);
            Vector2::new(angle.cos(), angle.sin()) * radius * (f64::from(i) / 100.0).sqrt()
        };
        let around = |middle: &[f64; 2]| {
            let middle = Vector2::from(*middle);
            (0..100).map(move |i| middle + offset(i))
        };
        Self(middles.iter().flat_map(around).collect())
    }
}

impl Belief for Cloud {
    fn position(&self) -> Estimate<2> {
        let count = f64::from(u32::try_from(self.0.len()).expect("few"));
        let mean = self.0.iter().sum::<Vector2<f64>>() / count;
        let square = |place: &Vector2<f64>| (place - mean) * (place - mean).transpose();
        Estimate { mean, covariance: self.0.iter().map(square).sum::<Matrix2<f64>>() / count }
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        let weight = 1.0 / f64::from(u32::try_from(self.0.len()).expect("few"));
        self.0.iter().for_each(|place| visit(place, weight));
    }
}

fn planner() -> Information {
    Information::new(InformationConfig::default()).expect("the defaults are in range")
}

fn descent() -> SteepestDescent {
    SteepestDescent::new(SteepestDescentConfig::default()).expect("the defaults are in range")
}

fn drones(places: &[[f64; 2]]) -> Vec<Station> {
    places.iter().map(|[e, n]| Station::holding(Pose::at(*e, *n, 4.0))).collect()
}

fn triangle() -> Vec<Station> {
    drones(&[[6.0, 0.0], [-3.0, 5.2], [-3.0, -5.2]])
}

fn goals(stations: &[Station]) -> Vec<Vector3<f64>> {
    stations.iter().map(|station| station.goal.position).collect()
}

fn middle(stations: &[Station]) -> Vector2<f64> {
    let count = f64::from(u32::try_from(stations.len()).expect("few"));
    stations.iter().map(|s| s.goal.position.xy()).sum::<Vector2<f64>>() / count
}

fn explained(planner: &dyn FormationPlanner) -> String {
    let mut text = String::new();
    planner.explain(&mut text).expect("a String takes everything");
    text
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2))]

    #[test]
    fn both_keep_the_laws(e in -200.0..200.0, n in -200.0..200.0, sigma in 2.0..100.0) {
        let belief = Estimate::isotropic(Vector2::new(e, n), sigma);
        laws::formation_planner(planner, &belief, &mut triangle());
        laws::formation_planner(descent, &belief, &mut triangle());
        let config = InformationConfig { prior_sigma_m: 40.0, ..InformationConfig::default() };
        let with_prior = || Information::new(config).expect("in range");
        laws::formation_planner(with_prior, &belief, &mut triangle());
    }
}

#[test]
fn goals_are_apart_low_and_near_a_narrow_belief() {
    let mut refined = 0;
    for count in 1..=8_u8 {
        let mut stations: Vec<_> = (0..count)
            .map(|i| Station::holding(Pose::at(5.0 * f64::from(i), -40.0, 4.0)))
            .collect();
        let belief = Estimate::isotropic(Vector2::new(10.0, 20.0), 2.0);
        let mut planner = planner();
        planner.begin(&mut stations).expect("there are drones");
        assert!(explained(&planner).contains("nothing is believed"));
        assert!(matches!(planner.plan(&belief, &mut stations), Ok(Decision::Listen(_))));
        assert!((middle(&stations) - Vector2::new(10.0, 20.0)).norm() < 8.0, "{count}");
        let goals = goals(&stations);
        for (index, a) in goals.iter().enumerate() {
            assert!((2.0..=4.0).contains(&a.z));
            assert!(goals[..index].iter().all(|b| (a.xy() - b.xy()).norm() > 3.0 - 1e-6));
        }
        let why = explained(&planner);
        refined += u32::from(why.contains(", refined: "));
        assert!(why.contains("move ") && why.contains("turning again"), "{why}");
    }
    // Now and then a regular formation is best as it is.
    assert!((1..=8).contains(&refined), "{refined}");
}

#[test]
fn the_same_plan_every_time_and_for_fewer_drones() {
    let belief = Cloud::about(&[[30.0, 10.0], [60.0, -20.0]], 9.0);
    let (mut one, mut two) = (planner(), planner());
    let (mut a, mut b) = (triangle(), triangle());
    for _ in 0..2 {
        assert_eq!(one.plan(&belief, &mut a), two.plan(&belief, &mut b));
        assert_eq!(a, b);
    }
    // One drops out: the others go on, and it makes no difference who plans.
    assert!(one.plan(&belief, &mut a[..2]).is_ok() && two.plan(&belief, &mut b[..2]).is_ok());
    assert_eq!(a, b);
}

#[test]
fn it_ends_when_the_ellipse_is_small_when_little_is_learned_and_at_its_cap() {
    let wide = Estimate::isotropic(Vector2::new(40.0, 0.0), 10.0);
    let mut stations = triangle();
    let mut planner = planner();
    // 1.6 m is 0.654 standard deviations of a 95 % ellipse.
    let small = Estimate::isotropic(Vector2::zeros(), 0.65);
    let end = Ok(Decision::Finish(Outcome::EllipseReached));
    assert_eq!(planner.plan(&small, &mut stations), end);
    assert!(explained(&planner).contains("ellipse 1.59 m"), "{}", explained(&planner));
    let larger = Estimate::isotropic(Vector2::zeros(), 0.66);
    assert!(matches!(planner.plan(&larger, &mut stations), Ok(Decision::Listen(_))));

    let config = InformationConfig { most_positions: 3, ..InformationConfig::default() };
    let mut capped = Information::new(config).expect("in range");
    capped.begin(&mut stations).expect("there are drones");
    for _ in 0..2 {
        assert!(matches!(capped.plan(&wide, &mut stations), Ok(Decision::Listen(_))));
    }
    assert_eq!(capped.plan(&wide, &mut stations), Ok(Decision::Finish(Outcome::MoveLimit)));

    let config = InformationConfig { least_nats_per_s: 1.0, ..InformationConfig::default() };
    let mut choosy = Information::new(config).expect("in range");
    assert_eq!(choosy.plan(&wide, &mut stations), Ok(Decision::Finish(Outcome::LittleToLearn)));
    assert!(explained(&choosy).contains("little more to learn"));
}

/// Levels alone, the power known: on the line that halves two modes both would read the same.
#[test]
fn two_modes_are_distinguished_where_they_read_differently() {
    let belief = Cloud::about(&[[-50.0, 0.0], [50.0, 0.0]], 3.0);
    let config = InformationConfig {
        bearing_sigma_deg: 1000.0,
        power_sigma_db: 0.0,
        ..InformationConfig::default()
    };
    for criterion in [Criterion::Automatic, Criterion::Entropy] {
        let mut planner = Information::new(InformationConfig { criterion, ..config }).expect("ok");
        let mut stations = drones(&[[0.0, -60.0]]);
        assert!(matches!(planner.plan(&belief, &mut stations), Ok(Decision::Listen(_))));
        let goal = stations[0].goal.position;
        let range = |east: f64| (goal - Vector3::new(east, 0.0, 0.0)).norm();
        let differ = 27.65 * (range(-50.0) / range(50.0)).log10();
        assert!(differ.abs() > 8.0, "{differ} dB between the modes at {goal}");
    }
}

#[test]
fn a_target_that_is_found_weighs_nothing_and_wide_ones_do() {
    let targets = |first: Estimate<2>, others: &[Estimate<2>]| {
        let mut stations = triangle();
        let all: Vec<Estimate<2>> = [first].iter().chain(others).copied().collect();
        let targets: Vec<_> = (0..)
            .zip(&all)
            .map(|(index, belief)| Target { beacon: BeaconId(index), belief })
            .collect();
        planner().plan_together(&targets, &mut stations).expect("a plan");
        goals(&stations)
    };
    let at = |e, sigma| Estimate::isotropic(Vector2::new(e, 30.0), sigma);
    let alone = targets(at(40.0, 10.0), &[]);
    assert_eq!(targets(at(40.0, 10.0), &[at(-200.0, 0.5)]), alone);
    // A second one beside it that is as wide draws the formation to its side.
    let both = targets(at(40.0, 10.0), &[at(20.0, 10.0), at(20.0, 10.0), at(20.0, 10.0)]);
    let east = |goals: &[Vector3<f64>]| goals.iter().map(|goal| goal.x).sum::<f64>() / 3.0;
    assert!(east(&both) < east(&alone) - 5.0, "{} and {}", east(&both), east(&alone));
}

/// With a prior of where the target may be it goes there before it listens, if that is far.
#[test]
fn what_is_believed_beforehand_is_used_at_the_start() {
    let config = InformationConfig {
        prior_sigma_m: 20.0,
        prior_centre_m: Some([300.0, 0.0]),
        ..InformationConfig::default()
    };
    let mut planner = Information::new(config).expect("in range");
    let mut stations = triangle();
    planner.begin(&mut stations).expect("there are drones");
    assert!((middle(&stations) - Vector2::new(300.0, 0.0)).norm() < 60.0, "{}", middle(&stations));
    assert!(explained(&planner).contains("nats"));
    let mut blind = self::planner();
    blind.begin(&mut stations).expect("there are drones");
    assert!(stations.iter().all(|s| s.goal.position == s.pose.position));
}

/// A user's own sensor: a closure that measures bearings alone, from the South only.
#[test]
fn a_closure_is_a_kind_of_turn() {
    let deaf_to_the_north = |target: &Vector2<f64>, receiver: &Vector3<f64>| {
        let offset = target - receiver.xy();
        let sigma = if offset.y > 0.0 { 0.2 } else { 1e3 };
        ExpectedReading {
            level_db: 0.0,
            level_sigma_db: 1e3,
            bearing: offset.y.atan2(offset.x),
            bearing_sigma: sigma,
        }
    };
    let mut planner =
        Information::with_turn(InformationConfig::default(), deaf_to_the_north).expect("in range");
    let mut stations = drones(&[[30.0, 50.0], [33.0, 55.0], [36.0, 50.0]]);
    let belief = Estimate::isotropic(Vector2::new(0.0, 0.0), 5.0);
    assert!(matches!(planner.plan(&belief, &mut stations), Ok(Decision::Listen(_))));
    assert!(stations.iter().all(|s| s.goal.position.y < 2.0), "{:?}", goals(&stations));
}

#[test]
fn descent_steps_towards_the_target_and_ends() {
    let (mut planner, mut stations) = (descent(), triangle());
    planner.begin(&mut stations).expect("there are drones");
    let belief = Estimate::isotropic(Vector2::new(80.0, 0.0), 8.0);
    for _ in 0..4 {
        let before = (middle(&stations) - belief.mean).norm();
        assert!(matches!(planner.plan(&belief, &mut stations), Ok(Decision::Listen(_))));
        for station in &mut stations {
            let step = (station.goal.position - station.pose.position).xy().norm();
            assert!(step <= 30.0 + 1e-9, "{step}");
            station.pose.position = station.goal.position;
        }
        let after = (middle(&stations) - belief.mean).norm();
        assert!(after < before.max(15.0), "{before} to {after}");
    }
    assert!((middle(&stations) - belief.mean).norm() < 15.0);
    assert!(explained(&planner).contains("nats"));
    let small = Estimate::isotropic(Vector2::zeros(), 0.5);
    let end = planner.plan(&small, &mut stations);
    assert_eq!(end, Ok(Decision::Finish(Outcome::EllipseReached)));
    // A point and a line have no information matrix.
    let point = Estimate { mean: Vector2::new(5.0, 5.0), covariance: Matrix2::zeros() };
    let end = planner.plan(&point, &mut stations);
    assert_eq!(end, Ok(Decision::Finish(Outcome::EllipseReached)));
    let line = Estimate { covariance: Matrix2::new(90.0, 0.0, 0.0, 0.0), ..point };
    assert_eq!(descent().plan(&line, &mut stations), Err(PlanError::NoPlace));
    let config = SteepestDescentConfig { most_positions: 1, ..SteepestDescentConfig::default() };
    let mut capped = SteepestDescent::new(config).expect("in range");
    let end = capped.plan(&line, &mut stations);
    assert_eq!(end, Ok(Decision::Finish(Outcome::MoveLimit)));
    let config = SteepestDescentConfig { step_m: 0.0, ..SteepestDescentConfig::default() };
    assert_eq!(SteepestDescent::new(config).map_err(|e| e.name).err(), Some("step_m"));
}

#[test]
fn what_is_out_of_range_is_named() {
    let good = InformationConfig::default();
    let inverted = AltitudeRule { least_m: 9.0, ..good.altitude };
    for (field, config) in [
        ("turn_s", InformationConfig { turn_s: 0.0, ..good }),
        ("horizon", InformationConfig { horizon: 0, ..good }),
        ("places", InformationConfig { places: 2, ..good }),
        ("most_m", InformationConfig { altitude: inverted, ..good }),
        ("prior_centre_m", InformationConfig { prior_centre_m: Some([0.0, f64::NAN]), ..good }),
        ("exponent", InformationConfig { exponent: -1.0, ..good }),
    ] {
        assert_eq!(Information::new(config).map_err(|e| e.name).err(), Some(field));
    }
    let mut none: [Station; 0] = [];
    let belief = Estimate::isotropic(Vector2::zeros(), 5.0);
    let few = Err(PlanError::TooFew { needed: 1, have: 0 });
    assert_eq!(planner().plan(&belief, &mut none), few);
    assert_eq!(descent().plan(&belief, &mut none), few);
}
