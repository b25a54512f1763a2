use alloc::vec::Vec;

use foxhunt_core::{
    Correction, Covariance, Estimate, Estimator, EstimatorError, Observation, Pose, Quantity, Role,
    State, parameter::positive,
};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use crate::{Gaussian, count::number, peaks};

/// Estimator of the place of a source of unknown strength and orientation whose field at a receiver
/// is linear in its moment, as a magnetic dipole's is: z = ± G(place) m + noise. The sign of each
/// measurement is unknown.
///
/// At each place the moment is a Gaussian that is integrated out, and the signs that the moment
/// explains best are found in turns with it. The remaining density over places is kept on a grid
/// about each of its maxima that covers it. So nothing is linearised, and no start has to be
/// guessed. After each observation all grids are weighed again; the prior's area is searched as a
/// whole whenever there are twice as many observations.
///
/// The belief is about a target that stays. Its receiver's own place is taken for known.
#[derive(Clone, Debug)]
pub struct MomentGrid<F> {
    prior: Gaussian<2>,
    moment_sigma: f64,
    quantities: [Quantity; 3],
    field: F,
    data: Vec<Datum>,
    /// Number of observations at which the whole area is searched again.
    search_at: usize,
    modes: Vec<Window>,
    cells: Vec<(Vector2<f64>, f64)>,
    belief: Estimate<2>,
    log_evidence: f64,
}

/// An observation in units of its noise.
#[derive(Clone, Debug)]
struct Datum {
    receiver: Pose,
    whitened: Vector3<f64>,
    /// L⁻¹ of its noise L Lᵀ, without the rows of what is missing.
    whitener: Matrix3<f64>,
    /// The logarithm of the noise's normaliser.
    log_normaliser: f64,
}

/// A part of the plane about a maximum.
#[derive(Clone, Copy, Debug)]
struct Window {
    middle: Vector2<f64>,
    half: Vector2<f64>,
}

/// Half-extent of the area, in standard deviations of the prior.
const REACH: f64 = 4.0;
/// Cells to a side where the whole area is searched, where a maximum is enclosed, and at the end.
const SEARCHED: usize = 48;
const ENCLOSED: usize = 11;
const WEIGHED: usize = 33;
/// Largest number of maxima that are followed.
const MAXIMA: usize = 6;
/// Gaps (nats) below the maximum at which cells (5 σ) and other maxima (3e-7) are left out.
const NEGLIGIBLE: f64 = 12.5;
const BEHIND: f64 = 15.0;
/// Largest number of times that a window is moved or narrowed.
const MOVES: usize = 60;
/// Largest number of times that signs are decided again.
const TURNS: usize = 4;

impl<F> MomentGrid<F>
where
    F: Fn(&Vector2<f64>, &Pose) -> Matrix3<f64>,
{
    /// A prior of the place; σ of each of the moment's components, about 0; what is measured; and
    /// G, the field that a place and a receiver's pose have for each unit of the moment.
    ///
    /// # Errors
    ///
    /// An error when the prior is not finite and positive definite, or σ not a positive number.
    pub fn new(
        prior: Estimate<2>,
        moment_sigma: f64,
        quantities: [Quantity; 3],
        field: F,
    ) -> Result<Self, EstimatorError> {
        let moment_sigma = positive("moment_sigma", moment_sigma)?;
        Ok(Self {
            prior: Gaussian::new(prior, Role::Prior)?,
            moment_sigma,
            quantities,
            field,
            data: Vec::new(),
            search_at: 1,
            modes: Vec::new(),
            cells: Vec::new(),
            belief: prior,
            log_evidence: 0.0,
        })
    }

    /// The logarithm of prior and likelihood at a place, the moment integrated out.
    fn log_density(&self, place: &Vector2<f64>, scratch: &mut Vec<Matrix3<f64>>) -> f64 {
        scratch.clear();
        let mut information =
            Matrix3::from_diagonal_element(1.0 / (self.moment_sigma * self.moment_sigma));
        let mut weighted = Vector3::zeros();
        let mut squares = 0.0;
        let mut normalisers = 0.0;
        // One after the other, each with the sign that those before it explain.
        for datum in &self.data {
            let field = datum.whitener * (self.field)(place, &datum.receiver);
            let sign = information
                .cholesky()
                .map_or(1.0, |root| sign((field * root.solve(&weighted)).dot(&datum.whitened)));
            information += field.transpose() * field;
            weighted += field.transpose() * datum.whitened * sign;
            squares += datum.whitened.norm_squared();
            normalisers += datum.log_normaliser;
            scratch.push(field);
        }
        let Some(root) = information.cholesky() else { return f64::NEG_INFINITY };
        for _ in 0..TURNS {
            let moment = root.solve(&weighted);
            let anew =
                self.data.iter().zip(&*scratch).fold(Vector3::zeros(), |sum, (datum, field)| {
                    let sign = sign((field * moment).dot(&datum.whitened));
                    sum + field.transpose() * datum.whitened * sign
                });
            if anew == weighted {
                break;
            }
            weighted = anew;
        }
        let explained = weighted.dot(&root.solve(&weighted));
        let log_root: f64 = root.l_dirty().diagonal().iter().map(|d| libm::log(*d)).sum();
        let volume = -log_root - 3.0 * libm::log(self.moment_sigma);
        self.log_prior(place) - 0.5 * (squares - explained) + volume + normalisers
    }

    fn log_prior(&self, place: &Vector2<f64>) -> f64 {
        let factor = self.prior.factor();
        let off = factor.solve_lower_triangular_unchecked(&(place - self.prior.mean()));
        let log_root: f64 = factor.diagonal().iter().map(|d| libm::log(*d)).sum();
        -0.5 * off.norm_squared() - log_root - libm::log(core::f64::consts::TAU)
    }

    /// The density at the cells of a window, row by row from the South.
    fn weigh(&self, window: &Window, side: usize) -> Vec<(Vector2<f64>, f64)> {
        let mut scratch = Vec::with_capacity(self.data.len());
        let share = |n: usize| (2.0 * number(n) + 1.0) / number(side) - 1.0;
        let mut cells = Vec::with_capacity(side * side);
        for row in 0..side {
            for column in 0..side {
                let off = Vector2::new(share(column), share(row)).component_mul(&window.half);
                let place = window.middle + off;
                cells.push((place, self.log_density(&place, &mut scratch)));
            }
        }
        cells
    }

    fn area(&self) -> Window {
        let Estimate { mean, covariance } = *self.prior.estimate();
        Window {
            middle: mean,
            half: covariance.diagonal().map(|variance| REACH * libm::sqrt(variance)),
        }
    }

    /// The strongest of the area's maxima, each with the cells about it.
    fn maxima(&self) -> Vec<Window> {
        let area = self.area();
        let cells = self.weigh(&area, SEARCHED);
        let maxima = peaks(&cells, SEARCHED, MAXIMA);
        let half = area.half * (2.0 / number(SEARCHED));
        maxima.into_iter().map(|(middle, _)| Window { middle, half }).collect()
    }

    /// A window that holds a maximum and next to all of what is about it.
    fn enclose(&self, mut window: Window) -> (Window, f64) {
        let area = self.area();
        let mut highest = f64::NEG_INFINITY;
        for _ in 0..MOVES {
            let cells = self.weigh(&window, ENCLOSED);
            let top = cells.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((place, most)) = top.copied() else { break };
            highest = highest.max(most);
            let spacing = window.half * (2.0 / number(ENCLOSED));
            let mut low = place;
            let mut high = place;
            for (place, _) in cells.iter().filter(|(_, value)| *value > most - NEGLIGIBLE) {
                low = low.inf(place);
                high = high.sup(place);
            }
            // One cell more on each side; half of the window where something reaches its border.
            let inner = window.half - spacing;
            let margin = Vector2::from_fn(|axis, _| {
                let reach = (high - window.middle).sup(&(window.middle - low))[axis];
                if reach > inner[axis] { window.half[axis] / 2.0 } else { spacing[axis] }
            });
            let next = Window {
                middle: (low + high) / 2.0,
                half: ((high - low) / 2.0 + margin).inf(&area.half),
            };
            let moved = (next.middle - window.middle).component_div(&window.half).amax();
            // What is a little too wide stays: narrower, it would be at its border again.
            let ratio = next.half.component_div(&window.half);
            if moved < 0.1 && ratio.iter().all(|ratio| (0.7..1.15).contains(ratio)) {
                break;
            }
            window = next;
        }
        (window, highest)
    }

    /// The maxima that count, and the cells about them with their share of the mass; and ln p(Z).
    fn solve(&mut self) -> Result<(), EstimatorError> {
        let mut starts = core::mem::take(&mut self.modes);
        if self.data.len() >= self.search_at {
            self.search_at = 2 * self.data.len();
            starts.extend(self.maxima());
        }
        let mut enclosed: Vec<(Window, f64)> =
            starts.into_iter().map(|start| self.enclose(start)).collect();
        enclosed.sort_by(|a, b| b.1.total_cmp(&a.1));
        let best = enclosed.first().map_or(f64::NEG_INFINITY, |(_, value)| *value);
        if !best.is_finite() {
            return Err(EstimatorError::NotFinite { role: Role::Posterior });
        }
        let mut modes: Vec<Window> = Vec::new();
        let mut cells: Vec<(Vector2<f64>, f64)> = Vec::new();
        for (window, value) in enclosed {
            let inside = |place: &Vector2<f64>| {
                let holds = |mode: &Window| {
                    let off = (place - mode.middle).abs();
                    off.x <= mode.half.x && off.y <= mode.half.y
                };
                modes.iter().any(holds)
            };
            if value < best - BEHIND || inside(&window.middle) {
                continue;
            }
            let log_area = libm::log(4.0 * window.half.x * window.half.y);
            let log_cell = log_area - 2.0 * libm::log(number(WEIGHED));
            let own = self.weigh(&window, WEIGHED).into_iter();
            // What another window holds as well counts once.
            let own: Vec<_> = own.filter(|(place, _)| !inside(place)).collect();
            cells.extend(own.into_iter().map(|(place, value)| (place, value + log_cell)));
            modes.push(window);
        }
        let most = cells.iter().fold(f64::NEG_INFINITY, |most, (_, value)| most.max(*value));
        let mut sum = 0.0;
        for (_, value) in &mut cells {
            *value = libm::exp(*value - most);
            sum += *value;
        }
        cells.retain(|(_, weight)| *weight > 1e-9 * sum);
        let kept: f64 = cells.iter().map(|(_, weight)| weight).sum();
        cells.iter_mut().for_each(|(_, weight)| *weight /= kept);
        let mean = cells.iter().fold(Vector2::zeros(), |mean, (place, w)| mean + place * *w);
        let mut covariance =
            cells.iter().fold(Matrix2::zeros(), |sum: Matrix2<f64>, (place, w)| {
                let off = place - mean;
                sum + off * off.transpose() * *w
            });
        // A cell's own extent.
        if let Some(window) = modes.first() {
            let spacing = window.half * (2.0 / number(WEIGHED));
            covariance += Covariance::from_diagonal(&spacing.map(|d| d * d / 12.0));
        }
        let belief = Estimate { mean, covariance };
        Gaussian::new(belief, Role::Posterior)?;
        (self.modes, self.cells, self.belief) = (modes, cells, belief);
        self.log_evidence = most + libm::log(sum);
        Ok(())
    }
}

fn sign(product: f64) -> f64 {
    if product < 0.0 { -1.0 } else { 1.0 }
}

impl<F> Estimator<2, 3> for MomentGrid<F>
where
    F: Fn(&Vector2<f64>, &Pose) -> Matrix3<f64> + Clone,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)
    }

    fn update(&mut self, observation: &Observation<3>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let mut next = self.clone();
        next.data.push(Datum::new(observation));
        next.solve()?;
        let log_evidence = next.log_evidence - self.log_evidence;
        *self = next;
        Ok(Correction::Fused { nis: None, log_evidence, effective_sample_size: None })
    }

    fn estimate(&self) -> Estimate<2> {
        self.belief
    }

    fn quantities(&self) -> [Quantity; 3] {
        self.quantities
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<2>, f64)) {
        if self.cells.is_empty() {
            return foxhunt_core::visit_cubature_points(&self.belief, visit);
        }
        self.cells.iter().for_each(|(place, weight)| visit(place, *weight));
    }
}

impl Datum {
    fn new(observation: &Observation<3>) -> Self {
        let factor = observation.noise_factor();
        let whitener = factor.solve_lower_triangular_unchecked(&Matrix3::identity());
        let whitener = whitener * observation.strike(Matrix3::identity());
        let present = (0..3).filter(|part| observation.has(*part));
        let log_normaliser = present
            .map(|part| -libm::log(factor[(part, part)]) - 0.5 * libm::log(core::f64::consts::TAU))
            .sum();
        Self {
            receiver: *observation.receiver(),
            whitened: whitener * observation.value(),
            whitener,
            log_normaliser,
        }
    }
}
