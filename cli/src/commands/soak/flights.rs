use std::path::Path;

use foxhunt::{
    log::Log,
    registry::Registry,
    replay::replay,
    soak::{SoakFailure, SoakFlight, SoakRun},
};

use super::tally::Tally;

/// Flies a flight, and replays its log.
pub(super) fn fly(flight: &SoakFlight, registry: &Registry) -> Tally {
    let SoakRun { outcomes, refused, estimates, log, mut failures } = flight.fly(registry);
    let count = |count: usize| u64::try_from(count).unwrap_or(u64::MAX);
    let replayed = if refused.is_none() && failures.is_empty() {
        replayed(&log, registry).unwrap_or_else(|failure| {
            failures.push(failure);
            0
        })
    } else {
        0
    };
    Tally {
        refused: refused.is_some(),
        searches: count(outcomes.len()),
        estimates,
        replayed,
        log_bytes: count(log.len()),
        failures,
        ..Tally::default()
    }
}

/// Returns the number of estimates that a replay gives again to the bit.
fn replayed(log: &[u8], registry: &Registry) -> Result<u64, SoakFailure> {
    let failure = |what: String| SoakFailure::new("replay", what);
    let log = Log::parse(&String::from_utf8_lossy(log), Path::new("soak.jsonl"));
    let log = log.map_err(|error| failure(error.to_string()))?;
    let replay = replay(&log, registry, None).map_err(|error| failure(error.to_string()))?;
    if replay.different > 0 {
        let different = replay.different;
        let compared = replay.compared;
        return Err(failure(format!("{different} of {compared} estimates differ")));
    }
    Ok(u64::try_from(replay.compared).unwrap_or(u64::MAX))
}
