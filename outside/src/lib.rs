//! Everything of a hunt that a user may bring, brought from outside of foxhunt's workspace.

mod array;
mod estimator;
mod model;
mod planner;

use foxhunt::filters::{GridConfig, GridFilter};
use foxhunt::nalgebra::Vector3;
use foxhunt::prelude::*;
use foxhunt::registry::{
    EstimatorEntry, ExtractorEntry, Need, Needs, PlannerEntry, Registry, SourceEntry, TrackRequest,
};

pub use array::ThreeBeams;
pub use estimator::EnsembleKalman;
pub use model::{DOPPLER, TdoaDopplerBearing};
pub use planner::TurningTriangle;

/// The scenario that flies all of it.
pub const SCENARIO: &str = include_str!("../array.toml");

/// Measurement model; its reference station stands 2 m above the origin.
const MODEL: TdoaDopplerBearing = TdoaDopplerBearing { reference: Vector3::new(0.0, 0.0, 2.0) };

// ANCHOR: registry
/// Returns foxhunt's registry with the entries that this crate adds to it.
pub fn registry() -> Registry {
    let needs = Needs {
        level: Need::Unused,
        bearing: Need::Used,
        others: vec![Quantity::RANGE_DIFFERENCE, DOPPLER],
        moving: false,
        all_at_once: false,
    };
    // The model under a filter of foxhunt.
    let grid = |request: &TrackRequest<'_>| {
        let walk = RandomWalk::uniform(0.02);
        let filter = GridFilter::new(walk, MODEL, request.search.prior, GridConfig::default())?;
        Ok(Track::new::<2, 3>(filter, TrackConfig::default()))
    };
    // The model under an estimator of this crate.
    let ensemble = |request: &TrackRequest<'_>| {
        let filter = EnsembleKalman::new(MODEL, &request.search.prior, 300, request.seed)?;
        Ok(Track::new(filter, TrackConfig::default()))
    };
    Registry::builtin()
        .with_estimator(EstimatorEntry::own(
            "ensemble",
            "ensemble Kalman filter on range difference, Doppler shift and bearing",
            "Evensen 1994",
            needs.clone(),
            ensemble,
        ))
        .with_estimator(EstimatorEntry::own(
            "array-grid",
            "grid on range difference, Doppler shift and bearing",
            "own",
            needs,
            grid,
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
// ANCHOR_END: registry
