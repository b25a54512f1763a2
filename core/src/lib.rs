//! The traits and data types of foxhunt.
//!
//! Everything here is `no_std`. Only states whose size is known at run time (`DynamicEstimate` and
//! the models of them) need an allocator, and the feature `alloc`. A crate that only needs to
//! *implement* a backend depends on this crate and on nothing else.
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
#[cfg(feature = "dual")]
extern crate std;

pub mod angle;
mod bearing;
pub mod columns;
#[cfg(feature = "dual")]
mod dual;
#[cfg(feature = "alloc")]
mod dynamic;
pub mod elementary;
mod estimate;
mod estimator;
mod forward;
#[cfg(feature = "laws")]
pub mod laws;
mod measurement;
mod motion;
pub mod noise;
mod observation;
pub mod parameter;
mod planner;
mod quantity;
mod reception;
#[cfg(feature = "alloc")]
mod receptions;
#[cfg(feature = "alloc")]
mod remark;
mod source;
pub mod vectorised;
mod vehicle;

pub use nalgebra;

pub use bearing::{
    Bearing, BearingExtractor, BearingMode, BearingModes, BearingModesError, NoBearing, NoReading,
    Reading,
};
#[cfg(feature = "dual")]
pub use dual::{Differentiated, DualMeasurement, DualMotion, Number, num_dual};
#[cfg(feature = "alloc")]
pub use dynamic::{
    AtSize, DynamicEstimate, DynamicMeasurement, DynamicMotion, DynamicObservation, Fixed, On,
};
pub use estimate::{Covariance, Ellipse, Estimate, State, visit_cubature_points};
pub use estimator::{Belief, BeliefOf, Correction, Estimator, EstimatorError, Role, Smooth};
pub use measurement::{
    MeasurementModel, OutlierMixture, absorb_receiver_noise, gaussian_log_likelihood,
    log_likelihoods_one_by_one, numeric_jacobian, residuals_one_by_one,
};
pub use motion::{ConstantVelocity, CoordinatedTurn, MotionModel, RandomWalk};
pub use observation::{Observation, ObservationError};
pub use planner::{
    Decision, FormationPlanner, Outcome, PlanError, PlannerFn, Stage, Station, Target, planner_fn,
};
pub use quantity::{Axis, Measured, MeasuredError, MeasuredList, Quantity, QuantityName};
pub use reception::{ByQuantity, Intake, Level, Reception};
#[cfg(feature = "alloc")]
pub use receptions::{ReceptionView, Receptions};
#[cfg(feature = "alloc")]
pub use remark::Remark;
#[cfg(feature = "alloc")]
pub use source::OwnedSweep;
pub use source::{Clock, PatternSource, Radio, Rotator, Sample, Sweep, Unanswered};
pub use vehicle::{
    BeaconId, HeightAboveGround, HeightSource, Pose, Spinner, SteadyMotion, Terrain, Vehicle,
    Waypoint,
};
