//! An unknown number of transmitters that appear and disappear, each with a label of its own.

use alloc::vec::Vec;

use foxhunt_core::{
    Axis, Correction, Estimate, Estimator, EstimatorError, Observation, State,
    parameter::{not_negative, probability, require},
};

use super::{
    Associations, Density, Detection, Reduction, proper,
    scan::{Before, cardinality, condition, mean, most_probable},
};

/// Existence below which a track is dropped.
const LEAST_EXISTENCE: f64 = 1e-4;

/// Largest number of tracks.
const MOST_TRACKS: usize = 200;

/// Label of a track: the step in which it was born, and the number of its birth density. Both
/// count from 0. No two tracks have the same label, and a track keeps its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Label {
    /// Number of the step of positive length in which the track was born.
    pub step: u64,
    /// Index of the birth density.
    pub birth: usize,
}

/// A track: a transmitter that may be there.
#[derive(Clone, Debug)]
pub struct Track<E, const N: usize> {
    label: Label,
    existence: f64,
    density: Density<E>,
    estimate: Estimate<N>,
}

impl<E, const N: usize> Track<E, N> {
    /// The track's label.
    #[must_use]
    pub fn label(&self) -> Label {
        self.label
    }

    /// Probability that the transmitter is there.
    #[must_use]
    pub fn existence(&self) -> f64 {
        self.existence
    }

    /// Mean and covariance of the transmitter's state, if it is there.
    #[must_use]
    pub fn estimate(&self) -> &Estimate<N> {
        &self.estimate
    }

    /// Number of association histories.
    #[must_use]
    pub fn histories(&self) -> usize
    where
        E: Clone,
    {
        self.density.len()
    }

    /// Calls `visit` with states and weights that stand for the density of the transmitter, if it
    /// is there; the weights sum to 1.
    pub fn visit_samples<const M: usize>(&self, visit: &mut dyn FnMut(&State<N>, f64))
    where
        E: Estimator<N, M> + Clone,
    {
        self.density.visit_samples(visit);
    }
}

/// The labelled multi-Bernoulli filter (Reuter, Vo, Vo & Dietmayer 2014): an unknown number of
/// transmitters that appear and disappear, over any estimator.
///
/// Each step adds a track for each birth density; [`add_births`](Self::add_births) adds one for
/// each observation. Each scan multiplies the probability of existence of each track, and its
/// density, by the marginals over all joint associations. These are summed exactly for groups of
/// tracks that compete for up to some dozens of observations, and by loopy belief propagation
/// beyond ([`Associations::is_exact`]), where the filter of 2014 lists the best associations.
/// Tracks whose existence falls below 10⁻⁴ are dropped; of more than 200 the most probable are
/// kept.
///
/// ```
/// use foxhunt_core::{Estimate, MeasurementModel, Observation, Pose, Quantity, RandomWalk, State,
///     nalgebra::{Matrix2, Vector2}};
/// use foxhunt_filters::{Ekf, multi::{Detection, LabelledMultiBernoulli}};
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
/// let anywhere = Ekf::new(RandomWalk::uniform(1.0), Place,
///     Estimate::isotropic(Vector2::zeros(), 50.0))?;
/// let detection = Detection::new(0.9, 1.0, [200.0, 200.0])?;
/// let mut filter = LabelledMultiBernoulli::new([], 0.99, detection)?;
/// let place = |east| Observation::new(
///     1.0, Pose::default(), Vector2::new(east, 1.0), Matrix2::identity());
/// for _ in 0..5 {
///     filter.predict(1.0)?;
///     let scan = [place(-30.0)?, place(40.0)?];
///     let associations = filter.update(&scan)?;
///     filter.add_births(&anywhere, &scan, &associations, 0.1, 0.05)?;
/// }
/// let found = filter.found();
/// assert_eq!(found.len(), 2);
/// assert!(found.iter().all(|track| track.existence() > 0.9));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct LabelledMultiBernoulli<E, const N: usize, const M: usize> {
    tracks: Vec<Track<E, N>>,
    births: Vec<Birth<E, N>>,
    survival: f64,
    detection: Detection<M>,
    reduction: Reduction<E, N>,
    axes: [Axis; N],
    least_existence: f64,
    most_tracks: usize,
    steps: u64,
    /// Number of labels of the present step that observations have used.
    added: usize,
}

#[derive(Clone, Debug)]
struct Birth<E, const N: usize> {
    existence: f64,
    density: Density<E>,
    estimate: Estimate<N>,
}

impl<E, const N: usize, const M: usize> LabelledMultiBernoulli<E, N, M>
where
    E: Estimator<N, M> + Clone,
{
    /// No track yet, over a state without angles. In each step a transmitter appears for each of
    /// `births` with its probability and the density of its estimator. `survival` is the
    /// probability that a transmitter is still there one second later.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when `survival` or the probability of a birth is not a
    /// probability; [`EstimatorError`] when an estimate is not finite and positive definite.
    pub fn new(
        births: impl IntoIterator<Item = (f64, E)>,
        survival: f64,
        detection: Detection<M>,
    ) -> Result<Self, EstimatorError> {
        probability("the probability of survival", survival)?;
        let mut born = Vec::new();
        for (existence, prior) in births {
            probability("the probability of a birth", existence)?;
            let estimate = proper(prior.estimate())?;
            born.push(Birth { existence, density: Density::new(prior), estimate });
        }
        Ok(Self {
            tracks: Vec::new(),
            births: born,
            survival,
            detection,
            reduction: Reduction::default(),
            axes: [Axis::Linear; N],
            least_existence: LEAST_EXISTENCE,
            most_tracks: MOST_TRACKS,
            steps: 0,
            added: 0,
        })
    }

    /// Sets the rules that keep the number of association histories of a track small.
    #[must_use]
    pub fn with_reduction(self, reduction: Reduction<E, N>) -> Self {
        Self { reduction, ..self }
    }

    /// Sets the state's axes, where some components are angles.
    #[must_use]
    pub fn with_axes(self, axes: [Axis; N]) -> Self {
        Self { axes, ..self }
    }

    /// Sets the existence below which a track is dropped after a scan, and the largest number of
    /// tracks.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when `least_existence` is not in [0, 1), or `most` is 0.
    pub fn with_pruning(self, least_existence: f64, most: usize) -> Result<Self, EstimatorError> {
        let proper = (0.0..1.0).contains(&least_existence);
        require(proper, "the least existence", least_existence, "in [0, 1)")?;
        require(most > 0, "most tracks", 0.0, "at least 1")?;
        Ok(Self { least_existence, most_tracks: most, ..self })
    }

    /// Carries every track `dt` seconds forward, and adds the births. A step of no length changes
    /// nothing.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TimeStep`] for a `dt` that is negative or not finite, and the estimators'
    /// errors. On any error every track is left as it was.
    pub fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        if dt <= 0.0 {
            return Ok(());
        }
        let survival = libm::pow(self.survival, dt);
        let mut tracks = Vec::with_capacity(self.tracks.len() + self.births.len());
        for track in &self.tracks {
            let mut density = track.density.clone();
            density.predict(dt)?;
            let estimate = proper(density.estimate(&self.axes)?)?;
            tracks.push(Track {
                existence: track.existence * survival,
                density,
                estimate,
                label: track.label,
            });
        }
        for (birth, born) in self.births.iter().enumerate() {
            tracks.push(Track {
                label: Label { step: self.steps, birth },
                existence: born.existence,
                density: born.density.clone(),
                estimate: born.estimate,
            });
        }
        self.steps += 1;
        self.added = 0;
        self.tracks = tracks;
        Ok(())
    }

    /// Conditions all tracks on the observations of one scan, of which there may be none.
    ///
    /// The result has the tracks in the order of [`tracks`](Self::tracks) before the scan; some of
    /// them may have been dropped since.
    ///
    /// # Errors
    ///
    /// The errors of reduction. On any error every track is left as it was.
    pub fn update(
        &mut self,
        observations: &[Observation<M>],
    ) -> Result<Associations, EstimatorError> {
        let before = self.tracks.iter();
        let before: Vec<_> = before
            .map(|track| Before { existence: track.existence, density: &track.density })
            .collect();
        let (after, associations) =
            condition(&before, observations, &self.detection, &self.reduction, &self.axes)?;
        let mut tracks = Vec::with_capacity(after.len());
        for (before, after) in self.tracks.iter().zip(after) {
            if after.existence < self.least_existence {
                continue;
            }
            let estimate = proper(after.density.estimate(&self.axes)?)?;
            let existence = after.existence;
            tracks.push(Track { label: before.label, existence, density: after.density, estimate });
        }
        if tracks.len() > self.most_tracks {
            tracks.sort_by(|a, b| b.existence.total_cmp(&a.existence));
            tracks.truncate(self.most_tracks);
            tracks.sort_by_key(|track| track.label);
        }
        self.tracks = tracks;
        Ok(associations)
    }

    /// Adds a track for each observation of the scan that was just conditioned on: a copy of
    /// `prior`, conditioned on the observation (Reuter et al. 2014, eq. 75).
    ///
    /// The tracks exist with probabilities of the sum `expected`, in proportion to the probability
    /// that no track made the observation, and at most `most` each. So births need no place of
    /// their own. Two wide birth densities in one place have no such difference: each of their
    /// tracks would stand for either of two transmitters.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when `expected` is negative or not finite, or `most` is not a
    /// probability. On any error no track is added.
    pub fn add_births(
        &mut self,
        prior: &E,
        observations: &[Observation<M>],
        associations: &Associations,
        expected: f64,
        most: f64,
    ) -> Result<(), EstimatorError> {
        not_negative("the expected number of births", expected)?;
        probability("the largest probability of a birth", most)?;
        let unclaimed: Vec<f64> =
            (0..observations.len()).map(|index| associations.clutter(index)).collect();
        let total: f64 = unclaimed.iter().sum();
        let mut born = Vec::new();
        for (index, (observation, share)) in observations.iter().zip(&unclaimed).enumerate() {
            let existence = (expected * share / total).min(most);
            let mut estimator = prior.clone();
            // An observation that the prior cannot have made has no birth.
            let Ok(Correction::Fused { .. }) = estimator.update(observation) else { continue };
            if existence < self.least_existence || !existence.is_finite() {
                continue;
            }
            let estimate = proper(estimator.estimate())?;
            let label = Label {
                step: self.steps.saturating_sub(1),
                birth: self.births.len() + self.added + index,
            };
            born.push(Track { label, existence, density: Density::new(estimator), estimate });
        }
        self.added += observations.len();
        self.tracks.append(&mut born);
        Ok(())
    }

    /// Returns all tracks in the order of their labels.
    #[must_use]
    pub fn tracks(&self) -> &[Track<E, N>] {
        &self.tracks
    }

    /// Distribution of the number of transmitters: element n is the probability of n.
    #[must_use]
    pub fn cardinality(&self) -> Vec<f64> {
        cardinality(self.tracks.iter().map(Track::existence))
    }

    /// Expected number of transmitters.
    #[must_use]
    pub fn expected_number(&self) -> f64 {
        mean(&self.cardinality())
    }

    /// Returns the tracks of highest existence, the most probable first; their number is the most
    /// probable number of transmitters (Reuter et al. 2014, §V-D).
    #[must_use]
    pub fn found(&self) -> Vec<&Track<E, N>> {
        let count = most_probable(&self.cardinality());
        let mut tracks: Vec<&Track<E, N>> = self.tracks.iter().collect();
        tracks.sort_by(|a, b| b.existence.total_cmp(&a.existence));
        tracks.truncate(count);
        tracks
    }
}
