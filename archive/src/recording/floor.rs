use std::{collections::BTreeMap, sync::Arc};

use foxhunt_core::Remark;
use nalgebra::Vector2;

use super::{
    Details, Record,
    ceiling::{SAME_DB, extent_m, level},
    row::Shared,
};

/// Width in dB of the window in which levels crowd: one to two σ of noise that is averaged.
const WINDOW_DB: f64 = 2.0;

/// Steps of rounded levels in that window, at least: noise falls on two of them.
const STEPS: f64 = 1.5;

/// Number of levels below the middle of the noise, at least: they give its σ.
const LEAST_BELOW: usize = 20;

/// Largest σ of noise in dB: a receiver averages it, and fading alone has more than twice as much.
const MOST_SIGMA_DB: f64 = 2.0;

/// Share of the noise that may be far below it, and share of all levels that is far above.
const MOST_FAR_BELOW: f64 = 0.05;
const LEAST_FAR_ABOVE: f64 = 0.05;

/// Density of the levels just above the noise over that of the noise, at most.
const MOST_BESIDE: f64 = 0.5;

/// σ from the middle of the noise to the floor: 97.7 % of the noise lies below.
const SIGMAS: f64 = 2.0;

/// Correlation of readings of noise, over the next ones, that two of its σ (Bartlett 1946) may
/// reach: levels that fade or fall are alike from place to place, and noise is new in each reading.
const MOST_ALIKE: f64 = 0.15;

/// Number of next readings over which that is averaged.
const LAGS: usize = 8;

/// Extent of the places at a floor over that of all places, at least, and in metres: a transmitter
/// that rests has a steady level, too, where the receiver stays to within its own errors.
const LEAST_EXTENT: f64 = 0.1;
const LEAST_EXTENT_M: f64 = 50.0;

/// A median absolute deviation is this share of σ.
const MEDIAN_DEVIATION: f64 = 0.6745;

/// Finds the noise floors of receivers that state none, and sets them in the records: the least
/// levels of one beacon crowd in a narrow bell, with few above it, and do not follow the place.
/// Returns a remark for each receiver.
pub(super) fn find_floors(file: &str, records: &mut [Record]) -> Vec<Remark> {
    type Heard = (Arc<str>, Option<Arc<str>>);
    let mut heard: BTreeMap<Heard, Vec<(f64, Vector2<f64>)>> = BTreeMap::new();
    // Who measures more than a level hears the transmitter.
    let may_be_noise = |record: &&Record| {
        let hears = record.bearing.is_some() || !record.measured.is_empty();
        record.floor_dbm.is_none() && record.boresight.is_none() && !hears
    };
    for record in records.iter().filter(may_be_noise) {
        let Some(level) = level(record) else { continue };
        heard.entry((record.drone.clone(), record.beacon.clone())).or_default().push(level);
    }
    let found = heard.into_iter().filter_map(|(of, levels)| Some((of, floor(&levels)?)));
    let found: BTreeMap<Heard, f64> = found.collect();
    if found.is_empty() {
        return Vec::new();
    }
    let shared = Shared::default();
    let mut rows: BTreeMap<Arc<str>, (usize, f64)> = BTreeMap::new();
    for record in records.iter_mut().filter(|record| may_be_noise(&&**record)) {
        let of = (record.drone.clone(), record.beacon.clone());
        let Some(&floor) = found.get(&of) else { continue };
        let details = Details { floor_dbm: Some(floor), ..(**record).clone() };
        record.details = shared.details(details);
        if record.rss_dbm.is_some_and(|level| level <= floor) {
            let (count, highest) = rows.entry(of.0).or_insert((0, floor));
            *count += 1;
            *highest = highest.max(floor);
        }
    }
    let remark = |(drone, (rows, floor)): (Arc<str>, (usize, f64))| {
        let text = format!(
            "{file}: {rows} levels of {drone} crowd at up to {floor:.1} dB, as the least ones, and \
             do not follow the place: they are taken for the receiver's own noise, and the true \
             levels to be no higher; --floor-dbm states another floor, and one just below the \
             least level keeps all of them"
        );
        Remark::new("receiver-at-floor", text)
    };
    rows.into_iter().map(remark).collect()
}

/// The floor of levels one after the other, with the places of the receiver, where there is one.
fn floor(levels: &[(f64, Vector2<f64>)]) -> Option<f64> {
    if levels.len() < 2 * LEAST_BELOW {
        return None;
    }
    let (sorted, step) = spread_out(levels);
    let window = WINDOW_DB.max(STEPS * step);
    let in_window = |from: f64| sorted.partition_point(|level| *level <= from + window);
    let counts = sorted.iter().enumerate().map(|(begin, level)| (in_window(*level) - begin, begin));
    // The lowest of several windows with as many.
    let (count, begin) = counts.max_by(|a, b| (a.0, b.1).cmp(&(b.0, a.1)))?;
    let middle = median(sorted.get(begin..begin + count)?)?;
    let below = sorted.partition_point(|level| *level < middle);
    if below < LEAST_BELOW {
        return None;
    }
    // Below the middle there is noise alone.
    let sigma = (middle - median(sorted.get(..below)?)?) / MEDIAN_DEVIATION;
    if !(sigma > 0.0 && sigma <= MOST_SIGMA_DB) {
        return None;
    }
    let between = |from: f64, to: f64| -> f64 {
        let of = |at: f64| sorted.partition_point(|level| *level < middle + at * sigma);
        number(of(to).saturating_sub(of(from)))
    };
    let all = number(sorted.len());
    let far_below = between(f64::NEG_INFINITY, -3.0);
    let far_above = between(3.0, f64::INFINITY);
    if far_below > MOST_FAR_BELOW * 2.0 * number(below) || far_above < LEAST_FAR_ABOVE * all {
        return None;
    }
    let beside = between(3.0, 5.0);
    // Two σ stand beside four, and chance adds its root.
    if 2.0 * beside + beside.max(1.0).sqrt() > MOST_BESIDE * between(-2.0, 2.0) {
        return None;
    }
    let floor = middle + SIGMAS * sigma;
    let at_it: Vec<_> = levels.iter().copied().filter(|(level, _)| *level <= floor).collect();
    let extent = extent_m(&at_it);
    let is_wide = extent >= LEAST_EXTENT_M.max(LEAST_EXTENT * extent_m(levels));
    let is_noise = |level: f64| (level - middle).abs() <= SIGMAS * sigma + 0.5 * step;
    (is_wide && most_alike(levels, is_noise)? <= MOST_ALIKE).then_some(floor)
}

/// The levels in their order, and the least step between two. Equal levels are spread over the step
/// that they were rounded by.
fn spread_out(levels: &[(f64, Vector2<f64>)]) -> (Vec<f64>, f64) {
    let mut sorted: Vec<f64> = levels.iter().map(|(level, _)| *level).collect();
    sorted.sort_by(f64::total_cmp);
    let groups: Vec<(f64, usize)> = sorted
        .chunk_by(|a, b| b - a < SAME_DB)
        .filter_map(|group| Some((*group.first()?, group.len())))
        .collect();
    let gap = |from: Option<&(f64, usize)>, to: Option<&(f64, usize)>| match (from, to) {
        (Some((from, _)), Some((to, _))) => to - from,
        _ => f64::INFINITY,
    };
    let mut spread = Vec::with_capacity(sorted.len());
    let mut step = f64::INFINITY;
    for (index, (level, count)) in groups.iter().enumerate() {
        let before = index.checked_sub(1).and_then(|before| groups.get(before));
        let above = gap(groups.get(index), groups.get(index + 1));
        let nearest = gap(before, groups.get(index)).min(above);
        step = step.min(nearest);
        let width = if nearest.is_finite() { nearest } else { 0.0 };
        let at = |rank: usize| level + width * ((number(rank) + 0.5) / number(*count) - 0.5);
        spread.extend((0..*count).map(at));
    }
    (spread, if step.is_finite() { step } else { 0.0 })
}

/// The mean correlation of a reading of noise with the next ones, with two of its σ; `None` without
/// any.
fn most_alike(levels: &[(f64, Vector2<f64>)], is_noise: impl Fn(f64) -> bool) -> Option<f64> {
    let noise: Vec<Option<f64>> =
        levels.iter().map(|(level, _)| Some(*level).filter(|level| is_noise(*level))).collect();
    let each = || noise.iter().flatten();
    let count = number(each().count());
    let mean = each().sum::<f64>() / count;
    let variance = each().map(|level| (level - mean).powi(2)).sum::<f64>() / count;
    let pairs = (1..=LAGS).flat_map(|lag| noise.iter().zip(noise.iter().skip(lag)));
    let products = pairs.filter_map(|(a, b)| Some(((*a)? - mean) * ((*b)? - mean)));
    let (pairs, product) =
        products.fold((0, 0.0), |(pairs, sum), product| (pairs + 1, sum + product));
    let pairs = number(pairs);
    (pairs > 0.0).then(|| product / pairs / variance + 2.0 / pairs.sqrt())
}

/// The median of numbers in their order.
fn median(sorted: &[f64]) -> Option<f64> {
    let half = sorted.len() / 2;
    let upper = sorted.get(half)?;
    if sorted.len() % 2 == 1 {
        return Some(*upper);
    }
    Some(0.5 * (upper + sorted.get(half.checked_sub(1)?)?))
}

#[expect(clippy::cast_precision_loss, reason = "a count of rows need not be exact")]
fn number(count: usize) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::StandardNormal;

    use super::*;

    /// Levels along lanes over a transmitter, which fade over some 30 m.
    fn flight(seed: u64) -> Vec<(f64, Vector2<f64>)> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut fading = 0.0;
        let mut level = |i: u16| {
            let lane = f64::from(i / 40);
            let place = Vector2::new(10.0 * f64::from(i % 40), 60.0 * lane);
            fading = 0.7 * fading + 2.5 * rng.sample::<f64, _>(StandardNormal);
            let range = (place - Vector2::new(130.0, 190.0)).norm().hypot(30.0);
            let noise: f64 = rng.sample(StandardNormal);
            (-30.0 - 30.0 * range.log10() + fading + 1.5 * noise, place)
        };
        (0..280).map(&mut level).collect()
    }

    /// Levels of the flight by a receiver whose own noise has a σ.
    fn over_noise(seed: u64, noise_dbm: f64, sigma: f64, step: f64) -> Vec<(f64, Vector2<f64>)> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1000 + seed);
        let mut shown = |(level, place): (f64, Vector2<f64>)| {
            let noise = noise_dbm + sigma * rng.sample::<f64, _>(StandardNormal);
            ((level.max(noise) / step).round() * step, place)
        };
        flight(seed).into_iter().map(&mut shown).collect()
    }

    #[test]
    fn noise_is_found_and_fading_is_none() {
        for (sigma, step) in [(0.5, 0.1), (0.7, 1.0), (1.2, 0.5)] {
            let mut found = 0;
            for seed in 0..30 {
                assert_eq!(floor(&flight(seed)), None, "seed {seed}");
                let noisy = over_noise(seed, -94.0, sigma, step);
                let Some(floor) = floor(&noisy) else { continue };
                let expected = -94.0 + 2.0 * sigma.max(0.4 * step);
                assert!((floor - expected).abs() < 1.5, "{floor} for {expected}, seed {seed}");
                found += 1;
            }
            println!("σ {sigma} dB, steps of {step} dB: {found} of 30");
            assert!(found >= 24, "{found} of 30 with σ {sigma} and steps of {step}");
        }
    }

    #[test]
    fn what_looks_like_noise_is_none() {
        // Noise alone shows no floor: nothing stands above it.
        let alone = over_noise(1, 0.0, 0.7, 0.1);
        assert_eq!(floor(&alone), None);
        // Levels far above it show it, but where the receiver stayed beside a steady transmitter.
        let strong: Vec<_> = flight(1).into_iter().filter(|(level, _)| *level > -90.0).collect();
        let with_places = |shrunk: f64| {
            let weak = alone.iter().map(|(level, place)| (level - 94.0, shrunk * place));
            weak.chain(strong.clone()).collect::<Vec<_>>()
        };
        assert!(floor(&with_places(1.0)).is_some());
        assert_eq!(floor(&with_places(0.05)), None);
        // Coarse steps, one level, and few.
        let coarse =
            flight(2).into_iter().map(|(level, place)| (6.0 * (level / 6.0).round(), place));
        assert_eq!(floor(&coarse.collect::<Vec<_>>()), None);
        let steady = flight(3).into_iter().map(|(_, place)| (-90.0, place));
        assert_eq!(floor(&steady.collect::<Vec<_>>()), None);
        assert_eq!(floor(&over_noise(4, -100.0, 0.7, 0.1)[..15]), None);
        assert_eq!(floor(&[]), None);
    }
}
