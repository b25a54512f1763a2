use foxhunt_wire::geodesy::Geodetic;

use super::levels::Levels;

/// Places and levels of a log, by times in seconds since 1970.
#[derive(Debug, Default)]
pub(in crate::recording) struct Log {
    pub(in crate::recording) fixes: Vec<Fix>,
    pub(in crate::recording) levels: Levels,
}

/// A place at a time in seconds since 1970.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::recording) struct Fix {
    pub(in crate::recording) time: f64,
    pub(in crate::recording) place: Geodetic,
}

/// A place at a time of the vehicle's own clock in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OwnFix {
    pub(super) own_s: f64,
    pub(super) place: Geodetic,
}

/// Fixes and levels of the vehicle's own clock in UTC. `pairs` are times of the own clock and of
/// UTC; their median offset stands for all, as single ones are late.
pub(super) fn in_utc(fixes: &[OwnFix], levels: Levels, pairs: &[[f64; 2]]) -> Result<Log, String> {
    let mut offsets: Vec<f64> = pairs.iter().map(|[own, utc]| utc - own).collect();
    offsets.sort_by(f64::total_cmp);
    let Some(offset) = offsets.get(offsets.len() / 2) else {
        return Err("no message of its GNSS says what time it was in UTC".to_owned());
    };
    let fix = |fix: &OwnFix| Fix { time: fix.own_s + offset, place: fix.place };
    Ok(Log { fixes: fixes.iter().map(fix).collect(), levels: levels.later(*offset) })
}
