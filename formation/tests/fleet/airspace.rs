use foxhunt_formation::{Airspace, AirspaceConfig, AirspaceError, KeepOut};
use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::world;

fn fenced(fence_m: &[[f64; 2]]) -> AirspaceConfig {
    AirspaceConfig { fence_m: fence_m.to_vec(), ..AirspaceConfig::default() }
}

/// 20 m to a side without its north-eastern quarter.
pub(crate) fn corner() -> AirspaceConfig {
    fenced(&[[0.0, 0.0], [20.0, 0.0], [20.0, 10.0], [10.0, 10.0], [10.0, 20.0], [0.0, 20.0]])
}

#[test]
fn nonsense_is_refused_by_name() {
    let refused = |config: &AirspaceConfig| Airspace::new(config).expect_err("nonsense");
    let parameter = |error: &AirspaceError| match error {
        AirspaceError::Parameter(error) => Some(error.name),
        _ => None,
    };
    let bow_tie = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
    let line = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]];
    for crossed in [bow_tie.as_slice(), &line] {
        let error = refused(&fenced(crossed));
        assert!(matches!(error, AirspaceError::NotSimple { field: "fence_m", .. }), "{error}");
    }
    let closed_line = [[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]];
    let error = refused(&fenced(&closed_line));
    assert_eq!(error, AirspaceError::Corners { field: "fence_m", corners: 2 });
    let error = refused(&fenced(&[[0.0, 0.0], [f64::NAN, 1.0], [1.0, 0.0]]));
    assert_eq!(parameter(&error), Some("fence_m"));

    let with = |keep_out| AirspaceConfig { keep_out: vec![keep_out], ..corner() };
    let error = refused(&with(KeepOut::Disc { centre_m: [5.0, 5.0], radius_m: -1.0 }));
    assert_eq!(parameter(&error), Some("keep_out.radius_m"));
    let error = refused(&with(KeepOut::Polygon { corners_m: vec![[0.0, 0.0]] }));
    assert_eq!(error, AirspaceError::Corners { field: "keep_out.corners_m", corners: 1 });
    let error = refused(&with(KeepOut::Disc { centre_m: [10.0, 10.0], radius_m: 40.0 }));
    assert_eq!(error, AirspaceError::NothingLeft { margin_m: 0.0 });

    let error = refused(&AirspaceConfig { altitude_m: Some([5.0, 2.0]), ..corner() });
    assert_eq!(error, AirspaceError::Band { lowest: 5.0, highest: 2.0 });
    let error = refused(&AirspaceConfig { altitude_m: Some([5.0, f64::INFINITY]), ..corner() });
    assert_eq!(parameter(&error), Some("altitude_m"));

    let airspace = Airspace::new(&corner()).expect("an airspace");
    let error = airspace.with_margin(6.0).expect_err("it is 10 m wide");
    assert_eq!(error, AirspaceError::NothingLeft { margin_m: 6.0 });
    assert!(airspace.with_margin(4.9).is_ok());
    assert!(airspace.with_margin(f64::NAN).is_err());
}

#[test]
fn a_corner_is_flown_around() {
    let config = AirspaceConfig { altitude_m: Some([2.0, 8.0]), ..corner() };
    let airspace = Airspace::new(&config).and_then(|a| a.with_margin(1.0)).expect("an airspace");
    let at = Vector3::new;
    assert!(airspace.permits(&at(5.0, 18.9, 2.0)));
    assert!(!airspace.permits(&at(5.0, 19.1, 2.0)));
    assert!(!airspace.permits(&at(15.0, 15.0, 2.0)));
    assert!(!airspace.permits(&at(5.0, 5.0, 8.1)));
    assert!(!airspace.permits(&at(f64::NAN, 5.0, 5.0)));
    assert!(airspace.clear(&at(5.0, 18.0, 5.0), &at(5.0, 5.0, 5.0)));
    assert!(!airspace.clear(&at(5.0, 18.0, 5.0), &at(18.0, 5.0, 5.0)), "across the corner");
    assert!(!airspace.clear(&at(5.0, 5.0, 5.0), &at(5.0, 5.0, 9.0)), "out of the band");
    // In the missing quarter, nearer to its southern side.
    let nearest = airspace.nearest(&at(15.0, 12.0, 9.0)).expect("a place");
    assert!((nearest - at(15.0, 9.0, 8.0)).norm() < 0.01, "{nearest}");
    assert_eq!(airspace.nearest(&at(f64::NAN, 0.0, 0.0)), None);
    assert!(
        (airspace.clearance(&Vector2::new(8.0, 8.0)) - 8.0_f64.hypot(0.0).min(2.0_f64.hypot(2.0)))
            .abs()
            < 1e-9
    );
}

#[test]
fn no_limits() {
    let airspace = Airspace::new(&AirspaceConfig::default()).expect("an airspace");
    let (here, there) = (Vector3::new(1e6, -3.0, -50.0), Vector3::new(-1e6, 9.0, 1e4));
    assert!(airspace.permits(&here) && airspace.clear(&here, &there));
    assert_eq!(airspace.nearest(&here), Some(here));
    assert!(!airspace.permits(&Vector3::new(f64::INFINITY, 0.0, 0.0)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Against 2000 places drawn from about the airspace. What is found may be farther than the
    /// nearest by what polygons add to round edges: 0.2 % of the radius, and 5 mm.
    #[test]
    fn nothing_permitted_is_nearer_than_the_nearest(seed in any::<u64>(), margin in 0.0..2.0) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let Ok(airspace) = Airspace::new(&world::airspace(&mut rng, 50.0)) else { return Ok(()) };
        let Ok(airspace) = airspace.with_margin(margin) else { return Ok(()) };
        let wanted = world::place(&mut rng, 60.0);
        let nearest = airspace.nearest(&wanted).expect("there is room");
        prop_assert!(airspace.permits(&nearest));
        let distance = (nearest - wanted).xy().norm();
        for _ in 0..2000 {
            let by = distance * 1.2 + 1.0;
            let offset = Vector2::new(rng.random_range(-by..by), rng.random_range(-by..by));
            let place = wanted.xy() + offset;
            if airspace.clearance(&place) >= margin {
                prop_assert!(offset.norm() >= distance - 0.002 * 12.0 - 0.01);
            }
        }
    }

    /// A clear way is permitted throughout, and a way that is not touches what is not.
    #[test]
    fn a_clear_way_is_permitted_throughout(seed in any::<u64>(), margin in 0.01..2.0) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let Ok(airspace) = Airspace::new(&world::airspace(&mut rng, 50.0)) else { return Ok(()) };
        let Ok(airspace) = airspace.with_margin(margin) else { return Ok(()) };
        for _ in 0..20 {
            let mut end = || airspace.nearest(&world::place(&mut rng, 40.0)).expect("there is room");
            let (from, to) = (end(), end());
            let least = (0..=2000)
                .map(|k| airspace.clearance(&from.xy().lerp(&to.xy(), f64::from(k) / 2000.0)))
                .fold(f64::INFINITY, f64::min);
            // Between two places that are looked at it can be nearer by half their distance.
            let between = (to - from).xy().norm() / 4000.0;
            if airspace.clear(&from, &to) {
                prop_assert!(least >= margin - 1e-6);
            } else {
                prop_assert!(least <= margin + between + 1e-6);
            }
        }
    }
}

#[test]
fn files_are_read_as_written() {
    let text = r#"{
        "fence_m": [[0, 0], [40, 0], [40, 40], [0, 40]],
        "keep_out": [
            { "centre_m": [10, 10], "radius_m": 3 },
            { "corners_m": [[20, 20], [30, 20], [25, 30]] }
        ],
        "altitude_m": [2, 30]
    }"#;
    let config: AirspaceConfig = serde_json::from_str(text).expect("it is written so");
    let airspace = Airspace::new(&config).expect("an airspace");
    assert!(!airspace.permits(&Vector3::new(11.0, 11.0, 5.0)));
    assert!(!airspace.permits(&Vector3::new(25.0, 22.0, 5.0)));
    assert!(airspace.permits(&Vector3::new(5.0, 5.0, 5.0)));
    let again = serde_json::to_string(&config).expect("it can be written");
    assert_eq!(serde_json::from_str::<AirspaceConfig>(&again).expect("as it was"), config);
    assert_eq!(
        serde_json::from_str::<AirspaceConfig>("{}").expect("all defaults"),
        AirspaceConfig::default()
    );
    for wrong in [
        r#"{ "fence": [] }"#,
        r#"{ "keep_out": [{ "centre_m": [0, 0], "radius_m": 1, "corners_m": [] }] }"#,
        r#"{ "keep_out": [{ "centre_m": [0, 0] }] }"#,
    ] {
        assert!(serde_json::from_str::<AirspaceConfig>(wrong).is_err(), "{wrong}");
    }
}
