use foxhunt_core::{
    MeasurementModel, Observation, Pose, Quantity, State, Terrain, columns,
    gaussian_log_likelihood, log_likelihoods_one_by_one, numeric_jacobian,
    parameter::{self, ParameterError},
};
use nalgebra::{SMatrix, SVector, Vector1, Vector3};

use super::differences;
use crate::TerrainLoss;

#[cfg(feature = "alloc")]
use super::WithElevationPattern;

/// A model of a level over terrain: the loss by diffraction over the ground between receiver and
/// target is subtracted.
///
/// The model inside expects the level over level ground in its first component, in dB; from that
/// the [`TerrainLoss`] is taken; without one it is the model inside. The receiver's Up, and the
/// target's height, count from the ground below each. The noise is Gaussian; a
/// [`Censored`](crate::Censored) model goes round this one, not into it.
///
/// The level has bends where another hill comes into the way. Grids and particles take them as they
/// are; a filter that linearises is only as good as that is within its own σ.
///
/// ```
/// use foxhunt_core::{MeasurementModel, Pose, nalgebra::{Vector1, Vector2}};
/// use foxhunt_sensors::{Hill, Hills, LogDistance, OverTerrain, Rss, TerrainLoss};
/// # fn main() -> Result<(), foxhunt_sensors::ParameterError> {
/// let hill = Hill { east_m: 50.0, north_m: 0.0, height_m: 15.0, radius_m: 20.0 };
/// let loss = TerrainLoss::new(Hills::new(vec![hill])?, 0.123)?;
/// let rss = Rss::new(LogDistance::pritzl2018_field());
/// let model = OverTerrain::new(rss, loss);
/// let (drone, behind) = (Pose::at(0.0, 0.0, 4.0), Vector2::new(100.0, 0.0));
/// let [over, without]: [Vector1<f64>; 2] =
///     [model.expected(&behind, &drone), rss.expected(&behind, &drone)];
/// assert!(over[0] < without[0] - 10.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct OverTerrain<H, G> {
    model: H,
    loss: Option<TerrainLoss<G>>,
    target_up: f64,
}

impl<H, G> OverTerrain<H, G> {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new(model: H, loss: TerrainLoss<G>) -> Self {
        Self { model, loss: Some(loss), target_up: 0.0 }
    }

    /// The model inside.
    #[must_use]
    pub fn model(&self) -> &H {
        &self.model
    }

    /// Loss by the terrain; `None` where the ground is taken for level.
    #[must_use]
    pub fn loss(&self) -> Option<&TerrainLoss<G>> {
        self.loss.as_ref()
    }

    /// Another model inside, over the same terrain and with the same target's height.
    #[must_use]
    pub fn map<I>(self, change: impl FnOnce(H) -> I) -> OverTerrain<I, G> {
        let Self { model, loss, target_up } = self;
        OverTerrain { model: change(model), loss, target_up }
    }

    /// Sets the height of the target above the ground below it, in metres, as the model inside has
    /// it.
    ///
    /// # Errors
    ///
    /// If the height is not finite.
    pub fn with_target_up(self, target_up: f64) -> Result<Self, ParameterError> {
        Ok(Self { target_up: parameter::finite("target_up", target_up)?, ..self })
    }
}

/// Without terrain: the ground is level.
impl<H, G> From<H> for OverTerrain<H, G> {
    fn from(model: H) -> Self {
        Self { model, loss: None, target_up: 0.0 }
    }
}

/// Without terrain and without an antenna's vertical pattern.
#[cfg(feature = "alloc")]
impl<H, G> From<H> for OverTerrain<WithElevationPattern<H>, G> {
    fn from(model: H) -> Self {
        WithElevationPattern::from(model).into()
    }
}

impl<H, G: Terrain> OverTerrain<H, G> {
    #[inline(never)]
    fn loss_db<const N: usize>(
        &self,
        loss: &TerrainLoss<G>,
        state: &State<N>,
        receiver: &Pose,
    ) -> f64 {
        const { assert!(N >= 2, "a state holds East and North") };
        loss.loss_db(&receiver.position, &Vector3::new(state[0], state[1], self.target_up))
    }
}

impl<H, G, const N: usize, const M: usize> MeasurementModel<N, M> for OverTerrain<H, G>
where
    H: MeasurementModel<N, M>,
    G: Terrain,
{
    fn quantities(&self) -> [Quantity; M] {
        self.model.quantities()
    }

    #[inline]
    fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M> {
        let Some(loss) = &self.loss else { return self.model.expected(state, receiver) };
        let mut expected = self.model.expected(state, receiver);
        expected[0] -= self.loss_db(loss, state, receiver);
        expected
    }

    #[inline]
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
        match &self.loss {
            Some(_) => self.residual(&self.expected(&(state + offset), receiver), expected),
            None => self.model.expected_change(state, expected, offset, receiver),
        }
    }

    fn expected_parts(
        &self,
        state: &State<N>,
        expected: &SVector<f64, M>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> [SVector<f64, M>; 2] {
        match &self.loss {
            Some(_) => differences(self, *state, *expected, *offset, receiver),
            None => self.model.expected_parts(state, expected, offset, receiver),
        }
    }

    #[inline]
    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, M, N> {
        let Some(loss) = &self.loss else { return self.model.jacobian(state, receiver) };
        let mut jacobian = self.model.jacobian(state, receiver);
        let place = state.fixed_rows::<2>(0).into_owned();
        let lost = |place: &State<2>| Vector1::new(self.loss_db(loss, place, receiver));
        let slope = numeric_jacobian(&place, lost, |a, b| a - b);
        for column in 0..2 {
            jacobian[(0, column)] -= slope[column];
        }
        jacobian
    }

    fn log_likelihood(&self, state: &State<N>, observation: &Observation<M>) -> f64 {
        match &self.loss {
            Some(_) => gaussian_log_likelihood(self, state, observation),
            None => self.model.log_likelihood(state, observation),
        }
    }

    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<M>, out: &mut [f64]) {
        match &self.loss {
            Some(_) => log_likelihoods_one_by_one(self, columns, observation, out),
            None => self.model.log_likelihoods(columns, observation, out),
        }
    }

    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &SVector<f64, M>,
        receiver: &Pose,
        out: [&mut [f64]; M],
    ) {
        let mut out = out;
        self.model.residuals(columns, z, receiver, columns::slices_mut(&mut out));
        let Some(loss) = &self.loss else { return };
        for (i, level) in out[0].iter_mut().enumerate() {
            let place = State::<2>::new(columns[0][i], columns[1][i]);
            *level += self.loss_db(loss, &place, receiver);
        }
    }
}
