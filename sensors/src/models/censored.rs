use foxhunt_core::{
    Axis, MeasurementModel, Observation, Pose, Quantity, State, noise::log_normal_cdf,
};
use nalgebra::{SMatrix, SVector};

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
