use std::cell::OnceCell;

use foxhunt_core::{Pose, Receptions};
use foxhunt_filters::{
    ShadowingGridConfig,
    vecchia::{Correlation, Neighbours, Receivers, Whitener},
};
use nalgebra::Vector2;

use super::{
    super::{Area, LocateConfig, Located, area::extent_m, loss_and_dipole},
    law::{
        LEAST_TO_COMPARE, Law, LevelAt, MOST_TO_COMPARE, Row, best_place, residuals, rows_at,
        square_about,
    },
};

/// Earlier levels by which each is whitened.
const NEIGHBOURS: usize = 8;

/// Shares of the variance that are each level's own.
const OWN_SHARES: [f64; 3] = [0.1, 0.3, 0.6];

/// Rounds in which a place is moved to where it is likelier, each with finer steps.
const ROUNDS: u32 = 6;

/// First of these steps, as a share of half the receivers' extent.
const STEP: f64 = 0.06;

/// Step of a round over that of the round before.
pub(super) const FINER_STEP: f64 = 0.6;

/// σ of levels about a law is no less than this, in dB.
const LEAST_SIGMA_DB: f64 = 1.0;

/// Law of levels by the place of a transmitter, for an exponent of 1.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    /// Vertical dipoles on the way, by the exponent.
    dipoles: f64,
    target_up_m: f64,
}

impl Shape {
    /// Returns levels in dB of a transmitter of 0 dBm at one metre.
    pub(super) fn losses(&self, levels: &[LevelAt], place: &Vector2<f64>) -> Vec<f64> {
        let target = place.push(self.target_up_m);
        let loss = |at: &LevelAt| {
            let own_square = at.receiver_sigma_m * at.receiver_sigma_m;
            let [loss, dipole] = loss_and_dipole(&(target - at.receiver), own_square);
            loss + self.dipoles * dipole
        };
        levels.iter().map(loss).collect()
    }
}

/// Levels whose shadowing is alike where they are near each other, and the likelihood of one
/// transmitter that stays, with which other hypotheses are compared.
pub(super) struct Shadowed<'a> {
    /// One level in some, in order.
    pub levels: Vec<LevelAt>,
    pub shape: Shape,
    /// Log-likelihood of one transmitter that stays.
    pub of_one: f64,
    /// Places of that one: the answer's, and the one where levels scatter least.
    places: [Vector2<f64>; 2],
    /// First step about these, in metres.
    step: f64,
    /// The largest log-likelihood about these, once it is asked for.
    of_likeliest: OnceCell<f64>,
    whiteners: Vec<Whitener<NEIGHBOURS>>,
    config: &'a LocateConfig,
}

impl<'a> Shadowed<'a> {
    /// Returns the levels of receptions that all have one; `None` where they are too few, or fit no
    /// law.
    pub(super) fn of(
        levels: &Receptions,
        located: &Located,
        config: &'a LocateConfig,
    ) -> Option<Self> {
        if levels.len() < LEAST_TO_COMPARE {
            return None;
        }
        let stride = levels.len().div_ceil(MOST_TO_COMPARE);
        let own: Vec<LevelAt> = LevelAt::of(levels, stride).collect();
        let scatter = |place: &Vector2<f64>| {
            let law = Law::of(&rows_at(&own, place, config), config)?;
            (law.exponent > 0.0).then_some(law.sigma_db)
        };
        let start = located.estimate.mean;
        let (narrowest, _) = best_place(&Area::about(levels, config.margin_m), &start, 8, scatter);
        let dipoles = located
            .explanation
            .as_ref()
            .and_then(|explanation| Some(explanation.dipoles?.mean / explanation.exponent.mean));
        let mut shadowed = Self {
            whiteners: whiteners(&own, extent_m(levels)),
            levels: own,
            shape: Shape { dipoles: dipoles.unwrap_or_default(), target_up_m: config.target_up_m },
            of_one: f64::NEG_INFINITY,
            places: [start, narrowest],
            step: STEP * Area::about(levels, 0.0).square().1,
            of_likeliest: OnceCell::new(),
            config,
        };
        shadowed.of_one = shadowed.one_at(&start).max(shadowed.one_at(&narrowest));
        shadowed.of_one.is_finite().then_some(shadowed)
    }

    /// Returns the largest log-likelihood of the levels' residuals over the correlations, with the
    /// mean and the variance that fit best.
    pub(super) fn log_likelihood(&self, residuals: &[f64]) -> f64 {
        let each = self.whiteners.iter().map(|own| log_likelihood(own, residuals));
        each.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Returns the log-likelihood of one transmitter where it is likeliest about its places.
    pub(super) fn of_likeliest(&self) -> f64 {
        let about = |place: &Vector2<f64>| {
            let mut best = (*place, self.one_at(place));
            let mut step = self.step;
            for _ in 0..ROUNDS {
                let middle = best.0;
                for place in square_about(middle, step, 2) {
                    let own = self.one_at(&place);
                    if own > best.1 {
                        best = (place, own);
                    }
                }
                step *= FINER_STEP;
            }
            best.1
        };
        let largest = || self.places.iter().map(about).fold(self.of_one, f64::max);
        *self.of_likeliest.get_or_init(largest)
    }

    /// Returns the log-likelihood of one transmitter at a place, with or without its antennas.
    fn one_at(&self, place: &Vector2<f64>) -> f64 {
        let losses = self.shape.losses(&self.levels, place);
        let shaped = self.levels.iter().zip(losses).map(|(at, loss)| Row::of(at, loss));
        let plain = rows_at(&self.levels, place, self.config);
        let likelihood = |rows: Vec<Row>| {
            let residuals = residuals(&rows, self.config);
            residuals.map_or(f64::NEG_INFINITY, |own| self.log_likelihood(&own))
        };
        likelihood(shaped.collect()).max(likelihood(plain))
    }
}

/// Returns the factors of the correlations that levels may have over an extent.
fn whiteners(levels: &[LevelAt], extent_m: f64) -> Vec<Whitener<NEIGHBOURS>> {
    let pose = |at: &LevelAt| Pose { position: at.receiver, ..Pose::default() };
    let poses: Vec<Pose> = levels.iter().map(pose).collect();
    let counts = vec![1.0; poses.len()];
    let near = Neighbours::new(&poses);
    let lengths = ShadowingGridConfig::over(extent_m).correlation_lengths_m;
    let shared = |&length_m: &f64| OWN_SHARES.map(|nugget| Correlation { length_m, nugget });
    // Levels that share nothing have no length.
    let own = lengths.first().map(|&length_m| Correlation { length_m, nugget: 1.0 });
    let all = lengths.iter().flat_map(shared).chain(own);
    let of = Receivers { poses: &poses, counts: &counts };
    all.filter_map(|correlation| Whitener::new(of, &near, correlation)).collect()
}

fn log_likelihood(whitener: &Whitener<NEIGHBOURS>, residuals: &[f64]) -> f64 {
    let mut rows: Vec<[f64; 2]> = residuals.iter().map(|residual| [*residual, 1.0]).collect();
    whitener.whiten(&mut rows);
    let sum = |of: fn(&[f64; 2]) -> f64| rows.iter().map(of).sum::<f64>();
    let product = sum(|[residual, one]| residual * one);
    let ones = sum(|[_, one]| one * one);
    let square = sum(|[residual, _]| residual * residual) - product * product / ones;
    let count = f64::from(u32::try_from(rows.len()).unwrap_or(u32::MAX));
    // Simulated levels without noise fit no place of a search to the digit.
    let variance = (square / count).max(LEAST_SIGMA_DB * LEAST_SIGMA_DB);
    -whitener.half_log_determinant() - 0.5 * (square / variance + count * libm::log(variance))
}
