use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use foxhunt_core::Remark;
use nalgebra::Vector2;

use super::{Details, Record, row::Shared};

/// Number of rows at a ceiling, at least: fewer repeat by chance.
const LEAST_ROWS: usize = 5;

/// Share of a receiver's levels that are at its ceiling, at least.
const LEAST_SHARE: f64 = 0.01;

/// Number of rows at a ceiling over the most at any of the next lower levels, at least. Without a
/// ceiling the strongest levels are the rarest.
const LEAST_EXCESS: usize = 2;

/// Number of lower levels that a ceiling is compared with.
const COMPARED: usize = 4;

/// Extent of the places at a ceiling over the extent of all places, at least: a receiver that
/// hovers near a steady transmitter repeats its level, too, and is not clipped.
const LEAST_EXTENT: f64 = 0.03;

/// Finds the ceilings of receivers that state none, where the greatest level of one repeats as only
/// a limit does, and sets them in its records. Rows of all beacons count, as the limit is the
/// receiver's own. Returns a remark for each.
pub(super) fn find_ceilings(file: &str, records: &mut [Record]) -> Vec<Remark> {
    let steady = steady_beacons(records);
    let mut of_receiver: BTreeMap<Arc<str>, Vec<(f64, Vector2<f64>)>> = BTreeMap::new();
    for record in records.iter().filter(|record| record.ceiling_dbm.is_none()) {
        let Some((level, receiver)) = level(record) else { continue };
        if steady.contains(&record.beacon) {
            continue;
        }
        match of_receiver.get_mut(&record.drone) {
            Some(levels) => levels.push((level, receiver)),
            None => {
                of_receiver.insert(record.drone.clone(), vec![(level, receiver)]);
            }
        }
    }
    let found =
        of_receiver.into_iter().filter_map(|(drone, levels)| Some((drone, ceiling(levels)?)));
    let found: BTreeMap<Arc<str>, f64> = found.collect();
    if found.is_empty() {
        return Vec::new();
    }
    let shared = Shared::default();
    let mut rows: BTreeMap<&str, usize> = BTreeMap::new();
    for record in records.iter_mut() {
        let Some((drone, ceiling)) = found.get_key_value(&record.drone) else { continue };
        if record.ceiling_dbm.is_none() {
            let details = Details { ceiling_dbm: Some(*ceiling), ..(**record).clone() };
            record.details = shared.details(details);
            let is_at_it = record.rss_dbm.is_some_and(|level| level >= *ceiling);
            *rows.entry(drone).or_default() += usize::from(is_at_it);
        }
    }
    let remark = |(drone, rows): (&str, usize)| {
        let ceiling = found.get(drone).copied().unwrap_or_default();
        let text = format!(
            "{file}: {rows} levels of {drone} are {ceiling} dB, its highest: the receiver is \
             taken to be at its ceiling there, and the true levels to be higher; --ceiling-dbm \
             states another ceiling, and a high one none"
        );
        Remark::new("receiver-at-ceiling", text)
    };
    rows.into_iter().map(remark).collect()
}

/// Codes that receivers and their programs write for a missing level, above all true ones.
const HIGH_CODES_DB: [f64; 3] = [0.0, 99.0, 127.0];

/// Such codes below all true levels: the least numbers of a byte, and what Android writes.
const LOW_CODES_DB: [f64; 3] = [-127.0, -128.0, -200.0];

/// Distance of such a level from all others, in dB, at least: no path brings a receiver from one to
/// the other without a level between them.
const CODE_APART_DB: f64 = 30.0;

/// Finds levels that stand for no reading: the greatest or the least of a receiver, where it is one
/// of the usual codes and far from all others. Levels at a stated floor are readings. Returns the
/// index of each record, and how far it is from the next.
pub(super) fn codes(records: &[Record]) -> Vec<(usize, f64)> {
    let mut of_receiver: BTreeMap<&str, Vec<(f64, usize)>> = BTreeMap::new();
    for (index, record) in records.iter().enumerate() {
        let is_at_floor = |level: f64| record.floor_dbm.is_some_and(|floor| level <= floor);
        if let Some(level) = record.rss_dbm.filter(|level| !is_at_floor(*level)) {
            of_receiver.entry(&record.drone).or_default().push((level, index));
        }
    }
    let mut found = Vec::new();
    for levels in of_receiver.values_mut() {
        levels.sort_by(|a, b| b.0.total_cmp(&a.0));
        let groups: Vec<&[(f64, usize)]> =
            levels.chunk_by(|a, b| (a.0 - b.0).abs() < SAME_DB).collect();
        found.extend(far_codes(groups.iter(), HIGH_CODES_DB));
        found.extend(far_codes(groups.iter().rev(), LOW_CODES_DB));
    }
    found
}

/// The records of the first of these groups of one level that are codes and far from the next.
fn far_codes<'g>(
    groups: impl Iterator<Item = &'g &'g [(f64, usize)]> + Clone,
    codes: [f64; 3],
) -> Vec<(usize, f64)> {
    let mut found = Vec::new();
    for (group, next) in groups.clone().zip(groups.skip(1)) {
        let ([(level, _), ..], [(other, _), ..]) = (group, next) else { break };
        let apart_db = (level - other).abs();
        let is_code = codes.iter().any(|code| (level - code).abs() < SAME_DB);
        if !is_code || apart_db < CODE_APART_DB {
            break;
        }
        found.extend(group.iter().map(|(_, index)| (*index, apart_db)));
    }
    found
}

/// The beacons with one level alone: a number that stands for all of them is no limit.
fn steady_beacons(records: &[Record]) -> BTreeSet<Option<Arc<str>>> {
    let mut extremes: BTreeMap<&Option<Arc<str>>, (f64, f64)> = BTreeMap::new();
    for record in records {
        let Some((level, _)) = level(record) else { continue };
        let (low, high) = extremes.entry(&record.beacon).or_insert((level, level));
        (*low, *high) = (low.min(level), high.max(level));
    }
    let steady = extremes.into_iter().filter(|(_, (low, high))| high - low < SAME_DB);
    steady.map(|(beacon, _)| beacon.clone()).collect()
}

/// The level of an omnidirectional antenna, and its place.
pub(super) fn level(record: &Record) -> Option<(f64, Vector2<f64>)> {
    let level = record.rss_dbm.filter(|_| record.boresight.is_none())?;
    Some((level, record.receiver()?.position.xy()))
}

/// The greatest level, where it is a limit.
fn ceiling(mut levels: Vec<(f64, Vector2<f64>)>) -> Option<f64> {
    levels.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut groups = levels.chunk_by(|a, b| (a.0 - b.0).abs() < SAME_DB);
    let highest = groups.next()?;
    let [(greatest, _), ..] = highest else { return None };
    let most = groups.take(COMPARED).map(<[_]>::len).max()?;
    let rows = highest.len();
    #[expect(clippy::cast_precision_loss, reason = "a share of rows need not be exact")]
    let share = rows as f64 / levels.len() as f64;
    let spreads = extent_m(highest) >= LEAST_EXTENT * extent_m(&levels) && extent_m(highest) > 0.0;
    let repeats = rows >= LEAST_ROWS && rows > LEAST_EXCESS * most && share >= LEAST_SHARE;
    (repeats && spreads).then_some(*greatest)
}

/// Levels nearer to each other than this are the same number.
pub(super) const SAME_DB: f64 = 1e-6;

/// The diagonal of the box about all places.
pub(super) fn extent_m(levels: &[(f64, Vector2<f64>)]) -> f64 {
    let nowhere = Vector2::repeat(f64::INFINITY);
    let (low, high) = levels
        .iter()
        .fold((nowhere, -nowhere), |(low, high), (_, place)| (low.inf(place), high.sup(place)));
    if levels.is_empty() { 0.0 } else { (high - low).norm() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole decibels along a line past a transmitter, clipped at a limit.
    fn drive(limit: f64, count: u16) -> Vec<(f64, Vector2<f64>)> {
        let level = |i: u16| {
            let east = 4.0 * (f64::from(i) - 0.5 * f64::from(count));
            let fading = 5.0 * f64::from(i).sin() + 3.0 * f64::from(3 * i).cos();
            let level = -20.0 - 25.0 * east.hypot(40.0).log10() + fading;
            (level.round().min(limit), Vector2::new(east, 0.0))
        };
        (0..count).map(level).collect()
    }

    #[test]
    fn a_greatest_level_that_repeats_is_a_ceiling() {
        for limit in [-68.0, -72.0, -75.0] {
            assert_eq!(ceiling(drive(limit, 200)), Some(limit), "{limit}");
        }
        assert_eq!(ceiling(drive(0.0, 200)), None);
        assert_eq!(ceiling(drive(0.0, 20)), None);
        assert_eq!(ceiling(Vec::new()), None);
    }

    #[test]
    fn a_steady_level_at_one_place_is_none() {
        let mut levels = drive(0.0, 200);
        let best = levels.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0)).expect("some");
        levels.extend([best; 60]);
        assert_eq!(ceiling(levels), None);
    }
}
