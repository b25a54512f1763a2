//! The estimator over cells, powers, and the sites that the receiver stayed at.

use alloc::{sync::Arc, vec, vec::Vec};
use core::{f64::consts::TAU, fmt};

use foxhunt_core::{
    Correction, Covariance, Estimate, Estimator, EstimatorError, Observation, Pose, Quantity, Role,
    State,
    elementary::{exp, ln},
};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::{
    CURVE_END, CURVE_STEPS, Curves, DirectionalGridConfig, Integral, Nodes, Received, SIDE, Window,
    read,
};
use crate::{Gaussian, count::number, vectorised::run};

/// Gap (nats) to the maximum beyond which a narrower grid leaves cells and powers out: 5 σ.
const NEGLIGIBLE: f64 = 12.5;
/// Gap (nats) to the maximum within which nothing may lie at a border: 4 σ.
const UNLIKELY: f64 = 8.0;
/// Gap (nats) to the maximum beyond which a cell is ruled out.
const HOPELESS: f64 = 25.0;
/// The grid is rebuilt when it needs less than `NARROWED` of a side, or `WIDENED` of a side more at
/// a border. A side widened at both ends is not narrowed again.
const NARROWED: f64 = 0.45;
const WIDENED: f64 = 0.3;
/// Largest number of rebuilds after one signal.
const LAID_OUT: usize = 12;
/// Number of sites, three drones and one that was just left, that can be added to without going
/// through their signals again.
const OPEN_SITES: usize = 4;

/// Estimator of the place of a transmitter that is received signal by signal, each along a known
/// boresight of a directional antenna: a tag whose pulses are too slow to wait for a turn of many.
///
/// An observation holds a level in dBm and the boresight; a signal that was due and not received is
/// one whose level lay [below](Observation::below) the receiver's floor. With h the level of the
/// place, the likelihood of a level is (1 − ε) (1 − l) N(z; h, σ²) + ε / w, that of a miss
/// (1 − ε) (l + (1 − l) Φ((f − h) / σ)): ε the share of signals of something else, l that of lost
/// ones, f the floor.
///
/// A site distorts a pattern alike for all levels there: they share an offset of h and a turn, and
/// all sites share the power of the transmitter. All three are Gaussian, and are integrated out
/// over nodes (Rao-Blackwell without the Gaussian approximation), so that a hundred pulses of one
/// hover do not pass for a hundred witnesses. The place is a grid over what the belief covers. When
/// the belief has become narrower, the grid is rebuilt from all observations, which are kept.
///
/// The belief is about a target that stays, within four σ of the prior. Its receiver's own place
/// is taken for known.
#[derive(Clone)]
pub struct DirectionalGrid {
    prior: Gaussian<2>,
    config: DirectionalGridConfig,
    levels: Arc<Levels>,
    curves: Option<Curves>,
    sites: Vec<Site>,
    nodes: Nodes,
    /// Over cells and powers: the sum of the sites' log-likelihoods.
    total: Vec<f64>,
    /// True for cells that are not ruled out yet.
    open: Vec<bool>,
    cells: Vec<(Vector2<f64>, f64)>,
    belief: Estimate<2>,
    log_evidence: f64,
}

impl fmt::Debug for DirectionalGrid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DirectionalGrid")
            .field("config", &self.config)
            .field("sites", &self.sites.len())
            .field("belief", &self.belief)
            .finish_non_exhaustive()
    }
}

impl DirectionalGrid {
    /// A prior of the place, and the level in dBm of a place, a receiver's pose and a boresight,
    /// for each of some turns of the antenna's pattern in radians, all of them finite.
    ///
    /// # Errors
    ///
    /// An error when the prior is not finite and positive definite, or the configuration out of
    /// range.
    pub fn new(
        prior: Estimate<2>,
        config: DirectionalGridConfig,
        levels: impl Fn(&Vector2<f64>, &Pose, f64, &[f64], &mut [f64]) + Send + Sync + 'static,
    ) -> Result<Self, EstimatorError> {
        config.check()?;
        let prior = Gaussian::new(prior, Role::Prior)?;
        let nodes = Nodes::over(Window::of(&prior, &config), &config, 1, f64::INFINITY);
        let mut grid = Self {
            belief: *prior.estimate(),
            prior,
            config,
            levels: Arc::new(levels),
            curves: None,
            sites: Vec::new(),
            total: vec![0.0; SIDE * SIDE * nodes.powers],
            open: vec![true; SIDE * SIDE],
            nodes,
            cells: Vec::new(),
            log_evidence: 0.0,
        };
        grid.log_evidence = grid.weigh().log_evidence;
        Ok(grid)
    }

    /// Adds a signal to the log-likelihoods of a site over all nodes.
    fn add(&self, signal: &Signal, curves: &Curves, site: &mut [f64]) {
        let nodes = &self.nodes;
        let offsets = nodes.offset_count();
        let mut levels = vec![0.0; nodes.turns.len()];
        let steps_per_db = number(CURVE_STEPS) / (2.0 * CURVE_END * signal.sigma);
        let middle = number(CURVE_STEPS / 2);
        let last = number(CURVE_STEPS) - 1e-6;
        let each = nodes.turns.len() * offsets;
        for (cell, row) in site.chunks_exact_mut(each).enumerate() {
            if !self.open[cell] {
                continue;
            }
            let place = nodes.place(cell);
            (self.levels)(&place, &signal.receiver, signal.boresight, &nodes.turns, &mut levels);
            for (level, row) in levels.iter().zip(row.chunks_exact_mut(offsets)) {
                let residual = signal.level - level - nodes.first_offset();
                if signal.received {
                    let residual = residual / signal.sigma;
                    let step = nodes.step_db / signal.sigma;
                    run(Received { row, residual, step, densities: curves.received });
                    continue;
                }
                let mut at = middle + residual * steps_per_db;
                for value in row {
                    *value += read(&curves.missed, at.clamp(0.0, last));
                    at -= nodes.step_db * steps_per_db;
                }
            }
        }
    }

    /// The log-likelihoods of a site over cells and powers, its offset and turn integrated out.
    fn integrate(&self, site: &[f64], powers: &mut [f64]) {
        let nodes = &self.nodes;
        let offsets = nodes.offset_count();
        let mut sums = vec![0.0; offsets];
        let log_turns = &nodes.log_turns;
        let offset_weights = &nodes.offsets;
        let each = nodes.turns.len() * offsets;
        let cells = site.chunks_exact(each).zip(powers.chunks_exact_mut(nodes.powers));
        for ((row, powers), _) in cells.zip(&self.open).filter(|(_, open)| **open) {
            run(Integral { row, log_turns, offset_weights, sums: &mut sums, powers });
        }
    }

    /// The log-likelihoods of a site from all of its signals.
    fn likelihood_of(&self, signals: &[Signal]) -> Vec<f64> {
        let mut site = vec![0.0; SIDE * SIDE * self.nodes.turns.len() * self.nodes.offset_count()];
        for signal in signals {
            match &self.curves {
                Some(curves) if curves.is_for(signal.sigma) => self.add(signal, curves, &mut site),
                _ => self.add(signal, &Curves::new(&self.config, signal.sigma), &mut site),
            }
        }
        site
    }

    /// Rebuilds the cells over a window.
    fn lay_out(&mut self, window: Window) {
        let most = self.sites.iter().map(|site| site.signals.len()).max().unwrap_or(1);
        let sigmas = self.sites.iter().flat_map(|site| &site.signals).map(|signal| signal.sigma);
        let sigma = sigmas.fold(f64::INFINITY, f64::min);
        let before =
            core::mem::replace(&mut self.nodes, Nodes::over(window, &self.config, 2 * most, sigma));
        // What was out of the question stays so.
        let is_open = |cell| before.cell(&self.nodes.place(cell)).is_none_or(|at| self.open[at]);
        self.open = (0..SIDE * SIDE).map(is_open).collect();
        self.total = vec![0.0; SIDE * SIDE * self.nodes.powers];
        let mut sites = core::mem::take(&mut self.sites);
        let mut ages: Vec<_> = sites.iter().map(|site| site.last_used).collect();
        ages.sort_unstable_by(|a, b| b.cmp(a));
        let oldest = ages.get(OPEN_SITES - 1).copied().unwrap_or(0);
        for site in &mut sites {
            let nodes = self.likelihood_of(&site.signals);
            site.powers = vec![0.0; self.total.len()];
            self.integrate(&nodes, &mut site.powers);
            self.total.iter_mut().zip(&site.powers).for_each(|(total, own)| *total += own);
            site.nodes = if site.last_used >= oldest { nodes } else { Vec::new() };
        }
        self.sites = sites;
    }

    /// Weighs the cells, and closes cells of negligible weight.
    fn weigh(&mut self) -> Weighed {
        let nodes = &self.nodes;
        let powers = self.nodes.powers;
        let log_area = ln(nodes.spacing.x * nodes.spacing.y);
        let mut logs = Vec::with_capacity(SIDE * SIDE);
        let mut most = f64::NEG_INFINITY;
        for (cell, row) in self.total.chunks_exact(powers).enumerate() {
            let log_prior = if self.open[cell] {
                self.log_prior(&nodes.place(cell))
            } else {
                f64::NEG_INFINITY
            };
            let values = row.iter().zip(&nodes.log_powers).map(|(value, weight)| value + weight);
            most = most.max(log_prior + values.fold(f64::NEG_INFINITY, f64::max));
            logs.push(log_prior);
        }
        let mut of_powers = vec![0.0; powers];
        self.cells.clear();
        let mut sum = 0.0;
        for (cell, row) in self.total.chunks_exact(powers).enumerate() {
            let mut weight = 0.0;
            if self.open[cell] {
                for ((value, log_power), of_power) in
                    row.iter().zip(&nodes.log_powers).zip(&mut of_powers)
                {
                    let density = exp(value + log_power + logs[cell] - most);
                    *of_power += density;
                    weight += density;
                }
            }
            sum += weight;
            self.open[cell] = weight > exp(-HOPELESS);
            self.cells.push((nodes.place(cell), weight));
        }
        let mut extents = [Extent::default(); 3];
        let highest = self.cells.iter().fold(0.0, |most: f64, (_, weight)| most.max(*weight));
        for (cell, (_, weight)) in self.cells.iter().enumerate() {
            extents[0].add(cell % SIDE, weight / highest);
            extents[1].add(cell / SIDE, weight / highest);
        }
        let strongest = of_powers.iter().copied().fold(0.0, f64::max);
        for (power, weight) in of_powers.iter().enumerate() {
            extents[2].add(power, weight / strongest);
        }
        let lengths = [SIDE, SIDE, powers];
        self.cells.iter_mut().for_each(|(_, weight)| *weight /= sum);
        Weighed {
            log_evidence: most + ln(sum) + log_area,
            extent: extents.map(|extent| extent.negligible_outside),
            at_border: core::array::from_fn(|axis| {
                let [first, last] = extents[axis].unlikely_outside;
                [first == 0, last + 1 == lengths[axis]]
            }),
        }
    }

    fn log_prior(&self, place: &Vector2<f64>) -> f64 {
        let factor = self.prior.factor();
        let off = factor.solve_lower_triangular_unchecked(&(place - self.prior.mean()));
        let log_root: f64 = factor.diagonal().iter().map(|d| libm::log(*d)).sum();
        -0.5 * off.norm_squared() - log_root - ln(TAU)
    }

    /// The window that fits the belief, where the present one does not: a wider one where the
    /// belief reaches a border, or one of what counts where that is much less.
    fn better_window(&self, weighed: &Weighed) -> Option<Window> {
        let nodes = &self.nodes;
        let all = Window::of(&self.prior, &self.config);
        let count = [SIDE, SIDE, nodes.powers];
        let spacing = [nodes.spacing.x, nodes.spacing.y, nodes.step_db];
        let mut wider = nodes.window;
        let mut narrower = nodes.window;
        for axis in 0..3 {
            let ([low, high], [least, most]) = (nodes.window.sides[axis], all.sides[axis]);
            let [first, last] = weighed.at_border[axis];
            let over = WIDENED * (high - low);
            wider.sides[axis] = [
                if first { (low - over).max(least) } else { low },
                if last { (high + over).min(most) } else { high },
            ];
            let [from, to] = weighed.extent[axis];
            // Two cells more on each side, whose first is one that counts no more.
            let inner = low + (number(from) - 2.0) * spacing[axis];
            let outer = low + (number(to.min(count[axis] - 1)) + 3.0) * spacing[axis];
            narrower.sides[axis] = [inner.max(low), outer.min(high)];
        }
        let now = |axis| nodes.window.width(axis);
        if (0..3).any(|axis| wider.width(axis) > 1.01 * now(axis)) {
            return Some(wider);
        }
        (0..3).any(|axis| narrower.width(axis) < NARROWED * now(axis)).then_some(narrower)
    }

    /// Adds a signal to the site where the receiver is.
    fn take(&mut self, signal: Signal) {
        if !self.curves.as_ref().is_some_and(|curves| curves.is_for(signal.sigma)) {
            self.curves = Some(Curves::new(&self.config, signal.sigma));
        }
        let used = self.sites.iter().map(|site| site.last_used).max().unwrap_or(0) + 1;
        let place = signal.receiver.position;
        let near = |site: &Site| (site.place - place).norm() <= self.config.site_m;
        let index = self.sites.iter().position(near).unwrap_or_else(|| {
            let powers = vec![0.0; self.total.len()];
            let signals = Vec::new();
            let nodes = Vec::new();
            self.sites.push(Site { place, signals, nodes, powers, last_used: 0 });
            self.sites.len() - 1
        });
        let mut site = self.sites.swap_remove(index);
        site.last_used = used;
        site.signals.push(signal);
        match &self.curves {
            Some(curves) if !site.nodes.is_empty() => self.add(&signal, curves, &mut site.nodes),
            _ => site.nodes = self.likelihood_of(&site.signals),
        }
        self.total.iter_mut().zip(&site.powers).for_each(|(total, own)| *total -= own);
        self.integrate(&site.nodes, &mut site.powers);
        self.total.iter_mut().zip(&site.powers).for_each(|(total, own)| *total += own);
        self.sites.push(site);
        let is_open = |site: &&mut Site| !site.nodes.is_empty();
        if self.sites.iter_mut().filter(is_open).count() > OPEN_SITES {
            let oldest = self.sites.iter_mut().filter(is_open).min_by_key(|site| site.last_used);
            oldest.into_iter().for_each(|site| site.nodes = Vec::new());
        }
    }
}

impl Estimator<2, 2> for DirectionalGrid {
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)
    }

    /// An observation without a boresight, or without level and floor, is empty.
    fn update(&mut self, observation: &Observation<2>) -> Result<Correction, EstimatorError> {
        let received = observation.has(0);
        let level = match received {
            true => Some((observation.value()[0], libm::sqrt(observation.noise()[(0, 0)]))),
            false => observation.upper_limit(0),
        };
        let Some((level, sigma)) = level.filter(|_| observation.has(1)) else {
            return Ok(Correction::Empty);
        };
        let receiver = *observation.receiver();
        let boresight = observation.value()[1];
        self.take(Signal { receiver, boresight, level, sigma, received });
        let mut weighed = self.weigh();
        for _ in 0..LAID_OUT {
            let most = self.sites.iter().map(|site| site.signals.len()).max().unwrap_or(0);
            let coarse = (most > self.nodes.resolved).then_some(self.nodes.window);
            let Some(window) = self.better_window(&weighed).or(coarse) else { break };
            self.lay_out(window);
            weighed = self.weigh();
        }
        let mean = self.cells.iter().fold(Vector2::zeros(), |mean, (place, w)| mean + place * *w);
        let scatter = self.cells.iter().fold(Matrix2::zeros(), |sum, (place, w)| {
            let off = place - mean;
            sum + off * off.transpose() * *w
        });
        // A cell's own extent.
        let own = self.nodes.spacing.map(|side| side * side / 12.0);
        let covariance: Covariance<2> = scatter + Covariance::from_diagonal(&own);
        let belief = Estimate { mean, covariance };
        Gaussian::new(belief, Role::Posterior)?;
        self.belief = belief;
        let log_evidence = weighed.log_evidence - self.log_evidence;
        self.log_evidence = weighed.log_evidence;
        Ok(Correction::Fused { nis: None, log_evidence, effective_sample_size: None })
    }

    fn estimate(&self) -> Estimate<2> {
        self.belief
    }

    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BORESIGHT]
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<2>, f64)) {
        if self.sites.is_empty() {
            return foxhunt_core::visit_cubature_points(&self.belief, visit);
        }
        let counting = self.cells.iter().filter(|(_, weight)| *weight > 1e-9);
        counting.for_each(|(place, weight)| visit(place, *weight));
    }
}

/// The levels of a place, a receiver's pose and a boresight, for some turns of the pattern.
type Levels = dyn Fn(&Vector2<f64>, &Pose, f64, &[f64], &mut [f64]) + Send + Sync;

/// A signal that was received, or missed.
#[derive(Clone, Copy, Debug)]
struct Signal {
    receiver: Pose,
    boresight: f64,
    /// The level, or the floor below which it lay.
    level: f64,
    sigma: f64,
    received: bool,
}

/// Place where the receiver stayed for some time.
#[derive(Clone, Debug)]
struct Site {
    place: Vector3<f64>,
    signals: Vec<Signal>,
    /// Log-likelihood over cells, turns and offsets; empty for a site that was left long ago.
    nodes: Vec<f64>,
    /// Log-likelihood over cells and powers.
    powers: Vec<f64>,
    last_used: usize,
}

/// Result of weighing the cells; columns, rows and powers.
struct Weighed {
    log_evidence: f64,
    /// The first and the last that counts.
    extent: [[usize; 2]; 3],
    /// True if the likely part goes on before the first, and behind the last.
    at_border: [[bool; 2]; 3],
}

/// The first and the last with more than two small shares of the largest weight.
#[derive(Clone, Copy)]
struct Extent {
    negligible_outside: [usize; 2],
    unlikely_outside: [usize; 2],
}

impl Default for Extent {
    fn default() -> Self {
        Self { negligible_outside: [usize::MAX, 0], unlikely_outside: [usize::MAX, 0] }
    }
}

impl Extent {
    fn add(&mut self, at: usize, share: f64) {
        let widen = |[first, last]: &mut [usize; 2]| {
            (*first, *last) = (at.min(*first), at.max(*last));
        };
        if share > exp(-NEGLIGIBLE) {
            widen(&mut self.negligible_outside);
        }
        if share > exp(-UNLIKELY) {
            widen(&mut self.unlikely_outside);
        }
    }
}
