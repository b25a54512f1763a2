//! Models made of others: two at once, and one that takes silence for a measurement.

use foxhunt_core::{
    Axis, MeasurementModel, Observation, Pose, Quantity, State, columns, gaussian_log_likelihood,
    log_likelihoods_one_by_one, noise::log_normal_cdf,
};
use nalgebra::{SMatrix, SVector};

use super::BLOCK;

/// Two models of one state, measured at once: the `MA` components of the first, then the `MB` of
/// the second.
///
/// As a [`MeasurementModel`] it has M = `MA` + `MB` components; another M does not compile. Each
/// keeps its own likelihood, outliers and all, unless the observation's noise couples the two: then
/// the noise is Gaussian.
///
/// ```
/// use foxhunt_core::{MeasurementModel, Pose, nalgebra::{Vector2, Vector3}};
/// use foxhunt_sensors::{BearingOnly, DifferentialRss, Stacked};
/// # fn main() -> Result<(), foxhunt_sensors::ParameterError> {
/// let level = DifferentialRss::new(Vector3::new(50.0, 0.0, 2.0), 2.5)?;
/// let both = Stacked::<_, _, 1, 1>::new(level, BearingOnly::new());
/// let expected: Vector2<f64> = both.expected(&Vector2::new(10.0, 10.0), &Pose::default());
/// assert!(expected[0] > 0.0 && (expected[1] - 0.785).abs() < 1e-3);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stacked<A, B, const MA: usize, const MB: usize> {
    first: A,
    second: B,
}

impl<A, B, const MA: usize, const MB: usize> Stacked<A, B, MA, MB> {
    /// The first over the second.
    #[must_use]
    pub fn new(first: A, second: B) -> Self {
        Self { first, second }
    }
}

impl<A, B, const MA: usize, const MB: usize, const N: usize, const M: usize> MeasurementModel<N, M>
    for Stacked<A, B, MA, MB>
where
    A: MeasurementModel<N, MA>,
    B: MeasurementModel<N, MB>,
{
    fn quantities(&self) -> [Quantity; M] {
        const { assert!(M == MA + MB, "a stack has the components of both models") };
        let first = self.first.quantities();
        let second = self.second.quantities();
        core::array::from_fn(|i| if i < MA { first[i] } else { second[i - MA] })
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M> {
        join(&self.first.expected(state, receiver), &self.second.expected(state, receiver))
    }

    fn residual(&self, z: &SVector<f64, M>, expected: &SVector<f64, M>) -> SVector<f64, M> {
        let ((first, second), (a, b)) = (split(z), split(expected));
        join(&self.first.residual(&first, &a), &self.second.residual(&second, &b))
    }

    #[inline(always)]
    fn expected_change(
        &self,
        state: &State<N>,
        expected: &SVector<f64, M>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> SVector<f64, M> {
        let (first, second) = split(expected);
        join(
            &self.first.expected_change(state, &first, offset, receiver),
            &self.second.expected_change(state, &second, offset, receiver),
        )
    }

    #[inline(always)]
    fn expected_parts(
        &self,
        state: &State<N>,
        expected: &SVector<f64, M>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> [SVector<f64, M>; 2] {
        let (first, second) = split(expected);
        let first = self.first.expected_parts(state, &first, offset, receiver);
        let second = self.second.expected_parts(state, &second, offset, receiver);
        [join(&first[0], &second[0]), join(&first[1], &second[1])]
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, M, N> {
        join(&self.first.jacobian(state, receiver), &self.second.jacobian(state, receiver))
    }

    fn log_likelihood(&self, state: &State<N>, observation: &Observation<M>) -> f64 {
        if is_coupled(observation, MA) {
            return gaussian_log_likelihood(self, state, observation);
        }
        self.first.log_likelihood(state, &observation.marginal(0))
            + self.second.log_likelihood(state, &observation.marginal(MA))
    }

    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<M>, out: &mut [f64]) {
        if is_coupled(observation, MA) {
            return log_likelihoods_one_by_one(self, columns, observation, out);
        }
        self.first.log_likelihoods(columns, &observation.marginal(0), out);
        let second = observation.marginal(MA);
        let mut more = [0.0; BLOCK];
        for (block, out) in out.chunks_mut(BLOCK).enumerate() {
            let rows = block * BLOCK..block * BLOCK + out.len();
            let more = &mut more[..out.len()];
            self.second.log_likelihoods(columns::rows(&columns, rows), &second, more);
            out.iter_mut().zip(more).for_each(|(out, more)| *out += *more);
        }
    }

    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &SVector<f64, M>,
        receiver: &Pose,
        out: [&mut [f64]; M],
    ) {
        let (first, second) = split(z);
        let mut out = out.into_iter();
        let mut next = || out.next().expect("a stack has the components of both models");
        let above = core::array::from_fn(|_| next());
        let below = core::array::from_fn(|_| next());
        self.first.residuals(columns, &first, receiver, above);
        self.second.residuals(columns, &second, receiver, below);
    }
}

/// A model with a likelihood of silence: a component that lay below the receiver's floor has
/// the likelihood P(zᵢ < floor | x) = Φ((floor − hᵢ(x)) / σᵢ) (Tobin 1958).
///
/// Such an observation is made with the floor for its value and the level's σ, and marked with
/// [`Observation::below`]. Estimators that evaluate likelihoods, a particle filter or a batch, use
/// it; a Kalman filter, which works with residuals, takes it for missing. The components that were
/// received have the likelihood of the model inside. The noise of a silent component is taken for
/// independent of theirs, and an angle has no floor.
///
/// ```
/// use foxhunt_core::{MeasurementModel, Observation, Pose, nalgebra::{Matrix1, Vector1, Vector2}};
/// use foxhunt_sensors::{Censored, LogDistance, Rss};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = Censored::new(Rss::new(LogDistance::new(-30.0, 2.5)?));
/// let (floor, variance) = (Vector1::new(-90.0), Matrix1::new(16.0));
/// let silence = Observation::new(0.0, Pose::at(0.0, 0.0, 30.0), floor, variance)?.below(0);
/// let near = model.log_likelihood(&Vector2::new(50.0, 0.0), &silence);
/// let far = model.log_likelihood(&Vector2::new(900.0, 0.0), &silence);
/// assert!(near < -10.0 && far > -0.01);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Censored<H> {
    model: H,
}

impl<H> Censored<H> {
    /// The model with silence understood.
    #[must_use]
    pub fn new(model: H) -> Self {
        Self { model }
    }

    /// The log likelihood of a state from the components below a limit.
    fn silence<const N: usize, const M: usize>(
        &self,
        state: &State<N>,
        observation: &Observation<M>,
    ) -> f64
    where
        H: MeasurementModel<N, M>,
    {
        let expected = self.model.expected(state, observation.receiver());
        let linear = self.model.axes().map(|axis| axis == Axis::Linear);
        let below = (0..M).filter(|i| linear[*i]);
        let below = below.filter_map(|i| observation.upper_limit(i).map(|limit| (i, limit)));
        below.map(|(i, (limit, sigma))| log_normal_cdf((limit - expected[i]) / sigma)).sum()
    }
}

impl<H, const N: usize, const M: usize> MeasurementModel<N, M> for Censored<H>
where
    H: MeasurementModel<N, M>,
{
    fn quantities(&self) -> [Quantity; M] {
        self.model.quantities()
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M> {
        self.model.expected(state, receiver)
    }

    fn residual(&self, z: &SVector<f64, M>, expected: &SVector<f64, M>) -> SVector<f64, M> {
        self.model.residual(z, expected)
    }

    fn expected_change(
        &self,
        state: &State<N>,
        expected: &SVector<f64, M>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> SVector<f64, M> {
        self.model.expected_change(state, expected, offset, receiver)
    }

    fn expected_parts(
        &self,
        state: &State<N>,
        expected: &SVector<f64, M>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> [SVector<f64, M>; 2] {
        self.model.expected_parts(state, expected, offset, receiver)
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, M, N> {
        self.model.jacobian(state, receiver)
    }

    fn log_likelihood(&self, state: &State<N>, observation: &Observation<M>) -> f64 {
        self.model.log_likelihood(state, observation) + self.silence(state, observation)
    }

    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<M>, out: &mut [f64]) {
        self.model.log_likelihoods(columns, observation, out);
        if !observation.is_censored() {
            return;
        }
        for (i, out) in out.iter_mut().enumerate() {
            let state = State::from_fn(|row, _| columns[row][i]);
            *out += self.silence(&state, observation);
        }
    }

    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &SVector<f64, M>,
        receiver: &Pose,
        out: [&mut [f64]; M],
    ) {
        self.model.residuals(columns, z, receiver, out);
    }
}

/// The parts of a vector.
fn split<const MA: usize, const MB: usize, const M: usize>(
    whole: &SVector<f64, M>,
) -> (SVector<f64, MA>, SVector<f64, MB>) {
    const { assert!(M == MA + MB, "a stack has the components of both models") };
    (SVector::from_fn(|i, _| whole[i]), SVector::from_fn(|i, _| whole[MA + i]))
}

/// Both vectors or matrices, one over the other.
fn join<const MA: usize, const MB: usize, const M: usize, const C: usize>(
    first: &SMatrix<f64, MA, C>,
    second: &SMatrix<f64, MB, C>,
) -> SMatrix<f64, M, C> {
    const { assert!(M == MA + MB, "a stack has the components of both models") };
    SMatrix::from_fn(|i, j| if i < MA { first[(i, j)] } else { second[(i - MA, j)] })
}

/// Returns true if noise is shared by a component of each part.
fn is_coupled<const M: usize>(observation: &Observation<M>, first: usize) -> bool {
    let noise = observation.noise();
    noise.view((first, 0), (M - first, first)).iter().any(|c| c.abs() > 0.0)
}
