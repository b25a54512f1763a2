//! The laws that implementors keep, as plain functions to call from a test.
//!
//! They take one case and panic on a breach, so they serve under `proptest`, under a seeded
//! loop, and in the tests of a crate that brings its own backend.

mod models;
mod predictive;

use core::fmt;

use nalgebra::{Matrix2, Vector2, Vector3};

use crate::{
    BeaconId, BearingExtractor, Decision, Estimate, FormationPlanner, NoReading, PatternSource,
    PlanError, Pose, Sample, Station, Sweep, angle,
};

pub use models::{
    Checks, estimator, estimator_with, measurement_model, measurement_model_at_one_observation,
    motion_model, smoother,
};
pub use predictive::Predictive;

/// The most drones that the laws are tried with.
const DRONES: usize = 8;

/// The most drones that a planner may be given.
const MOST: usize = 64;

/// True if anything was written.
struct Written(bool);

impl fmt::Write for Written {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0 |= !text.trim().is_empty();
        Ok(())
    }
}

/// A pattern source's laws over one turn that listens for `beacons`. `advance` lets a little time
/// pass; the turn must complete within `polls` of them.
///
/// # Panics
///
/// On a breach.
pub fn pattern_source(
    source: &mut impl PatternSource,
    beacons: &[BeaconId],
    polls: usize,
    mut advance: impl FnMut(),
) {
    lends_nothing(source, "a source before `begin`");
    if let Err(error) = source.begin(beacons) {
        panic!("the turn did not begin: {error}");
    }
    let mut left = beacons;
    for _ in 0..polls {
        let Some((beacon, others)) = left.split_first() else { break };
        match source.poll() {
            Err(error) => panic!("the turn failed: {error}"),
            // Further sweeps need no time.
            Ok(None) => {
                assert_eq!(left.len(), beacons.len(), "the sweep of {beacon:?} came late");
                advance();
            }
            Ok(Some(sweep)) => {
                assert_eq!(sweep.beacon, *beacon, "the sweep is of another beacon");
                keeps_order(&sweep);
                left = others;
            }
        }
    }
    assert!(left.is_empty(), "the turn did not end within {polls} polls");
    lends_nothing(source, "a source whose turn is over");
    if let Err(error) = source.begin(&[]) {
        panic!("a turn for no beacon failed: {error}");
    }
    lends_nothing(source, "a source with no beacon to measure");
}

fn lends_nothing(source: &mut impl PatternSource, which: &str) {
    match source.poll() {
        Ok(lent) => assert!(lent.is_none(), "{which} lent a sweep"),
        Err(error) => panic!("{which} failed: {error}"),
    }
}

fn keeps_order(sweep: &Sweep<'_>) {
    assert!(sweep.receiver.is_finite(), "the receiver's pose is not finite");
    let mut before = f64::NEG_INFINITY;
    for sample in sweep.samples {
        assert!(sample.time >= before, "time ran back to {} s", sample.time);
        before = sample.time;
        assert!(sample.position < sweep.positions, "position {}", sample.position);
        assert!(sample.boresight.is_finite() && sample.rss_dbm.is_finite());
    }
    for unanswered in sweep.unanswered {
        assert!(unanswered.position < sweep.positions, "position {}", unanswered.position);
        assert!(unanswered.boresight.is_finite(), "boresight {}", unanswered.boresight);
    }
    assert!(sweep.time >= before, "the turn ended before its last sample");
}

/// A bearing extractor's laws on one sweep; `room` holds at least as many samples as it. Questions
/// without an answer are left out.
///
/// # Panics
///
/// On a breach, and when `room` is too small.
pub fn bearing_extractor(
    extractor: &impl BearingExtractor,
    sweep: &Sweep<'_>,
    room: &mut [Sample],
) {
    let sweep = &Sweep { unanswered: &[], ..*sweep };
    let nothing = extractor.extract(&Sweep { samples: &[], ..*sweep });
    assert_eq!(nothing, Err(NoReading::Empty), "a sweep without samples was read");
    let Ok(reading) = extractor.extract(sweep) else { return };

    // Whole decibels and whole positions, so that rounding and binning turn along.
    const LOUDER: f64 = 7.0;
    const TURNED: u16 = 3;
    let turn = core::f64::consts::TAU * f64::from(TURNED) / f64::from(sweep.positions);
    let samples = &mut room[..sweep.samples.len()];
    for (copy, sample) in samples.iter_mut().zip(sweep.samples) {
        *copy = *sample;
        copy.rss_dbm += LOUDER;
        copy.boresight = angle::wrap(sample.boresight + turn);
        copy.position = (sample.position + TURNED) % sweep.positions;
    }
    let changed = extractor.extract(&Sweep { samples, ..*sweep }).expect("as good as before");
    let rise = changed.rss_dbm - reading.rss_dbm - LOUDER;
    assert!(rise.abs() < 1e-6, "{LOUDER} dB more raised the level by {rise} dB more than that");
    match (reading.bearing, changed.bearing) {
        (Ok(before), Ok(after)) => {
            let error = angle::distance(after.angle, before.angle + turn);
            assert!(error < 1e-6, "a turned sweep's bearing is off by {error} rad");
            let change = (after.sigma - before.sigma).abs();
            assert!(change < 1e-6, "a turned sweep's σ changed by {change} rad");
            assert!(before.sigma > 0.0, "the bearing's σ is {} rad", before.sigma);
            assert!((0.0..=1.0).contains(&before.confidence), "confidence {}", before.confidence);
            let change = (changed.covariance - reading.covariance).abs();
            assert!(change < 1e-6, "a turned sweep's covariance changed by {change} dB rad");
        }
        (Err(_), Err(_)) => {}
        (before, after) => panic!("the turned sweep has {after:?}, the other {before:?}"),
    }
}

/// A planner's laws for one belief and one set of drones, and for 1 to 8 drones that come and go.
/// `fresh` makes the same planner each time, one that explains itself.
///
/// # Panics
///
/// On a breach, or for more than 64 stations.
pub fn formation_planner<P: FormationPlanner>(
    fresh: impl Fn() -> P,
    belief: &Estimate<2>,
    stations: &mut [Station],
) {
    one_by_one(&mut fresh(), belief, stations);
    drones_come_and_go(&mut fresh(), belief);
}

/// The goal of each drone; zero beyond the last drone.
fn goals(stations: &[Station]) -> [Vector3<f64>; MOST] {
    assert!(stations.len() <= MOST, "{} stations are more than {MOST}", stations.len());
    core::array::from_fn(|drone| {
        stations.get(drone).map_or_else(Vector3::zeros, |s| s.goal.position)
    })
}

fn finite(stations: &[Station]) -> bool {
    stations.iter().all(|s| s.goal.position.iter().all(|c| c.is_finite()))
}

fn one_by_one<P: FormationPlanner>(
    planner: &mut P,
    belief: &Estimate<2>,
    stations: &mut [Station],
) {
    let before = goals(stations);
    match planner.begin(stations) {
        Ok(()) => assert!(finite(stations), "the first goals are not finite"),
        Err(error) => assert_eq!(goals(stations), before, "goals were changed despite: {error}"),
    }
    let before = goals(stations);
    match planner.plan(belief, stations) {
        Ok(_) => assert!(finite(stations), "the goals are not finite"),
        Err(error) => assert_eq!(goals(stations), before, "goals were changed despite: {error}"),
    }
    let before = goals(stations);
    let none = planner.plan_together(&[], stations);
    if planner.goes_on_without_signal() {
        assert!(none.is_ok() && finite(stations), "without a target it does not go on: {none:?}");
    } else {
        assert_eq!(none, Err(PlanError::NoPlace), "it plans for no target");
        assert_eq!(goals(stations), before, "goals were changed where there is no target");
    }
    let nowhere =
        Estimate { mean: Vector2::repeat(f64::NAN), covariance: Matrix2::repeat(f64::NAN) };
    for resumes in [false, true] {
        let before = goals(stations);
        let planned = match resumes {
            false => planner.plan(&nowhere, stations).map(|_| ()),
            true => planner.resume(&nowhere, stations),
        };
        if let Err(error) = planned {
            assert_eq!(goals(stations), before, "goals were changed despite: {error}");
        }
        assert!(
            finite(stations),
            "a belief that is not finite made goals that are not; return an error and change no goal"
        );
    }
}

/// Every number of drones plans after every other one, some of them not where they should be.
fn drones_come_and_go<P: FormationPlanner>(planner: &mut P, belief: &Estimate<2>) {
    let mut all: [Station; DRONES] = core::array::from_fn(|drone| {
        let east = 5.0 * f64::from(u8::try_from(drone).unwrap_or(u8::MAX));
        Station::holding(Pose::at(east, -0.5 * east, 2.0))
    });
    if let Err(error) = planner.begin(&mut all) {
        panic!("eight drones cannot begin: {error}");
    }
    for first in 1..=DRONES {
        for count in [first, DRONES + 1 - first, 1] {
            for station in all.iter_mut().step_by(2) {
                station.pose.position = station.goal.position;
            }
            let stations = &mut all[..count];
            match planner.plan(belief, stations) {
                Ok(decision) => {
                    assert!(finite(stations), "the goals of {count} drones are not finite");
                    explained(planner, &decision);
                    if let Decision::Finish(_) = decision
                        && let Err(error) = planner.begin(stations)
                    {
                        panic!("{count} drones cannot begin again: {error}");
                    }
                }
                Err(error) => panic!("{count} drones have no plan: {error}"),
            }
        }
    }
}

fn explained<P: FormationPlanner>(planner: &P, decision: &Decision) {
    let mut written = Written(false);
    let written_out = planner.explain(&mut written);
    assert!(written_out.is_ok() && written.0, "no reason is given for {decision:?}");
}
