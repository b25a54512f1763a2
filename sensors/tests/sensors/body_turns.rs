//! A body that turns with its antenna, and an antenna that need not.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use core::f64::consts::{PI, TAU};

use foxhunt_core::{BeaconId, PatternSource, Pose, Sample, Sweep, Unanswered, angle, laws};
use foxhunt_sensors::{BodyConfig, BodyError, OmnidirectionalConfig, OmnidirectionalError};
use nalgebra::Vector3;

use crate::devices::{Body, Failed, Handle, Health};

/// Result of a turn of one beacon.
struct Turn {
    samples: Vec<Sample>,
    unanswered: Vec<Unanswered>,
    seconds: f64,
    failures: Vec<BodyError<Failed, Failed>>,
}

/// Devices whose answers come two ticks of 5 ms after the question.
fn devices() -> Handle {
    let handle = Handle::default();
    // Times are sums of ticks, which may fall short of it by rounding.
    handle.with(|w| w.latency = 0.0099);
    handle
}

/// Polls every `tick` seconds to the end of a turn for `beacons`.
fn turns(handle: &Handle, source: &mut Body, beacons: &[BeaconId], tick: f64) -> Vec<Turn> {
    let (begun, mut failures, mut turns) = (handle.with(|w| w.now), Vec::new(), Vec::new());
    source.begin(beacons).expect("a turn can always begin");
    for _ in 0..100_000 {
        match source.poll() {
            Ok(Some(Sweep { beacon, samples, unanswered, .. })) => {
                assert_eq!(beacon, beacons[turns.len()]);
                turns.push(Turn {
                    samples: samples.to_vec(),
                    unanswered: unanswered.to_vec(),
                    seconds: handle.with(|w| w.now) - begun,
                    failures: std::mem::take(&mut failures),
                });
                if turns.len() == beacons.len() {
                    return turns;
                }
            }
            Ok(None) => handle.wait(tick),
            Err(error) => {
                failures.push(error);
                handle.wait(tick);
            }
        }
    }
    panic!("the turn does not end");
}

fn turn(handle: &Handle, source: &mut Body) -> Turn {
    turns(handle, source, &[BeaconId(3)], 0.005).remove(0)
}

#[test]
fn it_keeps_the_laws_of_a_pattern_source() {
    for config in [BodyConfig::isaacs2014(), BodyConfig::pritzl2018()] {
        let handle = devices();
        let mut source = handle.body(config);
        for beacons in [&[BeaconId(1)][..], &[BeaconId(2), BeaconId(0)]] {
            laws::pattern_source(&mut source, beacons, 20_000, || handle.wait(0.005));
        }
        handle.with(|w| (w.lose_every, w.nan_every) = (5, 7));
        laws::pattern_source(&mut source, &[BeaconId(1)], 20_000, || handle.wait(0.005));
    }
}

#[test]
fn a_turn_goes_all_the_way_round_once() {
    for rate_rad_s in [1.3, -1.3] {
        let handle = devices();
        handle.with(|w| w.drift = Vector3::new(0.5, -0.2, 0.0));
        let start = handle.with(|w| (w.now, w.pose));
        let config = BodyConfig { rate_rad_s, mount_offset_rad: 0.4, ..BodyConfig::isaacs2014() };
        let mut source = handle.body(config);
        let Turn { samples, seconds, .. } = turn(&handle, &mut source);
        assert_abs_diff_eq!(seconds, TAU / 1.3, epsilon = 0.02);
        assert!(samples.len() > 450, "{} samples every 10 ms", samples.len());
        for sample in &samples {
            let since = sample.time - start.0;
            let heading = start.1.heading + rate_rad_s * since;
            assert!(angle::distance(sample.receiver.heading, heading) < 1e-9);
            assert!(angle::distance(sample.boresight, heading + 0.4) < 1e-9);
            let place = start.1.position + Vector3::new(0.5, -0.2, 0.0) * since;
            assert!((sample.receiver.position - place).norm() < 1e-9, "it is where it was then");
            let nominal = TAU * f64::from(sample.position) / 128.0;
            assert!(angle::distance(sample.boresight, nominal) <= TAU / 256.0 + 1e-9);
        }
        let mut positions: Vec<u16> = samples.iter().map(|s| s.position).collect();
        positions.sort_unstable();
        positions.dedup();
        assert_eq!(positions.len(), 128);
        assert_eq!(handle.with(|w| w.spins.clone()), [Some(rate_rad_s)], "it goes on turning");
    }
}

#[test]
fn the_references_turn_polls_six_times_at_each_heading_and_ends_at_rest() {
    let handle = devices();
    let config = BodyConfig::pritzl2018();
    let mut source = handle.body(config);
    let Turn { samples, seconds, .. } = turn(&handle, &mut source);
    // Polled every few milliseconds, a question is late by as much.
    assert!((350..=384).contains(&samples.len()), "{}", samples.len());
    assert_abs_diff_eq!(seconds, 12.8, epsilon = 0.02);
    for pair in samples.windows(2) {
        let step = angle::wrap(pair[1].boresight - pair[0].boresight);
        assert!((TAU / 384.0 - 1e-9..TAU / 340.0).contains(&step), "{step}");
    }
    assert_eq!(handle.with(|w| w.spins.clone()), [Some(config.rate_rad_s), None]);
    // A turn that is given up for good ends at rest, too.
    source.begin(&[BeaconId(0)]).expect("it begins");
    assert_eq!(source.poll(), Ok(None));
    source.begin(&[]).expect("it ends");
    assert_eq!(handle.with(|w| w.spins.len()), 4);
    assert_abs_diff_eq!(handle.with(|w| w.rate), 0.0, epsilon = 1e-12);
}

#[test]
fn the_moment_of_the_power_is_where_the_sample_lies() {
    for (measured_at, late) in [(0.0, 0.0), (0.5, 0.02), (1.0, 0.04)] {
        let handle = devices();
        handle.with(|w| w.latency = 0.0399);
        // Through the heading π, where a plain mean would look back.
        handle.with(|w| w.pose.heading = 3.0);
        let begun = handle.with(|w| w.now);
        let mut source = handle.body(BodyConfig { measured_at, ..BodyConfig::isaacs2014() });
        let Turn { samples, .. } = turn(&handle, &mut source);
        let questions = handle.with(|w| w.questions.clone());
        for (sample, (_, requested)) in samples.iter().zip(questions) {
            assert_abs_diff_eq!(sample.time - requested, late, epsilon = 1e-9);
            let heading = 3.0 + 0.5 * PI * (sample.time - begun);
            assert!(angle::distance(sample.boresight, heading) < 1e-9);
        }
    }
}

#[test]
fn beacons_are_polled_in_turn() {
    let handle = devices();
    handle.with(|w| w.mute = Some(BeaconId(5)));
    let mut source = handle.body(BodyConfig::isaacs2014());
    let beacons = [BeaconId(5), BeaconId(2), BeaconId(0)];
    let received = turns(&handle, &mut source, &beacons, 0.005);
    let requested = handle.with(|w| w.questions.clone());
    assert!(
        requested
            .iter()
            .zip(beacons.iter().cycle())
            .all(|(requested, beacon)| requested.0 == *beacon)
    );
    // Two answers of 10 ms and a time-out of 50 ms, or a tick more, make a round.
    let rounds = 4.0 / 0.0725;
    for (turn, silent) in received.iter().zip([true, false, false]) {
        let (answers, none) = (turn.samples.len(), turn.unanswered.len());
        let count = f64::from(u32::try_from(answers.max(none)).expect("few"));
        assert_abs_diff_eq!(count, rounds, epsilon = 3.0);
        assert_eq!((answers == 0, none > 0), (silent, silent));
    }
}

#[test]
fn a_body_that_does_not_turn_is_reported() {
    // One that stays, one that is too slow, one that turns the other way.
    for (follows, sound) in [(0.0, false), (0.2, false), (-1.0, true)] {
        let handle = devices();
        handle.with(|w| w.follows = follows);
        let mut source = handle.body(BodyConfig::isaacs2014());
        let turn = turn(&handle, &mut source);
        assert!(turn.samples.len() > 300, "it keeps what it has");
        assert_eq!(turn.failures.is_empty(), sound);
        if let Some(BodyError::NotAround { turned, seconds }) = turn.failures.first() {
            assert_abs_diff_eq!(*turned, follows * 12.0 * 0.5 * PI, epsilon = 0.02);
            assert!(abs_diff_eq!(*seconds, 12.0, epsilon = 0.011) && turn.failures.len() == 1);
        }
    }
}

#[test]
fn a_turn_ends_whatever_fails() {
    let broken = |radio, rotator, vehicle| {
        let handle = devices();
        handle.with(|w| (w.radio, w.rotator, w.vehicle) = (radio, rotator, vehicle));
        let mut source = handle.body(BodyConfig::pritzl2018());
        let turn = turn(&handle, &mut source);
        (turn.samples.len(), turn.seconds, turn.failures)
    };
    let (good, bad) = (Health::Good, Health::Broken);
    let radio = broken(bad, good, good);
    assert_eq!(radio.0, 0);
    assert!(radio.2.iter().all(|f| *f == BodyError::Radio(Failed)) && radio.1 < 13.0);
    // Without a body that turns there are no samples: the antenna looks one way.
    let spin = broken(good, bad, good);
    assert!((40.0..40.3).contains(&spin.1) && spin.0 == 0, "{} s, {}", spin.1, spin.0);
    let place = broken(good, good, bad);
    assert!((40.0..40.3).contains(&place.1) && place.0 == 0, "{} s", place.1);
    assert!(place.2.contains(&BodyError::Vehicle(Failed)));
    let silent = broken(Health::Silent, good, good);
    assert!(silent.0 == 0 && silent.1 < 13.0 && silent.2.is_empty());
}

/// A body that does not take the order to stop goes on turning: that is reported, and the turn is
/// over only when the order is taken.
#[test]
fn a_body_that_does_not_stop_is_reported() {
    let handle = devices();
    let mut source = handle.body(BodyConfig::pritzl2018());
    let begun = handle.with(|w| w.now);
    source.begin(&[BeaconId(3)]).expect("a turn can always begin");
    let mut failures = 0_u32;
    let mut samples = 0;
    while failures < 100 {
        let turns = handle.with(|w| w.now) > begun + 1.0;
        handle.with(|w| w.rotator = if turns { Health::Broken } else { Health::Good });
        match source.poll() {
            Ok(Some(_)) => panic!("the turn is over, and the body turns on"),
            Ok(None) => {}
            Err(error) => {
                assert_eq!(error, BodyError::Vehicle(Failed));
                failures += 1;
            }
        }
        handle.wait(0.005);
    }
    handle.with(|w| w.rotator = Health::Good);
    for _ in 0..1000 {
        match source.poll() {
            Ok(Some(sweep)) => samples = sweep.samples.len(),
            over => assert_eq!(over.map(|_| ()), Ok(())),
        }
        handle.wait(0.005);
    }
    assert!(samples > 100, "{samples} samples");
}

#[test]
fn what_is_not_a_number_is_counted_and_dropped() {
    let handle = devices();
    handle.with(|w| w.nan_every = 4);
    let mut source = handle.body(BodyConfig::isaacs2014());
    let turn = turn(&handle, &mut source);
    let requested = handle.with(|w| w.questions.len());
    let dropped = usize::try_from(source.dropped()).expect("few");
    assert_eq!((turn.samples.len() + dropped, dropped), (requested, requested / 4));
    // A compass that reports nothing for a while costs samples, not the turn.
    source.begin(&[BeaconId(0)]).expect("it begins");
    let good = handle.with(|w| w.pose);
    handle.with(|w| w.pose = Pose { heading: f64::NAN, ..good });
    for _ in 0..20 {
        assert_eq!(source.poll(), Ok(None));
        handle.with(|w| w.now += 0.005);
    }
    handle.with(|w| w.pose = good);
    let ended = (0..2000).any(|_| {
        handle.wait(0.005);
        source.poll().expect("the devices work").is_some()
    });
    assert!(ended);
}

#[test]
fn without_a_direction_there_is_a_level_at_one_position() {
    let config = OmnidirectionalConfig { questions: 20, ..OmnidirectionalConfig::default() };
    let handle = devices();
    let mut source = handle.omnidirectional(config);
    let beacons = [BeaconId(1), BeaconId(4)];
    laws::pattern_source(&mut source, &beacons, 1000, || handle.wait(0.005));
    assert_eq!(handle.with(|w| w.questions.len()), 40);
    handle.with(|w| w.mute = Some(BeaconId(4)));
    source.begin(&beacons).expect("it begins");
    let mut counts = Vec::new();
    while counts.len() < 2 {
        match source.poll().expect("the devices work") {
            Some(sweep) => {
                assert_eq!(sweep.positions, 1);
                counts.push((sweep.samples.len(), sweep.unanswered.len()));
            }
            None => handle.wait(0.005),
        }
    }
    assert_eq!(counts, [(20, 0), (0, 20)]);
    for (radio, vehicle) in [(Health::Broken, Health::Good), (Health::Good, Health::Broken)] {
        handle.with(|w| (w.radio, w.vehicle, w.mute) = (radio, vehicle, None));
        source.begin(&beacons[..1]).expect("it begins");
        let mut failures = Vec::new();
        let seconds = (0..100_000).find_map(|tick| {
            match source.poll() {
                Ok(Some(sweep)) => {
                    assert!(sweep.samples.is_empty());
                    return Some(f64::from(tick) * 0.005);
                }
                Ok(None) => {}
                Err(error) => failures.push(error),
            }
            handle.wait(0.005);
            None
        });
        // Twenty times two time-outs at most.
        assert!(seconds.is_some_and(|s| s < 20.0 * 0.12), "{seconds:?} s");
        let expected = match radio {
            Health::Broken => OmnidirectionalError::Radio(Failed),
            _ => OmnidirectionalError::Vehicle(Failed),
        };
        assert!(failures.contains(&expected));
    }
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let base = BodyConfig::isaacs2014();
    for (config, name) in [
        (BodyConfig { rate_rad_s: 0.0, ..base }, "rate_rad_s"),
        (BodyConfig { positions: 0, ..base }, "positions"),
        (BodyConfig { measured_at: 1.5, ..base }, "measured_at"),
        (BodyConfig { turn_timeout_s: f64::NAN, ..base }, "turn_timeout_s"),
        (BodyConfig { floor_dbm: Some(f64::NAN), ..base }, "floor_dbm"),
    ] {
        let reported = config.check().expect_err(name).to_string();
        assert!(reported.starts_with(name), "{reported}");
    }
    let none = OmnidirectionalConfig { questions: 0, ..OmnidirectionalConfig::default() };
    assert!(none.check().is_err());
}
