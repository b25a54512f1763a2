//! Records and alarms of an estimator while it runs.

use alloc::{collections::VecDeque, vec::Vec};

use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, MeasurementModel, Observation, Quantity,
    Smooth, State, parameter::require,
};
use nalgebra::SVector;

use super::{
    ChiSquaredAverage,
    verdict::{probability, quantiles},
};
use crate::{Innovation, count::number};

/// An estimator that records the innovations of its observations, and is otherwise the one inside.
///
/// The average of the NIS is over what the estimator itself calls so, rejected observations
/// included. The normalised innovations are worked out from the samples of the belief before
/// each update, for any family.
#[derive(Clone, Debug)]
pub struct Monitored<E, H, const M: usize> {
    estimator: E,
    model: H,
    nis: ChiSquaredAverage,
    innovations: Vec<SVector<Option<f64>, M>>,
}

impl<E, H, const M: usize> Monitored<E, H, M> {
    /// Watches an estimator over the measurement model that it has, or another; the interval of
    /// the NIS is that of 95 %.
    #[must_use]
    pub fn new(estimator: E, model: H) -> Self {
        Self { estimator, model, nis: ChiSquaredAverage::default(), innovations: Vec::new() }
    }

    /// The average of the normalised innovations squared.
    #[must_use]
    pub fn nis(&self) -> &ChiSquaredAverage {
        &self.nis
    }

    /// The normalised innovations in their order, as [`Whiteness`](super::Whiteness) takes them;
    /// innovations that could not be computed are missing as a whole.
    #[must_use]
    pub fn innovations(&self) -> &[SVector<Option<f64>, M>] {
        &self.innovations
    }

    /// The estimator inside.
    #[must_use]
    pub fn estimator(&self) -> &E {
        &self.estimator
    }
}

impl<E, H, const N: usize, const M: usize> Smooth<N, M> for Monitored<E, H, M>
where
    E: Smooth<N, M>,
    H: MeasurementModel<N, M>,
{
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError> {
        self.estimator.smooth(&later.estimator, dt)
    }
}

impl<E, H, const N: usize, const M: usize> Estimator<N, M> for Monitored<E, H, M>
where
    E: Estimator<N, M>,
    H: MeasurementModel<N, M>,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        self.estimator.predict(dt)
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        let innovation = Innovation::of_belief(&self.estimator, &self.model, observation);
        let correction = self.estimator.update(observation)?;
        if correction != Correction::Empty {
            let white =
                innovation.and_then(|innovation| innovation.normalised_present(observation));
            self.innovations.push(white.unwrap_or_else(|| SVector::repeat(None)));
        }
        if let Some(nis) = correction.nis() {
            self.nis.add(nis, observation.len());
        }
        Ok(correction)
    }

    fn estimate(&self) -> Estimate<N> {
        self.estimator.estimate()
    }

    fn quantities(&self) -> [Quantity; M] {
        self.estimator.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        self.estimator.visit_samples(visit);
    }
}

/// Detects that a filter has lost its target: the average normalised innovation squared over the
/// last few observations has left the interval that a consistent filter's keeps (Bar-Shalom, Li &
/// Kirubarajan 2001, §5.4.2 and §11.6).
///
/// The interval is that of χ² with as many degrees of freedom as components were present in the
/// window. The significance is that of one look, both sides together; looks at windows that
/// overlap are not independent, and the more there are the likelier is a false alarm: of
/// observations without end, one in any sequence. At 10⁻⁴ and a window of 10, 6 of 100 sequences
/// of 1000 observations have one.
///
/// Rejected observations count: a gate shuts out most of what a lost filter receives.
///
/// ```
/// # use foxhunt_filters::consistency::{NisHealth, NisWatchdog};
/// # fn main() -> Result<(), foxhunt_core::EstimatorError> {
/// let mut watchdog = NisWatchdog::new(5, 1e-3)?;
/// for _ in 0..5 {
///     assert!(!watchdog.add(2.0, 2).is_alarm());
/// }
/// assert!(!watchdog.add(20.0, 2).is_alarm(), "one outlier is none");
/// assert!(matches!(watchdog.add(20.0, 2), NisHealth::Diverged { .. }));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct NisWatchdog {
    window: usize,
    significance: f64,
    squares: VecDeque<(f64, usize)>,
    /// The degrees of freedom that the interval of the sum was worked out for, and it.
    limits: (usize, [f64; 2]),
}

impl Default for NisWatchdog {
    /// The last 10 observations at 10⁻⁴.
    fn default() -> Self {
        let squares = VecDeque::new();
        let limits = (0, [0.0; 2]);
        Self { window: 10, significance: 1e-4, squares, limits }
    }
}

impl NisWatchdog {
    /// Watches the last `window` observations; `significance` is the probability that a look at a
    /// consistent filter is an alarm, half of it for each side.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the window is empty or the significance not in (0, 1).
    pub fn new(window: usize, significance: f64) -> Result<Self, EstimatorError> {
        require(window > 0, "window", 0.0, "at least 1")?;
        let significance = probability("significance", significance)?;
        Ok(Self { window, significance, ..Self::default() })
    }

    /// Adds the outcome of an update by an observation with `components` present. One without a
    /// NIS, such as that of an empty observation, changes nothing.
    pub fn observe(&mut self, correction: &Correction, components: usize) -> NisHealth {
        match correction.nis() {
            Some(nis) => self.add(nis, components),
            None => self.health(),
        }
    }

    /// Adds a normalised innovation squared and its degrees of freedom; zero degrees of freedom
    /// change nothing.
    pub fn add(&mut self, nis: f64, degrees_of_freedom: usize) -> NisHealth {
        if degrees_of_freedom > 0 {
            if self.squares.len() == self.window {
                self.squares.pop_front();
            }
            self.squares.push_back((nis, degrees_of_freedom));
            self.set_limits();
        }
        self.health()
    }

    /// The health over the present window.
    pub fn health(&self) -> NisHealth {
        if self.squares.len() < self.window {
            return NisHealth::Filling;
        }
        let average = self.squares.iter().map(|(nis, _)| nis).sum::<f64>() / number(self.window);
        let interval = self.limits.1.map(|sum| sum / number(self.window));
        if average < interval[0] {
            NisHealth::Overcautious { average, interval }
        } else if average <= interval[1] {
            NisHealth::Sound { average, interval }
        } else {
            // An average that is no number is no sound one.
            NisHealth::Diverged { average, interval }
        }
    }

    /// Empties the window, as after the filter was reset.
    pub fn reset(&mut self) {
        self.squares.clear();
    }

    fn set_limits(&mut self) {
        let degrees = self.squares.iter().map(|(_, degrees)| degrees).sum();
        let tail = 0.5 * self.significance;
        // A quantile is dear, and observations mostly have one number of components.
        if self.squares.len() == self.window
            && degrees != self.limits.0
            && let Some(sums) = quantiles(degrees, [tail, 1.0 - tail])
        {
            self.limits = (degrees, sums);
        }
    }
}

/// A [`NisWatchdog`]'s verdict on a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use = "an alarm is reported only here"]
pub enum NisHealth {
    /// The window is not full yet.
    Filling,
    /// The average is where that of a consistent filter is.
    Sound {
        /// The average NIS over the window.
        average: f64,
        /// Interval of a consistent filter's average.
        interval: [f64; 2],
    },
    /// Innovations are larger than the filter expects: it has lost the target, or its noise is
    /// too small.
    Diverged {
        /// The average NIS over the window.
        average: f64,
        /// Interval of a consistent filter's average.
        interval: [f64; 2],
    },
    /// Innovations are smaller than the filter expects: its noise is too large.
    Overcautious {
        /// The average NIS over the window.
        average: f64,
        /// Interval of a consistent filter's average.
        interval: [f64; 2],
    },
}

impl NisHealth {
    /// Returns true if the average lies outside its interval.
    #[must_use]
    pub fn is_alarm(&self) -> bool {
        matches!(self, Self::Diverged { .. } | Self::Overcautious { .. })
    }
}
