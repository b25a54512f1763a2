//! Runs of a soak: their counts and failures, flights, and the least that still fails.

#[cfg(all(unix, feature = "hardware"))]
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::{any::Any, path::Path};

#[cfg(all(unix, feature = "hardware"))]
use foxhunt::fly::{DroneFaults, EmulatedFlight};
use foxhunt::{
    log::Log,
    registry::Registry,
    replay::replay,
    soak::{SoakFailure, SoakFlight, SoakRun},
};

/// Counts and failures of one run.
#[derive(Debug, Default)]
pub struct Tally {
    pub kind: Kind,
    pub refused: bool,
    pub searches: u64,
    pub estimates: u64,
    pub replayed: u64,
    pub log_bytes: u64,
    /// Places that were found in a recording.
    pub located: u64,
    pub failures: Vec<SoakFailure>,
}

/// Kind of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// A simulated flight.
    #[default]
    Flight,
    /// A flight of emulated devices.
    #[cfg(all(unix, feature = "hardware"))]
    Devices,
    /// A recording that could be read, or not.
    Recording {
        /// True if it could be read.
        is_read: bool,
    },
}

impl Kind {
    /// Returns the kind that a seed draws: a recording one time in four, and emulated devices,
    /// whose flights take longest, one time in eight.
    pub fn of(seed: u64) -> Self {
        match seed % 8 {
            0 | 4 => Self::Recording { is_read: false },
            #[cfg(all(unix, feature = "hardware"))]
            7 => Self::Devices,
            _ => Self::Flight,
        }
    }
}

/// Returns the message of a panic.
pub fn text_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("?").to_owned()
}

/// Flies a flight, and replays its log.
pub fn fly_simulated(flight: &SoakFlight, registry: &Registry) -> Tally {
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

#[cfg(all(unix, feature = "hardware"))]
/// Flies emulated devices with which things go wrong.
pub fn fly_devices(flight: &EmulatedFlight, registry: &Registry) -> Tally {
    let flown = catch_unwind(AssertUnwindSafe(|| flight.fly(registry)));
    let failure = |kind, what: String| vec![SoakFailure::new(kind, what)];
    let mut tally = Tally { kind: Kind::Devices, ..Tally::default() };
    match flown {
        Ok(Ok(flown)) => {
            tally.searches = u64::try_from(flown.found).unwrap_or(u64::MAX);
            let violations = flown.violations().into_iter();
            tally.failures = violations.map(|what| SoakFailure::new("devices", what)).collect();
        }
        Ok(Err(error)) => tally.failures = failure("devices", format!("{error}: {error:?}")),
        Err(panic) => tally.failures = failure("panic", text_of(&*panic)),
    }
    tally
}

#[cfg(all(unix, feature = "hardware"))]
/// Reduces a flight to as few faults as still make it fail.
pub fn minimal(
    mut flight: EmulatedFlight,
    fails: impl Fn(&EmulatedFlight) -> bool,
) -> EmulatedFlight {
    for drone in 0..flight.field.faults.len() {
        let clear: [fn(&mut DroneFaults); 5] = [
            |faults| faults.radio.pulled.clear(),
            |faults| faults.radio.garbage.clear(),
            |faults| faults.rotator.pulled.clear(),
            |faults| faults.vehicle.silent.clear(),
            |faults| faults.vehicle.pilot.clear(),
        ];
        for clear in clear {
            let mut simpler = flight.clone();
            clear(&mut simpler.field.faults[drone]);
            if simpler != flight && fails(&simpler) {
                flight = simpler;
            }
        }
    }
    flight
}

/// Leaves out lines as long as the rest still fails: first halves, then quarters, down to single
/// lines (Zeller & Hildebrandt 2002).
pub fn least<'a>(mut lines: Vec<&'a [u8]>, fails: impl Fn(&[&'a [u8]]) -> bool) -> Vec<&'a [u8]> {
    let mut size = lines.len().div_ceil(2);
    while size > 0 {
        let mut start = 0;
        while start < lines.len() {
            let end = lines.len().min(start + size);
            let shorter = [&lines[..start], &lines[end..]].concat();
            if fails(&shorter) {
                lines = shorter;
            } else {
                start = end;
            }
        }
        size /= 2;
    }
    lines
}
