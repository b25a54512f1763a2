use alloc::{vec, vec::Vec};

use foxhunt_core::{
    Covariance, Estimate, EstimatorError, MeasurementModel, MotionModel, Role, State, elementary,
};
use nalgebra::{Matrix2, Vector2};

use super::{
    Columns, GridConfig, Lattice,
    columns::{Cell, log_densities},
    estimator::slope_of_place,
};
use crate::{
    Gaussian,
    vectorised::{Dot, LogSumExp, Map, Sum, run},
};

/// How far a lattice goes from the mean of a Gaussian, in standard deviations.
pub(super) const REACH: f64 = 8.0;

/// Recursive Bayes over the cells of an area, the point-mass filter (Bucy & Senne 1971).
///
/// Exact but for its resolution, for any shape of belief: no linearisation, no sampling noise. The
/// cells follow the belief. Where it has become smaller than they can resolve, they are laid out
/// anew, along its principal axes, and what was believed is read between the old ones by cubic
/// convolution; so is a belief that leaves the area.
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
    pub(super) motion: F,
    pub(super) measurement: H,
    pub(super) config: GridConfig,
    /// The origin of the further components.
    pub(super) reference: State<N>,
    /// The lattice that covers all of an area that the target cannot leave.
    pub(super) widest: Option<Lattice>,
    pub(super) lattice: Lattice,
    pub(super) columns: Columns<N>,
    /// ln p(x) of the columns' cells, under each hypothesis.
    pub(super) marginals: Vec<Vec<f64>>,
    pub(super) belief: Gaussian<N>,
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
    /// When the prior is not finite or its covariance not symmetric and positive definite;
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
        let marginals = normalise(&mut columns, &lattice);
        let mut filter = Self {
            motion,
            measurement,
            config,
            reference,
            widest,
            lattice,
            columns,
            marginals,
            belief: prior,
        };
        filter.belief = filter.moments(&filter.columns, &filter.marginals, &filter.lattice)?;
        Ok(filter)
    }

    /// The centre of each cell, East and North in metres, with the probability that the target is
    /// in it; they sum to 1. Cells are laid out row by row.
    pub fn cells(&self) -> impl Iterator<Item = (Vector2<f64>, f64)> {
        let area = self.lattice.cell_area();
        let logs = log_densities(&self.marginals);
        logs.into_iter()
            .enumerate()
            .map(move |(i, log)| (self.lattice.place(i), area * libm::exp(log)))
    }

    /// How many cells there are along each side.
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
        let area = self.lattice.cell_area();
        let mass = |logs: &Vec<f64>| logs.iter().map(|log| area * libm::exp(*log)).sum();
        self.marginals.iter().map(mass).collect()
    }

    /// The moments of a normalised density.
    pub(super) fn moments(
        &self,
        columns: &Columns<N>,
        marginals: &[Vec<f64>],
        lattice: &Lattice,
    ) -> Result<Gaussian<N>, EstimatorError> {
        let area = lattice.cell_area();
        let origin = lattice.centre();
        let (mut total, mut mean) = (0.0, State::<N>::zeros());
        let (mut square, mut within) = (Covariance::<N>::zeros(), Covariance::<N>::zeros());
        // What is lost beside 1 only costs time.
        let least = libm::log(1e-18 / area);
        let mut places = lattice.places();
        for (axis, places) in places.iter_mut().enumerate() {
            places.iter_mut().for_each(|place| *place -= origin[axis]);
        }
        let (mut weights, mut weighted) = (vec![0.0; lattice.len()], vec![0.0; lattice.len()]);
        for (hypothesis, logs) in marginals.iter().enumerate() {
            let of = |[log]: [f64; 1], _| {
                let weight = area * elementary::exp(log);
                if log > least { weight } else { 0.0 }
            };
            run(Map { columns: [logs], of, out: &mut weights });
            let mass = run(Sum(&weights));
            if mass <= 0.0 {
                continue;
            }
            total += mass;
            let behind = columns.means(hypothesis);
            let states: [&[f64]; N] =
                core::array::from_fn(|i| if i < 2 { &places[i][..] } else { &behind[i - 2] });
            for i in 0..N {
                let of = |[weight, x]: [f64; 2], _| weight * x;
                run(Map { columns: [&weights, states[i]], of, out: &mut weighted });
                mean[i] += run(Sum(&weighted));
                (0..=i).for_each(|j| square[(i, j)] += run(Dot(&weighted, states[j])));
            }
            within += columns.spread(hypothesis, &weights);
        }
        mean /= total;
        let mut covariance = (square + within) / total - mean * mean.transpose();
        covariance.fill_upper_triangle_with_lower_triangle();
        // A belief within a single cell is known to the cell and no better.
        let steps = lattice.steps();
        let cell = steps * steps.transpose() * 1e-6;
        let mut place = covariance.fixed_view_mut::<2, 2>(0, 0);
        place += cell;
        mean += self.reference;
        let mut centre = mean.fixed_rows_mut::<2>(0);
        centre += origin;
        Gaussian::new(Estimate { mean, covariance }, Role::Posterior)
    }
}

/// ln ∫ of a density over the lattice.
pub(super) fn log_total(logs: &[f64], lattice: &Lattice) -> f64 {
    run(LogSumExp(logs)) + libm::log(lattice.cell_area())
}

/// Makes a density integrate to 1; what it is then, under each hypothesis.
pub(super) fn normalise<const N: usize>(
    columns: &mut Columns<N>,
    lattice: &Lattice,
) -> Vec<Vec<f64>> {
    let mut marginals = columns.log_marginals();
    let totals: Vec<f64> = marginals.iter().map(|logs| run(LogSumExp(logs))).collect();
    let total = log_total(&totals, lattice);
    shift(columns, -total);
    marginals.iter_mut().flatten().for_each(|log| *log -= total);
    marginals
}

/// Adds a constant to every log-density.
pub(super) fn shift<const N: usize>(columns: &mut Columns<N>, by: f64) {
    for hypothesis in 0..columns.hypotheses() {
        columns.logs_mut(hypothesis).iter_mut().for_each(|log| *log += by);
    }
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
    // With P = L Lᵀ and the place whitened by L's first block, the rest has the mean and the
    // factor in L's other rows.
    let factor = prior.factor();
    let mut rest = *factor;
    rest.fixed_columns_mut::<2>(0).fill(0.0);
    let mut spread = rest * rest.transpose();
    (0..2).for_each(|i| spread[(i, i)] = 1.0);
    let mut columns = Columns::new(factors.len(), lattice.len());
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
        let cell = Cell::of(log, &mean, &spread)
            .ok_or(EstimatorError::NotPositiveDefinite { role: Role::Prior })?;
        for (hypothesis, (_, weight)) in factors.iter().enumerate() {
            let log = cell.log + libm::log(weight / sum);
            columns.set(hypothesis, index, &Cell { log, ..cell });
        }
    }
    Ok(columns)
}
