//! Tables of planners.

use foxhunt::{
    config::{PlannerConfig, ShapeConfig},
    formation::FollowConfig,
};

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
