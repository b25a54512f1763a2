//! Estimators of what receptions hold besides level and bearing, and of several of it at once.

use std::sync::Arc;

use foxhunt_core::{
    EstimatorError, Intake, MeasurementModel, Observation, ObservationError, Pose, Quantity,
    RandomWalk, Reception,
};
use foxhunt_filters::{DirectionalGrid, MomentGrid};
use foxhunt_sensors::{BearingOnly, DifferentialRss, MagneticDipole, RangeDifference, Stacked};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::{EstimatorEntry, Need, Needs, TrackRequest};
use crate::{
    config::{FilterConfig, FilterOf, GateConfig},
    hunt::{Track, TrackConfig},
};

/// The random walk of a still beacon, m/√s: a few decimetres over a hunt, so that nothing
/// freezes.
pub(super) const STILL: f64 = 0.02;

/// Enough for what follows to change an iterated update by less than the filter's own tolerance;
/// most end after 3 to 6.
pub(super) const ITERATIONS: u32 = 10;

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
        EstimatorEntry::own(
            "pulses",
            "each pulse of a tag along its boresight, misses and false pulses included: the place on \
             a grid, the power and what each site does to the pattern integrated out",
            "Bucy & Senne 1971; Tobin 1958; Bar-Shalom & Tse 1975",
            Needs { level: Need::Required, ..needs(Need::Unused, &[Quantity::BORESIGHT]) },
            pulses,
        ),
    ]
}

/// The estimator of pulses.
fn pulses(request: &TrackRequest<'_>) -> Result<Track, EstimatorError> {
    let model = request.pulses.cloned().ok_or(EstimatorError::Unsupported {
        what: "an estimator of single pulses without the receiver's antenna (model.antenna, \
               --receiver-antenna)",
    })?;
    let sigma_db = model.sigma_db();
    let levels = {
        let model = model.clone();
        move |place: &Vector2<f64>, pose: &Pose, boresight, turns: &[f64], out: &mut [f64]| {
            model.levels_dbm(place, pose, boresight, turns, out);
        }
    };
    let grid = DirectionalGrid::new(request.search.prior, model.grid_config(), levels)?;
    Track::with_intake::<2, 2>(grid, PulseIntake { sigma_db }, TrackConfig::default())
}

/// A level, or a silence, and where the antenna looked; with σ of its own.
struct PulseIntake {
    sigma_db: f64,
}

impl Intake<2> for PulseIntake {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BORESIGHT]
    }

    fn observation(
        &self,
        reception: &Reception,
    ) -> Result<Option<Observation<2>>, ObservationError> {
        let Some(boresight) = reception.measured.get(Quantity::BORESIGHT) else { return Ok(None) };
        let Some(level) = reception.level.or(reception.silence) else { return Ok(None) };
        let value = Vector2::new(level.rss_dbm, boresight.value);
        let sigmas = Vector2::new(self.sigma_db, boresight.sigma);
        let noise = Matrix2::from_diagonal(&sigmas.component_mul(&sigmas));
        let observation = Observation::new(reception.time, reception.receiver, value, noise)?;
        Ok(Some(if reception.level.is_some() { observation } else { observation.below(0) }))
    }
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
    if request.model.loss().is_some() {
        return Err(EstimatorError::Unsupported {
            what: "an estimator of level differences over terrain (model.terrain)",
        });
    }
    let exponent = request.model.model().model().propagation().exponent();
    let model = DifferentialRss::new(reference(request)?, exponent)?;
    Ok(model.with_target_up(target_up(request))?)
}

fn target_up(request: &TrackRequest<'_>) -> f64 {
    request.model.model().model().target_up()
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
) -> Result<Track, EstimatorError>
where
    FilterConfig: FilterOf<2, M>,
{
    let filter = FilterConfig::Cubature {
        gate: GateConfig::Probability(0.999),
        outliers: None,
        iterations: ITERATIONS,
    };
    let walk = Arc::new(RandomWalk::uniform(STILL));
    let seed = request.seed;
    let filter = filter.build(walk, Arc::new(model), &request.search.prior, seed)?;
    Ok(Track::new::<2, M>(filter, TrackConfig::default()))
}
