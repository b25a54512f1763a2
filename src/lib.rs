//! Finds radio transmitters with drones.
//!
//! A directional antenna turns; the power over one turn is a radiation pattern; the pattern gives
//! a level and a bearing, each with its uncertainty; an estimator fuses them over drones and
//! time; a planner moves the formation to where the next turn tells most.
//!
//! This crate is the front door: it re-exports the parts and adds the [`hunt`] itself, its
//! [`log`], [`replay`], [`simulation`], [`campaign`]s, recorded flights and what picks a backend
//! at run time ([`config`]).
//!
//! # One estimator, everything known at compile time
//!
//! ```
//! use foxhunt::prelude::*;
//! use foxhunt::{filters::Ukf, sensors::{LogDistance, RssBearing}};
//! use nalgebra::{Matrix2, Vector2};
//!
//! let prior = Estimate::isotropic(Vector2::new(0.0, 0.0), 10.0);
//! let model = RssBearing::new(LogDistance::new(-29.06, 2.765)?);
//! let mut estimator = Ukf::new(RandomWalk::uniform(0.02), model, prior)?;
//!
//! // 8 m to the West a drone hears −62 dBm from 30° north of East.
//! let drone = Pose::at(-8.0, 0.0, 4.0);
//! let noise = Matrix2::from_diagonal(&Vector2::new(6.0_f64.powi(2), 0.3_f64.powi(2)));
//! let heard = Observation::new(0.0, drone, Vector2::new(-62.0, 0.52), noise)?;
//! let told = estimator.update(&heard)?;
//! assert!(!told.is_rejected());
//! assert!(estimator.estimate().mean.y > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A hunt from a file
//!
//! ```
//! use foxhunt::{config::estimator_named, scenario::Scenario, simulation::simulate};
//!
//! let scenario = Scenario::find("pritzl-6.1")?;
//! let estimator = estimator_named("ekf").ok_or("no such estimator")?;
//! let hunt = simulate(&scenario, &estimator, 1, |_event| Ok::<_, std::io::Error>(()))?;
//! assert_eq!(hunt.found.len(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bearing_trial;
pub mod calibration;
pub mod campaign;
pub mod config;
#[cfg(feature = "hardware")]
pub mod fly;
pub mod hunt;
pub mod locate;
pub mod log;
#[cfg(feature = "hardware")]
pub mod network;
pub mod picture;
pub mod planners;
pub mod recorded;
pub mod recording;
pub mod replay;
pub mod report;
pub mod scenario;
pub mod simulation;
pub mod trial;

pub use foxhunt_core as core;
pub use foxhunt_filters as filters;
pub use foxhunt_formation as formation;
#[cfg(feature = "hardware")]
pub use foxhunt_hardware as hardware;
pub use foxhunt_sensors as sensors;
pub use foxhunt_sim as sim;
#[cfg(feature = "hardware")]
pub use foxhunt_wire as wire;
pub use foxhunt_wire::geodesy;

/// The traits and the types that nearly every user names.
pub mod prelude {
    #[doc(no_inline)]
    pub use foxhunt_core::{
        BeaconId, Bearing, BearingExtractor, Belief, Correction, Covariance, Decision, Estimate,
        Estimator, Fleet, FormationPlanner, MeasurementModel, MotionModel, Observation,
        PatternSource, Pose, RandomWalk, Reading, Reception, Sample, Stage, State, Station, Sweep,
        Vehicle, Waypoint,
    };

    #[doc(no_inline)]
    pub use crate::hunt::{Hunt, HuntConfig, TrackConfig, drive};
}
