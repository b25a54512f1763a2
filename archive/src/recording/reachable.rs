use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector2;

use super::Record;

/// No receiver is faster than this, in metres a second: an airliner makes 250.
const MOST_MPS: f64 = 300.0;

/// Within the resolution of a clock that counts whole seconds a receiver moves no faster than this,
/// in metres a second.
const WITHIN_CLOCK_MPS: f64 = 100.0;

/// The resolution of the coarsest usual clock, in seconds.
const CLOCK_S: f64 = 1.0;

/// No receiver on the ground is faster than this, in metres a second, unless its usual speed is of
/// that order.
const GROUND_MPS: f64 = 40.0;

/// A receiver is slower than this many times its usual speed.
const TIMES_USUAL: f64 = 6.0;

/// Fixes nearer to each other than this, in metres, differ by the errors of GNSS.
const NEAR_M: f64 = 100.0;

/// At its usual speed this many fixes in a row may be wrong; more are a move.
const WRONG_IN_A_ROW: usize = 3;

/// Fixes below this number are no path that one of them could be off.
const LEAST_FIXES: usize = 5;

/// Runs of reachable fixes that are compared with each other. A file with more of them has no path.
const MOST_RUNS: usize = 4000;

/// A fix: the place of a receiver at a time.
#[derive(Clone, Copy)]
struct Fix {
    record: usize,
    time: f64,
    place: Vector2<f64>,
}

/// A receiver and a beacon, whose records are in the order of time.
type Series<'r> = (&'r str, Option<&'r str>);

/// A record whose place cannot be reached from the place of another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Jump {
    /// The record, from 0.
    pub record: usize,
    /// The distance from the nearest fix of the path in the file, in metres.
    pub distance_m: f64,
    /// The time between the two, in seconds.
    pub within_s: f64,
}

/// Returns the records that are not on the longest path of their receiver on which each fix can be
/// reached from the one before. A receiver whose longest path has no more than half of its fixes
/// has none that can be told from the others: its records are all kept, and their number is the
/// second value.
pub(super) fn jumps(records: &[Record]) -> (Vec<Jump>, usize) {
    let mut fixes: BTreeMap<&str, Vec<Fix>> = BTreeMap::new();
    for (index, record) in records.iter().enumerate() {
        let (Some(time), Some(receiver)) = (record.time, record.receiver()) else { continue };
        let fix = Fix { record: index, time, place: receiver.position.xy() };
        fixes.entry(&*record.drone).or_default().push(fix);
    }
    let mut jumps = Vec::new();
    let mut pathless = 0;
    for fixes in fixes.values().filter(|fixes| fixes.len() >= LEAST_FIXES) {
        let Some(off) = off_path(fixes, reaches) else {
            pathless += fixes.len();
            continue;
        };
        let out: BTreeSet<usize> = off.iter().flatten().map(|jump| jump.record).collect();
        jumps.extend(off.into_iter().flatten());
        let rest: Vec<Fix> = fixes.iter().filter(|f| !out.contains(&f.record)).copied().collect();
        jumps.append(&mut strays(&rest));
    }
    jumps.sort_by_key(|jump| jump.record);
    (jumps, pathless)
}

/// Returns the few fixes that are far off the path of a receiver that is slow otherwise.
fn strays(fixes: &[Fix]) -> Vec<Jump> {
    let step = |pair: &[Fix]| {
        let [from, to] = pair else { return None };
        let mps = (to.place - from.place).norm() / (to.time - from.time).abs();
        (mps > 0.0 && mps.is_finite()).then_some(mps)
    };
    let mut speeds: Vec<f64> = fixes.windows(2).filter_map(step).collect();
    speeds.sort_by(f64::total_cmp);
    let Some(usual) = speeds.get(speeds.len() / 2) else { return Vec::new() };
    let most_mps = (TIMES_USUAL * usual).max(GROUND_MPS);
    let follows = |from: &Fix, to: &Fix| {
        let seconds = (to.time - from.time).abs() + CLOCK_S;
        (to.place - from.place).norm() <= (most_mps * seconds).max(NEAR_M)
    };
    let off = off_path(fixes, follows).unwrap_or_default();
    // A longer run shows that the receiver was fast at times. Rows of one time are of one fix.
    let times = |run: &Vec<Jump>| {
        let is_later = |pair: &&[Jump]| match pair {
            [from, to] => (to.within_s - from.within_s).abs() > 0.0,
            _ => false,
        };
        1 + run.windows(2).filter(is_later).count()
    };
    let longest = off.iter().map(times).max().unwrap_or_default();
    let is_move = longest > WRONG_IN_A_ROW.max(fixes.len() / 20);
    if is_move { Vec::new() } else { off.into_iter().flatten().collect() }
}

/// Returns true if a receiver can have gone from one fix to the other. The order of the two does
/// not matter, as clocks may be set back and lines exchanged.
fn reaches(from: &Fix, to: &Fix) -> bool {
    let seconds = (to.time - from.time).abs();
    let most_m = (MOST_MPS * seconds).max(WITHIN_CLOCK_MPS * (seconds + CLOCK_S));
    (to.place - from.place).norm() <= most_m
}

/// Returns the runs of fixes off the longest path, or `None` if no path has more than half.
fn off_path(fixes: &[Fix], reaches: impl Fn(&Fix, &Fix) -> bool) -> Option<Vec<Vec<Jump>>> {
    let mut runs: Vec<&[Fix]> = Vec::new();
    runs.extend(fixes.chunk_by(&reaches));
    if runs.len() < 2 {
        return Some(Vec::new());
    }
    if runs.len() > MOST_RUNS {
        return None;
    }
    // The longest path that ends with each run, in fixes, and the run before on it.
    let mut longest: Vec<(usize, Option<usize>)> = Vec::with_capacity(runs.len());
    for run in &runs {
        let mut best = (0, None);
        for (earlier, (length, _)) in longest.iter().enumerate() {
            let ends = runs.get(earlier).and_then(|run| run.last());
            let joins = ends.zip(run.first()).is_some_and(|(end, first)| reaches(end, first));
            if joins && *length > best.0 {
                best = (*length, Some(earlier));
            }
        }
        longest.push((best.0 + run.len(), best.1));
    }
    let (end, (length, _)) = longest.iter().enumerate().max_by_key(|(_, (length, _))| *length)?;
    if 2 * *length <= fixes.len() {
        return None;
    }
    let mut on_path = vec![false; runs.len()];
    let mut next = Some(end);
    while let Some(run) = next {
        on_path.get_mut(run).into_iter().for_each(|on| *on = true);
        next = longest.get(run).and_then(|(_, before)| *before);
    }
    let kept = |(run, on): (&&[Fix], &bool)| run.first().copied().filter(|_| *on);
    // Fixes before the path's begin are compared with that.
    let mut near = runs.iter().zip(&on_path).find_map(kept)?;
    let mut off = Vec::new();
    for (run, on) in runs.iter().zip(&on_path) {
        if *on {
            near = run.last().copied().unwrap_or(near);
            continue;
        }
        let jump = |fix: &Fix| Jump {
            record: fix.record,
            distance_m: (fix.place - near.place).norm(),
            within_s: (fix.time - near.time).abs(),
        };
        off.push(run.iter().map(jump).collect());
    }
    Some(off)
}

/// Returns the records of a receiver and beacon that are not in the longest series of rising times,
/// and by how many seconds each is off: those between which the clock was set.
pub(super) fn out_of_time(records: &[Record]) -> Vec<(usize, f64)> {
    let mut times: BTreeMap<Series<'_>, Vec<(usize, f64)>> = BTreeMap::new();
    for (index, record) in records.iter().enumerate() {
        let Some(time) = record.time else { continue };
        let of = (&*record.drone, record.beacon.as_deref());
        times.entry(of).or_default().push((index, time));
    }
    let mut out = Vec::new();
    for times in times.values().filter(|times| !times.is_sorted_by(|a, b| a.1 <= b.1)) {
        let rising = longest_rising(times);
        let mut on_it = rising.iter().copied().peekable();
        let mut last: Option<f64> = None;
        for (place, (record, time)) in times.iter().enumerate() {
            if on_it.peek() == Some(&place) {
                on_it.next();
                last = Some(*time);
                continue;
            }
            let next = on_it.peek().and_then(|next| times.get(*next)).map(|(_, time)| *time);
            // Behind the row before it, or ahead of the row after it.
            let behind = last.map(|last| last - time).filter(|by_s| *by_s > 0.0);
            let ahead = next.map(|next| time - next);
            out.push((*record, behind.or(ahead).unwrap_or_default()));
        }
    }
    out.sort_by_key(|(record, _)| *record);
    out
}

/// Returns the places of the longest series that does not fall; of equally long series, the one
/// with the lowest end.
fn longest_rising(times: &[(usize, f64)]) -> Vec<usize> {
    // For each length the place at which the series of that length with the lowest end ends.
    let mut ends: Vec<usize> = Vec::new();
    let mut before: Vec<Option<usize>> = Vec::with_capacity(times.len());
    let at = |place: &usize| times.get(*place).map_or(f64::INFINITY, |(_, time)| *time);
    for (place, (_, time)) in times.iter().enumerate() {
        let length = ends.partition_point(|end| at(end) <= *time);
        before.push(length.checked_sub(1).and_then(|shorter| ends.get(shorter)).copied());
        match ends.get_mut(length) {
            Some(end) => *end = place,
            None => ends.push(place),
        }
    }
    let mut series = Vec::with_capacity(ends.len());
    let mut next = ends.last().copied();
    while let Some(place) = next {
        series.push(place);
        next = before.get(place).copied().flatten();
    }
    series.reverse();
    series
}
