//! Random flights without end: each is drawn from a seed, flown, and held against what every
//! flight must keep.

use std::{
    fmt,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use foxhunt_core::{Estimate, Outcome};
use foxhunt_formation::StopRules;
use foxhunt_hunt::{
    config::{ExtractorConfig, SourceConfig},
    hunt::Event,
    log::{Log, LogWriter},
    registry::Registry,
    scenario::{Scenario, random_fleet},
};
use foxhunt_sensors::OmnidirectionalConfig;
use foxhunt_sim::ChannelConfig;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::{campaign::FleetRun, simulation::Setup};

/// A flight of a soak: a scenario with the estimator that it names, and the seed of its world.
#[derive(Clone, Debug, PartialEq)]
pub struct SoakFlight {
    /// The scenario that is flown.
    pub scenario: Scenario,
    /// The seed.
    pub seed: u64,
}

/// The result of a flight.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SoakRun {
    /// The ends of the searches.
    pub outcomes: Vec<Outcome>,
    /// The reason why the hunt could not begin or go on, if so. That is no failure.
    pub refused: Option<String>,
    /// The number of estimates that were looked at.
    pub estimates: u64,
    /// The log, as it would stand in a file.
    pub log: Vec<u8>,
    /// The events that must not happen and did.
    pub failures: Vec<SoakFailure>,
}

/// Something that must not happen and did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SoakFailure {
    /// The kind, in a word or two.
    pub kind: &'static str,
    /// The exact failure.
    pub what: String,
}

impl fmt::Display for SoakFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.kind, self.what)
    }
}

impl SoakFailure {
    /// A failure.
    #[must_use]
    pub fn new(kind: &'static str, what: impl Into<String>) -> Self {
        Self { kind, what: what.into() }
    }
}

/// The number of places at which a log is cut off.
const CUTS: u32 = 4;

impl SoakFlight {
    /// The flight of a seed: a [`random_fleet`] with any estimator that takes a stream, any
    /// extractor, and drones that listen with any antenna.
    #[must_use]
    pub fn draw(registry: &Registry, seed: u64) -> Self {
        let mut scenario = random_fleet(seed);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ PARTS);
        let estimators: Vec<&str> = registry
            .estimators()
            .iter()
            .filter(|entry| !entry.needs().all_at_once && entry.needs().others.is_empty())
            .map(|entry| &entry.name[..])
            .collect();
        if let Some(name) = one_of(&estimators, &mut random) {
            scenario.estimator = (*name).to_owned();
        }
        if let Some(extractor) = one_of(registry.extractors(), &mut random) {
            scenario.extractor = extractor.config();
        }
        if random.random::<f64>() < 0.1 {
            scenario.source = SourceConfig::Omnidirectional(OmnidirectionalConfig::default());
        }
        Self { scenario, seed }
    }

    /// Flies it twice, and holds it against what every flight must keep: an end or a reason for
    /// each beacon; separation, airspace, altitude and batteries; estimates that are finite, with
    /// covariances that are positive definite; the same log again to the bit; a log that can be
    /// read up to its last whole line wherever it is cut off; and no panic.
    // Marked, as are those below it: what reads and writes logs is then compiled where it is
    // called, by a program that does not optimise it, and is not compiled here. A third of this
    // package.
    #[inline]
    #[must_use]
    pub fn fly(&self, registry: &Registry) -> SoakRun {
        let flown = catch_unwind(AssertUnwindSafe(|| self.fly_unguarded(registry)));
        flown.unwrap_or_else(|panic| {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("?");
            SoakRun { failures: vec![SoakFailure::new("panic", text)], ..SoakRun::default() }
        })
    }

    #[inline]
    fn fly_unguarded(&self, registry: &Registry) -> SoakRun {
        let mut run = self.fly_once(registry);
        if self.fly_once(registry).log != run.log {
            run.failures.push(SoakFailure::new("not the same again", "the logs differ"));
        }
        let failures = self.look_at_log(&run.log);
        run.failures.extend(failures);
        run
    }

    #[inline]
    fn fly_once(&self, registry: &Registry) -> SoakRun {
        let Self { scenario, seed } = self;
        let estimator = match registry.estimator(&scenario.estimator) {
            Ok(estimator) => estimator,
            Err(error) => {
                return SoakRun { refused: Some(error.to_string()), ..SoakRun::default() };
            }
        };
        let setup = Setup { scenario, estimator, registry };
        let mut log = Vec::new();
        let mut failures = Vec::new();
        let mut estimates = 0;
        let mut unwritten = None;
        let mut writer = LogWriter::new(&mut log, &setup.log_header(*seed));
        let flown = FleetRun::fly(&setup, *seed, |event| {
            if let Ok(writer) = &mut writer
                && let Err(error) = writer.event(event)
            {
                unwritten = Some(error.to_string());
            }
            let (time, estimate) = match event {
                Event::Corrected { time, estimate, .. } => (time, estimate),
                Event::BeaconFinished { time, fix, .. } => (time, &fix.estimate),
                _ => return,
            };
            estimates += 1;
            if failures.is_empty() {
                failures.extend(wrong_with(estimate).map(|what| {
                    SoakFailure::new("estimate", format!("{what} after {time} s: {estimate:?}"))
                }));
            }
        });
        if let Err(error) = writer {
            unwritten = Some(error.to_string());
        }
        failures.extend(unwritten.map(|error| SoakFailure::new("log", error)));
        failures.extend(flown.violations().iter().map(|violation| {
            let what = format!(
                "at {} s, drones {:?}: {} where the limit is {}",
                violation.time_s, violation.drones, violation.value, violation.limit
            );
            SoakFailure::new(violation.breach.name(), what)
        }));
        let refused = flown.error.map(|error| error.reason);
        SoakRun { outcomes: flown.outcomes, refused, estimates, log, failures }
    }

    /// Checks that a log reads back, whole and cut off, and returns the failures.
    #[inline]
    fn look_at_log(&self, log: &[u8]) -> Vec<SoakFailure> {
        let path = Path::new("soak.jsonl");
        let failure = |what: String| vec![SoakFailure::new("log", what)];
        let whole = match Log::parse(&String::from_utf8_lossy(log), path) {
            Ok(whole) => whole,
            Err(error) => return failure(format!("it cannot be read: {error}")),
        };
        let mut again = Vec::new();
        let written = LogWriter::new(&mut again, &whole.header)
            .and_then(|mut writer| whole.events.iter().try_for_each(|event| writer.event(event)));
        if written.is_err() || again != log {
            return failure("what was read is written otherwise".to_owned());
        }
        let header = log.iter().position(|byte| *byte == b'\n').map_or(log.len(), |end| end + 1);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(self.seed ^ PARTS);
        let mut failures = Vec::new();
        for _ in 0..CUTS {
            let end = random.random_range(header..=log.len());
            let lines = log[header..end].iter().filter(|byte| **byte == b'\n').count();
            let read = Log::parse(&String::from_utf8_lossy(&log[..end]), path);
            // A last line that lacks nothing but its end is read, too.
            let is_start = |cut: &Log| {
                (lines..=lines + 1).contains(&cut.events.len())
                    && whole.events.starts_with(&cut.events)
            };
            if !read.is_ok_and(|cut| is_start(&cut)) {
                failures.push(SoakFailure::new("log", format!("cut off after {end} bytes")));
            }
        }
        failures
    }

    /// The least flight that still fails: what can be left out one by one is left out, as long as
    /// `fails` holds.
    #[must_use]
    pub fn minimal(self, fails: impl Fn(&Self) -> bool) -> Self {
        let mut least = self;
        while let Some(simpler) = least.simpler().into_iter().find(|flight| fails(flight)) {
            least = simpler;
        }
        least
    }

    /// The flights with one thing less, for each thing that is not needed for a flight.
    fn simpler(&self) -> Vec<Self> {
        let mut all = Vec::new();
        let mut without = |change: &dyn Fn(&mut Scenario)| {
            let mut scenario = self.scenario.clone();
            change(&mut scenario);
            if scenario != self.scenario {
                all.push(Self { scenario, seed: self.seed });
            }
        };
        for drone in (0..self.scenario.world.drones.len()).rev() {
            if self.scenario.world.drones.len() > 1 {
                without(&|scenario| drop(scenario.world.drones.remove(drone)));
            }
            without(&|scenario| scenario.world.drones[drone].silent.clear());
            without(&|scenario| scenario.world.drones[drone].stuck.clear());
            without(&|scenario| scenario.world.drones[drone].lost.clear());
            without(&|scenario| scenario.world.drones[drone].late_s = 0.0);
        }
        if self.scenario.world.beacons.len() > 1 {
            without(&|scenario| drop(scenario.world.beacons.pop()));
        }
        without(&|scenario| scenario.hunt.airspace.keep_out.clear());
        without(&|scenario| scenario.hunt.airspace.fence_m.clear());
        without(&|scenario| scenario.hunt.airspace.altitude_m = None);
        without(&|scenario| scenario.hunt.void = None);
        without(&|scenario| scenario.hunt.endurance = None);
        without(&|scenario| scenario.hunt.shared_turns = false);
        without(&|scenario| scenario.hunt.return_home = false);
        without(&|scenario| scenario.hunt.prior_centre_m = None);
        without(&|scenario| {
            let StopRules { positions, .. } = scenario.hunt.stop;
            scenario.hunt.stop = StopRules { positions, ..StopRules::default() };
        });
        without(&|scenario| scenario.world.channel = ChannelConfig::default());
        without(&|scenario| {
            scenario.extractor = ExtractorConfig::FirstHarmonic(Default::default());
        });
        without(&|scenario| scenario.source = random_fleet(0).source);
        without(&|scenario| scenario.estimator = random_fleet(0).estimator);
        all
    }
}

/// A number that makes the parts of a flight independent of its fleet, which the same seed draws:
/// any number.
const PARTS: u64 = 0x50a4_0f11_6875_7473;

fn one_of<'a, T>(all: &'a [T], random: &mut Xoshiro256PlusPlus) -> Option<&'a T> {
    (!all.is_empty()).then(|| &all[random.random_range(0..all.len())])
}

/// The fault of an estimate; `None` if there is no fault.
fn wrong_with(estimate: &Estimate<2>) -> Option<&'static str> {
    let Estimate { mean, covariance } = estimate;
    if !mean.iter().chain(covariance.iter()).all(|number| number.is_finite()) {
        Some("not finite")
    } else if covariance.cholesky().is_none() {
        Some("not positive definite")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn estimates_that_are_none_are_noticed() {
        let good = Estimate::isotropic(Vector2::new(1.0, 2.0), 3.0);
        assert_eq!(wrong_with(&good), None);
        let off = Estimate { mean: Vector2::new(f64::NAN, 0.0), ..good };
        assert_eq!(wrong_with(&off), Some("not finite"));
        let flat = Estimate { covariance: Matrix2::new(1.0, 2.0, 2.0, 1.0), ..good };
        assert_eq!(wrong_with(&flat), Some("not positive definite"));
    }

    #[test]
    fn logs_that_lack_or_hold_too_much_are_noticed() {
        let registry = Registry::builtin();
        let flight = SoakFlight::draw(&registry, 3);
        let run = flight.fly(&registry);
        assert_eq!(run.failures, []);
        assert!(run.estimates > 0 && !run.log.is_empty());
        let mut bent = run.log.clone();
        bent.splice(..1, *b"[");
        assert_eq!(flight.look_at_log(&bent)[0].kind, "log");
        let mut longer = run.log.clone();
        longer.extend_from_slice(b" \n");
        assert_eq!(flight.look_at_log(&longer)[0].kind, "log");
    }

    #[test]
    fn a_reproducer_keeps_what_fails_and_nothing_else() {
        let registry = Registry::builtin();
        let flight = (0..)
            .map(|seed| SoakFlight::draw(&registry, seed))
            .find(|flight| {
                let drones = &flight.scenario.world.drones;
                drones.len() > 3 && drones.iter().any(|drone| drone.late_s > 0.0)
            })
            .expect("one in a few");
        let fails = |flight: &SoakFlight| {
            flight.scenario.world.drones.iter().any(|drone| drone.late_s > 0.0)
        };
        let least = flight.minimal(fails);
        assert!(fails(&least));
        assert_eq!(least.scenario.world.drones.len(), 1);
        let world = &least.scenario.world;
        assert_eq!((world.beacons.len(), world.channel.clone()), (1, ChannelConfig::default()));
        assert!(least.scenario.hunt.airspace.fence_m.is_empty());
    }

    #[test]
    fn a_panic_is_a_failure() {
        let registry = Registry::builtin();
        let run = catch_unwind(AssertUnwindSafe(|| panic!("on purpose")));
        assert!(run.is_err());
        let mut flight = SoakFlight::draw(&registry, 1);
        flight.scenario.estimator = "nobody".to_owned();
        let run = flight.fly(&registry);
        assert!(run.refused.is_some_and(|reason| reason.contains("nobody")));
    }
}
