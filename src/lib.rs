//! Finds radio transmitters with drones.
//!
//! A directional antenna turns; the power over one turn is a radiation pattern; the pattern gives
//! a level and a bearing, each with its uncertainty; an estimator fuses them over drones and
//! time; a planner moves the formation to where the next turn is expected to shrink the ellipse
//! most.
//!
//! This crate re-exports the parts, each behind a feature:
//!
//! | feature | modules |
//! |-|-|
//! | always | [`core`], [`filters`], [`sensors`], [`formation`] |
//! | `hunt` | [`hunt`], [`registry`], [`config`], [`scenario`], [`log`], [`locate`], [`calibration`], [`sim`] |
//! | `lab` | [`simulation`], [`campaign`], [`trial`], [`bearing_trial`], [`report`], [`soak`], [`drawn`] |
//! | `store` | [`store`]: campaigns in a file; with `parquet` also as Parquet |
//! | `archive` | [`recording`], [`recorded`], [`relocation`], [`replay`], [`overview`], [`page`], [`export`], [`movebank`], [`geodesy`]; with `pictures` also `picture` |
//! | `signal` | `signal` |
//! | `hardware` | `fly`, `network`, `hardware`, `wire` |
//! | `batch`, `maps` | estimators over all observations at once, in `filters` and by name |
//! | `dual` | `Differentiated` in [`core`]: models written once, with exact Jacobians |
//! | `parallel` | `ParticleFilter::with_threads` in `filters` |
//! | `large-states` | faer for joint states of 32 components and more, in `filters` |
//!
//! # One estimator, everything known at compile time
//!
//! ```
//! use foxhunt::nalgebra::{Matrix2, Vector2};
//! use foxhunt::prelude::*;
//! use foxhunt::{filters::Ukf, sensors::{LogDistance, RssBearing}};
//!
//! let prior = Estimate::isotropic(Vector2::new(0.0, 0.0), 10.0);
//! let model = RssBearing::new(LogDistance::new(-29.06, 2.765)?);
//! let mut estimator = Ukf::new(RandomWalk::uniform(0.02), model, prior)?;
//!
//! // 8 m to the West a drone receives −62 dBm from 30° north of East.
//! let drone = Pose::at(-8.0, 0.0, 4.0);
//! let noise = Matrix2::from_diagonal(&Vector2::new(6.0_f64.powi(2), 0.3_f64.powi(2)));
//! let observation = Observation::new(0.0, drone, Vector2::new(-62.0, 0.52), noise)?;
//! let correction = estimator.update(&observation)?;
//! assert!(!correction.is_rejected());
//! assert!(estimator.estimate().mean.y > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![cfg_attr(
    feature = "lab",
    doc = r#"
# A hunt from a file

```
use foxhunt::{registry::Registry, scenario::Scenario, simulation::Setup};

let registry = Registry::builtin();
let scenario = Scenario::find("pritzl-6.1")?;
let estimator = registry.estimator("ekf")?;
let setup = Setup { scenario: &scenario, estimator, registry: &registry };
let hunt = setup.simulate(1, |_event| Ok::<_, std::io::Error>(()))?;
assert_eq!(hunt.found.len(), 2);
# Ok::<(), Box<dyn std::error::Error>>(())
```
"#
)]

pub use foxhunt_core as core;
pub use foxhunt_core::nalgebra;
pub use foxhunt_filters as filters;
pub use foxhunt_formation as formation;
pub use foxhunt_sensors as sensors;

#[cfg(feature = "hunt")]
pub use foxhunt_hunt::{calibration, config, document, hunt, locate, log, registry, scenario};
#[cfg(feature = "hunt")]
pub use foxhunt_sim as sim;

#[cfg(feature = "lab")]
pub use foxhunt_drawn as drawn;
#[cfg(feature = "lab")]
pub use foxhunt_lab::{
    Experiment, FirstPassage, Paired, PairedDifference, Runner, Spread, StepSpread, ThreadsError,
    bearing_trial, campaign, report, simulation, soak, trial,
};

#[cfg(feature = "store")]
pub use foxhunt_lab::store;

#[cfg(feature = "archive")]
pub use foxhunt_archive::{bag, movebank, recorded, recording, replay, struck};
#[cfg(feature = "pictures")]
pub use foxhunt_show::picture;
#[cfg(feature = "archive")]
pub use foxhunt_show::{export, overview, page, raster, relocation};
#[cfg(feature = "archive")]
pub use foxhunt_wire::geodesy;

#[cfg(feature = "hardware")]
pub use foxhunt_field::{fly, network};
#[cfg(feature = "hardware")]
pub use foxhunt_hardware as hardware;
#[cfg(feature = "hardware")]
pub use foxhunt_wire as wire;

#[cfg(feature = "signal")]
pub use foxhunt_signal as signal;

/// The traits and the types that nearly every user names.
pub mod prelude {
    #[doc(no_inline)]
    pub use foxhunt_core::{
        BeaconId, Bearing, BearingExtractor, Belief, ByQuantity, Correction, Covariance, Decision,
        Estimate, Estimator, EstimatorError, FormationPlanner, Intake, Level, Measured,
        MeasuredList, MeasurementModel, MotionModel, Observation, Outcome, PatternSource,
        PlanError, Pose, Quantity, RandomWalk, Reading, Reception, Receptions, Sample, Stage,
        State, Station, Sweep, Vehicle, Waypoint,
    };

    #[cfg(feature = "hunt")]
    #[doc(no_inline)]
    pub use foxhunt_hunt::{
        hunt::{Drone, Event, Hunt, HuntConfig, Parts, Search, Track, TrackConfig, drive},
        registry::{EstimatorEntry, Registry},
        scenario::Scenario,
    };

    #[cfg(feature = "lab")]
    #[doc(no_inline)]
    pub use foxhunt_lab::{Experiment, Runner, simulation::Setup};
}

/// The README's examples, which are tested as the documentation's are.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
