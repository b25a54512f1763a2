//! Parameters of locating: numbers that may be free, places, and the terrain between recorded
//! receptions and a transmitter.

use std::{collections::BTreeMap, path::PathBuf, str::FromStr};

use foxhunt::{
    core::nalgebra::{Vector2, Vector3},
    geodesy::Geodetic,
    recorded::RecordedReception,
    recording::Recording,
    sensors::SharedTerrain,
    sim::ReliefConfig,
};

use crate::error::CliError;

/// A number of the propagation law that is known, or estimated along with the place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Parameter {
    Free,
    Value(f64),
}

impl FromStr for Parameter {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "free" {
            return Ok(Self::Free);
        }
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Self::Value(value)),
            _ => Err("it must be a number or `free`".to_owned()),
        }
    }
}

/// A place in the local frame, as the command line has it: East, North and Up in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EastNorthUp([f64; 3]);

impl FromStr for EastNorthUp {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<f64>, _> =
            text.split(',').map(|part| part.trim().parse()).collect();
        match numbers.as_deref() {
            Ok([east, north, up]) if [east, north, up].iter().all(|v| v.is_finite()) => {
                Ok(Self([*east, *north, *up]))
            }
            _ => Err("it must be E,N,U in metres, such as 0,0,1.5".to_owned()),
        }
    }
}

impl From<EastNorthUp> for Vector3<f64> {
    fn from(EastNorthUp(place): EastNorthUp) -> Self {
        place.into()
    }
}

/// The terrain whose loss comes off the levels.
#[derive(Debug, clap::Args)]
pub struct OverTerrain {
    /// Correct levels for the loss over the terrain in this folder's tiles: .hgt, or GeoTIFF in
    /// degrees (docs/terrain.md). Needs an estimator that takes levels in the order of time
    /// [default: `particle`]
    #[arg(long, value_name = "FOLDER")]
    terrain: Option<PathBuf>,
    /// The zero of the recordings' heights; heights above the ellipsoid (alt_m) need `take-off`
    #[arg(long, value_name = "FROM", requires = "terrain", default_value = "ground")]
    up_from: UpFrom,
    /// The transmitter's frequency, for the loss over the terrain
    #[arg(long, value_name = "MHZ", requires = "terrain", default_value_t = 2440.0)]
    frequency_mhz: f64,
}

/// Zero of Up in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum UpFrom {
    /// The ground below the receiver
    Ground,
    /// The ground at the first place of each drone, as autopilots count; for alt_m the ground at
    /// the first place of all, where a receiver stood
    TakeOff,
}

/// The terrain below receivers.
pub struct Relief {
    /// Terrain for estimators.
    pub config: ReliefConfig,
    terrain: SharedTerrain,
    up_from: UpFrom,
    /// The heights of the ground where the drones of each recording began, in metres.
    launches: Vec<BTreeMap<String, f64>>,
}

impl OverTerrain {
    /// Returns true if terrain is given.
    pub fn is_given(&self) -> bool {
        self.terrain.is_some()
    }

    /// Reads the tiles around the recordings, as far as the first search for the transmitter goes.
    pub fn read(
        &self,
        recordings: &[Recording],
        margin_m: f64,
    ) -> Result<Option<Relief>, CliError> {
        let Some(folder) = &self.terrain else { return Ok(None) };
        let Some(frame) = recordings.iter().find_map(Recording::frame) else {
            let reason = "--terrain: the recordings are in local metres; places in degrees are \
                          needed to find them on the tiles";
            return Err(CliError::input(reason));
        };
        let Geodetic { lat_deg, lon_deg, alt_m } = frame.origin();
        let by_ellipsoid = alt_m.abs() > 0.0;
        if by_ellipsoid && self.up_from == UpFrom::Ground {
            let reason = "--terrain: the recordings' heights (alt_m) are above the ellipsoid and \
                          not above the ground; --up-from take-off counts them from their first \
                          place, where the receiver has to have stood on the ground";
            return Err(CliError::input(reason));
        }
        let receivers = recordings.iter().flat_map(Recording::records).filter_map(|r| r.receiver());
        let farthest_m = receivers.map(|pose| pose.position.xy().amax()).fold(0.0, f64::max);
        let mut config = ReliefConfig::default();
        config.folder = Some(folder.clone());
        (config.lat_deg, config.lon_deg) = (Some(lat_deg), Some(lon_deg));
        config.reach_m = Some((farthest_m + margin_m).ceil());
        config.frequency_mhz = Some(self.frequency_mhz);
        let wrong = |error| CliError::input(format!("--terrain: {error}"));
        let terrain = config.build(self.frequency_mhz).map_err(wrong)?.terrain().clone();
        let mut relief = Relief { config, terrain, up_from: self.up_from, launches: Vec::new() };
        for recording in recordings {
            let mut launches = BTreeMap::new();
            for record in recording.records() {
                let Some(receiver) = record.receiver() else { continue };
                let from = if by_ellipsoid { Vector3::zeros() } else { receiver.position };
                if !launches.contains_key(&*record.drone) {
                    launches.insert(record.drone.to_string(), relief.ground(&from.xy())?);
                }
            }
            relief.launches.push(launches);
        }
        Ok(Some(relief))
    }
}

impl Relief {
    /// Returns a reception of a recording, counted from 0, with its height above the ground below
    /// as its Up.
    pub fn placed(
        &self,
        number: usize,
        mut received: RecordedReception,
    ) -> Result<RecordedReception, CliError> {
        let launch = self.launches.get(number).and_then(|of| of.get(&*received.drone));
        if let (UpFrom::TakeOff, Some(launch)) = (self.up_from, launch) {
            let place = &mut received.reception.receiver.position;
            place.z += launch - self.ground(&place.xy())?;
        }
        Ok(received)
    }

    fn ground(&self, place: &Vector2<f64>) -> Result<f64, CliError> {
        let beyond = || {
            let [east, north] = [place.x, place.y];
            CliError::input(format!("--terrain: no height at ({east:.0}, {north:.0}) m"))
        };
        self.terrain.height(place).ok_or_else(beyond)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_three_numbers() {
        assert_eq!("-1, 2,0.5".parse(), Ok(EastNorthUp([-1.0, 2.0, 0.5])));
        for text in ["1,2", "1,2,3,4", "1,2,x", "1,2,inf"] {
            assert!(text.parse::<EastNorthUp>().is_err(), "{text}");
        }
    }
}
