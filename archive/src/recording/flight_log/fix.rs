use foxhunt_wire::geodesy::Geodetic;

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

/// Fixes of the vehicle's own clock in UTC. `pairs` are times of the own clock and of UTC; their
/// median offset stands for all, as single ones are late.
pub(super) fn in_utc(fixes: &[OwnFix], pairs: &[[f64; 2]]) -> Result<Vec<Fix>, String> {
    let mut offsets: Vec<f64> = pairs.iter().map(|[own, utc]| utc - own).collect();
    offsets.sort_by(f64::total_cmp);
    let Some(offset) = offsets.get(offsets.len() / 2) else {
        return Err("no message of its GNSS says what time it was in UTC".to_owned());
    };
    let fix = |fix: &OwnFix| Fix { time: fix.own_s + offset, place: fix.place };
    Ok(fixes.iter().map(fix).collect())
}
