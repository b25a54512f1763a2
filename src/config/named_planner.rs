use nalgebra::Vector2;

use super::PlannerConfig;
use crate::scenario::Scenario;

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
    #[must_use]
    pub fn config(&self, scenario: &Scenario) -> PlannerConfig {
        (self.config)(scenario)
    }
}

/// How often `hold` listens.
const TURNS: u32 = 10;

/// The altitude of the reference's formation while it searches, in metres (Pritzl 2018, §5.2).
const UP_M: f64 = 4.0;

/// The circumradius of the reference's formation, in metres (Pritzl 2018, §5.2).
const CIRCUMRADIUS_M: f64 = 6.0;

/// How many places a side of the area is swept at where the scenario has no path of its own, as
/// the reference's sweep has it (Pritzl 2018, §7.4).
const PLACES_A_SIDE: u16 = 4;

/// Half the width of a box that holds a Gaussian of two equal, independent coordinates with 95 %,
/// in standard deviations: the quantile of (1 + √0.95) / 2.
const BOX_95: f64 = 2.236_476_644_557_896;

/// Every planner that has a name.
#[must_use]
pub fn planners() -> Vec<NamedPlanner> {
    let named = |name, about, source, config| NamedPlanner { name, about, source, config };
    vec![
        named(
            "pritzl2018",
            "a polygon, with three drones a triangle, that follows the estimate until it has settled",
            "Pritzl 2018, §5.2",
            |_| PlannerConfig::FollowEstimate { follow: Default::default() },
        ),
        named(
            "waypoints",
            "the scenario's own path, or else a sweep of the area where the beacon is believed to be",
            "Pritzl 2018, §7.3 and §7.4",
            waypoints,
        ),
        named("hold", "everyone stays and listens", "Isaacs et al. 2014, §V", hold),
    ]
}

/// The planner of a name.
#[must_use]
pub fn planner_named(name: &str) -> Option<NamedPlanner> {
    planners().into_iter().find(|known| known.name == name)
}

fn hold(scenario: &Scenario) -> PlannerConfig {
    match &scenario.planner {
        own @ PlannerConfig::Hold { .. } => own.clone(),
        _ => PlannerConfig::Hold { turns: TURNS },
    }
}

fn waypoints(scenario: &Scenario) -> PlannerConfig {
    if let own @ PlannerConfig::Waypoints { .. } = &scenario.planner {
        return own.clone();
    }
    let half = BOX_95 * scenario.hunt.prior_sigma_m;
    let centre = prior_centre(scenario);
    // Each place is the middle of its share of the area.
    let across = |i: u16| half * (f64::from(2 * i + 1) / f64::from(PLACES_A_SIDE) - 1.0);
    let row = |j: u16| {
        let along = move |i: u16| if j % 2 == 0 { i } else { PLACES_A_SIDE - 1 - i };
        (0..PLACES_A_SIDE).map(move |i| [centre.x + across(along(i)), centre.y + across(j)])
    };
    PlannerConfig::Waypoints {
        places_m: (0..PLACES_A_SIDE).flat_map(row).collect(),
        circumradius_m: CIRCUMRADIUS_M,
        rotation_deg: 0.0,
        up_m: UP_M,
        turns_at_each: 1,
        rounds: 1,
    }
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
    fn the_area_that_is_believed_in_is_swept() {
        let mut scenario = scenario("pritzl-6.1");
        scenario.hunt.prior_centre_m = Some([100.0, -20.0]);
        scenario.hunt.prior_sigma_m = 10.0;
        let waypoints = planner_named("waypoints").expect("it is known");
        let PlannerConfig::Waypoints { places_m, .. } = waypoints.config(&scenario) else {
            panic!("waypoints are waypoints");
        };
        assert_eq!(places_m.len(), 16);
        let first = [100.0 - 0.75 * 10.0 * BOX_95, -20.0 - 0.75 * 10.0 * BOX_95];
        let off = (Vector2::from(places_m[0]) - Vector2::from(first)).norm();
        assert!(off < 1e-12, "{:?}", places_m[0]);
        let step = 0.5 * 10.0 * BOX_95;
        for pair in places_m.windows(2) {
            let moved = (Vector2::from(pair[0]) - Vector2::from(pair[1])).norm();
            assert!((moved - step).abs() < 1e-9, "back and forth: {moved} m");
        }
    }
}
