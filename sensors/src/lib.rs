//! Models of a receiver's measurements, and extraction of levels and bearings from them.
//!
//! | what | here |
//! |-|-|
//! | power over range | [`Propagation`]: [`LogDistance`], [`Friis`], [`TwoRay`] |
//! | expected measurements | [`Rss`], [`BearingOnly`], [`RssBearing`], [`FreePowerRssBearing`], [`FreePathLossRssBearing`] |
//! | the same through an antenna's pattern | [`WithElevationPattern`] (`alloc`) |
//! | loss by terrain | [`knife_edge_loss_db`], [`TerrainLoss`], [`Hills`] |
//! | a model with that loss | [`OverTerrain`] |
//! | a model with any added term | [`ChangedLevel`] over a [`LevelChange`] |
//! | the difference between two receivers | [`DifferentialRss`], [`RangeDifference`] |
//! | two models at once; silence as a measurement | [`Stacked`]; [`Censored`] |
//! | errors of bearings | [`BearingMixture`] |
//! | a turn of the antenna, put in order | [`Pattern`] |
//! | from a turn to level and bearing | [`Pritzl2018`]; [`Maximum`], [`FirstHarmonic`], [`MainLobeFit`]; with a known antenna [`CrossCorrelation`], [`MaximumLikelihood`] (`alloc`) |
//! | fit of the transmitter's law | [`fit_log_distance`] |
//! | a station of fixed antennas | [`StationPattern`], [`StationModel`], [`fit_stations`] (`alloc`) |
//! | fit of the bearings' offset and of their σ | [`fit_bearing_offset`], [`fit_sigma`] |
//! | an antenna's gain over direction | [`Antenna`] (`alloc`): [`Isotropic`], [`Dipole`], [`Cardioid`], [`Patch`], [`Yagi`] |
//! | gain from a table | [`PatternTable`], [`PatternTable3d`], [`PrincipalCuts`] (`alloc`) |
//! | gain from a vendor's file | [`MsiFile`] (`alloc`) |
//! | gain with reflections | [`multipath_gain_dbi`] (`alloc`) |
//! | the pattern of recorded turns | [`learn_pattern`] (`alloc`) |
//! | an antenna on a stepper | [`StepperSource`] (`alloc`) |
//! | an antenna on a body that turns | [`BodySource`] (`alloc`) |
//! | an antenna without a direction | [`OmnidirectionalSource`] (`alloc`) |
//!
//! Conventions are those of [`foxhunt_core`]: metres, seconds, radians counter-clockwise from
//! East, dBm. Without features nothing here allocates.

#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

#[cfg(feature = "alloc")]
mod antenna;
mod calibration;
mod extractor;
mod models;
mod propagation;
#[cfg(feature = "alloc")]
mod source;
mod terrain;

#[cfg(feature = "alloc")]
pub use antenna::{
    Antenna, Cardioid, Dipole, ElevationPattern, Isotropic, LearnPatternError, LearnedPattern,
    MainLobe, MsiFile, MsiUnit, Patch, PatternFileError, PatternFileReason, PatternTable,
    PatternTable3d, PatternTableError, PrincipalCuts, ReflectedWave, Yagi, learn_pattern,
    multipath_gain_dbi,
};
#[cfg(feature = "std")]
pub use antenna::{
    AntennaConfig, AntennaError, CardioidConfig, GainRow, PatchConfig, SharedAntenna, YagiConfig,
};
pub use calibration::{
    AtSite, BearingError, BearingOffset, BearingOffsetFit, Calibrated, CalibrationError,
    Correlation, Deviation, DeviationFit, HARMONIC_PATTERN_UNKNOWNS, KnownBearing, MOST_HARMONICS,
    OffsetTerms, PathLossFit, SigmaFit, Site, fit_bearing_offset, fit_deviation, fit_log_distance,
    fit_sigma, heading_towards, unexplained_by_harmonics,
};
#[cfg(feature = "alloc")]
pub use calibration::{
    StationBurst, StationDoubt, StationFit, StationRecord, StationsFit, fit_stations,
};
pub use extractor::{Cell, Pattern, Pritzl2018, resultant_confidence};
#[cfg(feature = "alloc")]
pub use extractor::{
    CrossCorrelation, CrossCorrelationConfig, FirstHarmonic, MainLobeFit, Maximum,
    MaximumLikelihood, MaximumLikelihoodConfig, Residuals,
};
#[cfg(feature = "alloc")]
pub use extractor::{StationAntenna, StationModel, StationPattern};
pub use foxhunt_core::parameter::ParameterError;
pub use models::{
    BearingMixture, BearingOnly, Censored, ChangedLevel, DifferentialRss, FreePathLoss,
    FreePathLossRssBearing, FreePower, FreePowerRssBearing, LevelBearing, LevelChange, LevelLaw,
    MagneticDipole, OverTerrain, RangeDifference, Rss, RssBearing, Stacked,
};
#[cfg(feature = "alloc")]
pub use models::{DirectionalLevel, WithElevationPattern};
pub use propagation::{Friis, LogDistance, Polarisation, Propagation, TwoRay};
#[cfg(feature = "alloc")]
pub use source::{
    BodyConfig, BodyError, BodySource, OmnidirectionalConfig, OmnidirectionalError,
    OmnidirectionalSource, StepperConfig, StepperError, StepperSource, TurnGoal, TurnGoalConfig,
};
#[cfg(feature = "alloc")]
pub use terrain::{HeightRaster, Hill, Hills, SharedTerrain};
pub use terrain::{TerrainLoss, fresnel_parameter, knife_edge_loss_db};
