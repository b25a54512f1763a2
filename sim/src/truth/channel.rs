use std::f64::consts::TAU;

use foxhunt_sensors::{
    Friis, Isotropic, LogDistance, Propagation, ReflectedWave, SharedAntenna, SharedTerrain,
    TerrainLoss, multipath_gain_dbi,
};
use nalgebra::Vector3;
use rand::rngs::Xoshiro256PlusPlus;

use super::{Port, shadowing::ShadowingField};
use crate::{
    ChannelConfig, DeadZoneConfig, PathLossConfig, ReliefConfig, ScatteringConfig, SimError,
    TwoRayConfig,
};

/// Speed of light in metres per second.
const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// The radio channel: what every sample goes through. Its random numbers are drawn by the
/// receivers, but for the fields of shadowing.
#[derive(Clone, Debug)]
pub(crate) struct Channel {
    law: Law,
    pub(super) frequency_mhz: f64,
    /// The wavelength in metres.
    wavelength: f64,
    /// 2π over the wavelength.
    pub(super) wave_number: f64,
    antenna: SharedAntenna,
    mean_gain_db: f64,
    /// Loss over the terrain; `None` if the ground is level.
    terrain: Option<TerrainLoss<SharedTerrain>>,
    /// The fields of shadowing, one for each beacon; empty without shadowing.
    shadowing: Vec<ShadowingField>,
    pub(super) reflectors: Vec<Reflector>,
    pub(super) scattering: Option<ScatteringConfig>,
    dead_zones: Vec<DeadZoneConfig>,
    pub(super) pattern_sigma_db: f64,
    pub(super) sample_sigma_db: f64,
    /// σ of a pattern's bearing, in radians.
    pub(super) bearing_sigma: f64,
    pub(super) patterns_stay: bool,
    pub(super) noise_dbm: Option<f64>,
    whole_db: bool,
    floor_dbm: Option<f64>,
    pub(super) loss_probability: f64,
}

#[derive(Clone, Copy, Debug)]
enum Law {
    LogDistance(LogDistance),
    Friis(Friis),
    TwoRay(TwoRayConfig),
}

/// A reflector: its phase in radians.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reflector {
    pub(super) place: Vector3<f64>,
    pub(super) amplitude: f64,
    pub(super) phase: f64,
}

impl Channel {
    /// The channel of a configuration that was checked but for its antenna and its law, over a
    /// terrain, for a number of beacons.
    pub(crate) fn new(
        config: &ChannelConfig,
        terrain: Option<&ReliefConfig>,
        beacons: usize,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Result<Self, SimError> {
        let antenna = config.antenna.build()?;
        let wavelength = SPEED_OF_LIGHT / (config.frequency_mhz * 1e6);
        let law = match config.path_loss {
            PathLossConfig::LogDistance(law) => Law::LogDistance(law),
            PathLossConfig::Friis { power_dbm } => {
                Law::Friis(Friis::new(power_dbm, 0.0, 0.0, wavelength).map_err(SimError::PathLoss)?)
            }
            PathLossConfig::TwoRay(config) => {
                // What holds at one height holds at all above it.
                config.law(wavelength, [0.0; 2]).map_err(SimError::PathLoss)?;
                Law::TwoRay(config)
            }
        };
        let build = |terrain: &ReliefConfig| terrain.build(config.frequency_mhz);
        let terrain = terrain.map(build).transpose().map_err(SimError::Terrain)?;
        let reflector = |reflector: &crate::ReflectorConfig| Reflector {
            place: Vector3::new(reflector.east_m, reflector.north_m, reflector.up_m),
            amplitude: reflector.amplitude,
            phase: reflector.phase_deg.to_radians(),
        };
        let fields = config.shadowing.iter().flat_map(|shadowing| vec![shadowing; beacons]);
        Ok(Self {
            law,
            frequency_mhz: config.frequency_mhz,
            wavelength,
            wave_number: TAU / wavelength,
            mean_gain_db: antenna.mean_gain_db(0.0),
            antenna,
            terrain,
            shadowing: fields.map(|shadowing| ShadowingField::draw(shadowing, rng)).collect(),
            reflectors: config.reflectors.iter().map(reflector).collect(),
            scattering: config.scattering,
            dead_zones: config.dead_zones.clone(),
            pattern_sigma_db: config.pattern_sigma_db,
            sample_sigma_db: config.sample_sigma_db,
            bearing_sigma: config.bearing_sigma_deg.to_radians(),
            patterns_stay: config.patterns_stay,
            noise_dbm: config.noise_dbm,
            whole_db: config.whole_db,
            floor_dbm: config.floor_dbm,
            loss_probability: config.loss_probability,
        })
    }

    /// The ground, where it is not level.
    pub(crate) fn terrain(&self) -> Option<&SharedTerrain> {
        self.terrain.as_ref().map(TerrainLoss::terrain)
    }

    /// The mean level of a beacon at `to` over a level turn at `from`, in dBm, behind what terrain
    /// there is between them.
    pub(super) fn level_dbm(&self, beacon: usize, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let range = (to - from).norm();
        let level = match &self.law {
            Law::LogDistance(law) => law.rss_dbm(range),
            Law::Friis(law) => law.rss_dbm(range),
            Law::TwoRay(config) => config
                .law(self.wavelength, [to.z, from.z])
                .expect("it was made at the least height, and vehicles' places are finite")
                .rss_dbm(range),
        };
        let level = level + self.shadowing.get(beacon).map_or(0.0, |field| field.at(from));
        match &self.terrain {
            Some(terrain) => level - terrain.loss_db(from, to),
            None => level,
        }
    }

    /// The gain over its mean in dB, for a direct wave and reflected ones, of the antenna at a
    /// port.
    pub(super) fn relative_gain_db(
        &self,
        azimuth: f64,
        elevation: f64,
        reflected: &[ReflectedWave],
        port: Port<'_>,
    ) -> f64 {
        match port {
            Port::Directional => {
                multipath_gain_dbi(&self.antenna, azimuth, elevation, reflected) - self.mean_gain_db
            }
            Port::Omnidirectional => multipath_gain_dbi(&Isotropic, azimuth, elevation, reflected),
            Port::Own(antenna) => {
                multipath_gain_dbi(antenna, azimuth, elevation, reflected)
                    - antenna.mean_gain_db(0.0)
            }
        }
    }

    /// The receiver's reading of a power, both in dBm; `None` below its floor.
    pub(super) fn reading_dbm(&self, power_dbm: f64) -> Option<f64> {
        let reading = if self.whole_db { libm::round(power_dbm) } else { power_dbm };
        self.floor_dbm.is_none_or(|floor| reading >= floor).then_some(reading)
    }

    /// Returns true if anything is received at a place.
    pub(super) fn reaches(&self, place: &Vector3<f64>) -> bool {
        !self.dead_zones.iter().any(|zone| zone.contains(place))
    }

    /// The weakest reading, if there is one.
    pub(crate) fn floor_dbm(&self) -> Option<f64> {
        self.floor_dbm
    }
}
