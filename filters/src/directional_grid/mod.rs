//! Levels along the boresights of a directional antenna: the errors that are integrated out, and
//! the nodes over which they are.

mod filter;

use alloc::{vec, vec::Vec};
use core::f64::consts::{FRAC_PI_2, TAU};

use foxhunt_core::{
    Estimate,
    elementary::{exp, ln},
    noise::{log_add, log_normal_cdf},
    parameter::{ParameterError, in_range, positive},
};
use nalgebra::Vector2;

use crate::{
    Gaussian,
    count::number,
    vectorised::{Kernel, largest},
};

pub use filter::DirectionalGrid;

/// Reach of the area and of the powers, in standard deviations of the prior.
const REACH: f64 = 4.0;
const POWER_REACH: f64 = 3.5;
/// Cells to a side.
const SIDE: usize = 32;
/// Largest residual, in σ; larger ones are as likely as this one.
const CURVE_END: f64 = 9.0;
const CURVE_STEPS: usize = 1152;

/// Errors of single levels through a directional antenna, which a [`DirectionalGrid`] integrates
/// out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalGridConfig {
    /// σ in dB of the transmitter's power about the power that the levels are of.
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

/// The area that the cells cover, in metres, and the powers, in dB.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window {
    /// East, North, power: from where to where.
    sides: [[f64; 2]; 3],
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

/// The likelihood of a signal over its residual in units of σ.
#[derive(Clone, Debug)]
struct Curves {
    sigma: f64,
    /// The density of a level that is as expected, and that of one of something else.
    received: [f64; 2],
    /// The logarithm of the probability of a miss, in steps.
    missed: Vec<f64>,
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

/// A curve between its steps, `at` from 0 to below the last.
#[inline(always)]
fn read(curve: &[f64], at: f64) -> f64 {
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a small index")]
    let index = at as usize;
    let share = at - number(index);
    curve[index] + share * (curve[index + 1] - curve[index])
}
