use std::{path::PathBuf, sync::Arc};

use foxhunt_core::parameter::{FieldError, positive};
use foxhunt_sensors::{Hill, Hills, SharedTerrain};
use foxhunt_sim::ReliefConfig;
use foxhunt_wire::{geodesy::LocalFrame, terrain::ElevationModel};
use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::FlyError;

/// The ground that a flight is over. With it, every Up of the flight is a height above the ground
/// below, be it of a pose, a goal or a band of altitudes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TerrainConfig {
    /// The folder of the tiles, `.hgt` or GeoTIFF; in a file, from where the file is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub folder: Option<PathBuf>,
    /// The hills of a plain in the place of tiles, as emulated fields have them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hills: Vec<Hill>,
    /// Reach of the ground that is read East, North, West and South of the site's origin, in
    /// metres: no drone is sent farther.
    #[serde(default = "reach_m")]
    pub reach_m: f64,
    /// Least height of a drone above the highest ground of its line, in metres; one that is sent
    /// lower keeps the height that it is sent to.
    #[serde(default = "clearance_m")]
    pub clearance_m: f64,
    /// Tolerance between the height above the ground that a drone's own devices report and this
    /// model's, in metres; beyond it there is a notice. 4 unless given: nine of ten differences of
    /// heights of Copernicus GLO-30 are better than that on slopes of more than 20 %, and the
    /// clearance is used up there.
    #[serde(default = "height_tolerance_m")]
    pub height_tolerance_m: f64,
}

fn reach_m() -> f64 {
    1000.0
}

fn clearance_m() -> f64 {
    4.0
}

fn height_tolerance_m() -> f64 {
    4.0
}

/// Reach of hills, in metres: no tile has to be read for them.
const HILLS_REACH_M: f64 = 50_000.0;

impl TerrainConfig {
    /// Returns the settings for a simulated world, with the usual clearance and tolerance.
    #[must_use]
    pub fn of_world(relief: &ReliefConfig) -> Self {
        let usual = if relief.folder.is_some() { reach_m() } else { HILLS_REACH_M };
        Self {
            folder: relief.folder.clone(),
            hills: relief.hills.clone(),
            reach_m: relief.reach_m.unwrap_or(usual),
            clearance_m: clearance_m(),
            height_tolerance_m: height_tolerance_m(),
        }
    }

    /// Refuses what cannot be; reads no tile.
    pub(super) fn check(&self) -> Result<(), FieldError> {
        if self.folder.is_some() != self.hills.is_empty() {
            let (value, requirement) = match &self.folder {
                Some(folder) => (folder.display().to_string(), "left out beside hills"),
                None => ("absent".to_owned(), "given, or hills"),
            };
            return Err(FieldError::new("folder", value, requirement));
        }
        Hills::new(self.hills.clone()).map_err(|error| error.within("hills"))?;
        positive("reach_m", self.reach_m)?;
        positive("clearance_m", self.clearance_m)?;
        positive("height_tolerance_m", self.height_tolerance_m)?;
        Ok(())
    }

    /// Reads the tiles about the origin of `frame`, or takes the hills.
    pub(super) fn read(&self, frame: LocalFrame) -> Result<Ground, FlyError> {
        let (terrain, relief_m): (SharedTerrain, f64) = match &self.folder {
            Some(folder) => {
                let model = ElevationModel::read(folder, frame, self.reach_m)?;
                let relief_m = model.relief_m();
                (Arc::new(model), relief_m)
            }
            None => {
                let hills = Hills::new(self.hills.clone());
                let hills = hills.map_err(|error| error.within("terrain.hills"))?;
                // No two places of theirs are farther apart in height.
                let relief_m = self.hills.iter().map(|hill| hill.height_m.abs()).sum();
                (Arc::new(hills), relief_m)
            }
        };
        let Self { reach_m, clearance_m, height_tolerance_m, .. } = *self;
        Ok(Ground { terrain, relief_m, reach_m, clearance_m, height_tolerance_m })
    }
}

/// The ground about a site, and how far drones keep above it.
#[derive(Clone, Debug)]
pub struct Ground {
    terrain: SharedTerrain,
    relief_m: f64,
    reach_m: f64,
    clearance_m: f64,
    height_tolerance_m: f64,
}

/// Reason why there is no way over the ground.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(super) enum WayError {
    /// It leaves the model.
    #[error("terrain.reach_m ends before the goal, or before the line to it")]
    Beyond,
    /// Some of the line is too high above the ground.
    #[error("the line to the goal is up to {above_m:.0} m above the ground, more than {most_m} m")]
    High {
        /// Height above the ground, in metres.
        above_m: f64,
        /// The limit.
        most_m: f64,
    },
}

/// Maximum distance of a hovering drone from its ordered height, in metres.
const HOVER_M: f64 = 0.5;

impl Ground {
    /// The height of the ground at a place, in metres above what the elevation model counts from;
    /// `None` beyond its reach.
    #[must_use]
    pub fn height(&self, place: &Vector2<f64>) -> Option<f64> {
        (place.amax() <= self.reach_m).then(|| self.terrain.height(place))?
    }

    /// Returns the tolerance between heights above the ground that drones report and its own, in
    /// metres.
    pub(super) fn height_tolerance_m(&self) -> f64 {
        self.height_tolerance_m
    }

    /// Returns the upper bound of its relief, highest minus lowest place, in metres.
    pub(super) fn relief_m(&self) -> f64 {
        self.relief_m
    }

    /// The places that a drone flies by, straight from one to the next, to come from one place to
    /// another: the goal alone where the straight line clears the ground, else straight up, over
    /// the highest ground of the line, and straight down, nowhere more than `most_m` metres above
    /// the ground. Heights are above what the elevation
    /// model counts from.
    pub(super) fn way(
        &self,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
        most_m: f64,
    ) -> Result<Vec<Vector3<f64>>, WayError> {
        let own = to.z - self.height(&to.xy()).ok_or(WayError::Beyond)?;
        let clearance = self.clearance_m.min(own);
        // Bilinear ground is highest at a sample of the model, or between two along the line: at a
        // quarter of a step the slope of an eighth is all that can be missed.
        let pieces = (4.0 * (to - from).xy().norm() / self.terrain.step_m()).ceil().max(1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a line within the reach has at most some million pieces"
        )]
        let pieces = pieces as u32;
        let mut lowest = f64::INFINITY;
        let mut highest = f64::NEG_INFINITY;
        let mut clears = true;
        let mut above_m = 0.0_f64;
        for piece in 0..=pieces {
            let place = from.lerp(to, f64::from(piece) / f64::from(pieces));
            let ground = self.height(&place.xy()).ok_or(WayError::Beyond)?;
            (lowest, highest) = (lowest.min(ground), highest.max(ground));
            above_m = above_m.max(place.z - ground);
            clears &= place.z >= ground + clearance - HOVER_M;
        }
        let level = from.z.max(to.z).max(highest + clearance);
        if !clears {
            above_m = level - lowest;
        }
        if above_m > most_m + HOVER_M {
            return Err(WayError::High { above_m, most_m });
        }
        if clears {
            return Ok(vec![*to]);
        }
        let at = |place: &Vector3<f64>| Vector3::new(place.x, place.y, level);
        let mut way = vec![at(from), at(to), *to];
        way.dedup_by(|next, before| (*next - *before).norm() < HOVER_M);
        if let Some(last) = way.last_mut() {
            *last = *to;
        }
        if way.len() > 1 && (way[0] - from).norm() < HOVER_M {
            way.remove(0);
        }
        Ok(way)
    }
}
