use foxhunt_core::{ReceptionView, Receptions};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::{
    super::{Area, LocateConfig, Located, Power, loss_db},
    shared::UNSTATED_SIGMA_M,
};

/// Level by which places are compared.
#[derive(Clone, Copy)]
pub(super) struct LevelAt {
    /// Index of the reception.
    pub reception: usize,
    pub level: f64,
    pub receiver: Vector3<f64>,
    /// σ of the receiver's own place on each axis, in metres.
    pub receiver_sigma_m: f64,
}

impl LevelAt {
    pub(super) fn new(reception: usize, received: &ReceptionView<'_>, level: f64) -> Self {
        let sigma = received.kind.receiver_sigma_m;
        Self {
            reception,
            level,
            receiver: received.position,
            receiver_sigma_m: sigma.map_or(UNSTATED_SIGMA_M, |sigma| sigma.x.max(sigma.y)),
        }
    }

    /// Returns one level in `stride`.
    pub(super) fn of(
        receptions: &Receptions,
        stride: usize,
    ) -> impl Iterator<Item = Self> + use<'_> {
        let level = |(reception, received): (usize, ReceptionView<'_>)| {
            Some(Self::new(reception, &received, received.level_dbm()?))
        };
        receptions.views().enumerate().filter_map(level).step_by(stride)
    }
}

/// Returns levels as they are for a transmitter at a place.
pub(super) fn rows_at<'a>(
    levels: impl IntoIterator<Item = &'a LevelAt>,
    place: &Vector2<f64>,
    config: &LocateConfig,
) -> Vec<Row> {
    levels.into_iter().map(|level| Row::new(level, place, config)).collect()
}

/// Fewer levels than this do not show that another place fits better.
pub(super) const LEAST_TO_COMPARE: usize = 40;

/// Largest number of levels at which places are compared.
pub(super) const MOST_TO_COMPARE: usize = 400;

/// Returns the places of a square lattice, `reach` steps on each side of its middle.
pub(super) fn square_about(middle: Vector2<f64>, step: f64, reach: i32) -> Vec<Vector2<f64>> {
    let mut places = Vec::new();
    for x in -reach..=reach {
        for y in -reach..=reach {
            places.push(middle + Vector2::new(f64::from(x), f64::from(y)) * step);
        }
    }
    places
}

/// Returns the place of least cost about an area's centre, and that cost: of `reach` cells on each
/// side of it, and of finer ones about the best. A place without a cost is skipped.
pub(super) fn best_place(
    area: &Area,
    start: &Vector2<f64>,
    reach: i32,
    cost: impl Fn(&Vector2<f64>) -> Option<f64>,
) -> (Vector2<f64>, f64) {
    let mut best = (*start, cost(start).unwrap_or(f64::INFINITY));
    let (mut middle, half) = area.square();
    let mut step = half / f64::from(reach);
    for reach in [reach, 2, 2, 2] {
        for place in square_about(middle, step, reach) {
            if let Some(cost) = cost(&place)
                && cost < best.1
            {
                best = (place, cost);
            }
        }
        middle = best.0;
        step *= 0.4;
    }
    best
}

/// Returns the residuals of levels from the law that fits them.
pub(super) fn residuals(rows: &[Row], config: &LocateConfig) -> Option<Vec<f64>> {
    let law = Law::of(rows, config)?;
    Some(rows.iter().map(|row| law.residual(row)).collect())
}

/// Returns the ratio of the mean squares of residuals, elsewhere over here, where σ is their
/// spread, and twice the logarithm of the likelihood ratio. Residuals beyond 4 σ count as that
/// much, so that fading and outliers decide nothing; neighbours that shadowing makes alike count
/// for fewer.
pub(super) fn gain(here: &[f64], elsewhere: &[f64], sigma_db: f64) -> (f64, f64) {
    let limit = (4.0 * sigma_db).powi(2);
    let sum = |residuals: &[f64]| residuals.iter().map(|r| (r * r).min(limit)).sum::<f64>();
    let least = sum(here).max(f64::MIN_POSITIVE);
    let ratio = sum(elsewhere) / least;
    let pairs = here.iter().zip(here.iter().skip(1));
    let product: f64 = pairs.map(|(a, b)| (a * b).clamp(-limit, limit)).sum();
    let alike = (product / least).clamp(0.0, 0.99);
    let count = f64::from(u32::try_from(here.len()).unwrap_or(u32::MAX));
    (ratio, count * (1.0 - alike) / (1.0 + alike) * libm::log(ratio))
}

/// 1.4826 times the median of the absolute residuals: σ of a normal distribution.
pub(super) fn spread(residuals: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = residuals.map(f64::abs).collect();
    let half = sizes.len() / 2;
    if half >= sizes.len() {
        return 0.0;
    }
    let (_, median, _) = sizes.select_nth_unstable_by(half, f64::total_cmp);
    1.4826 * *median
}

/// Level as it is for a transmitter at a place.
pub(super) struct Row {
    level: f64,
    /// Level of a transmitter of 0 dBm at one metre with an exponent of 1, in dB.
    loss: f64,
}

impl Row {
    pub(super) fn of(at: &LevelAt, loss: f64) -> Self {
        Self { level: at.level, loss }
    }

    pub(super) fn new(at: &LevelAt, place: &Vector2<f64>, config: &LocateConfig) -> Self {
        Self::of(at, loss_db(&(place.push(config.target_up_m) - at.receiver)))
    }
}

/// Log-distance law that fits levels, with the spread of the residuals.
pub(super) struct Law {
    reference_dbm: f64,
    pub exponent: f64,
    pub exponent_sigma: f64,
    pub is_fitted: bool,
    pub sigma_db: f64,
}

impl Law {
    pub(super) fn residual(&self, row: &Row) -> f64 {
        row.level - self.reference_dbm - self.exponent * row.loss
    }

    /// Returns σ of a level with the errors of the transmitter's and the receiver's places.
    pub(super) fn sigma_with_place(
        &self,
        at: &LevelAt,
        located: &Located,
        config: &LocateConfig,
    ) -> f64 {
        // Near the transmitter a small error of its place is a large one of the level.
        let way = located.estimate.mean.push(config.target_up_m) - at.receiver;
        let range = way.norm().max(1.0);
        let slope = way.xy() * (10.0 / (std::f64::consts::LN_10 * range * range)) * self.exponent;
        let own = at.receiver_sigma_m.powi(2) * slope.norm_squared();
        let of_place = slope.dot(&(located.estimate.covariance * slope)).max(0.0) + own;
        (self.sigma_db.powi(2) + of_place).sqrt()
    }

    /// Least squares of intercept and exponent as far as they are unknown, then again without the
    /// levels beyond 4 σ of a robust spread.
    pub(super) fn of(rows: &[Row], config: &LocateConfig) -> Option<Self> {
        let mut law = Self::fit(rows.iter(), config)?;
        for _ in 0..2 {
            law.sigma_db = law.spread(rows);
            let limit = 4.0 * law.sigma_db.max(1.0);
            let kept = rows.iter().filter(|row| law.residual(row).abs() <= limit);
            law = Self::fit(kept, config)?;
        }
        law.sigma_db = law.spread(rows).max(1.0);
        Some(law)
    }

    /// [`spread`] of the residuals.
    pub(super) fn spread(&self, rows: &[Row]) -> f64 {
        spread(rows.iter().map(|row| self.residual(row)))
    }

    pub(super) fn fit<'a>(
        rows: impl Iterator<Item = &'a Row> + Clone,
        config: &LocateConfig,
    ) -> Option<Self> {
        let count = f64::from(u32::try_from(rows.clone().count()).ok()?);
        let mean = |of: fn(&Row) -> f64| rows.clone().map(of).sum::<f64>() / count;
        let mean_level = mean(|row| row.level);
        let mean_loss = mean(|row| row.loss);
        let known = |reference_dbm, exponent| Self {
            reference_dbm,
            exponent,
            exponent_sigma: 0.0,
            is_fitted: false,
            sigma_db: 0.0,
        };
        match config.power {
            Power::Known { reference_dbm, exponent } => Some(known(reference_dbm, exponent)),
            // The law's error is common to all levels, which the mean takes off.
            Power::Calibrated(_) => {
                let exponent = config.power.exponent();
                Some(known(mean_level - exponent * mean_loss, exponent))
            }
            Power::FreeReference { exponent } => {
                Some(known(mean_level - exponent * mean_loss, exponent))
            }
            Power::Free => {
                let moments = rows.clone().fold(Matrix2::zeros(), |sum: Matrix2<f64>, row| {
                    let apart = Vector2::new(row.loss - mean_loss, row.level - mean_level);
                    sum + apart * apart.transpose()
                });
                let [spread, product, total] = [moments.m11, moments.m12, moments.m22];
                if spread <= 1e-9 * count || count < 4.0 {
                    return None;
                }
                let exponent = product / spread;
                let left = (total - exponent * product).max(0.0) / (count - 2.0);
                Some(Self {
                    exponent_sigma: (left / spread).sqrt(),
                    is_fitted: true,
                    ..known(mean_level - exponent * mean_loss, exponent)
                })
            }
        }
    }
}
