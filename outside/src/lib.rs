//! Everything of a hunt that a user may bring, brought from outside of foxhunt's workspace.

mod array;
mod estimator;
mod model;
mod planner;

use foxhunt::nalgebra::Vector3;
use foxhunt::prelude::*;
use foxhunt::registry::{
    EstimatorEntry, ExtractorEntry, Need, Needs, PlannerEntry, Registry, SourceEntry,
};

pub use array::ThreeBeams;
pub use estimator::EnsembleKalman;
pub use model::{DOPPLER, TdoaDopplerBearing};
pub use planner::TurningTriangle;

/// The scenario that flies all of it.
pub const SCENARIO: &str = include_str!("../array.toml");

/// Measurement model; its reference station stands 2 m above the origin.
const MODEL: TdoaDopplerBearing = TdoaDopplerBearing { reference: Vector3::new(0.0, 0.0, 2.0) };

/// Returns foxhunt's registry with the entries that this crate adds to it.
pub fn registry() -> Registry {
    let needs = Needs {
        level: Need::Unused,
        bearing: Need::Used,
        others: vec![Quantity::RANGE_DIFFERENCE, DOPPLER],
        moving: false,
        all_at_once: false,
    };
    let ensemble = |request: &foxhunt::registry::TrackRequest<'_>| {
        let filter = EnsembleKalman::new(MODEL, &request.search.prior, 300, request.seed)?;
        Ok(Track::new(filter, TrackConfig::default()))
    };
    Registry::builtin()
        .with_estimator(EstimatorEntry::own(
            "ensemble",
            "ensemble Kalman filter on range difference, Doppler shift and bearing",
            "Evensen 1994",
            needs,
            ensemble,
        ))
        .with_extractor(ExtractorEntry::own(
            "three-beams",
            "centre of the strongest beam and its neighbours",
            "own",
            || Box::new(ThreeBeams),
        ))
        .with_planner(PlannerEntry::own(
            "turning-triangle",
            "a triangle as wide as the belief that turns at each step",
            "own",
            |_| Box::new(TurningTriangle::default()),
        ))
        .with_source(SourceEntry::own(
            "phased-array",
            "sixteen beams, range difference and Doppler shift",
            &[Quantity::RANGE_DIFFERENCE, DOPPLER],
            |world, drone| array::source(world, drone, MODEL),
        ))
}
