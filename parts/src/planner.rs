use std::iter::repeat_n;

use foxhunt_core::{FormationPlanner, PlanError, parameter::ParameterError};
use foxhunt_formation::{
    Arcs, ArcsConfig, Coverage, CoverageConfig, CoverageError, Detection, DetectionConfig, Emulate,
    FollowConfig, FollowEstimate, Hold, Information, InformationConfig, Orbit, OrbitConfig,
    SteepestDescent, SteepestDescentConfig, SurgeCast, SurgeCastConfig, Waypoints,
};
use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

#[cfg(feature = "maps")]
use super::{BayesianOptimisation, BayesianOptimisationConfig};
use super::{BoxedShape, RegistryError, ShapeConfig};

/// A planner chosen at run time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum PlannerConfig {
    /// A shape that follows the estimate (Pritzl 2018, §5.2).
    FollowEstimate {
        /// Parameters of the planner; the reference's unless given.
        #[serde(default)]
        follow: FollowConfig,
        /// Shape of the formation; a polygon of `follow.circumradius_m` unless given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        shape: Option<ShapeConfig>,
    },
    /// A shape over one place after the other (Pritzl 2018, §7.3 and §7.4).
    Waypoints {
        /// East and North of each place, or East, North and Up.
        places_m: Vec<PlaceConfig>,
        /// From the polygon's centre to each of several drones; 6 m unless given.
        #[serde(default = "reference_circumradius")]
        circumradius_m: f64,
        /// Shape of the formation; a polygon of that circumradius unless given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        shape: Option<ShapeConfig>,
        /// Counter-clockwise rotation of the shape, with a polygon the direction from the centre to
        /// the first drone; 0 unless given.
        #[serde(default)]
        rotation_deg: f64,
        /// The drones' altitude at the places that name none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        up_m: Option<f64>,
        /// Number of turns at each place; 1 unless given.
        #[serde(default = "once")]
        turns_at_each: u16,
        /// Number of rounds over all places; 1 unless given.
        #[serde(default = "once")]
        rounds: u16,
    },
    /// A shape that sweeps an area in rows, back and forth (Pritzl 2018, §7.4).
    LawnMower {
        /// East and North of each corner of the area, in their order.
        corners_m: Vec<[f64; 2]>,
        /// Distances between rows and between places; as in the reference's sweep unless given.
        #[serde(default)]
        coverage: CoverageConfig,
        /// Shape of the formation; a polygon of 6 m unless given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        shape: Option<ShapeConfig>,
        /// The drones' altitude.
        up_m: f64,
        /// Number of sweeps of the area; 1 unless given.
        #[serde(default = "once")]
        rounds: u16,
    },
    /// Goals where a transmitter that was missed would be received soonest. Another planner has the
    /// goals once it is received.
    Detection {
        /// East and North of each corner of the area, in their order.
        corners_m: Vec<[f64; 2]>,
        /// Parameters of the search; the defaults unless given.
        #[serde(default)]
        detection: DetectionConfig,
        /// Planner for a transmitter that was received.
        then: Box<PlannerConfig>,
    },
    /// Goals where the next turns are expected to shrink the ellipse most.
    Information {
        /// Parameters of the planner; the defaults unless given.
        #[serde(default)]
        information: InformationConfig,
    },
    /// Each drone down the gradient of the posterior bound.
    SteepestDescent(SteepestDescentConfig),
    /// Goals where the level is expected to be highest, by a Gaussian process of levels.
    #[cfg(feature = "maps")]
    BayesianOptimisation(BayesianOptimisationConfig),
    /// Everyone stays and listens.
    Hold {
        /// For this many turns.
        turns: u32,
    },
    /// Around the estimate.
    Orbit(OrbitConfig),
    /// On a spiral towards the estimate, then around it.
    Arcs(ArcsConfig),
    /// Along the bearings while the level rises, across them when it falls.
    SurgeCast(SurgeCastConfig),
    /// Few drones fly the places of many, one after the other (Pritzl 2018, §7.2).
    Emulated {
        /// Number of drones that the planner plans for.
        virtual_drones: u16,
        /// Planner for the virtual drones.
        planner: Box<PlannerConfig>,
    },
    /// One that a registry knows by a name.
    Registered {
        /// The name.
        name: String,
    },
}

/// A place of a path: East and North in metres, or East, North and Up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "a place is [East, North] or [East, North, Up] in metres")]
pub enum PlaceConfig {
    /// A place at the altitude of its path.
    Plane([f64; 2]),
    /// A place with an altitude of its own.
    Space([f64; 3]),
}

impl PlaceConfig {
    fn plane_m(&self) -> Vector2<f64> {
        let (Self::Plane([east, north]) | Self::Space([east, north, _])) = *self;
        Vector2::new(east, north)
    }

    fn up_m(&self) -> Option<f64> {
        match self {
            Self::Plane(_) => None,
            Self::Space([_, _, up]) => Some(*up),
        }
    }
}

/// The default of `turns_at_each` and `rounds`.
const fn once() -> u16 {
    1
}

/// The reference's circumradius in metres (Pritzl 2018, §5.2).
const fn reference_circumradius() -> f64 {
    FollowConfig::pritzl2018().circumradius_m
}

impl PlannerConfig {
    /// Returns true if its places are known before anything is received.
    #[must_use]
    pub fn is_known_beforehand(&self) -> bool {
        match self {
            Self::Waypoints { .. } | Self::LawnMower { .. } | Self::Hold { .. } => true,
            Self::Emulated { planner, .. } => planner.is_known_beforehand(),
            _ => false,
        }
    }

    /// Builds the planner.
    ///
    /// # Errors
    ///
    /// [`PlannerConfigError`] names what is out of its range.
    pub fn build(&self) -> Result<Box<dyn FormationPlanner>, PlannerConfigError> {
        Ok(match self {
            Self::FollowEstimate { follow, shape } => {
                let planner = FollowEstimate::new(*follow)?;
                match shape {
                    Some(shape) => {
                        not_beside_shape("follow.circumradius_m", follow.circumradius_m)?;
                        Box::new(planner.with_shape(shape.build()?))
                    }
                    None => Box::new(planner),
                }
            }
            Self::Waypoints {
                places_m,
                circumradius_m,
                shape,
                rotation_deg,
                up_m,
                turns_at_each,
                rounds,
            } => {
                let each = usize::from(*turns_at_each);
                let path = "places_m, turns_at_each and rounds in all";
                bounded(path, [places_m.len(), each, usize::from(*rounds)])?;
                if up_m.is_some() && places_m.iter().all(|place| place.up_m().is_some()) {
                    return Err(PlannerConfigError::AltitudeNotUsed);
                }
                let centre = |(index, place): (usize, &PlaceConfig)| {
                    let up_m = place.up_m().or(*up_m);
                    let up_m = up_m.ok_or(PlannerConfigError::NoAltitude { place: index + 1 });
                    up_m.map(|up_m| place.plane_m().push(up_m))
                };
                let centres: Vec<Vector3<f64>> =
                    places_m.iter().enumerate().map(centre).collect::<Result<_, _>>()?;
                let round = centres.iter().flat_map(|centre| repeat_n(*centre, each));
                let places: Vec<_> = repeat_n(round, usize::from(*rounds)).flatten().collect();
                if shape.is_some() {
                    not_beside_shape("circumradius_m", *circumradius_m)?;
                }
                let shape = shape_or_polygon(shape.as_ref(), *circumradius_m)?;
                Box::new(Waypoints::new(places, shape, rotation_deg.to_radians())?)
            }
            Self::LawnMower { corners_m, coverage, shape, up_m, rounds } => {
                let corners: Vec<_> = corners_m.iter().map(|p| Vector2::from(*p)).collect();
                let sweep = Coverage::new(&corners, coverage)?;
                let rounds = usize::from(*rounds);
                bounded(
                    "the places of the sweep and rounds in all",
                    [sweep.places().len(), rounds, 1],
                )?;
                let round = sweep.places().iter().map(|place| place.push(*up_m));
                let places: Vec<_> = repeat_n(round, rounds).flatten().collect();
                let shape = shape_or_polygon(shape.as_ref(), reference_circumradius())?;
                Box::new(Waypoints::new(places, shape, 0.0)?)
            }
            Self::Detection { corners_m, detection, then } => {
                let corners: Vec<_> = corners_m.iter().map(|p| Vector2::from(*p)).collect();
                if let Self::Information { information } = &**then
                    && (information.prior_sigma_m != 0.0 || information.prior_centre_m.is_some())
                {
                    return Err(PlannerConfigError::PriorNotUsed);
                }
                Box::new(Detection::new(&corners, *detection, then.build()?)?)
            }
            Self::Information { information } => Box::new(Information::new(*information)?),
            Self::SteepestDescent(config) => Box::new(SteepestDescent::new(*config)?),
            #[cfg(feature = "maps")]
            Self::BayesianOptimisation(config) => Box::new(BayesianOptimisation::new(*config)?),
            Self::Hold { turns } => Box::new(Hold::new(*turns)),
            Self::Orbit(config) => Box::new(Orbit::new(*config)?),
            Self::Arcs(config) => Box::new(Arcs::new(*config)?),
            Self::SurgeCast(config) => Box::new(SurgeCast::new(*config)?),
            Self::Emulated { virtual_drones, planner } => {
                Box::new(Emulate::new(planner.build()?, usize::from(*virtual_drones))?)
            }
            Self::Registered { name } => {
                return Err(PlannerConfigError::NoRegistry { name: name.clone() });
            }
        })
    }
}

/// A path holds this many places at most.
const MOST_PLACES: usize = 10_000;

/// Refuses a path of too many places before it is made.
fn bounded(field: &'static str, counts: [usize; 3]) -> Result<(), ParameterError> {
    let places = counts.into_iter().fold(1, usize::saturating_mul);
    if places <= MOST_PLACES {
        return Ok(());
    }
    let value = u32::try_from(places).map_or(f64::INFINITY, f64::from);
    Err(ParameterError { name: field, value, requirement: "at most 10000 places" })
}

/// Refuses a circumradius that stands beside a shape, but for the one of files that give none.
fn not_beside_shape(name: &'static str, given: f64) -> Result<(), PlannerConfigError> {
    let is_usual = [reference_circumradius()].contains(&given);
    if is_usual { Ok(()) } else { Err(PlannerConfigError::CircumradiusNotUsed { name }) }
}

fn shape_or_polygon(
    shape: Option<&ShapeConfig>,
    circumradius_m: f64,
) -> Result<BoxedShape, ParameterError> {
    shape.unwrap_or(&ShapeConfig::Polygon { circumradius_m }).build()
}

/// Reason why there is no planner.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlannerConfigError {
    /// A field is out of its range.
    #[error("planner: {0}")]
    Parameter(#[from] ParameterError),
    /// A place has no altitude, and neither has the path.
    #[error("planner.up_m is missing, and place {place} of planner.places_m has no Up of its own")]
    NoAltitude {
        /// The number of the place, from 1.
        place: usize,
    },
    /// Each place has an altitude of its own.
    #[error("planner.up_m is not used: each place of planner.places_m has an Up of its own")]
    AltitudeNotUsed,
    /// A polygon's size stands beside another shape.
    #[error("planner.{name} is not used: planner.shape is the shape of the formation")]
    CircumradiusNotUsed {
        /// The key.
        name: &'static str,
    },
    /// A planner that begins after the first reception has a belief of before it.
    #[error(
        "planner.then.information: prior_sigma_m and prior_centre_m are not used: this planner \
         begins once a transmitter was received"
    )]
    PriorNotUsed,
    /// The waypoints make no path.
    #[error("planner.places_m: {0}")]
    Path(#[from] PlanError),
    /// The area cannot be swept.
    #[error("planner.corners_m: {0}")]
    Area(#[source] CoverageError),
    /// The planner's name is not known.
    #[error("planner.name: {0}")]
    Name(#[from] RegistryError),
    /// It is known by name alone, and no registry is at hand.
    #[error("planner.name is {name:?}, which only a registry can build")]
    NoRegistry {
        /// The name.
        name: String,
    },
}

impl From<CoverageError> for PlannerConfigError {
    fn from(error: CoverageError) -> Self {
        match error {
            CoverageError::Parameter(error) => Self::Parameter(error),
            error => Self::Area(error),
        }
    }
}
