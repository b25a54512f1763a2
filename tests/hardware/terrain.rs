//! A flight over hills: heights are above the ground that an elevation model has.

use std::{fs, path::PathBuf};

use foxhunt::{
    fly::{
        BoxedAircraft, EmulatedField, EmulatedFieldConfig, FlightConfig, Mission, TerrainConfig,
    },
    hardware::Shared,
    hunt::{BoxedSource, Event, FlightStage},
    overview::notice,
    registry::Registry,
    scenario::Scenario,
    sim::{ReliefConfig, World},
};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use nalgebra::{Vector2, Vector3};

/// Samples to a side of a tile of one arc second.
const SIDE: u32 = 3601;

/// The height of a sample in metres: hills of 12 m, 120 m from top to top northwards, 79 m
/// eastwards.
fn hill(row: u32, column: u32) -> i16 {
    let wave = |index: u32| [0, 4, 6, 3][index as usize % 4];
    wave(row) + wave(column)
}

/// The tile of a site, in a folder that is gone at the end.
struct Tiles(PathBuf);

impl Tiles {
    fn new(test: &str) -> Self {
        let folder = format!("foxhunt-{test}-{}", std::process::id());
        let folder = std::env::temp_dir().join(folder);
        fs::create_dir_all(&folder).expect("a folder for this test");
        let places = (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column)));
        let bytes: Vec<u8> = places.flat_map(|(r, c)| hill(r, c).to_be_bytes()).collect();
        fs::write(folder.join("N50E014.hgt"), bytes).expect("it is ours");
        Self(folder)
    }
}

impl Drop for Tiles {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The height of the ground, by the definition of the tile.
fn ground(frame: &LocalFrame, place: &Vector2<f64>) -> f64 {
    let place = frame.to_geodetic(&Vector3::new(place.x, place.y, 0.0));
    let row = (51.0 - place.lat_deg) * 3600.0;
    let column = (place.lon_deg - 14.0) * 3600.0;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "rows and columns are whole numbers below 3601"
    )]
    let at = |row: f64, column: f64| f64::from(hill(row as u32, column as u32));
    let top = row.floor();
    let left = column.floor();
    let down = row - top;
    let along = column - left;
    let upper = at(top, left) * (1.0 - along) + at(top, left + 1.0) * along;
    let lower = at(top + 1.0, left) * (1.0 - along) + at(top + 1.0, left + 1.0) * along;
    upper * (1.0 - down) + lower * down
}

#[test]
fn drones_keep_their_height_above_hills() {
    let tiles = Tiles::new("hills");
    let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    let world = World::new(&scenario.world, 1).expect("a world");
    let config = EmulatedFieldConfig::default();
    let (mut field, mut ports) =
        EmulatedField::in_memory(&scenario, &world, &config).expect("a field");
    let mut flight: FlightConfig = field.flight().clone();
    let terrain = |reach_m| TerrainConfig {
        folder: Some(tiles.0.clone()),
        hills: Vec::new(),
        reach_m,
        clearance_m: 4.0,
        height_tolerance_m: 4.0,
    };
    flight.terrain = Some(terrain(500.0));
    let origin = Geodetic::new(flight.site.lat_deg, flight.site.lon_deg, 0.0).expect("a place");
    let frame = LocalFrame::new(origin).expect("a place");
    let registry = Registry::builtin();
    let estimator = flight.estimator(&registry).expect("it is known");
    let hunt = flight.parts(&registry, estimator, 1).build().expect("a hunt");
    let drones = flight.open(&mut ports, &world.clock(), 0.0, None, None).expect("devices");
    let mut mission: Mission<Shared<BoxedAircraft>, BoxedSource> =
        Mission::new(flight.flight, hunt, drones, world.time()).expect("a flight");
    let up = flight.flight.takeoff_up_m;
    let place = |drone| world.pose(drone).expect("a drone").position;
    let launches: Vec<f64> =
        (0..world.drone_count()).map(|drone| ground(&frame, &place(drone).xy())).collect();
    let mut lowest = f64::INFINITY;
    let mut flat = f64::INFINITY;
    let mut receptions = 0;
    let mut worst = 0.0_f64;
    // Whoever is recalled flies home and lands.
    let mut recalled = false;
    while !mission.is_over() && world.time() < 4000.0 {
        world.advance(scenario.simulation.tick_s).expect("time passes");
        field.serve(|device, error| panic!("{device}: {error}"));
        mission.step(world.time());
        if mission.stage() == FlightStage::Hunting && !recalled {
            for (drone, launch) in launches.iter().enumerate() {
                let here = place(drone);
                let rise = ground(&frame, &here.xy()) - launch;
                lowest = lowest.min(here.z - rise);
                flat = flat.min(up - rise);
            }
        }
        while let Some(event) = mission.poll_event() {
            recalled |= matches!(event, Event::Recalled { .. });
            if let Event::Received { drone, reception, .. } = event {
                let here = place(drone);
                let above = here.z - (ground(&frame, &here.xy()) - launches[drone]);
                receptions += 1;
                // The planner's two heights.
                worst = worst.max((above - up).abs().min((above - up + 1.0).abs()));
                worst = worst.max((reception.receiver.position.z - above).abs());
            }
        }
    }
    assert!(mission.is_over() && mission.failure().is_none(), "{mission:?}");
    assert_eq!(mission.hunt().fixes().len(), 2);
    // The hills matter: at one height above the launch a drone would have met them, or nearly so.
    assert!(flat < 1.0, "{flat}");
    // The planner's lower height, less what a line may be off; where they listen they are exact.
    assert!(lowest > up - 1.0 - 0.5, "{lowest}");
    assert!(receptions > 10 && worst < 0.1, "{receptions} receptions, {worst} m");

    flight.terrain = Some(terrain(45_000.0));
    let error = flight.open(&mut ports, &world.clock(), 0.0, None, None).err().expect("no tile");
    let text = error.to_string();
    assert!(text.starts_with("terrain: ") && text.contains("N49E013.hgt"), "{text}");
    assert!(text.contains("foxhunt-hills"), "{text}");
}

/// Logged differences between heights by [terrain] and by the drones' own devices, and the number
/// of health reports with a height, in a flight whose world has a terrain or is level.
fn differences(tiles: &Tiles, relief: Option<ReliefConfig>, ranged: bool) -> (Vec<Event>, usize) {
    let mut scenario = Scenario::find("pritzl-6.1").expect("it is built in");
    scenario.world.terrain = relief;
    scenario.hunt.stop.time_s = Some(100.0);
    let world = World::new(&scenario.world, 1).expect("a world");
    let rangefinder_m = ranged.then_some([0.2, 40.0]);
    let config = EmulatedFieldConfig { rangefinder_m, ..EmulatedFieldConfig::default() };
    let (mut field, mut ports) =
        EmulatedField::in_memory(&scenario, &world, &config).expect("a field");
    let mut flight = field.flight().clone();
    flight.terrain = Some(TerrainConfig {
        folder: Some(tiles.0.clone()),
        hills: Vec::new(),
        reach_m: 500.0,
        clearance_m: 4.0,
        height_tolerance_m: 4.0,
    });
    let registry = Registry::builtin();
    let estimator = flight.estimator(&registry).expect("it is known");
    let hunt = flight.parts(&registry, estimator, 1).build().expect("a hunt");
    let drones = flight.open(&mut ports, &world.clock(), 0.0, None, None).expect("devices");
    let mut mission: Mission<Shared<BoxedAircraft>, BoxedSource> =
        Mission::new(flight.flight, hunt, drones, world.time()).expect("a flight");
    let mut differences = Vec::new();
    let mut heights = 0;
    while !mission.is_over() && world.time() < 1000.0 {
        world.advance(scenario.simulation.tick_s).expect("time passes");
        field.serve(|device, error| panic!("{device}: {error}"));
        mission.step(world.time());
        while let Some(event) = mission.poll_event() {
            match event {
                Event::HeightDiffers { .. } => differences.push(event),
                Event::Health { above_ground: Some(_), .. } => heights += 1,
                _ => {}
            }
        }
    }
    assert!(mission.is_over() && mission.failure().is_none(), "{mission:?}");
    (differences, heights)
}

#[test]
fn ground_that_is_not_where_the_tiles_have_it_is_reported() {
    let tiles = Tiles::new("shifted");
    // The world is level, and the tiles have hills of 12 m there.
    let (shifted, heights) = differences(&tiles, None, true);
    assert!(heights > 10, "{heights}");
    assert!(!shifted.is_empty() && shifted.len() < 30, "once while it lasts: {}", shifted.len());
    for event in &shifted {
        let Event::HeightDiffers { reported, expected_m, tolerance_m, .. } = event else {
            continue;
        };
        assert!((reported.metres - expected_m).abs() > *tolerance_m, "{event:?}");
        let text = notice(event).expect("it is shown").text;
        assert!(text.contains("by rangefinder") && text.contains("terrain.folder"), "{text}");
    }
    let (unknown, heights) = differences(&tiles, None, false);
    assert_eq!((unknown, heights), (vec![], 0), "nobody has a rangefinder");
    // A world with the same hills.
    let mut relief = ReliefConfig::default();
    let site = EmulatedFieldConfig::default().site;
    relief.folder = Some(tiles.0.clone());
    (relief.lat_deg, relief.lon_deg) = (Some(site.lat_deg), Some(site.lon_deg));
    relief.reach_m = Some(500.0);
    let (same, heights) = differences(&tiles, Some(relief), true);
    assert!(heights > 5, "{heights}");
    assert_eq!(same, vec![]);
}

/// A drone South of a hill of 14 m, which flies to the other side, where the beacon is.
const HILL: &str = r#"
name = "hill"
description = "over a hill"
estimator = "particle"
[world]
beacons = [{ name = "fox", east_m = 0.0, north_m = 60.0, up_m = 0.5 }]
drones = [{ east_m = 0.0, north_m = -25.0, up_m = 4.0 }]
[world.terrain]
hills = [{ east_m = 0.0, north_m = 15.0, height_m = 14.0, radius_m = 15.0 }]
[source]
kind = "stepper"
positions = 16
samples_per_position = 1
[model]
reference_dbm = -29.06
exponent = 2.765
target_up_m = 0.5
terrain = true
[extractor]
kind = "pritzl2018"
[planner]
kind = "waypoints"
places_m = [[0.0, -25.0], [0.0, 50.0]]
up_m = 4.0
[hunt]
prior_centre_m = [0.0, 40.0]
prior_sigma_m = 40.0
move_timeout_s = 120.0
"#;

#[test]
fn an_emulated_flight_has_the_terrain_of_its_world() {
    let scenario = Scenario::parse(HILL, "hill.toml").expect("a scenario");
    let world = World::new(&scenario.world, 1).expect("a world");
    let config =
        EmulatedFieldConfig { rangefinder_m: Some([0.2, 40.0]), ..EmulatedFieldConfig::default() };
    let (mut field, mut ports) =
        EmulatedField::in_memory(&scenario, &world, &config).expect("a field");
    let flight = field.flight().clone();
    flight.check().expect("a model over terrain goes with the flight's");
    let file = toml::to_string(&flight).expect("it is plain");
    assert_eq!(FlightConfig::parse(&file, "field.toml").expect("what was written"), flight);
    let registry = Registry::builtin();
    let estimator = flight.estimator(&registry).expect("it is known");
    let hunt = flight.parts(&registry, estimator, 1).build().expect("a hunt");
    let drones = flight.open(&mut ports, &world.clock(), 0.0, None, None).expect("devices");
    let mut mission: Mission<Shared<BoxedAircraft>, BoxedSource> =
        Mission::new(flight.flight, hunt, drones, world.time()).expect("a flight");
    let mut lowest = f64::INFINITY;
    let mut heard = Vec::new();
    let mut north = f64::NEG_INFINITY;
    let mut recalled = false;
    while !mission.is_over() && world.time() < 2000.0 {
        world.advance(scenario.simulation.tick_s).expect("time passes");
        field.serve(|device, error| panic!("{device}: {error}"));
        mission.step(world.time());
        let here = world.pose(0).expect("a drone").position;
        if mission.stage() == FlightStage::Hunting && !recalled {
            (lowest, north) = (lowest.min(here.z), north.max(here.y));
        }
        while let Some(event) = mission.poll_event() {
            match event {
                Event::Received { reception, .. } => {
                    let reported = reception.receiver.position;
                    assert!((reported - here).norm() < 0.2, "{reported} at {here}");
                    heard.push(here.z);
                }
                Event::Recalled { .. } => recalled = true,
                Event::HeightDiffers { .. } => panic!("{event:?}"),
                _ => {}
            }
        }
    }
    assert!(mission.is_over() && mission.failure().is_none(), "{mission:?}");
    assert!(north > 49.0, "it came to the other side: {north}");
    // The half metre is what a climb may end below its goal. Straight on it would have been 10 m
    // inside of the hill.
    assert!(lowest > 4.0 - 0.5 - 0.1, "{lowest}");
    assert!(heard.len() >= 2 && heard.iter().all(|up| (up - 4.0).abs() < 0.1), "{heard:?}");
}

#[test]
fn a_site_away_from_the_tiles_is_refused() {
    let tiles = Tiles::new("site");
    let mut scenario = Scenario::find("one-drone").expect("it is built in");
    let mut relief = ReliefConfig::default();
    relief.folder = Some(tiles.0.clone());
    (relief.lat_deg, relief.lon_deg, relief.reach_m) = (Some(50.5), Some(14.5), Some(300.0));
    scenario.world.terrain = Some(relief);
    let world = World::new(&scenario.world, 1).expect("a world");
    let mut config = EmulatedFieldConfig::default();
    let (field, _) = EmulatedField::in_memory(&scenario, &world, &config).expect("a field");
    let flight = field.flight();
    assert_eq!((flight.site.lat_deg, flight.site.lon_deg), (50.5, 14.5));
    assert_eq!(flight.terrain.as_ref().and_then(|it| it.folder.as_ref()), Some(&tiles.0));
    config.site.lat_deg = 51.0;
    let error = EmulatedField::in_memory(&scenario, &world, &config).expect_err("elsewhere");
    assert!(error.to_string().contains("50.5"), "{error}");
}
