use std::{fs, path::Path};

use serde::{Deserialize, Serialize};

use super::{DroneConfig, FlightRules, FlyError};
use crate::{
    calibration::BearingCalibration,
    config::{DEFAULT_ESTIMATOR, EstimatorConfig, ExtractorConfig, ModelConfig, PlannerConfig},
    geodesy::{Geodetic, LocalFrame},
    hunt::{HuntConfig, HuntParts},
    log::{LOG_VERSION, LogHeader, LoggedBeacon},
};

/// A hunt on real devices, as it stands in a file: the same hunt as a
/// [`Scenario`](crate::scenario::Scenario)'s, with devices instead of a simulated world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightConfig {
    /// Its name.
    pub name: String,
    /// The origin of the common frame, from which East and North are counted.
    pub site: Site,
    /// What is looked for, in this order.
    pub beacons: Vec<FlownBeacon>,
    /// The estimator's name.
    #[serde(default = "default_estimator")]
    pub estimator: String,
    /// What the estimator takes for the law of propagation.
    pub model: ModelConfig,
    /// What makes a level and a bearing of a turn.
    pub extractor: ExtractorConfig,
    /// How the bearings err and their σ is off, as a calibration has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bearings: Option<BearingCalibration>,
    /// What decides where to listen.
    pub planner: PlannerConfig,
    /// Time-outs, tolerances, the prior, the airspace, the batteries.
    #[serde(default)]
    pub hunt: HuntConfig,
    /// How the flight begins and ends.
    #[serde(default)]
    pub flight: FlightRules,
    /// The drones.
    pub drones: Vec<DroneConfig>,
}

/// The origin of the common frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Site {
    /// Latitude in degrees, WGS84, North positive.
    pub lat_deg: f64,
    /// Longitude in degrees, WGS84, East positive.
    pub lon_deg: f64,
    /// Height of the ground where the drones stand above the ellipsoid, in metres: what Up is counted from
    /// where a GNSS receiver of its own tells where a drone is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ground_alt_m: Option<f64>,
}

/// A beacon that is looked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlownBeacon {
    /// Its name.
    pub name: String,
    /// The address that an XBee asks: 16 hexadecimal digits, or 4.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub address: Option<String>,
    /// The frequency that a receiver is tuned to, in MHz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_mhz: Option<f64>,
}

fn default_estimator() -> String {
    DEFAULT_ESTIMATOR.to_owned()
}

impl Site {
    /// The common East-North-Up frame.
    ///
    /// # Errors
    ///
    /// [`FlyError::Site`] when there is no such place.
    pub fn frame(&self) -> Result<LocalFrame, FlyError> {
        Ok(LocalFrame::new(Geodetic::new(
            self.lat_deg,
            self.lon_deg,
            self.ground_alt_m.unwrap_or(0.0),
        )?)?)
    }
}

impl FlightConfig {
    /// Reads a TOML file.
    ///
    /// # Errors
    ///
    /// [`FlyError`] names the file, the line and the field.
    pub fn read(path: &Path) -> Result<Self, FlyError> {
        let file = path.display().to_string();
        let text = fs::read_to_string(path)
            .map_err(|source| FlyError::Read { file: file.clone(), source })?;
        Self::parse(&text, &file)
    }

    /// Takes it from TOML; `file` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`FlyError`] names the file, the line and the field.
    pub fn parse(text: &str, file: &str) -> Result<Self, FlyError> {
        let config: Self = toml::from_str(text)
            .map_err(|source| FlyError::Parse { file: file.to_owned(), source })?;
        config.check()?;
        Ok(config)
    }

    /// Whether it can be flown, as far as no device is asked.
    ///
    /// # Errors
    ///
    /// [`FlyError`] names what cannot be.
    pub fn check(&self) -> Result<(), FlyError> {
        self.site.frame()?;
        if let Some((field, value)) = self.flight.out_of_range() {
            return Err(FlyError::Flight { field, value });
        }
        if self.drones.is_empty() || self.beacons.is_empty() {
            let missing = if self.drones.is_empty() { "drones" } else { "beacons" };
            return Err(FlyError::Nothing { missing });
        }
        let mut names: Vec<&str> = self.drones.iter().map(|drone| drone.name.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(FlyError::Twice { drone: twice[0].to_owned() });
        }
        self.drones.iter().try_for_each(|drone| {
            let named = |reason| FlyError::Drone { drone: drone.name.clone(), reason };
            drone.check(&self.site, &self.beacons, self.flight.takeoff_up_m).map_err(named)
        })
    }

    /// What its hunt is made of with an estimator and a seed.
    #[must_use]
    pub fn parts(&self, estimator: &EstimatorConfig, seed: u64) -> HuntParts<'_> {
        HuntParts {
            extractor: &self.extractor,
            bearings: self.bearings,
            planner: &self.planner,
            model: &self.model,
            estimator: *estimator,
            hunt: &self.hunt,
            beacons: self.beacons.iter().map(|beacon| beacon.name.clone()).collect(),
            seed,
        }
    }

    /// The header that a log of this flight begins with, whose time 0 is `epoch_unix_s` in whole
    /// seconds of UNIX time.
    #[must_use]
    pub fn log_header(
        &self,
        estimator: &EstimatorConfig,
        seed: u64,
        epoch_unix_s: Option<i64>,
    ) -> LogHeader {
        let beacon =
            |b: &FlownBeacon| LoggedBeacon { name: b.name.clone(), truth: None, course: None };
        LogHeader {
            foxhunt_log: LOG_VERSION,
            scenario: self.name.clone(),
            seed,
            estimator_name: self.estimator.clone(),
            estimator: *estimator,
            model: self.model.clone(),
            planner: Some(self.planner.clone()),
            beacons: self.beacons.iter().map(beacon).collect(),
            epoch_unix_s,
            homes: Vec::new(),
        }
    }
}
