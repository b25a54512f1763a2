//! Observations that arrive late.

use alloc::{collections::VecDeque, vec::Vec};
use core::cmp::Ordering;

use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, MotionModel, Observation, Quantity, Smooth,
    State,
    parameter::{finite, not_negative, require},
};

use crate::rauch_tung_striebel;

/// An estimator that uses an observation at its own time, however late it arrives: it goes back
/// to what was believed before that time and runs through everything since once more.
///
/// Observations are put in the order of their own times; observations of one time, in an order of
/// their contents. So whatever the order in which they arrive within the lag, the posterior of an
/// estimator that is a function of its inputs is the same to the bit; one that draws random numbers
/// draws them in the order of time too.
///
/// Holds a copy of the estimator for each observation of the last `lag` seconds, so a particle
/// filter's cloud as many times. A time that is older than the newest observation by more than the
/// lag is settled; an observation of that time is refused with [`EstimatorError::TooLate`], which
/// leaves the belief as it was.
///
/// As an [`Estimator`] it keeps the time: `predict` lets it pass, and an observation that is newer
/// than that makes it pass. The belief is that at the latest known time.
#[derive(Clone, Debug)]
pub struct OutOfOrder<E, const M: usize> {
    lag: f64,
    most: usize,
    time: f64,
    /// The belief at `time`, which is −∞ as long as none is known.
    present: E,
    /// The belief after the last observation, at that one's time.
    last: E,
    last_time: f64,
    /// The observations that are not settled, in their order.
    recent: VecDeque<Step<E, M>>,
}

impl<E, const M: usize> OutOfOrder<E, M> {
    /// An estimator whose belief is that at `time`, and which takes observations that are up to
    /// `lag` seconds older than the newest, but not older than `time`.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the time is not finite, or the lag is negative or not
    /// finite.
    pub fn new<const N: usize>(estimator: E, time: f64, lag: f64) -> Result<Self, EstimatorError>
    where
        E: Estimator<N, M> + Clone,
    {
        finite("time", time)?;
        let made = Self::from_first(estimator, lag)?;
        Ok(Self { time, last_time: time, ..made })
    }

    /// Starts from a belief that holds at the time of the first observation, whichever that turns
    /// out to be: until something is settled no observation is too early.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the lag is negative or not finite.
    pub fn from_first<const N: usize>(estimator: E, lag: f64) -> Result<Self, EstimatorError>
    where
        E: Estimator<N, M> + Clone,
    {
        not_negative("lag", lag)?;
        let present = estimator.clone();
        let last = estimator;
        let time = f64::NEG_INFINITY;
        let recent = VecDeque::new();
        Ok(Self { lag, most: usize::MAX, time, present, last, last_time: time, recent })
    }

    /// Sets the largest number of observations held, however near they lie: the oldest is settled
    /// before.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is 0.
    pub fn with_most(self, most: usize) -> Result<Self, EstimatorError> {
        require(most > 0, "most observations", 0.0, "at least 1")?;
        Ok(Self { most, ..self })
    }

    /// Before this time everything is settled; −∞ as long as nothing is.
    #[must_use]
    pub fn horizon(&self) -> f64 {
        self.recent.front().map_or(self.last_time, |step| step.before_time)
    }

    /// The time of the belief, in seconds; −∞ as long as none is known.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The estimator at the time of the belief.
    #[must_use]
    pub fn estimator(&self) -> &E {
        &self.present
    }

    /// The Gaussian beliefs at the times of the observations that are not settled, given all of
    /// them up to now: fixed-interval smoothing over the lag, the oldest first
    /// ([`rauch_tung_striebel`]). The first is that at the [`horizon`](Self::horizon), if there is
    /// one.
    ///
    /// `motion` is that of the estimator, whose belief has to be Gaussian or to be well described
    /// by its two moments.
    ///
    /// # Errors
    ///
    /// An error when a predicted covariance is not positive definite.
    pub fn smoothed<const N: usize>(
        &self,
        motion: &impl MotionModel<N>,
    ) -> Result<Vec<(f64, Estimate<N>)>, EstimatorError>
    where
        E: Estimator<N, M>,
    {
        let moments = |step: &Step<E, M>| (step.before_time, step.before.estimate());
        let mut filtered: Vec<_> = self.recent.iter().map(moments).collect();
        filtered.push((self.last_time, self.last.estimate()));
        filtered.retain(|(time, _)| time.is_finite());
        rauch_tung_striebel(motion, &filtered)
    }

    /// Puts an observation in its place and runs through what follows.
    fn insert<const N: usize>(
        &mut self,
        observation: &Observation<M>,
    ) -> Result<Correction, EstimatorError>
    where
        E: Estimator<N, M> + Clone,
    {
        let time = observation.time();
        let horizon = self.horizon();
        if time < horizon {
            return Err(EstimatorError::TooLate { time, horizon });
        }
        let after = |step: &Step<E, M>| order(&step.observation, observation) == Ordering::Greater;
        let place = self.recent.iter().position(after).unwrap_or(self.recent.len());
        let (mut belief, mut at) = match self.recent.get(place) {
            Some(step) => (step.before.clone(), step.before_time),
            None => (self.last.clone(), self.last_time),
        };
        let mut steps = Vec::new();
        let mut own = Correction::Empty;
        let later = self.recent.iter().skip(place).map(|step| &step.observation);
        for (i, observation) in core::iter::once(observation).chain(later).enumerate() {
            let before = belief.clone();
            let before_time = at;
            steps.push(Step { observation: *observation, before, before_time });
            belief.predict(elapsed(at, observation.time()))?;
            let correction = belief.update(observation)?;
            at = observation.time();
            if i == 0 {
                own = correction;
            }
        }
        let now = self.time.max(at);
        let mut present = belief.clone();
        present.predict(elapsed(at, now))?;

        self.recent.truncate(place);
        self.recent.extend(steps);
        (self.last, self.last_time) = (belief, at);
        (self.present, self.time) = (present, now);
        self.settle();
        Ok(own)
    }

    fn settle(&mut self) {
        while self.recent.len() > self.most
            || self.recent.front().is_some_and(|s| s.observation.time() < self.last_time - self.lag)
        {
            self.recent.pop_front();
        }
    }
}

impl<E, const N: usize, const M: usize> Estimator<N, M> for OutOfOrder<E, M>
where
    E: Estimator<N, M> + Clone,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        let mut present = self.last.clone();
        if self.time.is_finite() {
            present.predict(elapsed(self.last_time, self.time + dt))?;
        } else {
            // No observation yet: the belief that the first observation will find grows older.
            present.predict(dt)?;
            self.last = present.clone();
        }
        self.present = present;
        self.time += dt;
        Ok(())
    }

    /// Conditions the belief on an observation made at its own time.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TooLate`] when that is before the [`horizon`](OutOfOrder::horizon), and
    /// any error of the estimator for it or, after it, for a later one. The belief is then as it
    /// was.
    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        self.insert(observation)
    }

    fn estimate(&self) -> Estimate<N> {
        self.present.estimate()
    }

    fn quantities(&self) -> [Quantity; M] {
        self.last.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        self.present.visit_samples(visit);
    }
}

/// Refused: a copy from before a late observation does not know it. Within the lag,
/// [`smoothed`](OutOfOrder::smoothed) does it for one motion.
impl<E, const N: usize, const M: usize> Smooth<N, M> for OutOfOrder<E, M>
where
    E: Estimator<N, M> + Clone,
{
    fn smooth(&mut self, _: &Self, _: f64) -> Result<(), EstimatorError> {
        Err(EstimatorError::Unsupported { what: "smoothing with a lag for late observations" })
    }
}

/// One observation, and what was believed before.
#[derive(Clone, Debug)]
struct Step<E, const M: usize> {
    observation: Observation<M>,
    /// The belief after the observation before, and its time.
    before: E,
    before_time: f64,
}

/// From one time to another; none from an unknown time.
fn elapsed(from: f64, to: f64) -> f64 {
    if from.is_finite() { to - from } else { 0.0 }
}

/// By time, and at one time by contents.
fn order<const M: usize>(a: &Observation<M>, b: &Observation<M>) -> Ordering {
    let key = |o: &Observation<M>| {
        let pose = o.receiver();
        let present = (0..M).map(|i| (o.has(i), if o.has(i) { o.value()[i] } else { 0.0 }));
        (pose.position, present.collect::<Vec<_>>(), o.noise())
    };
    let numbers = |a: &[f64], b: &[f64]| {
        let mut pairs = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
        pairs.find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
    };
    a.time().total_cmp(&b.time()).then_with(|| {
        let ((at, values, noise), (other, others, others_noise)) = (key(a), key(b));
        let values =
            values.iter().zip(&others).map(|(a, b)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        numbers(at.as_slice(), other.as_slice())
            .then(values.fold(Ordering::Equal, Ordering::then))
            .then(numbers(noise.as_slice(), others_noise.as_slice()))
    })
}
