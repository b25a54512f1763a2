//! The grid filter: its state, its making and what it shows.

mod estimator;

use alloc::vec::Vec;

use foxhunt_core::{
    Covariance, Estimate, EstimatorError, MeasurementModel, MotionModel, Role, State,
    parameter::{ParameterError, require},
};
use nalgebra::{Matrix2, Vector2};

use super::{
    GridConfig, Lattice,
    columns::{Cell, Columns},
    likelihood::Pool,
    weights::Weights,
};
use crate::{
    Gaussian,
    vectorised::{Sum, run},
};

/// Reach of a lattice from the mean of a Gaussian, in standard deviations.
const REACH: f64 = 8.0;

/// Recursive Bayes over the cells of an area, the point-mass filter (Bucy & Senne 1971).
///
/// Exact but for its resolution, for any shape of belief: no linearisation, no sampling noise. The
/// cells follow the belief. When it has become smaller than they can resolve, the lattice is
/// rebuilt along its principal axes, and the belief is read between the old cells by cubic
/// convolution; so is a belief that leaves the area. Beside a cliff, as where all bearings meet at
/// a receiver, it is bounded: cubics would make a peak there of what is nearly impossible.
///
/// Components of the state behind East and North are marginalised (Rao-Blackwell): given the
/// place they are kept as a Gaussian in every cell. The measurement must be linear in them and
/// its noise Gaussian, as a level is in an unknown reference power or in a path-loss exponent;
/// and their motion a random walk that the place has no part in.
///
/// Where the noise itself is in doubt, [`GridConfig::noise_scales`] runs the same cells under
/// several of it, weighed by their evidence.
///
/// ```
/// use foxhunt_core::{Estimate, Estimator, MeasurementModel, Observation, Pose, Quantity,
///     RandomWalk, State, nalgebra::{Matrix1, Vector1, Vector2}};
/// use foxhunt_filters::{GridConfig, GridFilter};
///
/// /// The range of the target in metres: a ring of places fits it.
/// #[derive(Clone)]
/// struct Range;
///
/// impl MeasurementModel<2, 1> for Range {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::linear("x_m")]
///     }
///     fn expected(&self, target: &State<2>, receiver: &Pose) -> Vector1<f64> {
///         Vector1::new((target - receiver.position.xy()).norm())
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let prior = Estimate::isotropic(Vector2::zeros(), 20.0);
/// let still = RandomWalk::uniform(0.0);
/// let mut grid = GridFilter::new(still, Range, prior, GridConfig::default())?;
/// let (range, variance) = (Vector1::new(15.0), Matrix1::new(1.0));
/// let _ = grid.update(&Observation::new(0.0, Pose::default(), range, variance)?)?;
/// // On the ring it is likely, in its middle it is not.
/// let mass_within = |radius: f64| -> f64 {
///     grid.cells().filter(|(place, _)| place.norm() < radius).map(|(_, mass)| mass).sum()
/// };
/// assert!(mass_within(10.0) < 1e-3 && mass_within(20.0) > 0.999);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct GridFilter<F, H, const N: usize, const M: usize> {
    motion: F,
    measurement: H,
    config: GridConfig,
    /// The origin of the further components.
    reference: State<N>,
    /// The lattice that covers all of an area that the target cannot leave.
    widest: Option<Lattice>,
    lattice: Lattice,
    /// Columns of a density that integrates to 1.
    columns: Columns<N>,
    weights: Weights<N>,
    /// Buffers for the next step.
    spare: (Columns<N>, Weights<N>),
    pool: Pool,
    belief: Gaussian<N>,
}

impl<F, H, const N: usize, const M: usize> GridFilter<F, H, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
{
    /// A filter that starts from `prior`; where the configuration has an area, the prior's place
    /// is that area and no other component may be correlated with it.
    ///
    /// # Errors
    ///
    /// An error when the prior is not finite or its covariance not symmetric and positive definite;
    /// [`EstimatorError::Parameter`] names a setting that is out of its range, or a motion of the
    /// components beside the place that a grid has no cells for: they may only walk at random.
    pub fn new(
        motion: F,
        measurement: H,
        prior: Estimate<N>,
        config: GridConfig,
    ) -> Result<Self, EstimatorError> {
        const { assert!(N >= 2, "a state holds East and North") };
        config.check(M)?;
        let prior = Gaussian::new(prior, Role::Prior)?;
        slope_of_place(&motion, prior.mean(), 1.0)?;
        let mut reference = *prior.mean();
        reference.fixed_rows_mut::<2>(0).fill(0.0);
        let (lattice, widest) = match config.area {
            Some([low, high]) => {
                let half_sides = Matrix2::from_diagonal(&((high - low) * 0.5));
                let whole = Lattice::new((low + high) * 0.5, half_sides, config.side)?;
                (whole.clone(), Some(whole))
            }
            None => {
                let centre: Vector2<f64> = prior.mean().fixed_rows::<2>(0).into_owned();
                let spread: Matrix2<f64> =
                    prior.estimate().covariance.fixed_view::<2, 2>(0, 0).into_owned();
                let eigen = spread.symmetric_eigen();
                let half = eigen.eigenvalues.map(|v| REACH * libm::sqrt(v.max(0.0)));
                let half_sides = eigen.eigenvectors * Matrix2::from_diagonal(&half);
                (Lattice::new(centre, half_sides, config.side)?, None)
            }
        };
        let mut columns = prior_columns(&prior, &lattice, &config)?;
        let mut weights = Weights::default();
        let log_one = weights.set(&columns);
        columns.shift(-(log_one + log_total(&weights, &lattice)));
        let belief = weights.moments(&columns, &lattice, &reference)?;
        let spare = Default::default();
        Ok(Self {
            motion,
            measurement,
            config,
            reference,
            widest,
            lattice,
            columns,
            weights,
            spare,
            pool: Pool::default(),
            belief,
        })
    }

    /// The centre of each cell, East and North in metres, with the probability that the target is
    /// in it; they sum to 1. Cells are laid out row by row.
    pub fn cells(&self) -> impl Iterator<Item = (Vector2<f64>, f64)> {
        let scale = 1.0 / self.weights.total();
        let weights = self.weights.all().iter().enumerate();
        weights.map(move |(i, weight)| (self.lattice.place(i), scale * weight))
    }

    /// The measurement model of the next observations, for one that changes from one to the next,
    /// as between receivers of different makes. Its components must stay what they are.
    pub fn measurement_mut(&mut self) -> &mut H {
        &mut self.measurement
    }

    /// Returns the number of cells along each side.
    #[must_use]
    pub fn side(&self) -> usize {
        self.lattice.side()
    }

    /// The area of a cell, in m².
    #[must_use]
    pub fn cell_area(&self) -> f64 {
        self.lattice.cell_area()
    }

    /// The probability of each of the doubted noise's factors, in their order.
    #[must_use]
    pub fn noise_scale_probabilities(&self) -> Vec<f64> {
        let mass = |weights: &Vec<f64>| run(Sum(weights)) / self.weights.total();
        self.weights.each().iter().map(mass).collect()
    }
}

/// ln ∫ of a density over the lattice, whose weights count from that of a weight of 1.
fn log_total<const N: usize>(weights: &Weights<N>, lattice: &Lattice) -> f64 {
    libm::log(weights.total() * lattice.cell_area())
}

/// The prior over the cells, not normalised: Gaussian in the place unless there is an area, and
/// in the rest the Gaussian of it given the place.
fn prior_columns<const N: usize>(
    prior: &Gaussian<N>,
    lattice: &Lattice,
    config: &GridConfig,
) -> Result<Columns<N>, EstimatorError> {
    let whole = [(1.0, 1.0)];
    let factors = config.noise_scales.as_ref().map_or(&whole[..], |scales| &scales.factors);
    let sum: f64 = factors.iter().map(|(_, weight)| weight).sum();
    let log_weights: Vec<f64> = factors.iter().map(|(_, weight)| libm::log(weight / sum)).collect();
    // With P = L Lᵀ and the place whitened by L's first block, the rest has the mean and the
    // factor in L's other rows.
    let factor = prior.factor();
    let mut rest = *factor;
    rest.fixed_columns_mut::<2>(0).fill(0.0);
    let mut spread = rest * rest.transpose();
    (0..2).for_each(|i| spread[(i, i)] = 1.0);
    let no_factor = EstimatorError::NotPositiveDefinite { role: Role::Prior };
    let first = Cell::of(0.0, &State::zeros(), &spread).ok_or(no_factor)?;
    let mut columns = Columns::new(factors.len(), lattice.len(), &first.information);
    for index in 0..lattice.len() {
        let mut white = State::<N>::zeros();
        let place = lattice.place(index) - prior.mean().fixed_rows::<2>(0);
        let mut log = 0.0;
        if config.area.is_none() {
            white[0] = place.x / factor[(0, 0)];
            white[1] = (place.y - factor[(1, 0)] * white[0]) / factor[(1, 1)];
            log = -0.5 * white.norm_squared();
        }
        let mut mean: State<N> = factor * white;
        mean.fixed_rows_mut::<2>(0).fill(0.0);
        let cell = Cell::of(log, &mean, &spread).ok_or(no_factor)?;
        for (hypothesis, log_weight) in log_weights.iter().enumerate() {
            columns.set(hypothesis, index, &Cell { log: cell.log + log_weight, ..cell });
        }
    }
    Ok(columns)
}

/// Returns ∂f/∂x over the place.
///
/// # Errors
///
/// An error when the further components do not walk at random, as a velocity does not.
fn slope_of_place<const N: usize>(
    motion: &impl MotionModel<N>,
    state: &State<N>,
    dt: f64,
) -> Result<Matrix2<f64>, ParameterError> {
    let slope = motion.jacobian(state, dt);
    let mut rest = slope - Covariance::<N>::identity();
    rest.fixed_view_mut::<2, 2>(0, 0).fill(0.0);
    let coupling = rest.norm();
    let name = "the motion of the components beside the place";
    require(coupling <= 1e-9, name, coupling, "a random walk independent of the place")?;
    Ok(slope.fixed_view::<2, 2>(0, 0).into_owned())
}
