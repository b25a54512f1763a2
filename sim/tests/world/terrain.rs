//! Terrain between beacons and drones.

use approx::abs_diff_eq;
use std::{fs, path::PathBuf};

use foxhunt_sensors::{Hill, Hills, TerrainLoss};
use foxhunt_sim::{ChannelConfig, ReliefConfig, World, WorldConfig};
use nalgebra::Vector3;

use crate::rig::{Rig, config, omnidirectional, quiet};

/// Between the drone at the origin and the beacon at (30, 40).
const HILL: Hill = Hill { east_m: 15.0, north_m: 20.0, height_m: 12.0, radius_m: 10.0 };

fn over(terrain: Option<ReliefConfig>, channel: ChannelConfig) -> WorldConfig {
    WorldConfig { terrain, ..config(ChannelConfig { antenna: omnidirectional(), ..channel }) }
}

fn hills() -> Option<ReliefConfig> {
    Some(ReliefConfig::of_hills(vec![HILL]))
}

#[test]
fn a_hill_takes_its_loss_and_nothing_else_changes() {
    let wavelength = 299_792_458.0 / 2.44e9;
    let loss = TerrainLoss::new(Hills::new(vec![HILL]).expect("in range"), wavelength);
    let loss = loss.expect("in range");
    // With everything random that there is: the draws stay what they are.
    let noisy = ChannelConfig { loss_probability: 0.2, ..ChannelConfig::default() };
    let [mut over, mut level] =
        [hills(), None].map(|terrain| Rig::new(&over(terrain, noisy.clone()), 5));
    let mut received = 0;
    for (up, angle) in [(4.0, 0.3), (4.0, 1.0), (12.0, 2.0), (60.0, 2.0), (3.0, -1.0)] {
        for (beacon, place) in [(0, [30.0, 40.0, 0.0]), (1, [-5.0, 0.0, 0.0])] {
            let db = loss.loss_db(&Vector3::new(0.0, 0.0, up), &Vector3::from(place));
            assert!(beacon == 0 || db < 0.01, "{db} dB beside the hill");
            let readings = [&mut over, &mut level].map(|rig| {
                rig.fly_to(0.0, 0.0, up);
                rig.turn_to(angle);
                rig.request(beacon)
            });
            let [Some(behind), Some(plain)] = readings else {
                assert_eq!(readings, [None, None]);
                continue;
            };
            received += 1;
            assert!((plain - behind - db).abs() < 1e-9, "{up} m: {} dB", plain - behind);
        }
    }
    assert!(received > 5);
    let low = loss.loss_db(&Vector3::new(0.0, 0.0, 4.0), &Vector3::new(30.0, 40.0, 0.0));
    assert!(low > 20.0, "{low} dB");
}

/// A tile of three arc seconds with a ridge of 40 m from North to South along its middle.
struct Tile(PathBuf);

impl Tile {
    fn new() -> Self {
        let folder = std::env::temp_dir().join(format!("foxhunt-ridge-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder for this test");
        let ridge = |index: u32| if index % 1201 == 600 { 40_i16 } else { 0 };
        let bytes: Vec<u8> = (0..1201 * 1201).flat_map(|i| ridge(i).to_be_bytes()).collect();
        fs::write(folder.join("N50E014.hgt"), bytes).expect("it is ours");
        Self(folder)
    }
}

impl Drop for Tile {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn tiles_are_terrain_and_read_once() {
    let tile = Tile::new();
    let mut terrain = ReliefConfig::default();
    terrain.folder = Some(".".into());
    terrain = terrain.in_folder(&tile.0);
    (terrain.lat_deg, terrain.lon_deg) = (Some(50.5), Some(14.5));
    terrain.reach_m = Some(500.0);
    let mut config = over(Some(terrain), quiet());
    (config.drones[0].east_m, config.drones[0].up_m) = (-200.0, 4.0);
    (config.beacons[0].east_m, config.beacons[0].north_m) = (200.0, 0.0);
    (config.beacons[1].east_m, config.beacons[1].north_m) = (-200.0, 400.0);
    let level = WorldConfig { terrain: None, ..config.clone() };
    let readings = |config: &WorldConfig| {
        let mut rig = Rig::new(config, 1);
        [rig.receive(0), rig.receive(1)]
    };
    let behind = readings(&config);
    let plain = readings(&level);
    assert!(plain[0] - behind[0] > 25.0, "{} dB over the ridge", plain[0] - behind[0]);
    assert!(abs_diff_eq!(plain[1], behind[1], epsilon = 1e-9), "along the valley");
    // Copies need the tiles no more; another reach does.
    let copy = config.clone();
    let mut wider = config.clone();
    drop(tile);
    assert_eq!(readings(&copy).map(f64::to_bits), behind.map(f64::to_bits));
    wider.terrain.as_mut().expect("as above").reach_m = Some(600.0);
    let error = World::new(&wider, 1).expect_err("it is gone").to_string();
    assert!(error.starts_with("terrain: ") && error.contains("cannot be read"), "{error}");
}

#[test]
fn a_terrain_that_is_none_is_refused_by_field() {
    let refused = |change: fn(&mut ReliefConfig)| {
        let mut terrain = ReliefConfig::of_hills(vec![HILL]);
        change(&mut terrain);
        World::new(&over(Some(terrain), quiet()), 1).expect_err("it is none").to_string()
    };
    for (change, expected) in [
        ((|t| t.hills.clear()) as fn(&mut ReliefConfig), "terrain.hills is empty"),
        (|t| t.lat_deg = Some(50.0), "terrain.lat_deg is 50; it must be left out without"),
        (|t| t.folder = Some("tiles".into()), "terrain.hills is 1; it must be left out beside"),
        (
            |t| (t.hills, t.folder) = (Vec::new(), Some("tiles".into())),
            "terrain.lat_deg is absent; it must be given with a folder",
        ),
        (
            |t| {
                (t.hills, t.folder) = (Vec::new(), Some("tiles".into()));
                (t.lat_deg, t.lon_deg) = (Some(50.0), Some(190.0));
            },
            "terrain.lon_deg is 190",
        ),
    ] {
        let error = refused(change);
        assert!(error.starts_with(expected), "{error}");
    }
}
