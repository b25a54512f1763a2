//! A drone's devices, driven by hand and at once.

use std::f64::consts::TAU;

use foxhunt_core::{BeaconId, Radio, Rotator, Vehicle, Waypoint};
use foxhunt_sensors::{AntennaConfig, GainRow};
use foxhunt_sim::{
    BeaconConfig, ChannelConfig, DroneConfig, KinematicConfig, OtherConfig, ReflectorConfig,
    ScatteringConfig, SimRadio, SimRotator, SimStepperConfig, SimVehicle, VehicleConfig, World,
    WorldConfig,
};
use nalgebra::Vector3;

pub(crate) const POSITIONS: u16 = 128;

/// A beacon at a place.
pub(crate) fn beacon(east_m: f64, north_m: f64, up_m: f64) -> BeaconConfig {
    BeaconConfig { name: "fox".to_owned(), east_m, north_m, up_m, ..BeaconConfig::default() }
}

/// A channel in which nothing is random.
/// A transmitter to the East, on a beacon's frequency.
pub(crate) fn other(east_m: f64) -> OtherConfig {
    OtherConfig { east_m, north_m: 0.0, up_m: 0.0, scatter_m: None, presence: 1.0 }
}

pub(crate) fn quiet() -> ChannelConfig {
    ChannelConfig {
        pattern_sigma_db: 0.0,
        sample_sigma_db: 0.0,
        bearing_sigma_deg: 0.0,
        ..ChannelConfig::default()
    }
}

/// An omnidirectional antenna.
pub(crate) fn omnidirectional() -> AntennaConfig {
    let row = |angle_deg| GainRow { angle_deg, gain_db: 5.0 };
    AntennaConfig::Table(vec![row(0.0), row(120.0), row(240.0)])
}

/// Something 20 m to the West that reflects with this amplitude.
pub(crate) fn reflector(amplitude: f64) -> ReflectorConfig {
    ReflectorConfig { east_m: -20.0, north_m: 0.0, up_m: 0.0, amplitude, phase_deg: 180.0 }
}

/// Six scattered waves on the horizon that have half the power together.
pub(crate) fn scattering() -> ScatteringConfig {
    ScatteringConfig { k_db: 0.0, k_sigma_db: 0.0, waves: 6, elevation_sigma_deg: 0.0 }
}

/// One drone at the origin, a beacon at (30, 40, 0), and another one elsewhere; devices that take
/// no time worth mentioning.
pub(crate) fn config(channel: ChannelConfig) -> WorldConfig {
    WorldConfig {
        beacons: vec![beacon(30.0, 40.0, 0.0), beacon(-5.0, 0.0, 0.0)],
        drones: vec![DroneConfig::default()],
        channel,
        terrain: None,
        vehicle: VehicleConfig::Kinematic(KinematicConfig {
            speed_mps: 1e6,
            climb_mps: 1e6,
            ..KinematicConfig::default()
        }),
        stepper: SimStepperConfig { rotator_speed_rad_s: 1e6, radio_latency_s: 0.0 },
    }
}

pub(crate) struct Rig {
    pub(crate) world: World,
    pub(crate) radio: SimRadio,
    pub(crate) rotator: SimRotator,
    pub(crate) vehicle: SimVehicle,
    backwards: bool,
}

impl Rig {
    pub(crate) fn new(config: &WorldConfig, seed: u64) -> Self {
        Self::on(&World::new(config, seed).expect("the configuration is in order"), 0)
    }

    pub(crate) fn on(world: &World, drone: usize) -> Self {
        Self {
            world: world.clone(),
            radio: world.radio(drone).expect("it exists"),
            rotator: world.rotator(drone).expect("it exists"),
            vehicle: world.vehicle(drone).expect("it exists"),
            backwards: false,
        }
    }

    /// Turns the antenna to `angle` radians from the nose and waits until it stands.
    pub(crate) fn turn_to(&mut self, angle: f64) {
        self.rotator.turn_to(angle).expect("finite");
        self.world.advance(1e-3).expect("a step");
        assert_eq!(self.rotator.poll().expect("it works"), Some(angle));
    }

    /// Flies to a place and waits until it is there.
    pub(crate) fn fly_to(&mut self, east: f64, north: f64, up: f64) {
        let position = Vector3::new(east, north, up);
        self.vehicle.go_to(&Waypoint { position }).expect("a place");
        self.world.advance(1.0).expect("a step");
        assert_eq!(self.vehicle.pose().expect("it works").position, position);
    }

    pub(crate) fn request(&mut self, beacon: u16) -> Option<f64> {
        self.radio.request(BeaconId(beacon)).expect("the beacon exists");
        self.radio.poll().expect("it works")
    }

    /// The reading of a beacon where nothing is lost.
    pub(crate) fn receive(&mut self, beacon: u16) -> f64 {
        self.request(beacon).expect("nothing is lost")
    }

    /// A turn to or fro: the antenna's angles and the readings there.
    pub(crate) fn turn(&mut self, beacon: u16, samples: usize) -> Vec<(f64, f64)> {
        let mut readings = Vec::new();
        for i in 0..POSITIONS {
            let position = if self.backwards { POSITIONS - 1 - i } else { i };
            let angle = TAU * f64::from(position) / f64::from(POSITIONS);
            self.turn_to(angle);
            readings.extend((0..samples).map(|_| (angle, self.receive(beacon))));
        }
        self.backwards = !self.backwards;
        readings
    }
}

/// The mean level of a turn in dBm.
pub(crate) fn level(turn: &[(f64, f64)]) -> f64 {
    mean(&turn.iter().map(|(_, rss)| *rss).collect::<Vec<_>>())
}

/// The direction of a turn of evenly spread angles: the phase of its first harmonic.
pub(crate) fn direction(turn: &[(f64, f64)]) -> f64 {
    let mut east = 0.0;
    let mut north = 0.0;
    for (angle, rss) in turn {
        east += rss * angle.cos();
        north += rss * angle.sin();
    }
    north.atan2(east)
}

pub(crate) fn count<T>(values: &[T]) -> f64 {
    f64::from(u32::try_from(values.len()).expect("few"))
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / count(values)
}

/// The standard deviation about zero, which the channel's draws have as their mean.
pub(crate) fn deviation(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / count(values)).sqrt()
}
