use foxhunt_core::{EstimatorError, Quantity, parameter::ParameterError};
use foxhunt_estimators::TrackError;
#[cfg(feature = "batch")]
use foxhunt_filters::BatchError;
use foxhunt_filters::ShadowingGridError;
use foxhunt_parts::RegistryError;
use foxhunt_sim::ReliefError;

/// Error in locating a transmitter.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LocateError {
    /// Nothing was received.
    #[error("none of {receptions} receptions holds a level, a bearing or anything else")]
    Nothing {
        /// Number of receptions.
        receptions: usize,
    },
    /// The estimator with a name cannot use the receptions.
    #[error("the estimator {estimator}: {source}")]
    Named {
        /// Name of the estimator.
        estimator: String,
        /// Cause of the error.
        source: Box<LocateError>,
    },
    /// The estimator works on levels alone, and no reception holds one.
    #[error("it needs received levels, and there are none")]
    NoLevels,
    /// The estimator works on bearings alone, and no reception holds one.
    #[error("it needs bearings, and there are none")]
    NoBearings,
    /// There are more bearings than can be sorted by transmitter.
    #[error("{bearings} bearings cannot be sorted by transmitter; at most {most} can")]
    TooManyBearings {
        /// Number of bearings.
        bearings: usize,
        /// Largest number of bearings.
        most: usize,
    },
    /// The estimator works on a quantity that no reception holds.
    #[error("it needs {quantity}, and no reception holds it")]
    NoQuantity {
        /// The missing quantity.
        quantity: Quantity,
    },
    /// All receptions were made in one place, which leaves the transmitter's place open.
    #[error(
        "all {what} were received at ({east}, {north}) m: from one place they leave open where the \
         transmitter is"
    )]
    OnePlace {
        /// Name of what was received, in the plural.
        what: &'static str,
        /// The place's East in metres.
        east: f64,
        /// The place's North in metres.
        north: f64,
    },
    /// The estimator is for several receivers or several transmitters of a hunt.
    #[error("it is for hunts; for bearings of several transmitters there is --unknown-number")]
    OfHunts,
    /// The estimator needs a known power.
    #[error("it needs the transmitter's power and the exponent (--p0-dbm, --exponent)")]
    NoPower,
    /// The estimator needs the place of the reference receiver.
    #[error("it needs the place of the reference receiver (--reference-m)")]
    NoReference,
    /// The receiver's antenna cannot be built.
    #[error("the receiver's antenna: {reason}")]
    Antenna {
        /// Text of the antenna's error.
        reason: String,
    },
    /// The terrain cannot be had.
    #[error("the terrain: {0}")]
    Terrain(#[from] ReliefError),
    /// The estimator takes the ground for level.
    #[error(
        "the estimator {estimator} takes the ground for level, and a terrain is given (--terrain); \
         particle, gaussian-sum, grid and others of levels in the order of time know one"
    )]
    NoUseOfTerrain {
        /// Name of the estimator.
        estimator: String,
    },
    /// The estimator does not follow the antennas that are named.
    #[error(
        "the estimator {estimator} does not use the antennas' patterns (--receiver-antenna, \
         --transmitter-antenna)"
    )]
    NoUseOfAntennas {
        /// Name of the estimator.
        estimator: String,
    },
    /// The estimator takes the transmitter's height for known.
    #[error(
        "the estimator {estimator} does not estimate the transmitter's height \
         (--target-up-m free); shadowing-grid does"
    )]
    NoFreeHeight {
        /// Name of the estimator.
        estimator: String,
    },
    /// The bearings are too few, or do not meet.
    #[cfg(feature = "batch")]
    #[error(
        "no place was found where the bearings meet ({0}); batch-multistart and particle stay in \
         the searched area and may find one"
    )]
    Bearings(#[source] BatchError),
    /// The receptions have no most probable place, or it was not found.
    #[cfg(feature = "batch")]
    #[error("no place was found: {0}")]
    Batch(#[from] BatchError),
    /// The receptions do not make a track.
    #[cfg(feature = "batch")]
    #[error("no track was found: {0}")]
    Track(#[source] BatchError),
    /// The grid cannot use the levels.
    #[error(transparent)]
    Grid(#[from] ShadowingGridError),
    /// A parameter is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The estimator cannot be made.
    #[error("the estimator cannot start: {0}")]
    Start(EstimatorError),
    /// The estimator has no such setting.
    #[error(transparent)]
    Setting(#[from] RegistryError),
    /// No reception was used: none holds what the estimator measures, or its gate kept all out.
    #[error(
        "the estimator {estimator} used none of {receptions} receptions; it measures {}",
        quantities.iter().map(|quantity| quantity.name()).collect::<Vec<_>>().join(", ")
    )]
    NotUsed {
        /// Name of the estimator.
        estimator: String,
        /// Number of receptions.
        receptions: usize,
        /// Quantities that the estimator measures.
        quantities: Vec<Quantity>,
    },
    /// The estimator cannot use a reception.
    #[error("reception {index} (at {time} s) cannot be used: {source}")]
    Reception {
        /// Index of the reception, from 0.
        index: usize,
        /// Time of the reception, in seconds.
        time: f64,
        /// Cause of the error.
        source: TrackError,
    },
}
