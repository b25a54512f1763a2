//! A model of a level with an added term: by terrain, or by an antenna's vertical pattern.

use foxhunt_core::{
    MeasurementModel, Observation, Pose, Quantity, State, Terrain, columns,
    gaussian_log_likelihood, log_likelihoods_one_by_one, numeric_jacobian,
    parameter::{self, ParameterError},
};
use nalgebra::{SMatrix, SVector, Vector1, Vector2, Vector3};

use super::differences;
use crate::TerrainLoss;

/// A term of a level that depends on the places of target and receiver.
///
/// ```
/// use foxhunt_core::{MeasurementModel, Pose, nalgebra::{Vector1, Vector2, Vector3}};
/// use foxhunt_sensors::{ChangedLevel, LevelChange, LogDistance, Rss};
///
/// /// A wall along East = 20 m, which takes 6 dB.
/// struct Wall;
///
/// impl LevelChange for Wall {
///     fn change_db(&self, target: &Vector3<f64>, receiver: &Pose) -> f64 {
///         let is_behind = (target.x > 20.0) != (receiver.position.x > 20.0);
///         if is_behind { -6.0 } else { 0.0 }
///     }
/// }
///
/// let rss = Rss::new(LogDistance::pritzl2018_field());
/// let model = ChangedLevel::changed(rss, Wall);
/// let (drone, behind) = (Pose::at(0.0, 0.0, 4.0), Vector2::new(30.0, 0.0));
/// let [through, without]: [Vector1<f64>; 2] =
///     [model.expected(&behind, &drone), rss.expected(&behind, &drone)];
/// assert!((without[0] - through[0] - 6.0).abs() < 1e-12);
/// ```
pub trait LevelChange {
    /// The term in dB, for a target at a place East, North and Up in metres.
    fn change_db(&self, target: &Vector3<f64>, receiver: &Pose) -> f64;

    /// The slope of the term over the target's East and North, in dB per metre; by differences
    /// unless it is known better.
    fn slope_db_per_m(&self, target: &Vector3<f64>, receiver: &Pose) -> Vector2<f64> {
        let changed = |place: &State<2>| {
            Vector1::new(self.change_db(&Vector3::new(place.x, place.y, target.z), receiver))
        };
        numeric_jacobian(&target.xy(), changed, |a, b| a - b).transpose()
    }
}

/// A model of a level to whose first component, in dB, a [`LevelChange`] is added; without one it
/// is the model inside.
///
/// The noise is Gaussian; a [`Censored`](crate::Censored) model goes round this one, not into it.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangedLevel<H, C> {
    model: H,
    change: Option<C>,
    target_up: f64,
}

/// A model of a level over terrain: the loss by diffraction over the ground between receiver and
/// target is subtracted.
///
/// The model inside expects the level over level ground in its first component, in dB; from that
/// the [`TerrainLoss`] is taken; without one it is the model inside. The receiver's Up, and the
/// target's height, count from the ground below each.
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
pub type OverTerrain<H, G> = ChangedLevel<H, TerrainLoss<G>>;

impl<H, G> OverTerrain<H, G> {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new(model: H, loss: TerrainLoss<G>) -> Self {
        Self::changed(model, loss)
    }

    /// Loss by the terrain; `None` where the ground is taken for level.
    #[must_use]
    pub fn loss(&self) -> Option<&TerrainLoss<G>> {
        self.change.as_ref()
    }
}

impl<G: Terrain> LevelChange for TerrainLoss<G> {
    #[inline(never)]
    fn change_db(&self, target: &Vector3<f64>, receiver: &Pose) -> f64 {
        -self.loss_db(&receiver.position, target)
    }
}

impl<H, C> ChangedLevel<H, C> {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn changed(model: H, change: C) -> Self {
        Self { model, change: Some(change), target_up: 0.0 }
    }

    /// The model inside.
    #[must_use]
    pub fn model(&self) -> &H {
        &self.model
    }

    /// Another model inside, with the same term and the same target's height.
    #[must_use]
    pub fn map<I>(self, other: impl FnOnce(H) -> I) -> ChangedLevel<I, C> {
        let Self { model, change, target_up } = self;
        ChangedLevel { model: other(model), change, target_up }
    }

    /// Sets the height of the target, in metres, as the model inside has it; above the ground
    /// below it where there is terrain.
    ///
    /// # Errors
    ///
    /// If the height is not finite.
    pub fn with_target_up(self, target_up: f64) -> Result<Self, ParameterError> {
        Ok(Self { target_up: parameter::finite("target_up", target_up)?, ..self })
    }

    fn target<const N: usize>(&self, state: &State<N>) -> Vector3<f64> {
        const { assert!(N >= 2, "a state holds East and North") };
        Vector3::new(state[0], state[1], self.target_up)
    }
}

/// Without an added term.
impl<H, C> From<H> for ChangedLevel<H, C> {
    fn from(model: H) -> Self {
        Self { model, change: None, target_up: 0.0 }
    }
}

impl<H, C, const N: usize, const M: usize> MeasurementModel<N, M> for ChangedLevel<H, C>
where
    H: MeasurementModel<N, M>,
    C: LevelChange,
{
    fn quantities(&self) -> [Quantity; M] {
        self.model.quantities()
    }

    #[inline]
    fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M> {
        let mut expected = self.model.expected(state, receiver);
        if let Some(change) = &self.change {
            expected[0] += change.change_db(&self.target(state), receiver);
        }
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
        match &self.change {
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
        match &self.change {
            Some(_) => differences(self, *state, *expected, *offset, receiver),
            None => self.model.expected_parts(state, expected, offset, receiver),
        }
    }

    #[inline]
    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, M, N> {
        let mut jacobian = self.model.jacobian(state, receiver);
        if let Some(change) = &self.change {
            let slope = change.slope_db_per_m(&self.target(state), receiver);
            for column in 0..2 {
                jacobian[(0, column)] += slope[column];
            }
        }
        jacobian
    }

    fn log_likelihood(&self, state: &State<N>, observation: &Observation<M>) -> f64 {
        match &self.change {
            Some(_) => gaussian_log_likelihood(self, state, observation),
            None => self.model.log_likelihood(state, observation),
        }
    }

    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<M>, out: &mut [f64]) {
        match &self.change {
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
        let Some(change) = &self.change else { return };
        for (i, level) in out[0].iter_mut().enumerate() {
            let place = State::<2>::new(columns[0][i], columns[1][i]);
            *level -= change.change_db(&self.target(&place), receiver);
        }
    }
}
