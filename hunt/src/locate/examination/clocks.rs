use foxhunt_core::{Reception, Remark};
use nalgebra::Vector2;

use super::{
    super::{Area, LocateConfig, Located, Paths},
    law::{LEAST_TO_COMPARE, Law, Row, best_place, gain, residuals, rows},
};

/// Largest number of levels at which offsets of the clock are compared.
const MOST_TO_COMPARE: usize = 120;

/// Largest offset that is looked for, in seconds, and its share of all that was recorded.
const MOST_S: f64 = 120.0;
const MOST_SHARE: f64 = 0.25;

/// Number of offsets on either side at first.
const OFFSETS: i32 = 12;

/// Rounds about the best offset, each four times as fine.
const FINER: u32 = 3;

/// Twice the logarithm of the likelihood ratio from which on the clocks differ. χ² with one degree
/// of freedom exceeds it once in 16,000, and some twenty offsets are tried.
const DIFFER: f64 = 16.0;

/// χ² with one degree of freedom that a true value exceeds with 5 %.
const LIKELY: f64 = 3.84;

/// Levels at one offset of their clock.
struct Shifted {
    offset_s: f64,
    place: Vector2<f64>,
    residuals: Vec<f64>,
    sigma_db: f64,
    cost: f64,
}

/// Returns a remark if the levels fit the path of the receiver far better where it was some time
/// earlier or later.
pub(super) fn differ(
    located: &Located,
    receptions: &[Reception],
    config: &LocateConfig,
) -> Option<Remark> {
    let levels: Vec<Reception> =
        receptions.iter().filter(|reception| reception.level.is_some()).copied().collect();
    let is_timed = levels.iter().all(|reception| reception.time.is_finite());
    if levels.len() < LEAST_TO_COMPARE || !is_timed {
        return None;
    }
    let paths = Paths::new(&levels);
    let (length_m, duration_s) = paths.extent();
    if !(length_m > 0.0 && duration_s > 0.0) {
        return None;
    }
    let stride = levels.len().div_ceil(MOST_TO_COMPARE);
    let area = Area::about(&levels, config.margin_m);
    let at = |offset_s: f64| {
        let shifted = paths.shifted(offset_s, stride);
        let cost = |place: &Vector2<f64>| cost(&rows(&shifted, place, config, 1), config);
        let (place, cost) = best_place(&area, &located.estimate.mean, 5, cost);
        let residuals = residuals(&rows(&shifted, &place, config, 1), config)?;
        let sigma_db = Law::of(&rows(&shifted, &place, config, 1), config)?.sigma_db;
        cost.is_finite().then_some(Shifted { offset_s, place, residuals, sigma_db, cost })
    };
    let now = at(0.0)?;
    let step_s = (MOST_SHARE * duration_s).min(MOST_S) / f64::from(OFFSETS);
    let coarse = (-OFFSETS..=OFFSETS).filter(|number| *number != 0);
    let mut tried: Vec<Shifted> =
        coarse.filter_map(|number| at(f64::from(number) * step_s)).collect();
    let least = |tried: &[Shifted]| {
        tried.iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).map(|best| best.offset_s)
    };
    let mut finer_s = step_s;
    for _ in 0..FINER {
        let about_s = least(&tried)?;
        let shares = [-0.5, -0.25, 0.25, 0.5];
        tried.extend(shares.iter().filter_map(|share| at(about_s + share * finer_s)));
        finer_s *= 0.25;
    }
    let best_s = least(&tried)?;
    let best = tried.iter().find(|own| own.offset_s.total_cmp(&best_s).is_eq())?;
    let (_, gained) = gain(&best.residuals, &now.residuals, best.sigma_db);
    if gained < DIFFER {
        return None;
    }
    let likely =
        tried.iter().filter(|own| gain(&best.residuals, &own.residuals, best.sigma_db).1 < LIKELY);
    let [from_s, to_s] = likely
        .fold([best_s, best_s], |[from, to], own| [from.min(own.offset_s), to.max(own.offset_s)]);
    let apart_m = (best.place - located.estimate.mean).norm();
    Some(Remark::new(
        "clocks-differ",
        format!(
            "the levels fit the receiver's path far better where it was {:.1} s {} ({:.1} to {:.1} \
             s): the clocks of levels and places seem to differ; add {best_s:.1} to \
             --clock-offset-s (0 unless given), which would move the place by some {apart_m:.0} m",
            best_s.abs(),
            if best_s > 0.0 { "later" } else { "earlier" },
            from_s,
            to_s,
        ),
    ))
}

/// Returns the sum of the squared residuals, each of 4 σ at most, about the law that fits the
/// levels; `None` where they do not fall with the distance.
fn cost(rows: &[Row], config: &LocateConfig) -> Option<f64> {
    let law = Law::fit(rows.iter(), config)?;
    let limit = (4.0 * law.spread(rows).max(1.0)).powi(2);
    let square = |row: &Row| law.residual(row).powi(2).min(limit);
    (law.exponent > 0.0).then(|| rows.iter().map(square).sum())
}
