//! Tables of planners.

use foxhunt::{
    config::{PlannerConfig, ShapeConfig},
    core::{BeaconId, Bearing, Decision, Estimate, Level, Pose, Reception, Station, Target},
    formation::FollowConfig,
    registry::Registry,
    scenario::Scenario,
};
use nalgebra::{Vector2, Vector3};

use super::keys::silent;

/// A flight of some drones to a beacon at (40, 25) m.
struct Flight {
    turns: u32,
    drones: u16,
    /// Number of turns before it is heard.
    unheard: u32,
    /// σ of its place in metres after a turn.
    sigma_m: fn(f64) -> f64,
}

/// Flights that settle, that settle at once, that never do, of one drone, and to what is not heard.
const FLIGHTS: [Flight; 5] = [
    Flight { turns: 18, drones: 3, unheard: 6, sigma_m: |turn| 40.0 * 0.75_f64.powf(turn) },
    Flight { turns: 18, drones: 3, unheard: 0, sigma_m: |_| 0.2 },
    Flight { turns: 18, drones: 1, unheard: 0, sigma_m: |turn| 40.0 * 0.8_f64.powf(turn) },
    // Half of the most turns that planners take is tried.
    Flight { turns: 35, drones: 2, unheard: 0, sigma_m: |turn| 25.0 - 0.1 * turn },
    Flight { turns: 35, drones: 2, unheard: 35, sigma_m: |_| 30.0 },
];

impl Flight {
    /// Returns what a planner decides and where it sends the drones, turn by turn.
    fn flown(&self, config: &PlannerConfig) -> Result<Vec<String>, String> {
        let mut planner = config.build().map_err(|error| error.to_string())?;
        let start = |drone: u16| {
            let pose = Pose::at(-10.0 + 8.0 * f64::from(drone), -15.0, 3.0);
            Station::holding(pose)
        };
        let mut stations: Vec<Station> = (0..self.drones).map(start).collect();
        let beacon = Vector2::new(40.0, 25.0);
        let begun = planner.begin(&mut stations);
        let mut said = vec![format!("{begun:?} {stations:?}")];
        for turn in 0..self.turns {
            for station in &mut stations {
                station.pose.position = station.goal.position;
                let way: Vector3<f64> = beacon.push(0.0) - station.pose.position;
                let level = Level { rss_dbm: -30.0 - 25.0 * way.norm().log10(), sigma_db: 4.0 };
                let bearing = Bearing { angle: way.y.atan2(way.x), sigma: 0.2, confidence: 1.0 };
                planner.observe(&Reception {
                    beacon: BeaconId(1),
                    time: 20.0 * f64::from(turn),
                    receiver: station.pose,
                    level: Some(level),
                    bearing: Some(bearing),
                    ..Reception::default()
                });
            }
            let sigma = (self.sigma_m)(f64::from(turn));
            let around = 2.0 * f64::from(turn);
            let off = Vector2::new(around.cos(), around.sin());
            let belief = Estimate::isotropic(beacon + off * sigma, sigma);
            let target = Target { beacon: BeaconId(1), belief: &belief };
            let targets = if turn < self.unheard && planner.goes_on_without_signal() {
                &[]
            } else if turn == 12 {
                let resumed = planner.resume(&belief, &mut stations);
                said.push(format!("{resumed:?} {stations:?}"));
                continue;
            } else {
                std::slice::from_ref(&target)
            };
            let decision = planner.plan_together(targets, &mut stations);
            said.push(format!("{decision:?} {stations:?}"));
            if let Ok(Decision::Finish(_)) = decision {
                break;
            }
        }
        Ok(said)
    }
}

#[test]
fn every_setting_of_every_planner_changes_something_or_is_refused() {
    let field = Scenario::find("pritzl-6.1").expect("a built-in scenario").field();
    let named = Registry::builtin();
    let configs = named.planners().iter().map(|named| named.config(&field));
    let shaped = [
        "kind = 'waypoints'\nplaces_m = [[0.0, 0.0], [20.0, 9.0]]\nup_m = 4.0",
        "kind = 'waypoints'\nplaces_m = [[0.0, 0.0], [20.0, 9.0, 5.0]]\nup_m = 4.0\n\
         shape = { kind = 'line', spacing_m = 7.0 }",
        "kind = 'follow-estimate'\nshape = { kind = 'scaled', scale = 2.0, \
         shape = { kind = 'offsets', offsets_m = [[0.0, 0.0], [5.0, 0.0]] } }",
    ];
    let mut found = Vec::new();
    for config in configs.chain(shaped.map(parse)) {
        let keys = silent(&config, &FLIGHTS, |config, flight| flight.flown(config));
        if !keys.is_empty() {
            found.push(format!("{keys:?} of {config:?}"));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

fn parse(text: &str) -> PlannerConfig {
    toml::from_str(text).expect("a planner")
}

#[test]
fn files_name_shapes_and_keep_their_old_keys() {
    let old = parse("kind = \"follow-estimate\"\nfollow = { circumradius_m = 8.0 }");
    let follow = FollowConfig { circumradius_m: 8.0, ..FollowConfig::pritzl2018() };
    assert_eq!(old, PlannerConfig::FollowEstimate { follow, shape: None });
    let line = parse("kind = \"follow-estimate\"\nshape = { kind = \"line\", spacing_m = 8 }");
    let shape = Some(ShapeConfig::Line { spacing_m: 8.0 });
    assert_eq!(line, PlannerConfig::FollowEstimate { follow: Default::default(), shape });
    let old =
        parse("kind = \"waypoints\"\nplaces_m = [[1.0, 2.0]]\ncircumradius_m = 0.0\nup_m = 4.0");
    assert!(old.build().is_ok());
    for text in [
        "kind = \"waypoints\"\nplaces_m = [[1, 2]]\nup_m = 4\n[shape]\nkind = \"offsets\"\n\
         offsets_m = [[0, 0], [5, 0]]",
        "kind = \"waypoints\"\nplaces_m = [[1, 2, 5], [3, 4, 2.5]]",
        "kind = \"waypoints\"\nplaces_m = [[1, 2, 5], [3, 4]]\nup_m = 4",
        "kind = \"lawn-mower\"\ncorners_m = [[0, 0], [65, 0], [65, 50]]\nup_m = 4\n\
         coverage = { margin_m = 2 }\nshape = { kind = \"scaled\", scale = 2, shape = \
         { kind = \"polygon\", circumradius_m = 3 } }",
        "kind = \"detection\"\ncorners_m = [[0, 0], [65, 0], [65, 50]]\n\
         detection = { success = 0.8 }\nthen = { kind = \"orbit\" }",
        "kind = \"orbit\"\nradius_m = 12\naltitude = { elevation_limit_rad = 0.4 }",
        "kind = \"arcs\"\nshrink = 0.5\nsettling = { laps = 2 }",
        "kind = \"surge-cast\"\ncast_m = 5",
        "kind = \"information\"\ninformation = { horizon = 2, criterion = \"entropy\" }",
        "kind = \"steepest-descent\"\nstep_m = 10",
        "kind = \"bayesian-optimisation\"\nreach_m = 40",
        "kind = \"emulated\"\nvirtual_drones = 3\nplanner = { kind = \"follow-estimate\" }",
    ] {
        let config = parse(text);
        assert!(config.build().is_ok(), "{config:?}: {:?}", config.build().err());
        let written = toml::to_string(&config).expect("a table");
        assert_eq!(parse(&written), config, "{written}");
    }
}

#[test]
fn what_is_out_of_range_is_named_with_its_value() {
    for (text, expected) in [
        ("kind = \"follow-estimate\"\nfollow = { settled_m = -2 }", "settled_m is -2;"),
        (
            "kind = \"follow-estimate\"\nshape = { kind = \"line\", spacing_m = 0 }",
            "spacing_m is 0;",
        ),
        (
            "kind = \"waypoints\"\nplaces_m = [[0, 0], [9, 0]]\nup_m = 4\nturns_at_each = \
             100\nrounds = 51",
            "rounds in all is 10200;",
        ),
        (
            "kind = \"waypoints\"\nplaces_m = [[0, 0, 3], [9, 0]]",
            "planner.up_m is missing, and place 2 of",
        ),
        ("kind = \"waypoints\"\nplaces_m = [[0, 0, 3]]\nup_m = 4", "planner.up_m is not used"),
        (
            "kind = \"lawn-mower\"\ncorners_m = [[0, 0], [9, 0], [9, 9], [0, 9]]\nup_m = 4\n\
             coverage = { row_spacing_m = 1, along_spacing_m = 1, margin_m = 0 }\nrounds = \
             65535",
            "rounds in all is ",
        ),
        (
            "kind = \"detection\"\ncorners_m = [[0, 0], [65, 0], [65, 50]]\n\
             detection = { spacing_m = 1 }\nthen = { kind = \"orbit\" }",
            "spacing_m is 1;",
        ),
        (
            "kind = \"detection\"\ncorners_m = [[0, 0], [65, 0], [65, 50]]\nthen = { kind = \
             \"orbit\", radius_m = -7 }",
            "radius_m is -7;",
        ),
        ("kind = \"orbit\"\nradius_m = -7", "radius_m is -7;"),
        ("kind = \"orbit\"\naltitude = { most_m = 1 }", "most_m is 1;"),
        ("kind = \"arcs\"\nshrink = 1.5", "shrink is 1.5;"),
        ("kind = \"surge-cast\"\nmost_casts = 0", "most_casts is 0;"),
        ("kind = \"information\"\ninformation = { turn_s = 0 }", "turn_s is 0;"),
        ("kind = \"information\"\ninformation = { places = 4 }", "places is 4;"),
        ("kind = \"steepest-descent\"\nstep_m = -3", "step_m is -3;"),
        (
            "kind = \"emulated\"\nvirtual_drones = 0\nplanner = { kind = \"orbit\" }",
            "virtual_drones is 0;",
        ),
        ("kind = \"lawn-mower\"\ncorners_m = [[0, 0], [9, 0]]\nup_m = 4", "corners_m: 2 corners"),
        (
            "kind = \"waypoints\"\nplaces_m = [[0, 0]]\nup_m = 4\ncircumradius_m = -1",
            "circumradius_m is -1;",
        ),
    ] {
        let Err(error) = parse(text).build() else { panic!("{text} was built") };
        let error = error.to_string();
        assert!(error.contains(expected), "{error}");
    }
    assert!(toml::from_str::<PlannerConfig>("kind = \"orbit\"\nradius = 3").is_err());
}
