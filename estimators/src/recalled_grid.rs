use std::{f64::consts::TAU, fmt};

use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, Observation, Quantity, Role, State,
    absorb_receiver_noise, columns,
};
use foxhunt_filters::peaks;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use crate::AnyModel;

/// Grid over all observations so far, whatever their model, of the place of a target that stays.
///
/// The density at a place is the prior's times the likelihood of every observation, evaluated again
/// after each: nothing of it was read from other cells, so that the ridge of a first difference may
/// be far narrower than the cells of a wide prior. Cells are laid about each maximum, along the
/// principal axes of what is about it. The estimate is the most probable place, with the mean
/// squared deviations from it: the mean of a skewed belief, or of one in two places, is a poor
/// place. The prior's area is searched as a whole whenever there are twice as many observations.
#[derive(Clone)]
pub struct RecalledGrid<const M: usize> {
    model: AnyModel<2, M>,
    data: Vec<Observation<M>>,
    found: Found,
}

impl<const M: usize> fmt::Debug for RecalledGrid<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RecalledGrid").field("found", &self.found).finish_non_exhaustive()
    }
}

/// Belief over places, whatever the observations are: compiled once for all of them.
#[derive(Clone, Debug)]
struct Found {
    prior: Estimate<2>,
    /// The root of the prior's information: its product with a deviation is white.
    whitener: Matrix2<f64>,
    /// Number of observations from which on the whole area is searched again.
    search_at: usize,
    modes: Vec<Window>,
    cells: Vec<Cell>,
    belief: Estimate<2>,
    log_evidence: f64,
}

/// A place, with its weight or the logarithm of its density.
type Cell = (Vector2<f64>, f64);

/// The logarithm of the likelihood of all observations at places, as columns of East and North.
type LogLikelihoods<'a> = dyn Fn([&[f64]; 2], &mut [f64]) + 'a;

/// Parallelogram about a maximum.
#[derive(Clone, Copy, Debug)]
struct Window {
    middle: Vector2<f64>,
    /// Half sides as columns.
    half_sides: Matrix2<f64>,
}

/// Half-width of the area in standard deviations of the prior; of a mode's cells in its own.
const AREA: f64 = 4.0;
const REACH: f64 = 5.0;
/// Cells to a side where the whole area is searched, where a maximum is enclosed, and at the end.
const SEARCHED: usize = 64;
const ENCLOSED: usize = 17;
const WEIGHED: usize = 49;
/// Maxima that are followed.
const MAXIMA: usize = 8;
/// Cells this many nats below the highest hold nothing; windows this many below the best.
const NEGLIGIBLE: f64 = 12.5;
const BEHIND: f64 = 15.0;
/// The power of the density whose mean is the most probable place.
const SHARPENED: i32 = 6;
/// Most layouts of a window.
const LAYOUTS: usize = 60;
/// A side shrinks to this share, and grows by this factor, from one layout to the next at most.
const SHRINK: f64 = 0.4;
const GROW: f64 = 1.6;

impl<const M: usize> RecalledGrid<M> {
    /// Makes a grid that starts from a prior.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotPositiveDefinite`] for a prior whose covariance is not.
    pub fn new(model: AnyModel<2, M>, prior: Estimate<2>) -> Result<Self, EstimatorError> {
        Ok(Self { model, data: Vec::new(), found: Found::new(prior)? })
    }

    /// The observations, with the uncertainty of their receivers' own places in their noise, each
    /// with L⁻¹ of it, L Lᵀ, without what is missing.
    fn whitened(&self) -> Vec<(Observation<M>, SMatrix<f64, M, M>, f64)> {
        let mean = &self.found.belief.mean;
        let whiten = |observation: &Observation<M>| {
            let observation = absorb_receiver_noise(&*self.model, mean, observation);
            let factor = observation.noise_factor();
            let whitener = factor.solve_lower_triangular_unchecked(&SMatrix::identity());
            let present = (0..M).filter(|part| observation.has(*part));
            let normaliser = present
                .map(|part| -libm::log(factor[(part, part)]) - 0.5 * libm::log(TAU))
                .sum::<f64>();
            let whitener = whitener * observation.strike(SMatrix::identity());
            (observation, whitener, normaliser)
        };
        self.data.iter().map(whiten).collect()
    }

    fn solve(&mut self) -> Result<(), EstimatorError> {
        let data = self.whitened();
        let model = &self.model;
        self.found.solve(data.len(), &|columns, logs| {
            let mut residuals: [Vec<f64>; M] = std::array::from_fn(|_| vec![0.0; logs.len()]);
            for (observation, whitener, normaliser) in &data {
                let out = columns::slices_mut(&mut residuals);
                model.residuals(columns, observation.value(), observation.receiver(), out);
                for (index, log) in logs.iter_mut().enumerate() {
                    let residual = SVector::<f64, M>::from_fn(|part, _| residuals[part][index]);
                    *log += normaliser - 0.5 * (whitener * residual).norm_squared();
                }
            }
        })
    }
}

impl Found {
    fn new(prior: Estimate<2>) -> Result<Self, EstimatorError> {
        let singular = EstimatorError::NotPositiveDefinite { role: Role::Prior };
        let factor = prior.covariance.cholesky().ok_or(singular)?.unpack();
        let whitener = factor.solve_lower_triangular(&Matrix2::identity()).ok_or(singular)?;
        Ok(Self {
            prior,
            whitener,
            search_at: 1,
            modes: Vec::new(),
            cells: Vec::new(),
            belief: prior,
            log_evidence: 0.0,
        })
    }

    /// The cells of a window with the logarithm of prior and likelihood at each.
    fn weigh(&self, add: &LogLikelihoods<'_>, window: &Window, side: usize) -> Vec<Cell> {
        let share = |n: usize| (2.0 * count(n) + 1.0) / count(side) - 1.0;
        let places: Vec<Vector2<f64>> = (0..side * side)
            .map(|index| Vector2::new(share(index % side), share(index / side)))
            .map(|off| window.middle + window.half_sides * off)
            .collect();
        let columns = [0, 1].map(|axis| places.iter().map(|at| at[axis]).collect::<Vec<f64>>());
        let log_root = libm::log(self.whitener.determinant()) - libm::log(TAU);
        let prior = |at: &Vector2<f64>| {
            log_root - 0.5 * (self.whitener * (at - self.prior.mean)).norm_squared()
        };
        let mut logs: Vec<f64> = places.iter().map(prior).collect();
        add([columns[0].as_slice(), columns[1].as_slice()], &mut logs);
        places.into_iter().zip(logs).collect()
    }

    /// The prior's area.
    fn area(&self) -> Window {
        let eigen = self.prior.covariance.symmetric_eigen();
        let half = eigen.eigenvalues.map(|variance| AREA * variance.max(0.0).sqrt());
        let half_sides = eigen.eigenvectors * Matrix2::from_diagonal(&half);
        Window { middle: self.prior.mean, half_sides }
    }

    /// The highest of the area's maxima, each with the cells about it.
    fn maxima(&self, add: &LogLikelihoods<'_>) -> Vec<Window> {
        let area = self.area();
        let cells = self.weigh(add, &area, SEARCHED);
        let maxima = peaks(&cells, SEARCHED, MAXIMA);
        let half_sides = area.half_sides * (4.0 / count(SEARCHED));
        maxima.into_iter().map(|(middle, _)| Window { middle, half_sides }).collect()
    }

    /// Lays a window about a maximum so that it holds next to all of what is about it; and the
    /// logarithm of the density there.
    fn enclose(&self, add: &LogLikelihoods<'_>, mut window: Window) -> (Window, f64) {
        let mut highest = f64::NEG_INFINITY;
        for _ in 0..LAYOUTS {
            let cells = self.weigh(add, &window, ENCLOSED);
            let most = cells.iter().fold(f64::NEG_INFINITY, |most, (_, log)| most.max(*log));
            if !most.is_finite() {
                break;
            }
            highest = highest.max(most);
            let own = moments(cells.iter().map(|(at, log)| (*at, libm::exp(log - most))));
            let next = window.about(&own, &cells, most);
            let moved = window.half_sides.try_inverse().map_or(0.0, |inverse| {
                let off = (inverse * (next.middle - window.middle)).amax();
                let sizes =
                    inverse * next.half_sides * next.half_sides.transpose() * inverse.transpose();
                off.max((sizes - Matrix2::identity()).amax())
            });
            window = next;
            if moved < 0.15 {
                break;
            }
        }
        (window, highest)
    }

    /// Finds the maxima that count, and the cells about them with their share of the mass.
    fn solve(
        &mut self,
        observations: usize,
        add: &LogLikelihoods<'_>,
    ) -> Result<(), EstimatorError> {
        let mut starts = std::mem::take(&mut self.modes);
        if observations >= self.search_at {
            self.search_at = 2 * observations;
            starts.extend(self.maxima(add));
        }
        let mut enclosed: Vec<(Window, f64)> =
            starts.into_iter().map(|start| self.enclose(add, start)).collect();
        enclosed.sort_by(|a, b| b.1.total_cmp(&a.1));
        let best = enclosed.first().map_or(f64::NEG_INFINITY, |(_, log)| *log);
        if !best.is_finite() {
            return Err(EstimatorError::NotFinite { role: Role::Posterior });
        }
        let (mut modes, mut cells): (Vec<Window>, Vec<Cell>) = Default::default();
        for (window, log) in enclosed {
            let known = |at: &Vector2<f64>| modes.iter().any(|mode| mode.holds(at));
            if log < best - BEHIND || known(&window.middle) {
                continue;
            }
            let area = 4.0 * window.half_sides.determinant().abs();
            let log_cell = libm::log(area) - 2.0 * libm::log(count(WEIGHED));
            let own = self.weigh(add, &window, WEIGHED).into_iter();
            // What another window holds as well counts once.
            let own: Vec<_> = own.filter(|(at, _)| !known(at)).collect();
            cells.extend(own.into_iter().map(|(at, log)| (at, log + log_cell)));
            modes.push(window);
        }
        let most = cells.iter().fold(f64::NEG_INFINITY, |most, (_, log)| most.max(*log));
        let mut sum = 0.0;
        for (_, log) in &mut cells {
            *log = libm::exp(*log - most);
            sum += *log;
        }
        cells.iter_mut().for_each(|(_, weight)| *weight /= sum);
        cells.retain(|(_, weight)| *weight > 1e-9);
        let Some(first) = modes.first() else {
            return Err(EstimatorError::NotFinite { role: Role::Posterior });
        };
        // A power of the density has its mean near the maximum, wherever that is between cells.
        let sharp = |(at, weight): &(Vector2<f64>, f64)| (*at, weight.powi(SHARPENED));
        let about = cells.iter().filter(|(at, _)| first.holds(at)).map(sharp);
        let place = moments(about).mean;
        let whole = moments(cells.iter().copied());
        let away = whole.mean - place;
        let covariance = whole.covariance + away * away.transpose();
        let belief = Estimate { mean: place, covariance };
        if belief.covariance.cholesky().is_none() || !belief.mean.iter().all(|c| c.is_finite()) {
            return Err(EstimatorError::NotPositiveDefinite { role: Role::Posterior });
        }
        (self.modes, self.cells, self.belief) = (modes, cells, belief);
        self.log_evidence = most + libm::log(sum);
        Ok(())
    }
}

impl Window {
    /// Returns true if it holds a place.
    fn holds(&self, place: &Vector2<f64>) -> bool {
        let inverse = self.half_sides.try_inverse();
        inverse.is_some_and(|inverse| (inverse * (place - self.middle)).amax() <= 1.0)
    }

    /// Returns the window about the moments of its own cells, from [`SHRINK`] to [`GROW`] times as
    /// large; it grows where there is something at its border.
    fn about(&self, own: &Estimate<2>, cells: &[(Vector2<f64>, f64)], most: f64) -> Self {
        let spacing = self.half_sides * (2.0 / count(ENCLOSED));
        let covariance = own.covariance + spacing * spacing.transpose() / 12.0;
        let eigen = covariance.symmetric_eigen();
        let mut half_sides = Matrix2::zeros();
        for axis in 0..2 {
            let direction = eigen.eigenvectors.column(axis).into_owned();
            let wanted = REACH * eigen.eigenvalues[axis].max(0.0).sqrt();
            let now = (self.half_sides.transpose() * direction).amax();
            let reached = cells
                .iter()
                .filter(|(_, log)| *log > most - NEGLIGIBLE)
                .map(|(at, _)| (at - own.mean).dot(&direction).abs())
                .fold(0.0, f64::max);
            let half = wanted.max(reached).clamp(SHRINK * now, GROW * now);
            half_sides.set_column(axis, &(direction * half));
        }
        Self { middle: own.mean, half_sides }
    }
}

/// Mean and covariance of weighted places, whose weights need not sum to 1.
fn moments(places: impl Iterator<Item = (Vector2<f64>, f64)> + Clone) -> Estimate<2> {
    let total: f64 = places.clone().map(|(_, weight)| weight).sum();
    let mean = places.clone().map(|(at, weight)| at * weight).sum::<Vector2<f64>>() / total;
    let covariance = places.fold(Matrix2::zeros(), |sum, (at, weight)| {
        sum + (at - mean) * (at - mean).transpose() * (weight / total)
    });
    Estimate { mean, covariance }
}

/// A small number of things as a number.
fn count(things: usize) -> f64 {
    f64::from(u32::try_from(things).unwrap_or(u32::MAX))
}

impl<const M: usize> Estimator<2, M> for RecalledGrid<M> {
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let mut next = self.clone();
        next.data.push(*observation);
        next.solve()?;
        let log_evidence = next.found.log_evidence - self.found.log_evidence;
        *self = next;
        Ok(Correction::Fused { nis: None, log_evidence, effective_sample_size: None })
    }

    fn estimate(&self) -> Estimate<2> {
        self.found.belief
    }

    fn quantities(&self) -> [Quantity; M] {
        self.model.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<2>, f64)) {
        if self.found.cells.is_empty() {
            return foxhunt_core::visit_cubature_points(&self.found.belief, visit);
        }
        self.found.cells.iter().for_each(|(place, weight)| visit(place, *weight));
    }
}
