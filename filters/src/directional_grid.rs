use alloc::{sync::Arc, vec, vec::Vec};
use core::{
    f64::consts::{FRAC_PI_2, TAU},
    fmt,
};

use foxhunt_core::{
    Correction, Covariance, Estimate, Estimator, EstimatorError, Observation, Pose, Quantity, Role,
    State,
    elementary::{exp, ln},
    noise::{log_add, log_normal_cdf},
    parameter::{ParameterError, in_range, positive},
};
use nalgebra::{Matrix2, Vector2, Vector3};

use crate::{
    Gaussian,
    count::number,
    vectorised::{Kernel, largest, run},
};

/// Errors of single levels through a directional antenna, which a [`DirectionalGrid`] integrates
/// out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalGridConfig {
    /// σ in dB of the transmitter's power about the one that the levels are of.
    pub power_sigma_db: f64,
    /// σ in dB of the error that all levels at one site have in common.
    pub site_sigma_db: f64,
    /// σ in radians by which a site turns the antenna's pattern.
    pub site_sigma: f64,
    /// Receivers within this distance, in metres, are at one site.
    pub site_m: f64,
    /// The probability that a signal above the receiver's floor is missed all the same.
    pub lost_probability: f64,
    /// The share of levels that are of something else.
    pub false_share: f64,
    /// The span in dB over which these are spread evenly.
    pub false_width_db: f64,
}

impl Default for DirectionalGridConfig {
    /// 10 dB of power, sites of 3 m with 3 dB and 6°, one level in twenty lost, one in fifty of
    /// something else over 60 dB.
    fn default() -> Self {
        Self {
            power_sigma_db: 10.0,
            site_sigma_db: 3.0,
            site_sigma: 6.0_f64.to_radians(),
            site_m: 3.0,
            lost_probability: 0.05,
            false_share: 0.02,
            false_width_db: 60.0,
        }
    }
}

impl DirectionalGridConfig {
    /// Checks the ranges of all settings.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first setting out of its range.
    pub fn check(&self) -> Result<(), ParameterError> {
        // Nodes go so far, and a number from a file must not be able to take all memory.
        in_range("power_sigma_db", self.power_sigma_db, 0.1..=30.0, "from 0.1 to 30")?;
        in_range("site_sigma_db", self.site_sigma_db, 0.0..=20.0, "from 0 to 20")?;
        in_range("site_sigma", self.site_sigma, 0.0..=FRAC_PI_2, "from 0 to π/2")?;
        positive("site_m", self.site_m)?;
        let share = "from 0.0001 to 0.5";
        in_range("lost_probability", self.lost_probability, 1e-4..=0.5, share)?;
        in_range("false_share", self.false_share, 1e-4..=0.5, share)?;
        positive("false_width_db", self.false_width_db)?;
        Ok(())
    }
}

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

/// The levels of a place, a receiver's pose and a boresight, for some turns of the pattern.
type Levels = dyn Fn(&Vector2<f64>, &Pose, f64, &[f64], &mut [f64]) + Send + Sync;

impl fmt::Debug for DirectionalGrid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DirectionalGrid")
            .field("config", &self.config)
            .field("sites", &self.sites.len())
            .field("belief", &self.belief)
            .finish_non_exhaustive()
    }
}

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

/// Nodes of the integration.
#[derive(Clone, Debug)]
struct Nodes {
    window: Window,
    /// A cell's sides, in metres.
    spacing: Vector2<f64>,
    /// The step of powers and offsets, in dB.
    step_db: f64,
    powers: usize,
    /// The logarithms of the weights of the powers.
    log_powers: Vec<f64>,
    /// The turns of a site's pattern in radians, and the logarithms of their weights.
    turns: Vec<f64>,
    log_turns: Vec<f64>,
    /// The weights of a site's offsets, about 0.
    offsets: Vec<f64>,
    /// The most signals of one site that the steps are fine enough for.
    resolved: usize,
}

/// The area that the cells cover, in metres, and the powers, in dB.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window {
    /// East, North, power: from where to where.
    sides: [[f64; 2]; 3],
}

/// The likelihood of a signal over its residual in units of σ.
#[derive(Clone, Debug)]
struct Curves {
    sigma: f64,
    /// The density of a level that is as expected, and that of one of something else.
    received: [f64; 2],
    /// The logarithm of the probability of a miss, in steps.
    missed: Vec<f64>,
}

/// Adds the log-likelihood of a level to nodes whose residuals fall by a step from one to the next.
struct Received<'a> {
    row: &'a mut [f64],
    residual: f64,
    step: f64,
    densities: [f64; 2],
}

impl Kernel for Received<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [as_expected, other] = self.densities;
        for (i, value) in self.row.iter_mut().enumerate() {
            let x = self.residual - number(i) * self.step;
            *value += ln(as_expected * exp(-0.5 * x * x) + other);
        }
    }
}

/// The log-likelihoods of a cell over powers, from those over turns and offsets.
struct Integral<'a> {
    row: &'a [f64],
    log_turns: &'a [f64],
    offset_weights: &'a [f64],
    sums: &'a mut [f64],
    powers: &'a mut [f64],
}

impl Kernel for Integral<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { row, log_turns, offset_weights, sums, powers } = self;
        let most = largest(row);
        sums.fill(0.0);
        for (row, log_weight) in row.chunks_exact(sums.len()).zip(log_turns) {
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum += exp(value - most + log_weight);
            }
        }
        powers.fill(0.0);
        for (first, weight) in offset_weights.iter().enumerate() {
            for (power, sum) in powers.iter_mut().zip(&sums[first..]) {
                *power += weight * sum;
            }
        }
        for power in powers {
            let sum = if *power > 1e-300 { *power } else { 1e-300 };
            *power = most + ln(sum);
        }
    }
}

/// Reach of the area and of the powers, in standard deviations of the prior.
const REACH: f64 = 4.0;
const POWER_REACH: f64 = 3.5;
/// Cells to a side.
const SIDE: usize = 32;
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
/// Largest residual, in σ; larger ones are as likely as this one.
const CURVE_END: f64 = 9.0;
const CURVE_STEPS: usize = 1152;

impl DirectionalGrid {
    /// A prior of the place, and the level in dBm of a place, a receiver's pose and a boresight,
    /// for each of some turns of the antenna's pattern in radians, all of them finite.
    ///
    /// # Errors
    ///
    /// When the prior is not finite and positive definite, or the configuration out of range.
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

    /// Weighs the cells, and closes those that are out of the question.
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

impl Window {
    /// All that the prior covers.
    fn of(prior: &Gaussian<2>, config: &DirectionalGridConfig) -> Self {
        let Estimate { mean, covariance } = *prior.estimate();
        let half = covariance.diagonal().map(|variance| REACH * libm::sqrt(variance));
        let power = POWER_REACH * config.power_sigma_db;
        let [x, y] = [0, 1].map(|axis| [mean[axis] - half[axis], mean[axis] + half[axis]]);
        Self { sides: [x, y, [-power, power]] }
    }

    fn corner(&self) -> Vector2<f64> {
        Vector2::new(self.sides[0][0], self.sides[1][0])
    }

    fn width(&self, axis: usize) -> f64 {
        self.sides[axis][1] - self.sides[axis][0]
    }
}

impl Nodes {
    /// Nodes for sites of up to `signals` signals of σ `sigma` dB or more.
    fn over(window: Window, config: &DirectionalGridConfig, signals: usize, sigma: f64) -> Self {
        // A site's offset and turn are known better with each of its signals.
        let root = libm::sqrt(number(signals.max(1)));
        let step_db = (1.2 * sigma / root).clamp(0.25, 1.5);
        let [low, high] = window.sides[2];
        #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "few steps")]
        let count = |steps: f64| libm::ceil(steps) as usize;
        let powers = count((high - low) / step_db).max(2) + 1;
        let power_sigma = config.power_sigma_db;
        let log_power = |i: usize| {
            let off = (low + number(i) * step_db) / power_sigma;
            -0.5 * off * off - ln(power_sigma) - 0.5 * ln(TAU) + ln(step_db)
        };
        let half = count(3.0 * config.site_sigma_db / step_db);
        let offset = |i: usize| {
            let off = (number(i) - number(half)) * step_db / config.site_sigma_db;
            exp(-0.5 * off * off)
        };
        let mut offsets: Vec<f64> =
            if half == 0 { vec![1.0] } else { (0..=2 * half).map(offset).collect() };
        let sum: f64 = offsets.iter().sum();
        offsets.iter_mut().for_each(|weight| *weight /= sum);
        // Over ± 2.75 σ.
        let beside = if config.site_sigma > 0.0 { count(1.6 * root).clamp(4, 20) } else { 0 };
        let share = |i: usize| 2.75 * (number(i) - number(beside)) / number(beside.max(1));
        let turns: Vec<f64> = (0..=2 * beside).map(|i| share(i) * config.site_sigma).collect();
        let sum: f64 = (0..=2 * beside).map(|i| exp(-0.5 * share(i) * share(i))).sum();
        let log_turns = (0..=2 * beside).map(|i| -0.5 * share(i) * share(i) - ln(sum)).collect();
        Self {
            window,
            spacing: Vector2::new(window.width(0), window.width(1)) / number(SIDE),
            step_db,
            powers,
            log_powers: (0..powers).map(log_power).collect(),
            turns,
            log_turns,
            offsets,
            resolved: signals,
        }
    }

    /// The middle of a cell; cells go row by row from the South.
    fn place(&self, cell: usize) -> Vector2<f64> {
        let at = Vector2::new(number(cell % SIDE) + 0.5, number(cell / SIDE) + 0.5);
        self.window.corner() + at.component_mul(&self.spacing)
    }

    /// The cell that holds a place, if one does.
    fn cell(&self, place: &Vector2<f64>) -> Option<usize> {
        let at = (place - self.window.corner()).component_div(&self.spacing);
        let inside = at.iter().all(|at| (0.0..number(SIDE)).contains(at));
        #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "inside")]
        inside.then(|| at.y as usize * SIDE + at.x as usize)
    }

    /// Number of sums of a power and an offset.
    fn offset_count(&self) -> usize {
        self.powers + self.offsets.len() - 1
    }

    /// The lowest of them, in dB.
    fn first_offset(&self) -> f64 {
        self.window.sides[2][0] - number(self.offsets.len() / 2) * self.step_db
    }
}

impl Curves {
    fn new(config: &DirectionalGridConfig, sigma: f64) -> Self {
        let at = |i: usize| CURVE_END * (2.0 * number(i) / number(CURVE_STEPS) - 1.0);
        let sound = libm::log1p(-config.false_share);
        let lost = libm::log(config.lost_probability);
        let found = libm::log1p(-config.lost_probability);
        let missed = |i| sound + log_add(lost, found + log_normal_cdf(at(i)));
        Self {
            sigma,
            received: [
                libm::exp(sound + found) / (sigma * libm::sqrt(TAU)),
                config.false_share / config.false_width_db,
            ],
            missed: (0..=CURVE_STEPS).map(missed).collect(),
        }
    }

    fn is_for(&self, sigma: f64) -> bool {
        self.sigma.to_bits() == sigma.to_bits()
    }
}

/// A curve between its steps, `at` from 0 to below the last.
#[inline(always)]
fn read(curve: &[f64], at: f64) -> f64 {
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a small index")]
    let index = at as usize;
    let share = at - number(index);
    curve[index] + share * (curve[index + 1] - curve[index])
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
