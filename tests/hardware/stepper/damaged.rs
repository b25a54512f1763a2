//! Flights whose bytes are damaged: lost, garbled, doubled, inserted, in both directions.

use approx::assert_abs_diff_eq;
use std::{collections::BTreeMap, f64::consts::TAU};

use foxhunt::{
    core::{Clock, Rotator},
    hardware::{Approach, FirmataConfig, FirmataStepperError},
    sim::{EmulatedStepperConfig, Emulator},
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use super::rig::{Damage, DamageKind, FROM_DEVICE, Rig, TO_DEVICE};

/// Positions of a turn.
const POSITIONS: i32 = 16;
const POSITION: f64 = TAU / POSITIONS as f64;
/// Orders of a flight.
const ORDERS: usize = 8;
/// Time for which the motor may turn on after an error, in seconds: a damaged stop is repeated.
const GRACE_S: f64 = 0.5;
/// Time for which it is watched after an error, in seconds.
const WATCHED_S: f64 = 2.0;
/// The longest that an order may take, in seconds.
const PATIENCE_S: f64 = 90.0;

/// Findings of a flight.
#[derive(Debug, Default)]
struct Flown {
    /// Bytes to the device and from it.
    passed: [usize; 2],
    /// Largest difference of the true angle from the reported one, in radians.
    worst: f64,
    /// Kinds of errors, each once.
    errors: Vec<String>,
    lost: bool,
}

/// A flight of a seed.
struct Flight {
    rig: Rig,
    random: Xoshiro256PlusPlus,
    flown: Flown,
    /// Beginning of the present error, and the rotor's place at the end of its grace.
    failed: Option<(f64, Option<i64>)>,
    cable: f64,
}

impl Flight {
    fn new(seed: u64, damage: [Vec<Damage>; 2]) -> Self {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let ramp = random.random_bool(0.5);
        let two_sided = random.random_bool(0.5);
        let config = FirmataConfig {
            speed_half_steps_per_s: if ramp { 1000.0 } else { 600.0 },
            acceleration_half_steps_per_s2: if ramp { 4000.0 } else { 0.0 },
            approach: if two_sided { Approach::Compensated } else { Approach::OneSided },
            backlash_deg: if two_sided { 3.0 } else { 6.0 },
            answer_timeout_s: 2.0,
            ..FirmataConfig::default()
        };
        let cable = config.cable_turns * TAU;
        let emulated = EmulatedStepperConfig {
            phase: random.random_range(0..8),
            fastest_half_steps_per_s: Some(1100.0),
            ..EmulatedStepperConfig::default()
        };
        let rig = Rig::new(config, emulated);
        rig.cable.borrow_mut().damage = damage;
        Self { rig, random, flown: Flown::default(), failed: None, cable }
    }

    /// Lets 10 ms pass, and judges.
    fn tick(&mut self) -> Result<Option<f64>, FirmataStepperError> {
        let outcome = self.rig.tick();
        let now = self.rig.world.clock().now();
        let truth = self.rig.truth();
        assert_abs_diff_eq!(truth, 0.0, epsilon = self.cable + POSITION);
        match &outcome {
            Ok(Some(angle)) => {
                let error = (truth - angle).abs();
                self.flown.worst = self.flown.worst.max(error);
                assert!(error <= POSITION / 2.0, "it looks to {truth}, and reports {angle} rad");
            }
            Ok(None) => {}
            Err(error) => self.fail(error, now),
        }
        let rotor = self.rig.device.rotor();
        if let Some((since, stands_at)) = &mut self.failed
            && now > *since + GRACE_S
        {
            let stood = *stands_at.get_or_insert(rotor);
            assert_eq!(rotor, stood, "it turns {} s after an error", now - *since);
        }
        outcome
    }

    fn fail(&mut self, error: &FirmataStepperError, now: f64) {
        self.failed.get_or_insert((now, None));
        self.flown.lost |= matches!(error, FirmataStepperError::PositionLost { .. });
        let text = error.to_string();
        let kind = text.split(':').next().unwrap_or_default().to_owned();
        if !self.flown.errors.contains(&kind) {
            self.flown.errors.push(kind);
        }
    }

    /// Orders an angle.
    fn order(&mut self, angle: f64) -> bool {
        match self.rig.driver.turn_to(angle) {
            Ok(()) => {
                self.failed = None;
                true
            }
            Err(error) => {
                self.fail(&error, self.rig.world.clock().now());
                false
            }
        }
    }

    /// Waits until it stands, or fails for longer than an error is watched.
    fn settle(&mut self) {
        let begun = self.rig.world.clock().now();
        loop {
            let now = self.rig.world.clock().now();
            let outcome = self.tick();
            if matches!(outcome, Ok(Some(_))) && self.failed.is_none() {
                return;
            }
            if self.failed.is_some_and(|(since, _)| now > since + WATCHED_S) {
                return;
            }
            let patience = now - begun < PATIENCE_S;
            assert!(patience, "it neither stands nor fails: {:?}", self.rig.driver);
        }
    }

    fn pass(&mut self, seconds: f64) {
        let until = self.rig.world.clock().now() + seconds;
        while self.rig.world.clock().now() < until {
            // What comes of it is judged there.
            let _ = self.tick();
        }
    }

    fn fly(mut self) -> Flown {
        self.settle();
        for _ in 0..ORDERS {
            let angle = f64::from(self.random.random_range(-POSITIONS..=POSITIONS)) * POSITION;
            let aside = self.random.random_bool(0.15);
            let waits = self.random.random_bool(0.2);
            if self.order(angle) && aside {
                self.pass(0.4);
                let angle = f64::from(self.random.random_range(-POSITIONS..=POSITIONS)) * POSITION;
                self.order(angle);
            }
            self.settle();
            if waits {
                self.pass(2.5);
            }
            if self.flown.lost {
                break;
            }
        }
        self.end()
    }

    /// Ends it in the middle of a move: the motor stops.
    fn end(mut self) -> Flown {
        let angle = f64::from(self.random.random_range(-POSITIONS..=POSITIONS)) * POSITION;
        self.order(angle);
        self.pass(0.2);
        let Rig { driver, mut device, world, cable, .. } = self.rig;
        drop(driver);
        let mut serve = |seconds: f64| {
            world.advance(seconds).expect("a step");
            // Once it has taken what was sent, its end fails: the other one is gone.
            let _ = device.serve();
            device.rotor()
        };
        let stopped = serve(0.01);
        assert_eq!(serve(5.0), stopped, "it turns when the program has ended");
        self.flown.passed = cable.borrow().passed;
        self.flown
    }
}

/// One to three damaged bytes, anywhere in a flight with these numbers of bytes.
fn damage(seed: u64, passed: [usize; 2]) -> [Vec<Damage>; 2] {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x5EED);
    let mut damage = [Vec::new(), Vec::new()];
    // Half of them come together.
    let together = random.random_bool(0.5);
    let first = random.random_range(0..passed[0] + passed[1]);
    for i in 0..random.random_range(1..=3) {
        let any = if together || i == 0 {
            first + i
        } else {
            random.random_range(0..passed[0] + passed[1])
        };
        let (direction, at) =
            if any < passed[0] { (TO_DEVICE, any) } else { (FROM_DEVICE, any - passed[0]) };
        let byte = random.random();
        let kind = match random.random_range(0..4) {
            0 => DamageKind::Lost,
            1 => DamageKind::Doubled,
            2 => DamageKind::Inserted(byte),
            // One flipped bit is what a line makes most often.
            _ if random.random_bool(0.5) => DamageKind::Flipped(byte % 8),
            _ => DamageKind::Garbled(byte),
        };
        damage[direction].push(Damage { at, kind });
    }
    damage
}

/// Findings of all flights together.
#[derive(Default)]
struct Tally {
    flights: u32,
    lost: u32,
    failed: u32,
    worst: f64,
    errors: BTreeMap<String, u32>,
    /// Faults, each with its seed and its damage.
    wrong: Vec<String>,
}

impl Tally {
    fn add(&mut self, other: Self) {
        self.flights += other.flights;
        self.lost += other.lost;
        self.failed += other.failed;
        self.worst = self.worst.max(other.worst);
        for (error, count) in other.errors {
            *self.errors.entry(error).or_default() += count;
        }
        self.wrong.extend(other.wrong);
    }

    fn summary(&self) -> String {
        let Self { flights, lost, failed, errors, .. } = self;
        let degrees = self.worst.to_degrees();
        format!("{flights} flights: {lost} lost, {failed} failed, {degrees:.2}°\n{errors:#?}")
    }

    fn judge(&self) {
        let wrong = &self.wrong;
        assert!(wrong.is_empty(), "{} are wrong:\n{}", wrong.len(), wrong.join("\n"));
    }
}

/// Flies a seed without damage, and with it.
fn fly(seed: u64) -> Tally {
    let mut tally = Tally { flights: 1, ..Tally::default() };
    let flights = std::panic::catch_unwind(|| {
        let clean = Flight::new(seed, Default::default()).fly();
        assert!(clean.errors.is_empty(), "without damage: {:?}", clean.errors);
        Flight::new(seed, damage(seed, clean.passed)).fly()
    });
    match flights {
        Ok(flown) => {
            tally.lost = flown.lost.into();
            tally.failed = u32::from(!flown.errors.is_empty());
            tally.worst = flown.worst;
            tally.errors = flown.errors.into_iter().map(|error| (error, 1)).collect();
        }
        Err(panic) => {
            let text = panic.downcast_ref::<String>().cloned().unwrap_or_default();
            tally.wrong.push(format!("seed {seed}: {text}"));
        }
    }
    tally
}

#[test]
fn damaged_bytes_are_never_a_wrong_angle() {
    let mut tally = Tally::default();
    (0..150).for_each(|seed| tally.add(fly(seed)));
    println!("{}", tally.summary());
    tally.judge();
}

#[test]
#[ignore = "10,000 flights take minutes"]
fn ten_thousand_damaged_flights_have_no_wrong_angle() {
    let mut tally = Tally::default();
    std::thread::scope(|scope| {
        let part = |from: u64| {
            scope.spawn(move || {
                let mut tally = Tally::default();
                (from * 2500..(from + 1) * 2500).for_each(|seed| tally.add(fly(seed)));
                tally
            })
        };
        for thread in [0, 1, 2, 3].map(part) {
            tally.add(thread.join().expect("what panics is caught"));
        }
    });
    println!("{}", tally.summary());
    tally.judge();
}
