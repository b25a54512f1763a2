use std::iter::repeat_n;

use foxhunt_core::{FormationPlanner, PlanError};
use foxhunt_formation::{
    FollowConfig, FollowConfigError, FollowEstimate, Hold, Information, InformationConfig,
    InformationConfigError, Polygon, Waypoints,
};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// A planner chosen at run time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum PlannerConfig {
    /// A polygon that follows the estimate (Pritzl 2018, §5.2).
    FollowEstimate {
        /// Its parameters; the reference's unless given.
        #[serde(default)]
        follow: FollowConfig,
    },
    /// A polygon over one place after the other (Pritzl 2018, §7.3 and §7.4).
    Waypoints {
        /// East and North of each place.
        places_m: Vec<[f64; 2]>,
        /// From the polygon's centre to each of several drones.
        circumradius_m: f64,
        /// The direction of the first drone seen from the centre, counter-clockwise from East; 0
        /// unless given.
        #[serde(default)]
        rotation_deg: f64,
        /// The drones' altitude.
        up_m: f64,
        /// How many turns each place is worth; 1 unless given.
        #[serde(default = "once")]
        turns_at_each: u16,
        /// How often all places are flown to; 1 unless given.
        #[serde(default = "once")]
        rounds: u16,
    },
    /// Where the next turns tell most.
    Information {
        /// Its parameters; the defaults unless given.
        #[serde(default)]
        information: InformationConfig,
    },
    /// Everyone stays and listens.
    Hold {
        /// For this many turns.
        turns: u32,
    },
}

/// The default of `turns_at_each` and `rounds`.
const fn once() -> u16 {
    1
}

impl PlannerConfig {
    /// Builds the planner.
    ///
    /// # Errors
    ///
    /// [`PlannerConfigError`] names what is out of its range.
    pub fn build(&self) -> Result<Box<dyn FormationPlanner>, PlannerConfigError> {
        Ok(match self {
            Self::FollowEstimate { follow } => Box::new(FollowEstimate::new(*follow)?),
            Self::Waypoints {
                places_m,
                circumradius_m,
                rotation_deg,
                up_m,
                turns_at_each,
                rounds,
            } => {
                let each = usize::from(*turns_at_each);
                let round = places_m.iter().flat_map(|p| repeat_n(Vector2::from(*p), each));
                let places: Vec<_> = repeat_n(round, usize::from(*rounds)).flatten().collect();
                let polygon = Polygon { circumradius: *circumradius_m };
                Box::new(Waypoints::new(places, polygon, rotation_deg.to_radians(), *up_m)?)
            }
            Self::Information { information } => Box::new(Information::new(*information)?),
            Self::Hold { turns } => Box::new(Hold::new(*turns)),
        })
    }
}

/// Why there is no planner.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlannerConfigError {
    /// A field of the polygon that follows is out of its range.
    #[error(transparent)]
    Follow(#[from] FollowConfigError),
    /// A field of the information-driven planner is out of its range.
    #[error("planner.information.{0}")]
    Information(#[from] InformationConfigError),
    /// The waypoints make no path.
    #[error("planner.places_m: {0}")]
    Path(#[from] PlanError),
}
