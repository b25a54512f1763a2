use std::mem::discriminant;

use foxhunt_formation::{
    AltitudeRule, ArcsConfig, CoverageConfig, FollowConfig, InformationConfig, OrbitConfig,
    SettlingRule, SteepestDescentConfig, SurgeCastConfig,
};
use foxhunt_sim::VehicleConfig;
use nalgebra::Vector2;

use super::{PlannerConfig, ShapeConfig};
use crate::{hunt::HuntConfig, scenario::Scenario};

/// A planner that the program knows by name.
#[derive(Clone, Copy, Debug)]
pub struct NamedPlanner {
    /// Its name, as `--planner` takes it.
    pub name: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    config: fn(&Scenario) -> PlannerConfig,
}

impl NamedPlanner {
    /// What it is made of in a scenario, which tells it what the area and the signal are like.
    /// Where the scenario's own planner is of this kind, it is the scenario's own, but for
    /// `pritzl2018` and `pritzl2018-emulated`: these are the reference's whatever the scenario
    /// says.
    #[must_use]
    pub fn config(&self, scenario: &Scenario) -> PlannerConfig {
        let (named, own) = ((self.config)(scenario), &scenario.planner);
        let fixed = self.name.starts_with(REFERENCE);
        if discriminant(&named) == discriminant(own) && !fixed { own.clone() } else { named }
    }
}

/// What names of planners begin with that are the reference's.
const REFERENCE: &str = "pritzl2018";

/// How often `hold` listens.
const TURNS: u32 = 10;

/// How many drones `pritzl2018-emulated` emulates, the reference's.
const VIRTUAL_DRONES: u16 = 3;

/// How many places a side of the area is swept at where the scenario has no path of its own, as
/// the reference's sweep has it (Pritzl 2018, §7.4).
const PLACES_A_SIDE: f64 = 4.0;

/// Half the width of a box that holds a Gaussian of two equal, independent coordinates with 95 %,
/// in standard deviations: the quantile of (1 + √0.95) / 2.
const BOX_95: f64 = 2.236_476_644_557_789_5;

/// Every planner that has a name.
#[must_use]
pub fn planners() -> Vec<NamedPlanner> {
    let named = |name, about, source, config| NamedPlanner { name, about, source, config };
    vec![
        named(
            "pritzl2018",
            "a polygon, with three drones a triangle, that follows the estimate until it has settled",
            "Pritzl 2018, §5.2",
            |_| pritzl2018(),
        ),
        named(
            "pritzl2018-emulated",
            "the same, where there are fewer than three drones flown for three, one place after the other",
            "Pritzl 2018, §7.2",
            |_| PlannerConfig::Emulated {
                virtual_drones: VIRTUAL_DRONES,
                planner: Box::new(pritzl2018()),
            },
        ),
        named(
            "waypoints",
            "the scenario's own path, or else the lawn-mower's",
            "Pritzl 2018, §7.3 and §7.4",
            waypoints,
        ),
        named(
            "lawn-mower",
            "a sweep in rows, back and forth, of the area where the beacon is believed to be",
            "Pritzl 2018, §7.4; Choset & Pignon 1998",
            lawn_mower,
        ),
        named(
            "orbit",
            "a circle about the estimate, drones spread evenly, and one round once it has settled",
            "Pritzl 2018, §5.2, in steps about one centre",
            orbit,
        ),
        named(
            "arcs",
            "a spiral towards the estimate, so that bearings differ on the way in, then a circle",
            "Pritzl 2018, ch. 8, a logarithmic spiral",
            arcs,
        ),
        named(
            "surge-cast",
            "along the bearings while the level rises, across them when it falls, then a circle",
            "Kennedy & Marsh 1974; Balkovsky & Shraiman 2002",
            surge_cast,
        ),
        named(
            "information",
            "where the ellipse of what is believed is expected to become small soonest",
            "Chaloner & Verdinelli 1995; Kolchinsky & Tracey 2017",
            |scenario| PlannerConfig::Information { information: information(scenario) },
        ),
        named(
            "steepest-descent",
            "each drone down the gradient of the posterior bound, one turn ahead",
            "Uciński 2004; Martínez & Bullo 2006",
            steepest_descent,
        ),
        named(
            "bayesian-optimisation",
            "to where the level is expected to improve most, by a Gaussian process of levels",
            "Močkus 1975; Jones, Schonlau & Welch 1998",
            |_| PlannerConfig::BayesianOptimisation(Default::default()),
        ),
        named("hold", "everyone stays and listens", "Isaacs et al. 2014, §V", |_| {
            PlannerConfig::Hold { turns: TURNS }
        }),
    ]
}

/// The planner of a name.
#[must_use]
pub fn planner_named(name: &str) -> Option<NamedPlanner> {
    planners().into_iter().find(|known| known.name == name)
}

fn pritzl2018() -> PlannerConfig {
    PlannerConfig::FollowEstimate { follow: FollowConfig::pritzl2018(), shape: None }
}

fn steepest_descent(scenario: &Scenario) -> PlannerConfig {
    let exponent = scenario.model.exponent;
    PlannerConfig::SteepestDescent(SteepestDescentConfig { exponent, ..Default::default() })
}

/// With the exponent that the estimator takes, the vehicles' speed, the time that the slowest turn
/// takes and what is believed before anything was heard.
///
/// A turn is not taken for shorter than the planner's own 45 s: told the simulated stepper's 11 s, it
/// stops more often on the way, and is sure to 3 m later (from the far start after 365 s and not
/// 313 s, medians of 200 hunts).
fn information(scenario: &Scenario) -> InformationConfig {
    let default = InformationConfig::default();
    let (speed_mps, climb_mps) = match &scenario.world.vehicle {
        VehicleConfig::Kinematic(vehicle) => (vehicle.speed_mps, vehicle.climb_mps),
        VehicleConfig::Quadrotor(vehicle) => (vehicle.speed_mps, vehicle.climb_mps),
        _ => (default.speed_mps, default.climb_mps),
    };
    let asked = if scenario.hunt.shared_turns { scenario.world.beacons.len() } else { 1 };
    let asked = u16::try_from(asked).unwrap_or(u16::MAX);
    let quickness = &scenario.world.stepper;
    let sources = match scenario.sources.as_slice() {
        [] => std::slice::from_ref(&scenario.source),
        sources => sources,
    };
    let turn_s =
        sources.iter().map(|source| source.turn_s(quickness, asked)).fold(default.turn_s, f64::max);
    // What the traffic keeps between two goals: the separation, and twice its tolerance, which is
    // twice what a drone may be from its goal.
    let kept_m = scenario.hunt.separation_m + 4.0 * scenario.hunt.arrival_tolerance_m;
    InformationConfig {
        exponent: scenario.model.exponent,
        speed_mps,
        climb_mps,
        turn_s,
        separation_m: default.separation_m.max(kept_m),
        prior_sigma_m: scenario.hunt.prior_sigma_m,
        prior_centre_m: scenario.hunt.prior_centre_m,
        ..default
    }
}

/// A path of the scenario's own is of another kind than the lawn-mower's that stands in for it.
fn waypoints(scenario: &Scenario) -> PlannerConfig {
    match &scenario.planner {
        own @ (PlannerConfig::Waypoints { .. } | PlannerConfig::LawnMower { .. }) => own.clone(),
        _ => lawn_mower(scenario),
    }
}

/// Its area is the fence, or else a box that holds the beacon with 95 %.
fn lawn_mower(scenario: &Scenario) -> PlannerConfig {
    let fence = &scenario.hunt.airspace.fence_m;
    let (corners_m, spacing, inside) = if fence.is_empty() {
        let (half, centre) = (BOX_95 * scenario.hunt.prior_sigma_m, prior_centre(scenario));
        let corner = |east: f64, north: f64| [centre.x + east * half, centre.y + north * half];
        let square = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        (square.to_vec(), 2.0 * half / PLACES_A_SIDE, false)
    } else {
        (fence.clone(), area_m2(fence).sqrt() / PLACES_A_SIDE, true)
    };
    let circumradius_m = FollowConfig::pritzl2018().circumradius_m.min(0.25 * spacing);
    // Each place is the middle of its share of the box; inside a fence, the drones are.
    let margin_m = if inside { circumradius_m } else { 0.5 * spacing };
    PlannerConfig::LawnMower {
        corners_m,
        coverage: CoverageConfig {
            row_spacing_m: spacing,
            along_spacing_m: spacing,
            margin_m,
            direction_rad: None,
        },
        shape: Some(ShapeConfig::Polygon { circumradius_m }),
        up_m: altitude(scenario).most_m,
        rounds: 1,
    }
}

/// The area of a simple polygon in square metres (the shoelace formula).
fn area_m2(corners: &[[f64; 2]]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    let doubled = corners.iter().zip(next).map(|([e, n], [to_e, to_n])| e * to_n - to_e * n);
    0.5 * doubled.sum::<f64>().abs()
}

fn orbit(scenario: &Scenario) -> PlannerConfig {
    let config = OrbitConfig::default();
    PlannerConfig::Orbit(OrbitConfig {
        radius_m: in_area(config.radius_m, scenario),
        altitude: altitude(scenario),
        settling: settling(scenario),
        ..config
    })
}

fn arcs(scenario: &Scenario) -> PlannerConfig {
    let config = ArcsConfig::default();
    PlannerConfig::Arcs(ArcsConfig {
        spacing_m: in_area(config.spacing_m, scenario),
        standoff_m: in_area(config.standoff_m, scenario),
        altitude: altitude(scenario),
        settling: settling(scenario),
        ..config
    })
}

fn surge_cast(scenario: &Scenario) -> PlannerConfig {
    let config = SurgeCastConfig::default();
    // Its legs are for a prior as wide as the hunt's default.
    let wider = scenario.hunt.prior_sigma_m / HuntConfig::default().prior_sigma_m;
    PlannerConfig::SurgeCast(SurgeCastConfig {
        surge_m: config.surge_m * wider,
        cast_m: config.cast_m * wider,
        circumradius_m: in_area(config.circumradius_m, scenario),
        standoff_m: in_area(config.standoff_m, scenario),
        altitude: altitude(scenario),
        settling: settling(scenario),
        ..config
    })
}

/// A length, or the prior's σ where that is shorter: a room is not circled from outside.
fn in_area(length_m: f64, scenario: &Scenario) -> f64 {
    length_m.min(scenario.hunt.prior_sigma_m)
}

/// In a room, an estimate settles within less.
fn settling(scenario: &Scenario) -> SettlingRule {
    let rule = SettlingRule::default();
    SettlingRule { settled_m: rule.settled_m.min(0.1 * scenario.hunt.prior_sigma_m), ..rule }
}

/// Drones that begin in the air go no higher than the highest of them, and nobody leaves the
/// altitudes that the hunt permits.
fn altitude(scenario: &Scenario) -> AltitudeRule {
    let mut rule = AltitudeRule::default();
    let highest = scenario.world.drones.iter().map(|drone| drone.up_m).fold(0.0, f64::max);
    if highest > 0.0 {
        (rule.least_m, rule.most_m) = (rule.least_m.min(highest), highest);
    }
    if let Some([low, high]) = scenario.hunt.airspace.altitude_m {
        let within = |up: f64| up.min(high).max(low);
        (rule.least_m, rule.most_m) = (within(rule.least_m), within(rule.most_m));
    }
    rule
}

/// What a beacon is believed to be about before anything was heard, as the hunt has it.
fn prior_centre(scenario: &Scenario) -> Vector2<f64> {
    let drones = &scenario.world.drones;
    let count = u32::try_from(drones.len()).unwrap_or(u32::MAX).max(1);
    let sum: Vector2<f64> = drones.iter().map(|d| Vector2::new(d.east_m, d.north_m)).sum();
    scenario.hunt.prior_centre_m.map_or(sum / f64::from(count), Vector2::from)
}

#[cfg(test)]
mod tests {
    use foxhunt_formation::Coverage;

    use super::*;
    use crate::scenario::builtin_scenarios;

    fn scenario(name: &str) -> Scenario {
        Scenario::find(name).expect("a built-in scenario")
    }

    #[test]
    fn every_name_makes_a_planner_for_every_scenario() {
        for scenario in builtin_scenarios() {
            for planner in planners() {
                assert_eq!(planner_named(planner.name).map(|p| p.name), Some(planner.name));
                let config = planner.config(&scenario);
                let built = config.build();
                assert!(built.is_ok(), "{} for {}: {:?}", planner.name, scenario.name, built.err());
            }
        }
        assert!(planner_named("psychic").is_none());
    }

    #[test]
    fn a_scenario_that_has_a_path_keeps_it() {
        for (name, planner) in [("pritzl-7.4", "waypoints"), ("isaacs-line", "waypoints")] {
            let scenario = scenario(name);
            let named = planner_named(planner).expect("it is known");
            assert_eq!(named.config(&scenario), scenario.planner, "{name}");
        }
    }

    #[test]
    fn a_scenarios_own_settings_stay_with_the_name_of_their_kind() {
        let mut scenario = scenario("pritzl-6.1");
        for (name, text) in [
            ("information", "kind = \"information\"\ninformation = { horizon = 2 }"),
            ("steepest-descent", "kind = \"steepest-descent\"\nstep_m = 11"),
            ("bayesian-optimisation", "kind = \"bayesian-optimisation\"\nreach_m = 41"),
            ("orbit", "kind = \"orbit\"\nradius_m = 13"),
            ("hold", "kind = \"hold\"\nturns = 77"),
        ] {
            scenario.planner = toml::from_str(text).expect("a planner");
            let named = planner_named(name).expect("it is known");
            assert_eq!(named.config(&scenario), scenario.planner, "{name}");
        }
        let follow = FollowConfig { circumradius_m: 9.0, ..FollowConfig::pritzl2018() };
        scenario.planner = PlannerConfig::FollowEstimate { follow, shape: None };
        let named = planner_named("pritzl2018").expect("it is known");
        assert_eq!(named.config(&scenario), pritzl2018());
    }

    #[test]
    fn the_area_that_is_believed_in_is_swept() {
        let mut scenario = scenario("pritzl-6.1");
        scenario.hunt.prior_centre_m = Some([100.0, -20.0]);
        scenario.hunt.prior_sigma_m = 10.0;
        let waypoints = planner_named("waypoints").expect("it is known");
        let PlannerConfig::LawnMower { corners_m, coverage, .. } = waypoints.config(&scenario)
        else {
            panic!("this scenario has no path of its own");
        };
        let corners: Vec<_> = corners_m.into_iter().map(Vector2::from).collect();
        let coverage = Coverage::new(&corners, &coverage).expect("a square");
        let places = coverage.places();
        assert_eq!(places.len(), 16);
        let first = Vector2::new(100.0, -20.0) - Vector2::repeat(0.75 * 10.0 * BOX_95);
        assert!((places[0] - first).norm() < 1e-6, "{}", places[0]);
        for pair in places.windows(2) {
            let moved = (pair[0] - pair[1]).norm();
            assert!((moved - 5.0 * BOX_95).abs() < 1e-6, "back and forth: {moved} m");
        }
    }

    #[test]
    fn a_fence_is_swept_from_inside() {
        let mut scenario = scenario("pritzl-6.1");
        let fence =
            vec![[0.0, 0.0], [90.0, 0.0], [90.0, 30.0], [40.0, 30.0], [40.0, 80.0], [0.0, 80.0]];
        scenario.hunt.airspace.fence_m = fence.clone();
        scenario.hunt.airspace.altitude_m = Some([10.0, 20.0]);
        let named = planner_named("waypoints").expect("it is known");
        let config = named.config(&scenario);
        let PlannerConfig::LawnMower { corners_m, coverage, shape, up_m, .. } = &config else {
            panic!("this scenario has no path of its own");
        };
        assert!((area_m2(&fence) - 4700.0).abs() < 1e-9);
        assert_eq!((corners_m, *up_m), (&fence, 10.0));
        let circumradius_m = coverage.margin_m;
        assert_eq!(*shape, Some(ShapeConfig::Polygon { circumradius_m }));
        assert!(config.build().is_ok());
    }

    #[test]
    fn a_room_is_not_circled_from_outside() {
        let room = scenario("isaacs-line");
        let named = planner_named("orbit").expect("it is known");
        let PlannerConfig::Orbit(orbit) = named.config(&room) else { panic!("an orbit") };
        assert!(orbit.radius_m <= 2.0 && orbit.altitude.most_m <= 1.0, "{orbit:?}");
    }
}
