//! Names of the registry, its menu, and settings that an estimator does not use.

use foxhunt::core::{
    BeaconId, Bearing, BearingModes, Estimate, EstimatorError, Level, MeasuredList, Pose, Reception,
};
use foxhunt::sensors::{LogDistance, RssBearing};
use nalgebra::Vector2;

use foxhunt::{
    config::{EstimatorConfig, FilterConfig, ParticleConfig},
    registry::{DEFAULT_ESTIMATOR, EstimatorEntry, Registry},
    scenario::builtin_scenarios,
};

#[test]
fn names_are_found_and_differ() {
    let registry = Registry::builtin();
    for (index, entry) in registry.estimators().iter().enumerate() {
        let found = registry.estimator(&entry.name).expect("it is listed");
        assert!(std::ptr::eq(found, &registry.estimators()[index]), "{} twice", entry.name);
    }
    for entry in registry.extractors() {
        assert!(registry.extractor(&entry.name).is_ok());
    }
    let error = registry.estimator("kalman").expect_err("no such name").to_string();
    assert!(error.contains("\"kalman\"") && error.contains("ukf-pritzl2018"), "{error}");
}

#[test]
fn an_entry_of_ones_own_is_added_or_replaces() {
    let count = Registry::builtin().estimators().len();
    let settings = |registry: &Registry, name: &str| {
        *registry.estimator(name).expect("known").settings().expect("settings")
    };
    let mut small = settings(&Registry::builtin(), "particle");
    small.filter = FilterConfig::Particle(ParticleConfig::of(100));
    let own =
        |name: &str| EstimatorEntry::of_settings(name.to_owned(), "a small cloud", "none", small);
    let registry = Registry::builtin().with_estimator(own("tiny")).with_estimator(own("ukf"));
    assert_eq!(registry.estimators().len(), count + 1);
    assert_eq!(settings(&registry, "tiny"), small);
    assert_eq!(settings(&registry, "ukf"), small);
}

#[test]
fn the_menu_has_what_is_taken_by_itself_and_what_is_ones_own() {
    let registry = Registry::builtin();
    let menu: Vec<&str> = registry.menu().iter().map(|entry| &*entry.name).collect();
    // Each name of the menu is an estimator.
    assert_eq!(menu.len(), 22, "{menu:?}");
    assert_eq!(menu[0], DEFAULT_ESTIMATOR);
    for scenario in builtin_scenarios() {
        assert!(menu.contains(&&*scenario.estimator), "{}", scenario.name);
    }
    let suited = |receptions: &[Reception]| {
        registry.suited_to(&receptions.into()).expect("an estimator").name.clone()
    };
    let bearing = Bearing { angle: 0.5, sigma: 0.1, confidence: 0.9 };
    let level = Level { rss_dbm: -60.0, sigma_db: 4.0 };
    let taken = |level, bearing| {
        let at = |east| Reception {
            beacon: BeaconId(1),
            time: 0.0,
            receiver: Pose::at(east, 0.0, 4.0),
            level,
            silence: None,
            saturation: None,
            bearing,
            covariance: 0.0,
            modes: BearingModes::default(),
            receiver_sigma_m: None,
            measured: MeasuredList::default(),
        };
        [suited(&[at(0.0)]), suited(&[at(0.0), at(100.0), at(200.0), at(300.0)])]
    };
    for (level, bearing) in
        [(Some(level), None), (None, Some(bearing)), (Some(level), Some(bearing))]
    {
        for name in taken(level, bearing) {
            assert!(menu.contains(&&*name), "`locate` takes {name} by itself");
        }
    }

    let mut own = registry.estimator("ekf-iterated").expect("it is listed").clone();
    own.name = "mine".into();
    let about = own.about.clone();
    let registry = registry.clone().with_estimator(own);
    let last = registry.menu().pop().expect("an entry").clone();
    assert_eq!((&*last.name, last.when()), ("mine", Some(&*about)));
    let with_case = last.recommended_for("Sundays");
    let registry = registry.with_estimator(with_case);
    assert_eq!(registry.estimator("mine").expect("it").when(), Some("Sundays"));
}

#[test]
fn settings_that_would_not_be_used_are_refused() {
    let model = RssBearing::new(LogDistance::new(-29.06, 2.765).expect("in range"));
    let prior = Estimate::isotropic(Vector2::zeros(), 10.0);
    let registry = Registry::builtin();
    let config = |name| {
        let entry = registry.estimator(name).expect("it has a name");
        *entry.settings().expect("a stream estimator of the program")
    };
    let refused = |config: EstimatorConfig| match config.build(model, &prior, 1).err() {
        Some(EstimatorError::Unsupported { what }) => what,
        other => panic!("{other:?}"),
    };
    let late = EstimatorConfig { lag_s: Some(5.0), ..config("ukf-pritzl2018") };
    assert!(refused(late).contains("lag_s"));
    let moving = EstimatorConfig { power_sigma_db: Some(5.0), ..config("imm") };
    assert!(refused(moving).contains("power_sigma_db"));
    let cloud = EstimatorConfig { power_sigma_db: None, ..config("particle-rao-blackwellised") };
    assert!(refused(cloud).contains("reference power"));
    let seconds = EstimatorConfig { lag_s: Some(5.0), ..config("ukf") };
    assert!(seconds.build(model, &prior, 1).is_ok());
}
