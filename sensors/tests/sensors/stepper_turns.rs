//! The stepper source with devices that work.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use core::f64::consts::{PI, TAU};

use foxhunt_core::{BeaconId, PatternSource, Pose, Sample, angle, laws};
use foxhunt_sensors::StepperConfig;

use crate::devices::{Handle, Source};

/// Polls every `tick` seconds until the sweep is there: its samples, its receiver, its time.
fn turn(handle: &Handle, source: &mut Source, tick: f64) -> (Vec<Sample>, Pose, f64) {
    source.begin(&[BeaconId(3)]).expect("a turn can always begin");
    for _ in 0..100_000 {
        if let Some(sweep) = source.poll().expect("the devices work") {
            assert_eq!(sweep.beacon, BeaconId(3));
            return (sweep.samples.to_vec(), sweep.receiver, sweep.time);
        }
        handle.wait(tick);
    }
    panic!("the turn does not end");
}

#[test]
fn it_keeps_the_laws_of_a_pattern_source() {
    let handle = Handle::default();
    let mut source = handle.source(StepperConfig::pritzl2018());
    for _ in 0..3 {
        laws::pattern_source(&mut source, &[BeaconId(1)], 20_000, || handle.wait(0.005));
    }
    // Lossy radios too; the losses cost time.
    handle.with(|w| (w.lose_every, w.nan_every) = (5, 7));
    laws::pattern_source(&mut source, &[BeaconId(2)], 20_000, || handle.wait(0.005));
}

#[test]
fn a_turn_is_128_positions_of_6_samples() {
    let handle = Handle::default();
    let config = StepperConfig::default().with_mount_offset(0.3).expect("finite");
    let mut source = handle.source(config);
    let (samples, receiver, time) = turn(&handle, &mut source, 0.005);
    assert_eq!(samples.len(), 768);
    for (i, sample) in (0_u16..).zip(&samples) {
        assert_eq!(sample.position, i / 6);
        let angle = TAU * f64::from(i / 6) / 128.0;
        assert!(angle::distance(sample.boresight, 0.7 + 0.3 + angle) < 1e-12);
        assert!((-PI..PI).contains(&sample.boresight), "a boresight is wrapped");
        assert_eq!(sample.receiver, handle.with(|w| w.pose));
    }
    assert!((receiver.position - nalgebra::Vector3::new(3.0, -2.0, 4.0)).norm() < 1e-12);
    assert!(angle::distance(receiver.heading, 0.7) < 1e-12);
    // It ends when its last answer has come.
    assert_abs_diff_eq!(time, samples[767].time, epsilon = 1e-12);
    assert!(handle.with(|w| w.questions.iter().all(|q| q.0 == BeaconId(3))));
    assert_eq!(source.dropped(), 0);
    // A sweep is lent once.
    assert_eq!(source.poll(), Ok(None));
}

#[test]
fn turns_go_to_and_fro() {
    let handle = Handle::default();
    let mut source = handle.source(StepperConfig::pritzl2018());
    for backwards in [false, true, false] {
        handle.with(|w| w.orders.clear());
        let (samples, ..) = turn(&handle, &mut source, 0.01);
        let positions: Vec<u16> = samples.iter().step_by(6).map(|s| s.position).collect();
        let mut expected: Vec<u16> = (0..128).collect();
        if backwards {
            expected.reverse();
        }
        assert_eq!(positions, expected);
        // No order is more than a step from the one before: the cable never winds up.
        let orders = handle.with(|w| w.orders.clone());
        assert_eq!(orders.len(), 128);
        for pair in orders.windows(2) {
            assert_abs_diff_eq!(pair[1].0, pair[0].0, epsilon = TAU / 128.0 + 1e-12);
        }
    }
}

#[test]
fn a_poll_without_time_does_nothing_more() {
    let handle = Handle::default();
    let mut source = handle.source(StepperConfig::pritzl2018());
    source.begin(&[BeaconId(0)]).expect("a turn can always begin");
    let done = |h: &Handle| h.with(|w| (w.orders.len(), w.questions.len(), w.answers));
    for _ in 0..500 {
        let ended = source.poll().expect("the devices work").is_some();
        let before = done(&handle);
        if !ended {
            assert_eq!(source.poll(), Ok(None));
        }
        assert_eq!(done(&handle), before);
        handle.wait(0.007);
    }
}

#[test]
fn devices_without_delay_make_a_turn_in_one_poll() {
    let handle = Handle::default();
    handle.with(|w| (w.latency, w.turning) = (0.0, 0.0));
    let mut source = handle.source(StepperConfig::pritzl2018());
    source.begin(&[BeaconId(0)]).expect("a turn can always begin");
    let sweep = source.poll().expect("the devices work").expect("nothing to wait for");
    assert_eq!((sweep.samples.len(), sweep.positions), (768, 128));
}

#[test]
fn the_first_position_has_longer_than_the_others() {
    let handle = Handle::default();
    let config = StepperConfig::pritzl2018().with_positions(8).expect("positive");
    let mut source = handle.source(config);
    // 1.5 s is within the first position's 2 s and beyond every other's 0.4 s.
    handle.with(|w| w.turning = 1.5);
    let (samples, _, time) = turn(&handle, &mut source, 0.005);
    assert_eq!(samples.iter().map(|s| s.position).collect::<Vec<_>>(), [0; 6]);
    let orders = handle.with(|w| w.orders.clone());
    for pair in orders[1..].windows(2) {
        assert!(abs_diff_eq!(pair[1].1 - pair[0].1, 0.4, epsilon = 0.006), "0.4 s for a position");
    }
    assert_abs_diff_eq!(time - orders[7].1, 0.4, epsilon = 0.006);
}

#[test]
fn a_lost_answer_costs_the_rest_of_its_position() {
    let handle = Handle::default();
    // Questions 4, 8, 12 … are lost. Three answers, then silence until the time-out.
    handle.with(|w| w.lose_every = 4);
    let mut source = handle.source(StepperConfig::pritzl2018());
    let (samples, ..) = turn(&handle, &mut source, 0.005);
    let count = |p: u16| samples.iter().filter(|s| s.position == p).count();
    assert!((0..128).all(|p| count(p) == 3));
    let orders = handle.with(|w| w.orders.clone());
    // The time-out runs from the order, not from the standstill or the last answer.
    assert_abs_diff_eq!(orders[1].1 - orders[0].1, 2.0, epsilon = 0.006);
    assert_abs_diff_eq!(orders[2].1 - orders[1].1, 0.4, epsilon = 0.006);
}

#[test]
fn a_late_position_polls_no_more() {
    let handle = Handle::default();
    // An answer takes 0.15 s: two within 0.4 s less the turning, a third comes in late.
    handle.with(|w| w.latency = 0.15);
    let config = StepperConfig::pritzl2018().with_timeouts(0.4, 0.4).expect("positive");
    let mut source = handle.source(config);
    let (samples, ..) = turn(&handle, &mut source, 0.005);
    let questions = handle.with(|w| w.questions.len());
    assert_eq!(questions, 3 * 128);
    assert_eq!(samples.len(), 2 * 128);
    // Polled only every 0.3 s, the first answer is returned after 0.6 s: it counts, no second
    // question is sent.
    let handle = Handle::default();
    let mut source = handle.source(config);
    let (samples, ..) = turn(&handle, &mut source, 0.3);
    assert_eq!((samples.len(), handle.with(|w| w.questions.len())), (128, 128));
}

#[test]
fn a_turn_given_up_leaves_nothing_and_the_next_begins_nearby() {
    let handle = Handle::default();
    let mut source = handle.source(StepperConfig::pritzl2018());
    source.begin(&[BeaconId(9)]).expect("a turn can always begin");
    while handle.with(|w| w.orders.len()) < 100 {
        assert_eq!(source.poll(), Ok(None));
        handle.wait(0.005);
    }
    let (samples, ..) = turn(&handle, &mut source, 0.005);
    assert_eq!((samples.len(), samples[0].position), (768, 127), "99 is nearer to 127 than to 0");
}

#[test]
fn the_receiver_is_the_mean_over_the_turn() {
    let handle = Handle::default();
    let mut source = handle.source(StepperConfig::pritzl2018());
    source.begin(&[BeaconId(0)]).expect("a turn can always begin");
    let mut side = 1.0;
    let receiver = loop {
        // The heading swings about π: its linear mean would be 0.
        side = -side;
        handle.with(|w| w.pose = Pose { heading: side * 3.1, ..Pose::at(5.0 + side, 1.0, 4.0) });
        if let Some(sweep) = source.poll().expect("the devices work") {
            let east = sweep.samples.iter().map(|s| s.receiver.position.x).sum::<f64>() / 768.0;
            assert_abs_diff_eq!(sweep.receiver.position.x, east, epsilon = 1e-12);
            break sweep.receiver;
        }
        handle.wait(0.005);
    };
    assert!(angle::distance(receiver.heading, PI) < 0.05, "heading {}", receiver.heading);
}

/// Polls to the end of a turn for several beacons: what was received of each.
fn shared(handle: &Handle, source: &mut Source, beacons: &[BeaconId]) -> Vec<Vec<Sample>> {
    source.begin(beacons).expect("a turn can always begin");
    let mut received = Vec::new();
    for _ in 0..100_000 {
        while let Some(sweep) = source.poll().expect("the devices work") {
            assert_eq!(sweep.beacon, beacons[received.len()]);
            received.push(sweep.samples.to_vec());
        }
        if received.len() == beacons.len() {
            return received;
        }
        assert!(received.is_empty(), "all sweeps are lent when the turn is over");
        handle.wait(0.005);
    }
    panic!("the turn does not end");
}

#[test]
fn every_position_polls_every_beacon() {
    let handle = Handle::default();
    let mut source = handle.source(StepperConfig::pritzl2018());
    let beacons = [BeaconId(4), BeaconId(0)];
    laws::pattern_source(&mut source, &beacons, 20_000, || handle.wait(0.005));
    handle.with(|w| (w.orders.clear(), w.questions.clear()));
    for received in shared(&handle, &mut source, &beacons) {
        assert_eq!(received.len(), 768);
        assert!((0_u16..).zip(&received).all(|(i, sample)| sample.position == 127 - i / 6));
    }
    handle.with(|w| {
        assert_eq!(w.orders.len(), 128, "one turn serves both");
        for at_a_position in w.questions.chunks(12) {
            assert!(at_a_position[..6].iter().all(|q| q.0 == beacons[0]));
            assert!(at_a_position[6..].iter().all(|q| q.0 == beacons[1]));
        }
    });
}

#[test]
fn a_beacon_that_is_mute_costs_the_other_time_alone() {
    for (mute, other) in [(0, 1), (1, 0)] {
        let handle = Handle::default();
        handle.with(|w| w.mute = Some(BeaconId(u16::from(mute == 1))));
        let config = StepperConfig::pritzl2018();
        let mut source = handle.source(config);
        let begun = handle.with(|w| w.now);
        let received = shared(&handle, &mut source, &[BeaconId(0), BeaconId(1)]);
        assert_eq!((received[mute].len(), received[other].len()), (0, 768));
        let longest = config.longest_turn(2);
        assert_abs_diff_eq!(longest, 104.0, epsilon = 1e-12);
        let seconds = handle.with(|w| w.now) - begun;
        assert!(seconds < longest, "{seconds} s");
    }
}

#[test]
fn settings_are_checked() {
    let config = StepperConfig::pritzl2018();
    assert!(config.with_positions(0).is_err() && config.with_samples_per_position(0).is_err());
    assert!(config.with_timeouts(0.0, 1.0).is_err());
    assert!(config.with_timeouts(1.0, f64::NAN).is_err());
    assert!(config.with_mount_offset(f64::INFINITY).is_err());
    // 2 s and 127 times 0.4 s.
    assert_abs_diff_eq!(config.longest_turn(1), 52.8, epsilon = 1e-12);
}

/// One of every five questions has no answer. It ends its position, so that no position has two of
/// them.
#[test]
fn requests_without_an_answer_are_reported() {
    let handle = Handle::default();
    let config = StepperConfig::default().with_mount_offset(0.3).expect("finite");
    let config = config.with_floor_dbm(-100.0).expect("finite");
    let mut source = handle.source(config);
    handle.with(|w| w.lose_every = 5);
    for _ in 0..2 {
        source.begin(&[BeaconId(0)]).expect("a turn can always begin");
        let (unanswered, received) = loop {
            handle.wait(0.005);
            if let Some(sweep) = source.poll().expect("the devices work") {
                assert_eq!(sweep.floor_dbm, Some(-100.0));
                break (sweep.unanswered.to_vec(), sweep.samples.to_vec());
            }
        };
        assert!(unanswered.len() > 100, "{} questions", unanswered.len());
        for question in &unanswered {
            let nominal = 0.7 + 0.3 + TAU * f64::from(question.position) / 128.0;
            assert!(angle::distance(question.boresight, nominal) < 1e-9);
            assert!(received.iter().filter(|s| s.position == question.position).count() < 6);
        }
    }
}
