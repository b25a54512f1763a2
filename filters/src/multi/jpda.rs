//! A known number of transmitters, and observations that belong to any of them or to clutter.

use alloc::vec::Vec;

use foxhunt_core::{Axis, Estimate, Estimator, EstimatorError, Observation, State};

use super::{
    Associations, Density, Detection, Reduction, proper,
    scan::{Before, condition},
};

/// Joint probabilistic data association (Fortmann, Bar-Shalom & Scheffe 1983): a known number of
/// transmitters that are all there, over any estimator.
///
/// The association probabilities are exact for groups of tracks that compete for up to some dozens
/// of observations (Horridge & Maskell 2006), see [`Associations::is_exact`]. A gate of the
/// estimators keeps far observations out.
///
/// The filter of 1983 merges the histories of a track into one Gaussian after each scan:
///
/// ```
/// use foxhunt_core::{Estimate, MeasurementModel, Observation, Pose, Quantity, RandomWalk, State,
///     nalgebra::{Matrix2, Vector2}};
/// use foxhunt_filters::{Ekf, Reinitialise, multi::{Detection, Jpda, Reduction}};
///
/// /// East and North of the target, in metres.
/// #[derive(Clone)]
/// struct Place;
///
/// impl MeasurementModel<2, 2> for Place {
///     fn quantities(&self) -> [Quantity; 2] {
///         [Quantity::linear("east_m"), Quantity::linear("north_m")]
///     }
///     fn expected(&self, target: &State<2>, _: &Pose) -> Vector2<f64> {
///         *target
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let at = |east| Ekf::new(RandomWalk::uniform(1.0), Place,
///     Estimate::isotropic(Vector2::new(east, 0.0), 5.0));
/// let one_gaussian = Reduction::new(0.0, 1)?.with_merging(0.0, Ekf::reinitialise)?;
/// let detection = Detection::new(0.9, 2.0, [200.0, 200.0])?;
/// let mut jpda = Jpda::new([at(-20.0)?, at(20.0)?], detection)?.with_reduction(one_gaussian);
/// let place = |east| Observation::new(
///     1.0, Pose::default(), Vector2::new(east, 1.0), Matrix2::identity());
/// jpda.predict(1.0)?;
/// let associations = jpda.update(&[place(21.0)?, place(-18.0)?, place(90.0)?])?;
/// assert!(associations.of(0, 1) > 0.99 && associations.of(1, 0) > 0.99);
/// assert!(associations.clutter(2) > 0.99);
/// assert!(jpda.estimates().all(|estimate| estimate.mean.x.abs() < 25.0));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Jpda<E, const N: usize, const M: usize> {
    tracks: Vec<(Density<E>, Estimate<N>)>,
    detection: Detection<M>,
    reduction: Reduction<E, N>,
    axes: [Axis; N],
}

impl<E, const N: usize, const M: usize> Jpda<E, N, M>
where
    E: Estimator<N, M> + Clone,
{
    /// One transmitter for each of these estimators, over a state without angles, with
    /// [`Reduction::default`].
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when an estimate is not finite and positive definite.
    pub fn new(
        priors: impl IntoIterator<Item = E>,
        detection: Detection<M>,
    ) -> Result<Self, EstimatorError> {
        let mut tracks = Vec::new();
        for prior in priors {
            let estimate = proper(prior.estimate())?;
            tracks.push((Density::new(prior), estimate));
        }
        let reduction = Reduction::default();
        Ok(Self { tracks, detection, reduction, axes: [Axis::Linear; N] })
    }

    /// Sets the rules that keep the number of association histories small.
    #[must_use]
    pub fn with_reduction(self, reduction: Reduction<E, N>) -> Self {
        Self { reduction, ..self }
    }

    /// Sets the state's axes, where some components are angles.
    #[must_use]
    pub fn with_axes(self, axes: [Axis; N]) -> Self {
        Self { axes, ..self }
    }

    /// Carries every track `dt` seconds forward.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TimeStep`] for a `dt` that is negative or not finite, and the estimators'
    /// errors. On any error every track is left as it was.
    pub fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        let mut tracks = Vec::with_capacity(self.tracks.len());
        for (density, _) in &self.tracks {
            let mut density = density.clone();
            density.predict(dt)?;
            tracks.push(density);
        }
        self.take(tracks)
    }

    /// Conditions all tracks on the observations of one scan, of which there may be none. The
    /// result has the tracks in the order in which they were given.
    ///
    /// # Errors
    ///
    /// The errors of reduction. On any error every track is left as it was.
    pub fn update(
        &mut self,
        observations: &[Observation<M>],
    ) -> Result<Associations, EstimatorError> {
        let before: Vec<_> =
            self.tracks.iter().map(|(density, _)| Before { existence: 1.0, density }).collect();
        let (after, associations) =
            condition(&before, observations, &self.detection, &self.reduction, &self.axes)?;
        self.take(after.into_iter().map(|track| track.density))?;
        Ok(associations)
    }

    /// Mean and covariance of each transmitter, in the order in which they were given.
    pub fn estimates(&self) -> impl ExactSizeIterator<Item = &Estimate<N>> {
        self.tracks.iter().map(|(_, estimate)| estimate)
    }

    /// Calls `visit` with states and weights that stand for the density of a track, counted from 0;
    /// the weights sum to 1. A track that does not exist has none.
    pub fn visit_samples(&self, track: usize, visit: &mut dyn FnMut(&State<N>, f64)) {
        if let Some((density, _)) = self.tracks.get(track) {
            density.visit_samples(visit);
        }
    }

    fn take(
        &mut self,
        densities: impl IntoIterator<Item = Density<E>>,
    ) -> Result<(), EstimatorError> {
        let mut tracks = Vec::with_capacity(self.tracks.len());
        for density in densities {
            let estimate = proper(density.estimate(&self.axes)?)?;
            tracks.push((density, estimate));
        }
        self.tracks = tracks;
        Ok(())
    }
}
