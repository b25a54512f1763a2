//! Estimators of what receptions hold besides level and bearing, and of several of it at once.

use std::sync::Arc;

use foxhunt_core::{EstimatorError, MeasurementModel, Pose, Quantity, RandomWalk};
use foxhunt_filters::{Ckf, Gate, Iterations, MomentGrid};
use foxhunt_sensors::{BearingOnly, DifferentialRss, MagneticDipole, RangeDifference, Stacked};
use nalgebra::{Vector2, Vector3};

use super::{EstimatorEntry, Need, Needs, TrackRequest, estimators::STILL};
use crate::{
    config::AnyModel,
    hunt::{Track, TrackConfig},
};

/// The entries.
pub(super) fn builtin() -> Vec<EstimatorEntry> {
    vec![
        EstimatorEntry::own(
            "range-difference",
            "iterated posterior linearisation over range differences to a reference receiver",
            "Smith & Abel 1987; García-Fernández, Svensson, Morelande & Särkkä 2015",
            needs(Need::Unused, &[Quantity::RANGE_DIFFERENCE]),
            |request| {
                let model = RangeDifference::new(reference(request)?)?;
                track(request, model.with_target_up(target_up(request))?)
            },
        ),
        EstimatorEntry::own(
            "level-difference",
            "iterated posterior linearisation over level differences to a reference receiver",
            "the above; Gustafsson & Gunnarsson 2005",
            needs(Need::Unused, &[Quantity::RSS_DIFFERENCE]),
            |request| track(request, level_difference(request)?),
        ),
        EstimatorEntry::own(
            "level-difference-bearing",
            "level differences to a reference receiver stacked with bearings: the power is not \
             used",
            "the above",
            needs(Need::Used, &[Quantity::RSS_DIFFERENCE]),
            |request| {
                let stacked =
                    Stacked::<_, _, 1, 1>::new(level_difference(request)?, BearingOnly::new());
                track::<2>(request, stacked)
            },
        ),
        EstimatorEntry::own(
            "range-difference-bearing",
            "range differences to a reference receiver stacked with bearings",
            "the above",
            needs(Need::Used, &[Quantity::RANGE_DIFFERENCE]),
            |request| {
                let model = RangeDifference::new(reference(request)?)?;
                let model = model.with_target_up(target_up(request))?;
                track::<2>(request, Stacked::<_, _, 1, 1>::new(model, BearingOnly::new()))
            },
        ),
        EstimatorEntry::own(
            "magnetic-dipole",
            "the magnetic field near a coil, its moment unknown: the place on a grid, the moment \
             integrated out",
            "Jackson 1999; EN 300 718-1",
            needs(Need::Unused, &MagneticDipole::QUANTITIES),
            |request| {
                let model = MagneticDipole::new().with_target_up(target_up(request))?;
                let filter = MomentGrid::new(
                    request.search.prior,
                    MOMENT_SIGMA_MA_M2,
                    MagneticDipole::QUANTITIES,
                    move |place: &Vector2<f64>, receiver: &Pose| {
                        model.field_per_moment(place, receiver)
                    },
                )?;
                Ok(Track::new::<2, 3>(filter, TrackConfig::default()))
            },
        ),
    ]
}

/// σ of each component of an avalanche beacon's moment: EN 300 718-1 demands 0.5 µA/m abeam 10 m
/// off, 6.3 mA m², and allows some four times that.
const MOMENT_SIGMA_MA_M2: f64 = 10.0;

fn needs(bearing: Need, others: &[Quantity]) -> Needs {
    Needs {
        level: Need::Unused,
        bearing,
        others: others.to_vec(),
        moving: false,
        all_at_once: false,
    }
}

fn level_difference(request: &TrackRequest<'_>) -> Result<DifferentialRss, EstimatorError> {
    let exponent = request.model.model().propagation().exponent();
    let model = DifferentialRss::new(reference(request)?, exponent)?;
    Ok(model.with_target_up(target_up(request))?)
}

fn target_up(request: &TrackRequest<'_>) -> f64 {
    request.model.model().target_up()
}

fn reference(request: &TrackRequest<'_>) -> Result<Vector3<f64>, EstimatorError> {
    request.reference.ok_or(EstimatorError::Unsupported {
        what: "an estimator of differences without the reference receiver's place \
               (model.reference_m, --reference-m)",
    })
}

fn track<const M: usize>(
    request: &TrackRequest<'_>,
    model: impl MeasurementModel<2, M> + 'static,
) -> Result<Track, EstimatorError> {
    // Built here, not by `FilterConfig`, which would compile every filter for every M.
    let model: AnyModel<2, M> = Arc::new(model);
    let filter = Ckf::new(RandomWalk::uniform(STILL), model, request.search.prior)?
        .with_gate(Gate::probability(0.999)?)
        .with_iterations(Iterations::at_most(10)?);
    Ok(Track::new::<2, M>(filter, TrackConfig::default()))
}
