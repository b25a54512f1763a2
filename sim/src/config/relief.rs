//! The terrain of a world: hills, or the tiles of an elevation model.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use foxhunt_core::parameter::{FieldError, ParameterError, in_range, positive};
use foxhunt_sensors::{Hill, Hills, SharedTerrain, TerrainLoss};
use serde::{Deserialize, Serialize};

use crate::{SPEED_OF_LIGHT, error::ReliefError};

/// The terrain of a simulated world, or what a model takes for it: hills, or the tiles of an
/// elevation model about an origin.
///
/// In a file `hills = [{ east_m = 60.0, north_m = 0.0, height_m = 15.0, radius_m = 25.0 }]`, or
/// `folder = "tiles"` with `lat_deg`, `lon_deg` and `reach_m`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReliefConfig {
    /// The hills of a plain.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hills: Vec<Hill>,
    /// The folder of tiles, `.hgt` or GeoTIFF in degrees; in a file, from where the file is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub folder: Option<PathBuf>,
    /// Latitude of the origin of East and North in degrees, with a folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lat_deg: Option<f64>,
    /// Longitude of the origin in degrees, with a folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lon_deg: Option<f64>,
    /// The distance East, North, West and South of the origin up to which the tiles are read, in
    /// metres; beyond it the ground hides nothing. 1000 unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reach_m: Option<f64>,
    /// The frequency that the loss is computed with, in MHz; if absent, the frequency of the
    /// channel, and for a model without one 2440.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_mhz: Option<f64>,
    #[serde(skip)]
    read: Read,
}

/// The tiles and terrain that were read: once for all worlds and models of one configuration.
#[derive(Clone, Debug, Default)]
struct Read(Arc<OnceLock<(Tiles, SharedTerrain)>>);

/// The settings that the tiles are read with.
#[derive(Clone, Debug, PartialEq)]
struct Tiles {
    folder: PathBuf,
    lat_deg: f64,
    lon_deg: f64,
    reach_m: f64,
}

/// It follows from the other fields.
impl PartialEq for Read {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Nothing: neither hills nor a folder, which is refused when it is built.
impl Default for ReliefConfig {
    fn default() -> Self {
        Self::of_hills(Vec::new())
    }
}

/// The default of `reach_m`, in metres.
const REACH_M: f64 = 1000.0;

impl ReliefConfig {
    /// Some hills.
    #[must_use]
    pub fn of_hills(hills: Vec<Hill>) -> Self {
        let folder = None;
        let lat_deg = None;
        let lon_deg = None;
        let reach_m = None;
        let frequency_mhz = None;
        let read = Read::default();
        Self { hills, folder, lat_deg, lon_deg, reach_m, frequency_mhz, read }
    }

    /// Makes the folder relative to `base`, such as the folder of the file that names it.
    #[must_use]
    pub fn in_folder(self, base: &Path) -> Self {
        let folder = self.folder.map(|folder| base.join(folder));
        Self { folder, read: Read::default(), ..self }
    }

    /// Refuses what cannot be; reads no tile.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field, with its value.
    pub fn check(&self) -> Result<(), FieldError> {
        for (i, hill) in self.hills.iter().enumerate() {
            let within = |error: ParameterError| error.within(format_args!("hills[{i}]"));
            Hills::new(vec![*hill]).map_err(within)?;
        }
        let frequency_mhz = self.frequency_mhz.unwrap_or(1.0);
        in_range("frequency_mhz", frequency_mhz, 1e-3..=1e6, "a positive number, at most 1e6")?;
        let places = [
            ("lat_deg", self.lat_deg, 90.0),
            ("lon_deg", self.lon_deg, 180.0),
            ("reach_m", self.reach_m, f64::MAX),
        ];
        match &self.folder {
            None => {
                if self.hills.is_empty() {
                    let requirement = "at least one hill, or a folder of tiles";
                    return Err(FieldError::new("hills", "empty", requirement));
                }
                for (field, value, _) in places {
                    if let Some(value) = value {
                        return Err(FieldError::new(field, value, "left out without a folder"));
                    }
                }
            }
            Some(_) => {
                if !self.hills.is_empty() {
                    let hills = self.hills.len();
                    return Err(FieldError::new("hills", hills, "left out beside a folder"));
                }
                for (field, value, most) in &places[..2] {
                    let requirement = "given with a folder";
                    let value = value.ok_or_else(|| FieldError::new(*field, "absent", requirement));
                    in_range(field, value?, -most..=*most, "a place on Earth, in degrees")?;
                }
                positive("reach_m", self.reach_m.unwrap_or(1.0))?;
            }
        }
        Ok(())
    }

    /// Builds the loss over the terrain, computed with `frequency_mhz` unless the configuration has
    /// its own. Tiles are read when it, or a copy of it, is built for the first time.
    ///
    /// # Errors
    ///
    /// [`ReliefError`] names the field that is out of range, or the tile.
    pub fn build(&self, frequency_mhz: f64) -> Result<TerrainLoss<SharedTerrain>, ReliefError> {
        self.check()?;
        let frequency_mhz = self.frequency_mhz.unwrap_or(frequency_mhz);
        let frequency_mhz = positive("frequency_mhz", frequency_mhz).map_err(FieldError::from)?;
        let wavelength = SPEED_OF_LIGHT / (1e6 * frequency_mhz);
        let terrain: SharedTerrain = match &self.folder {
            None => Arc::new(Hills::new(self.hills.clone()).map_err(FieldError::from)?),
            Some(folder) => self.read(Tiles {
                folder: folder.clone(),
                lat_deg: self.lat_deg.unwrap_or(0.0),
                lon_deg: self.lon_deg.unwrap_or(0.0),
                reach_m: self.reach_m.unwrap_or(REACH_M),
            })?,
        };
        Ok(TerrainLoss::new(terrain, wavelength).map_err(FieldError::from)?)
    }

    /// Returns the terrain of some tiles; reads them unless they were read before.
    fn read(&self, tiles: Tiles) -> Result<SharedTerrain, ReliefError> {
        if let Some((known, terrain)) = self.read.0.get()
            && *known == tiles
        {
            return Ok(Arc::clone(terrain));
        }
        let terrain = tiles.read()?;
        // One that was changed after it was read is read anew each time.
        let _ = self.read.0.set((tiles, Arc::clone(&terrain)));
        Ok(terrain)
    }
}

impl Tiles {
    #[cfg(feature = "terrain")]
    fn read(&self) -> Result<SharedTerrain, ReliefError> {
        use foxhunt_sensors::HeightRaster;
        use foxhunt_wire::{
            geodesy::{GeodesyError, Geodetic, LocalFrame},
            terrain::ElevationModel,
        };
        let place = |error: GeodesyError| ReliefError::Tiles { reason: error.to_string() };
        let origin = Geodetic::new(self.lat_deg, self.lon_deg, 0.0).map_err(place)?;
        let frame = LocalFrame::new(origin).map_err(place)?;
        let model = ElevationModel::read(&self.folder, frame, self.reach_m)
            .map_err(|error| ReliefError::Tiles { reason: error.to_string() })?;
        Ok(Arc::new(HeightRaster::read(&model, self.reach_m).map_err(FieldError::from)?))
    }

    #[cfg(not(feature = "terrain"))]
    fn read(&self) -> Result<SharedTerrain, ReliefError> {
        let requirement = "left out of a program that is built without the feature `terrain`";
        Err(FieldError::new("folder", self.folder.display(), requirement).into())
    }
}
