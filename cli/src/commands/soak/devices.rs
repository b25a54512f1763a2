use std::panic::{AssertUnwindSafe, catch_unwind};

use foxhunt::{
    fly::{DroneFaults, EmulatedFlight},
    registry::Registry,
    soak::SoakFailure,
};

use super::tally::{Kind, Tally, text_of};

/// Flies emulated devices with which things go wrong.
pub(super) fn fly(flight: &EmulatedFlight, registry: &Registry) -> Tally {
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

/// Reduces a flight to as few faults as still make it fail.
pub(super) fn minimal(
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
