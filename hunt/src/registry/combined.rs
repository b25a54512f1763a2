//! Estimators of what receptions hold besides level and bearing, and of several of it at once.

use foxhunt_core::{
    ConstantVelocity, Estimate, Estimator, EstimatorError, Intake, Observation, ObservationError,
    Pose, Quantity, Reception, Role,
};
use foxhunt_estimators::{
    AnyModel, FilterConfig, FilterOf, IntoDyn, ParticleConfig, Prior, RecalledGrid, dipole_grid,
};
use foxhunt_filters::DirectionalGrid;
use foxhunt_sensors::{
    BearingMixture, BearingOnly, DifferentialRss, MagneticDipole, RangeDifference, Stacked,
};
use nalgebra::{Matrix1, Matrix2, Vector1, Vector2, Vector3, Vector4};
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::{EstimatorEntry, Need, Needs, TrackRequest};
use crate::hunt::{Track, TrackConfig, WithoutBearing};

/// The entries.
pub(super) fn builtin() -> Vec<EstimatorEntry> {
    vec![
        EstimatorEntry::own(
            "range-difference",
            "range differences to a reference receiver, all of them weighed on a grid after each",
            "Bucy & Senne 1971; Smith & Abel 1987",
            needs(Need::Unused, &[Quantity::RANGE_DIFFERENCE]),
            |request| {
                let model = RangeDifference::new(reference(request)?)?;
                track(request, model.with_target_up(target_up(request))?)
            },
        ),
        EstimatorEntry::own(
            "level-difference",
            "level differences to a reference receiver, all of them weighed on a grid after each",
            "Bucy & Senne 1971; Gustafsson & Gunnarsson 2005",
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
                let filter = dipole_grid(model, request.search.prior)?;
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
        EstimatorEntry::own(
            "particle-isaacs2014",
            "the particle filter of the document: uniform over the room, multinomial resampling at \
             every step, bearings that err as its mixture",
            "Isaacs et al. 2014, §IV and eq. 28 to 30",
            Needs { moving: true, ..needs(Need::Required, &[]) },
            isaacs2014,
        ),
    ]
}

/// Particles of the document, which does not print their number.
const ISAACS_PARTICLES: usize = 2000;

/// The filter of Isaacs et al. 2014, §IV, over a room of the prior's moments.
///
/// The document prints neither the intensity of the target's acceleration nor its speed: both are
/// as in `particle-bearing-moving`.
fn isaacs2014(request: &TrackRequest<'_>) -> Result<Track, EstimatorError> {
    let motion = ConstantVelocity { spectral_density: SPECTRAL_DENSITY }.into_dyn();
    let model = BearingOnly::isaacs2014().into_dyn();
    let filter = FilterConfig::Particle(ParticleConfig {
        every_step: true,
        ..ParticleConfig::of(ISAACS_PARTICLES)
    });
    let room = Room::new(&request.search.prior)?;
    let filter = filter.build(motion, model, &room, request.seed)?;
    let config = TrackConfig { without_bearing: WithoutBearing::Discard, ..TrackConfig::default() };
    Track::with_intake::<4, 1>(filter, MixtureIntake(BearingMixture::isaacs2014().sigma()), config)
}

/// A target anywhere in a room alike, with the moments of a Gaussian: a parallelogram whose half
/// sides are √3 of its standard deviations; and with any small velocity.
struct Room {
    middle: Vector2<f64>,
    half_sides: Matrix2<f64>,
}

impl Room {
    fn new(prior: &Estimate<2>) -> Result<Self, EstimatorError> {
        let singular = EstimatorError::NotPositiveDefinite { role: Role::Prior };
        let factor = prior.covariance.cholesky().ok_or(singular)?.unpack();
        Ok(Self { middle: prior.mean, half_sides: factor * 3.0_f64.sqrt() })
    }
}

impl Prior<4> for Room {
    fn moments(&self) -> Estimate<4> {
        let mean = Vector4::new(self.middle.x, self.middle.y, 0.0, 0.0);
        let mut moments = Estimate::isotropic(mean, SPEED_SIGMA_MPS);
        let place = self.half_sides * self.half_sides.transpose() / 3.0;
        moments.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place);
        moments
    }

    fn is_gaussian(&self) -> bool {
        false
    }

    fn draw(&self, rng: &mut Xoshiro256PlusPlus) -> Vector4<f64> {
        let mut side = || rng.random_range(-1.0..=1.0);
        let place = self.middle + self.half_sides * Vector2::new(side(), side());
        let mut speed = || SPEED_SIGMA_MPS * rng.sample::<f64, _>(StandardNormal);
        Vector4::new(place.x, place.y, speed(), speed())
    }

    fn sum(&self, parts: usize) -> Result<Vec<(f64, Estimate<4>)>, EstimatorError> {
        self.moments().sum(parts)
    }

    fn row(&self, _: usize) -> Result<Option<Vec<(f64, Estimate<4>)>>, EstimatorError> {
        Ok(None)
    }
}

/// q of the target's acceleration in m²/s³, and σ of its velocity's East and North in m/s.
const SPECTRAL_DENSITY: f64 = 2.5e-5;
const SPEED_SIGMA_MPS: f64 = 0.05;

/// A bearing with σ of the mixture, in radians, whatever its own.
struct MixtureIntake(f64);

impl Intake<1> for MixtureIntake {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::BEARING]
    }

    fn observation(
        &self,
        reception: &Reception,
    ) -> Result<Option<Observation<1>>, ObservationError> {
        let Some(bearing) = reception.bearing else { return Ok(None) };
        let value = Vector1::new(bearing.angle);
        let noise = Matrix1::new(self.0 * self.0);
        Ok(Some(Observation::new(reception.time, reception.receiver, value, noise)?))
    }
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
    model: impl IntoDyn<AnyModel<2, M>>,
) -> Result<Track, EstimatorError>
where
    RecalledGrid<M>: IntoDyn<Box<dyn Estimator<2, M>>>,
{
    // Each difference is a hyperbola or a circle, and two of them meet in two places: no Gaussian,
    // wherever it starts from, holds both.
    let filter = RecalledGrid::new(model.into_dyn(), request.search.prior)?;
    Ok(Track::new::<2, M>(filter.into_dyn(), TrackConfig::default()))
}
