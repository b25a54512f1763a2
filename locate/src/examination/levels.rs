use std::{borrow::Cow, collections::BTreeSet};

use foxhunt_core::{ReceptionView, Receptions, Remark};
use nalgebra::Vector2;
use statrs::distribution::{ContinuousCDF, Normal};

use super::{
    super::{Area, LocateConfig, Located, Power, clocks::FoundOffset, config::Centroid},
    clocks,
    law::{
        LEAST_TO_COMPARE, Law, LevelAt, MOST_TO_COMPARE, Row, best_place, gain, residuals, rows_at,
    },
    motion, pair,
    paths::Hypotheses,
    residuals::{Measurand, Residual, one_sided, two_sided},
    shadowing::Shadowed,
    shared::{APART, Name, has_law, spoken},
};

/// Fewer levels than this are not examined.
const LEAST: usize = 8;

/// Fewer levels than this have no law of their own.
const LEAST_FOR_LAW: usize = 4;

/// σ of levels about a law in dB, where there are too few to show it.
const USUAL_DB: f64 = 6.0;

/// Probability of a gross outlier among levels that have none.
const OUTLIER_P: f64 = 1e-5;

/// Level that is a gross outlier stands at least so far above the others, in dB.
const LEAST_DB: f64 = 15.0;

/// A level falls this much farther below the others by fading alone, in dB: a fading amplitude is
/// below a share of its mean with the square of that share.
const FADE_DB: f64 = 35.0;

/// Path-loss exponent below which no transmitter's levels fall with the distance.
const LEAST_EXPONENT: f64 = 0.7;

/// Remarks of levels on an answer, and the offset of the clocks where they show it well.
#[derive(Default)]
pub(super) struct Examined {
    pub remarks: Vec<Remark>,
    pub clock_offset: Option<FoundOffset>,
}

/// Examines the residuals of levels from the log-distance law that fits them best at the place.
pub(super) fn examine(
    located: &Located,
    receptions: &Receptions,
    config: &LocateConfig,
    name: Name<'_>,
) -> Examined {
    let left_out = &located.levels_left_out;
    if !left_out.is_empty() {
        let is_kept = |(index, _): &(usize, _)| left_out.binary_search(index).is_err();
        let kept = receptions.iter().enumerate().filter(is_kept).map(|(_, kept)| kept).collect();
        let nameless: Name<'_> = &|_| None;
        let mut examined = examine_kept(located, &kept, config, nameless);
        examined.remarks.retain(|remark| remark.code != "outlier");
        examined.remarks.push(of_left_out(left_out, receptions, name));
        return examined;
    }
    examine_kept(located, receptions, config, name)
}

/// Examines levels that all count.
fn examine_kept(
    located: &Located,
    receptions: &Receptions,
    config: &LocateConfig,
    name: Name<'_>,
) -> Examined {
    let place = located.estimate.mean;
    let rows = every_row(receptions, &place, config);
    let mut kinds = receptions.kinds().iter();
    let is_placed_by_levels = kinds.all(|kind| !kind.has_bearing() && kind.measured.is_empty());
    if rows.len() < LEAST {
        let are_few = is_placed_by_levels && !rows.is_empty();
        let open = are_few.then(|| range_open(located, receptions, config, rows.len()));
        return Examined { remarks: open.flatten().into_iter().collect(), clock_offset: None };
    }
    let Some(law) = Law::of(&rows, config) else { return Examined::default() };
    let levels: Cow<'_, Receptions> = if rows.len() == receptions.len() {
        Cow::Borrowed(receptions)
    } else {
        Cow::Owned(receptions.iter().filter(|r| r.level.is_some()).collect())
    };
    let hypotheses = Hypotheses::new(located, &levels, receptions, config);
    let offset = hypotheses.as_ref().and_then(|own| clocks::differ(located, own));
    let elsewhere = does_not_fit(located, receptions, config, rows.len());
    let is_flat = law.is_fitted && law.exponent + 4.0 * law.exponent_sigma < LEAST_EXPONENT;
    let clock_offset = offset.as_ref().and_then(|own| own.found);
    if is_flat && elsewhere.is_none() && clock_offset.is_none() {
        let remark = Remark::new(
            "levels-do-not-fall",
            format!(
                "the levels do not fall with the distance from the place at {} (exponent {:.1} ± \
                 {:.1}): check the sign and the unit of the levels, and the places of the receiver",
                spoken(&place),
                law.exponent,
                law.exponent_sigma
            ),
        );
        return Examined { remarks: vec![remark], clock_offset: None };
    }
    let open = range_open(located, receptions, config, rows.len()).filter(|_| is_placed_by_levels);
    let of_path = match offset {
        Some(offset) => Some(offset.remark),
        None => moving_or_two(located, &levels, hypotheses.as_ref(), config),
    };
    // Residuals from a place that is wrong, or of a second transmitter, are no outliers.
    let is_one = of_path.as_ref().is_none_or(|remark| remark.code != "two-transmitters");
    let single = || outlier(receptions, &law, located, config, name).filter(|_| is_one);
    let of_row = elsewhere.or_else(single);
    Examined { remarks: of_path.into_iter().chain(of_row).chain(open).collect(), clock_offset }
}

/// Returns a remark if the levels fit a transmitter that moves, or two, far better than one that
/// stays; the likelier if they fit both.
fn moving_or_two(
    located: &Located,
    levels: &Receptions,
    hypotheses: Option<&Hypotheses<'_>>,
    config: &LocateConfig,
) -> Option<Remark> {
    let may_be_two = pair::may_be_two(levels, config);
    if hypotheses.is_none() && !may_be_two {
        return None;
    }
    let shadowed = Shadowed::of(levels, located, config)?;
    let moves = hypotheses.and_then(|own| motion::moves(own, &shadowed));
    let two = may_be_two.then(|| pair::two_transmitters(&shadowed, levels, config)).flatten();
    let likelier = moves.into_iter().chain(two).max_by(|a, b| a.0.total_cmp(&b.0));
    likelier.map(|(_, remark)| remark)
}

/// Returns all levels as they are for a transmitter at a place.
fn every_row(receptions: &Receptions, place: &Vector2<f64>, config: &LocateConfig) -> Vec<Row> {
    LevelAt::of(receptions, 1).map(|level| Row::new(&level, place, config)).collect()
}

/// Returns the residuals of the levels that took part, of silences and of levels at a ceiling, from
/// the log-distance law that fits them best at the place. Empty for fewer than eight levels, which
/// show no law.
pub(super) fn residuals_of_rows(
    located: &Located,
    receptions: &Receptions,
    config: &LocateConfig,
    left_out: &BTreeSet<usize>,
) -> Vec<Residual> {
    let place = located.estimate.mean;
    // Levels that a gate kept out show the law as well as others; gross errors do not.
    let is_gross = |index: &usize| located.levels_left_out.binary_search(index).is_ok();
    let took_part = LevelAt::of(receptions, 1).filter(|level| !is_gross(&level.reception));
    let kept: Vec<Row> = took_part.map(|level| Row::new(&level, &place, config)).collect();
    if kept.len() < LEAST {
        return Vec::new();
    }
    let Some(law) = Law::of(&kept, config) else { return Vec::new() };
    // There may be millions.
    drop(kept);
    let row = |(reception, received): (usize, ReceptionView<'_>)| {
        let level = received.any_level_dbm()?;
        let at = LevelAt::new(reception, &received, level);
        let apart = law.residual(&Row::new(&at, &place, config));
        let sigma = law.sigma_with_place(&at, located, config);
        let (kind, residual, p) = if received.kind.level.is_some() {
            (Measurand::Level, apart, two_sided(apart / sigma))
        } else if received.kind.silence.is_some() {
            (Measurand::Silence, apart.min(0.0), one_sided(-apart / sigma))
        } else {
            (Measurand::Saturation, apart.max(0.0), one_sided(apart / sigma))
        };
        let left_out = left_out.contains(&reception);
        Some(Residual { reception, kind, residual, p, left_out })
    };
    receptions.views().enumerate().filter_map(row).collect()
}

/// Mean square of the residuals over that at the best place from which on the place may not fit.
const WIDER: f64 = 1.2;

/// Returns a remark if the levels scatter far less about the law of another place.
fn does_not_fit(
    located: &Located,
    receptions: &Receptions,
    config: &LocateConfig,
    count: usize,
) -> Option<Remark> {
    if count < LEAST_TO_COMPARE {
        return None;
    }
    let compared: Vec<_> = LevelAt::of(receptions, count.div_ceil(MOST_TO_COMPARE)).collect();
    let spread_at = |place: &Vector2<f64>| {
        let rows = rows_at(&compared, place, config);
        let law = Law::of(&rows, config)?;
        (law.exponent > 0.0).then_some(law.sigma_db)
    };
    let area = Area::about(receptions, config.margin_m);
    let best = best_place(&area, &located.estimate.mean, 8, spread_at);
    let away = best.0 - located.estimate.mean;
    let factor = located.estimate.covariance.cholesky();
    let apart = factor.map_or(f64::INFINITY, |factor| away.dot(&factor.solve(&away)));
    let there = residuals(&rows_at(&compared, &best.0, config), config)?;
    let here = residuals(&rows_at(&compared, &located.estimate.mean, config), config)?;
    let (ratio, gain) = gain(&there, &here, best.1);
    (ratio > WIDER && gain > 2.0 * APART && apart > APART).then(|| {
        Remark::new(
            "does-not-fit",
            format!(
                "the place does not fit the levels: they scatter by {:.1} dB about the law of \
                 propagation, and by {:.1} dB for a transmitter at {}, {:.0} m away; take another \
                 estimator",
                best.1 * ratio.sqrt(),
                best.1,
                spoken(&best.0),
                away.norm()
            ),
        )
    })
}

/// Exponent above which no levels fall with the distance.
const MOST_EXPONENT: f64 = 6.0;

/// χ² with two degrees of freedom that a true value exceeds with 1 %.
const LIKELY: f64 = 9.21;

/// Returns a remark if levels fit a transmitter far away nearly as well as one at the place.
fn range_open(
    located: &Located,
    receptions: &Receptions,
    config: &LocateConfig,
    count: usize,
) -> Option<Remark> {
    // A known power makes a distance of every level.
    let (_, half_m) = Area::about(receptions, 0.0).square();
    let is_known = |law: Centroid| law.sigma_db(FAR * half_m) < KNOWN_LAW_DB;
    if has_law(config) && config.power.centroid().is_none_or(is_known) {
        return None;
    }
    let compared: Vec<_> = LevelAt::of(receptions, count.div_ceil(MOST_TO_COMPARE)).collect();
    let near = rows_at(&compared, &located.estimate.mean, config);
    let open = || {
        Remark::new(
            "range-open",
            "the levels fit a transmitter far away nearly as well as one at this place: they do \
             not fix one; receive nearer to the transmitter, or from places farther apart",
        )
    };
    // A place, a power and an exponent are more unknowns than these.
    if count < LEAST_FOR_LAW && matches!(config.power, Power::Free) {
        return Some(open());
    }
    let sigma_db = Law::of(&near, config)?.sigma_db;
    let here = residuals(&near, config)?;
    let ratio = |there: &[f64]| {
        // The spread of a few levels about a law that is fitted to them is no σ.
        if count < LEAST {
            let sum = |residuals: &[f64]| residuals.iter().map(|r| r * r).sum::<f64>();
            return (sum(there) - sum(&here)) / USUAL_DB.powi(2);
        }
        gain(&here, there, sigma_db).1
    };
    let (centre, half) = Area::about(receptions, 0.0).square();
    let fits = |number: u32| {
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(number) / 16.0);
        let place = centre + Vector2::new(cos, sin) * (FAR * half);
        let law = |power| LocateConfig { power, ..config.clone() };
        let rows = rows_at(&compared, &place, config);
        let exponent = match config.power {
            Power::Free => Law::of(&rows, config).map_or(0.0, |law| law.exponent),
            Power::FreeReference { .. } | Power::Known { .. } | Power::Calibrated(_) => {
                config.power.exponent()
            }
        };
        let power = Power::FreeReference { exponent: exponent.clamp(0.0, MOST_EXPONENT) };
        let there = residuals(&rows, &law(power))?;
        Some(ratio(&there))
    };
    let gains = (0..16).filter_map(fits);
    let least = gains.fold(f64::INFINITY, f64::min);
    (least < LIKELY).then(open)
}

/// σ in dB of a calibrated law far away below which it makes a distance of every level.
const KNOWN_LAW_DB: f64 = 3.0;

/// Distance of a transmitter far away, in half sides of the receivers' square.
const FAR: f64 = 6.0;

/// Number of levels that a remark names.
const MOST_NAMED: usize = 3;

/// Returns a remark on the levels that the estimator left out.
fn of_left_out(left_out: &[usize], receptions: &Receptions, name: Name<'_>) -> Remark {
    let level = |index: &usize| {
        let named = name(*index).unwrap_or_else(|| format!("reception {}", index + 1));
        let level = receptions.get(*index).and_then(|reception| reception.any_level());
        level.map_or(named.clone(), |level| format!("{named} ({:.1} dBm)", level.rss_dbm))
    };
    let count = left_out.len();
    let named: Vec<String> = left_out.iter().take(MOST_NAMED).map(level).collect();
    let more = if count > MOST_NAMED { " and others" } else { "" };
    let text = format!(
        "{count} of {} levels stand far from what was received beside them, above and below, and \
         were left out: {}{more}; look at the receiver, its clock and its places",
        receptions.views().filter(|view| view.any_level_dbm().is_some()).count(),
        named.join(", "),
    );
    Remark::new("outlier", text)
}

/// Returns a remark on the level that lies farthest from all others, if no fading does that.
fn outlier(
    receptions: &Receptions,
    law: &Law,
    located: &Located,
    config: &LocateConfig,
    name: Name<'_>,
) -> Option<Remark> {
    let levels = || LevelAt::of(receptions, 1);
    let count = f64::from(u32::try_from(levels().count()).unwrap_or(u32::MAX));
    let normal = Normal::new(0.0, 1.0).ok()?;
    let most = -normal.inverse_cdf(OUTLIER_P / count);
    let place = &located.estimate.mean;
    let residual = |level: &LevelAt| law.residual(&Row::new(level, place, config));
    let excess = |level: &LevelAt| {
        let residual = residual(level);
        let sigma = law.sigma_with_place(level, located, config);
        let limit = if residual > 0.0 {
            (most * sigma).max(LEAST_DB)
        } else {
            (most * sigma).max(FADE_DB + 10.0 * libm::log10(count))
        };
        residual.abs() / limit
    };
    let excesses = levels().map(|level| (excess(&level), level));
    let (most, worst) = excesses.max_by(|a, b| a.0.total_cmp(&b.0))?;
    if most <= 1.0 {
        return None;
    }
    let residual = residual(&worst);
    let side = if residual > 0.0 { "above" } else { "below" };
    let named = name(worst.reception).map(|row| format!("the level of {row}"));
    let subject = named.unwrap_or_else(|| format!("reception {}", worst.reception + 1));
    Some(Remark::new(
        "outlier",
        format!(
            "{subject} ({:.1} dBm) lies {:.0} dB {side} what the others make likely, with a σ \
             of {:.1} dB; look at it, and leave it out with --ignore if it is wrong",
            worst.level,
            residual.abs(),
            law.sigma_db
        ),
    ))
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{Level, Pose, Reception};
    use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::StandardNormal;

    use super::*;

    /// Levels along seven lanes over a field of 240 m, at 5 m/s, with shadowing that neighbours
    /// share. `level` is the level at a time and a place without it.
    fn received(seed: u64, level: impl Fn(f64, Vector2<f64>) -> f64) -> Receptions {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut shadow: f64 = 0.0;
        let mut step = 0.0;
        let mut receptions = Vec::new();
        for lane in 0..7_u8 {
            for along in 0..24_u8 {
                let east = f64::from(if lane % 2 == 0 { along } else { 23 - along }) * 10.0;
                let place = Vector2::new(east, f64::from(lane) * 40.0);
                let [innovation, noise]: [f64; 2] =
                    core::array::from_fn(|_| rng.sample(StandardNormal));
                shadow = 0.7 * shadow + 1.2 * innovation;
                let time = 2.0 * step;
                step += 1.0;
                let rss_dbm = level(time, place) + shadow + 1.5 * noise;
                let heard = Some(Level { rss_dbm, sigma_db: 4.0 });
                let receiver = Pose::at(place.x, place.y, 20.0);
                receptions.push(Reception { time, receiver, level: heard, ..Reception::default() });
            }
        }
        receptions.into_iter().collect()
    }

    /// Level of a transmitter at a place.
    fn of(place: Vector2<f64>, power_dbm: f64, receiver: Vector2<f64>) -> f64 {
        power_dbm - 25.0 * libm::log10(libm::hypot((receiver - place).norm(), 19.0))
    }

    /// Codes of the remarks on an answer with a σ of 20 m.
    fn codes(receptions: &Receptions, answer: Vector2<f64>) -> Vec<Cow<'static, str>> {
        let config = LocateConfig::default();
        let located = Located::at(foxhunt_core::Estimate::isotropic(answer, 20.0));
        let remarks = examine(&located, receptions, &config, &|_| None).remarks;
        remarks.into_iter().map(|remark| remark.code).collect()
    }

    #[test]
    fn levels_without_noise_are_of_one_transmitter() {
        for seed in 0..6 {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let mut any = || rng.random_range(20.0..220.0);
            let place = Vector2::new(any(), any());
            let receptions = received(seed, |_, at| of(place, -40.0, at));
            let exact = receptions.iter().map(|mut reception| {
                let rss_dbm = of(place, -40.0, reception.receiver.position.xy());
                reception.level = Some(Level { rss_dbm, sigma_db: 4.0 });
                reception
            });
            let codes = codes(&exact.collect(), place + Vector2::new(1.5, -1.0));
            let is_other =
                |own: &Cow<'_, str>| own == "two-transmitters" || own == "transmitter-moves";
            assert!(!codes.iter().any(is_other), "{place}: {codes:?}");
        }
    }

    #[test]
    fn two_transmitters_are_told_from_one_and_from_one_that_moves() {
        let mut counts = [[0; 2]; 3];
        for seed in 0..12 {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed + 100);
            let mut any =
                || Vector2::new(rng.random_range(20.0..220.0), rng.random_range(20.0..100.0));
            let south = any();
            let north = Vector2::new(240.0, 240.0) - any();
            let one = received(seed, |_, at| of(south, -40.0, at));
            let two = received(seed, |_, at| of(south, -40.0, at).max(of(north, -43.0, at)));
            // To the south while the receiver goes to the north.
            let moving = received(seed, |time, at| {
                let share = time / 334.0;
                of(Vector2::new(40.0 + 160.0 * share, 200.0 - 160.0 * share), -40.0, at)
            });
            let middle = Vector2::new(120.0, 120.0);
            let answers = [(one, south), (two, south), (moving, middle)];
            for (counts, (receptions, answer)) in counts.iter_mut().zip(answers) {
                let codes = codes(&receptions, answer);
                for (count, code) in
                    counts.iter_mut().zip(["two-transmitters", "transmitter-moves"])
                {
                    *count += u32::from(codes.iter().any(|own| own == code));
                }
            }
        }
        let [one, two, moving] = counts;
        println!("one {one:?}, two {two:?}, moving {moving:?}");
        assert_eq!(one, [0, 0], "one that stays");
        assert!(two[0] >= 10 && two[1] <= 1, "two that stay: {two:?}");
        assert!(moving[1] >= 9 && moving[0] <= 1, "one that moves: {moving:?}");
    }
}
