//! The traits and data types of foxhunt.
//!
//! Everything here is `no_std` and allocates nothing. A crate that only needs to *implement* a
//! backend depends on this crate and on nothing else.
//!
//! | what | trait | its methods |
//! |-|-|-|
//! | how the target moves | [`MotionModel`] | `f(x, Δt)` and a factor of `Q` |
//! | what a receiver measures | [`MeasurementModel`] | `h(x; pose)`, its quantities, its likelihood |
//! | what is fed to it | [`Intake`] | a [`Reception`] to an [`Observation`] |
//! | the posterior | [`Estimator`] | `predict`, `update`, `estimate` |
//! | its place alone | [`Belief`] | moments and samples of the target's place |
//! | where the antenna looked | [`PatternSource`] | one finished [`Sweep`] at a time |
//! | where the signal came from | [`BearingExtractor`] | a sweep to a [`Reading`] |
//! | where to fly | [`FormationPlanner`] | a goal for each [`Station`] |
//! | how high the ground is | [`Terrain`] | a height for a place |
//! | who flies | [`Vehicle`], [`Spinner`] | a pose out, a goal in; turn, if it can |
//! | what a source is made of | [`Radio`], [`Rotator`], [`Clock`] | power, an angle, the time |
//!
//! # Conventions
//!
//! SI units and radians inside; a name carries its unit where that is not the SI one (`rss_dbm`).
//! The frame is local East-North-Up; angles run counter-clockwise from East. Compass degrees
//! exist only at the edges. The first two components of a state are the target's East and North.

#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;

mod above_ground;
pub mod angle;
mod axis;
mod bearing_modes;
mod belief;
mod devices;
pub mod elementary;
mod estimate;
mod estimator;
mod extractor;
mod forward;
mod intake;
#[cfg(feature = "laws")]
pub mod laws;
mod measurement;
mod motion;
pub mod noise;
mod observation;
mod outliers;
#[cfg(feature = "alloc")]
mod owned_sweep;
pub mod parameter;
mod pattern;
mod planner;
mod pose;
mod quantity;
mod reception;
#[cfg(feature = "alloc")]
mod remark;
mod terrain;
pub mod vectorised;
mod vehicle;

pub use nalgebra;

pub use above_ground::{HeightAboveGround, HeightSource};
pub use axis::Axis;
pub use bearing_modes::{BearingMode, BearingModes, BearingModesError};
pub use belief::{Belief, BeliefOf};
pub use devices::{Clock, Radio, Rotator};
pub use estimate::{Covariance, Ellipse, Estimate, State, visit_cubature_points};
pub use estimator::{Correction, Estimator, EstimatorError, Role};
pub use extractor::{Bearing, BearingExtractor, NoBearing, NoReading, Reading};
pub use intake::{ByQuantity, Intake};
pub use measurement::{
    MeasurementModel, absorb_receiver_noise, gaussian_log_likelihood, log_likelihoods_one_by_one,
    numeric_jacobian, residuals_one_by_one,
};
pub use motion::{ConstantVelocity, CoordinatedTurn, MotionModel, RandomWalk};
pub use observation::{Observation, ObservationError};
pub use outliers::OutlierMixture;
#[cfg(feature = "alloc")]
pub use owned_sweep::OwnedSweep;
pub use pattern::{PatternSource, Sample, Sweep, Unanswered};
pub use planner::{
    Decision, FormationPlanner, Outcome, PlanError, PlannerFn, Stage, Station, Target, planner_fn,
};
pub use pose::{BeaconId, Pose, Waypoint};
pub use quantity::{Measured, MeasuredError, MeasuredList, Quantity, QuantityName};
pub use reception::{Level, Reception};
#[cfg(feature = "alloc")]
pub use remark::Remark;
pub use terrain::Terrain;
pub use vehicle::{Spinner, SteadyMotion, Vehicle};
