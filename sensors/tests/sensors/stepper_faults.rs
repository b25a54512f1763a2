//! The stepper source with devices that fail: a turn always ends.

use foxhunt_core::{BeaconId, PatternSource, Pose};
use foxhunt_sensors::{StepperConfig, StepperError};

use crate::devices::{Failed, Handle, Health, Source};

type Failure = StepperError<Failed, Failed, Failed>;

/// Polls to the end of a turn: how many samples it has and where it was, how long it took, and the
/// failures on the way.
fn turn(handle: &Handle, source: &mut Source) -> (usize, Pose, f64, Vec<Failure>) {
    let (start, mut failures) = (handle.with(|w| w.now), Vec::new());
    source.begin(&[BeaconId(0)]).expect("a turn can always begin");
    for _ in 0..20_000 {
        match source.poll() {
            Ok(Some(sweep)) => {
                let (samples, receiver) = (sweep.samples.len(), sweep.receiver);
                return (samples, receiver, handle.with(|w| w.now) - start, failures);
            }
            Ok(None) => {}
            Err(error) => failures.push(error),
        }
        handle.wait(0.01);
    }
    panic!("the turn does not end");
}

/// 2 s and 127 · 0.4 s, and up to a tick of 0.01 s at each of 128 positions.
fn timed_out(seconds: f64) -> bool {
    (52.8..54.1).contains(&seconds)
}

#[test]
fn a_dead_radio_ends_in_an_empty_sweep() {
    for health in [Health::Silent, Health::Broken] {
        let handle = Handle::default();
        handle.with(|w| w.radio = health);
        let mut source = handle.source(StepperConfig::pritzl2018());
        let (samples, receiver, seconds, failures) = turn(&handle, &mut source);
        assert_eq!(samples, 0);
        assert!(timed_out(seconds), "{seconds} s");
        assert_eq!(receiver, handle.with(|w| w.pose), "only the vehicle knows where it was");
        assert_eq!(failures.is_empty(), health == Health::Silent);
        assert!(failures.iter().all(|f| *f == StepperError::Radio(Failed)));
        assert_eq!(handle.with(|w| w.orders.len()), 128);
    }
}

#[test]
fn a_dead_motor_ends_in_an_empty_sweep() {
    for health in [Health::Silent, Health::Broken] {
        let handle = Handle::default();
        handle.with(|w| w.rotator = health);
        let mut source = handle.source(StepperConfig::pritzl2018());
        let (samples, _, seconds, failures) = turn(&handle, &mut source);
        assert_eq!((samples, handle.with(|w| w.questions.len())), (0, 0));
        assert!(timed_out(seconds), "{seconds} s");
        assert_eq!(failures.is_empty(), health == Health::Silent);
        assert!(failures.iter().all(|f| *f == StepperError::Rotator(Failed)));
    }
}

#[test]
fn a_motor_that_dies_on_the_way_keeps_what_was_received() {
    let handle = Handle::default();
    let mut source = handle.source(StepperConfig::pritzl2018());
    source.begin(&[BeaconId(0)]).expect("a turn can always begin");
    while handle.with(|w| w.answers) < 60 {
        assert_eq!(source.poll(), Ok(None));
        handle.wait(0.005);
    }
    handle.with(|w| w.rotator = Health::Broken);
    let mut ended = None;
    for _ in 0..20_000 {
        if let Ok(Some(sweep)) = source.poll() {
            ended = Some(sweep.samples.len());
            break;
        }
        handle.wait(0.01);
    }
    assert_eq!(ended, Some(60));
}

#[test]
fn a_radio_that_comes_back_is_polled_again() {
    let handle = Handle::default();
    let mut source = handle.source(StepperConfig::pritzl2018());
    source.begin(&[BeaconId(0)]).expect("a turn can always begin");
    handle.with(|w| w.turning = 0.0);
    assert_eq!(source.poll(), Ok(None));
    handle.with(|w| w.radio = Health::Broken);
    handle.wait(0.05);
    assert_eq!(source.poll(), Err(StepperError::Radio(Failed)));
    handle.with(|w| w.radio = Health::Good);
    // The answer was waiting; nothing is lost.
    let mut length = 0;
    for _ in 0..20_000 {
        if let Some(sweep) = source.poll().expect("all is well again") {
            length = sweep.samples.len();
            break;
        }
        handle.wait(0.005);
    }
    assert_eq!((length, handle.with(|w| w.questions.len())), (768, 768));
}

#[test]
fn an_answer_waits_for_a_vehicle_that_fails_once() {
    let handle = Handle::default();
    let mut source = handle.source(StepperConfig::pritzl2018());
    source.begin(&[BeaconId(0)]).expect("a turn can always begin");
    assert_eq!(source.poll(), Ok(None));
    handle.wait(0.02);
    assert_eq!(source.poll(), Ok(None));
    handle.with(|w| w.vehicle = Health::Broken);
    handle.wait(0.02);
    let received = handle.with(|w| w.now);
    for _ in 0..3 {
        assert_eq!(source.poll(), Err(StepperError::Vehicle(Failed)));
        handle.wait(0.02);
    }
    handle.with(|w| w.vehicle = Health::Good);
    let first = loop {
        if let Some(sweep) = source.poll().expect("all is well again") {
            assert_eq!(sweep.samples.len(), 768);
            break sweep.samples[0];
        }
        handle.wait(0.005);
    };
    assert!((first.time - received).abs() < 1e-12, "the sample's time is when its answer came");
    assert_eq!(source.dropped(), 0);
}

#[test]
fn a_vehicle_that_never_answers_does_not_stop_the_turn() {
    let handle = Handle::default();
    handle.with(|w| w.vehicle = Health::Broken);
    let mut source = handle.source(StepperConfig::pritzl2018());
    let (samples, receiver, seconds, failures) = turn(&handle, &mut source);
    assert_eq!((samples, receiver), (0, Pose::default()));
    // One more time-out at the end, for the vehicle to report where it is.
    assert!((53.2..54.6).contains(&seconds), "{seconds} s");
    assert_eq!(source.dropped(), 128, "one answer at each position had no place");
    assert!(failures.iter().all(|f| *f == StepperError::Vehicle(Failed)));
}

#[test]
fn powers_and_places_that_are_no_numbers_are_counted_and_not_kept() {
    let handle = Handle::default();
    handle.with(|w| w.nan_every = 6);
    let mut source = handle.source(StepperConfig::pritzl2018());
    let (samples, ..) = turn(&handle, &mut source);
    assert_eq!((samples, source.dropped()), (640, 128));
    handle.with(|w| w.nan_every = 1);
    let (samples, ..) = turn(&handle, &mut source);
    assert_eq!((samples, source.dropped()), (0, 768));
    handle.with(|w| (w.nan_every, w.pose.heading) = (usize::MAX, f64::NAN));
    let (samples, receiver, ..) = turn(&handle, &mut source);
    assert_eq!((samples, source.dropped()), (0, 768));
    assert!(receiver.is_finite());
}

#[test]
fn a_failure_names_the_device() {
    let failure: Failure = StepperError::Rotator(Failed);
    assert_eq!(failure.to_string(), "the rotator failed: out of order");
    assert!(core::error::Error::source(&failure).is_some());
}

#[test]
fn a_stuck_motor_fills_one_position() {
    let handle = Handle::default();
    handle.with(|w| w.stuck_at = Some(1.0));
    let mut source = handle.source(StepperConfig::pritzl2018());
    source.begin(&[BeaconId(0)]).expect("a turn can always begin");
    let mut positions = Vec::new();
    while positions.is_empty() {
        handle.wait(0.005);
        if let Some(sweep) = source.poll().expect("the devices work") {
            positions = sweep.samples.iter().map(|s| s.position).collect();
        }
    }
    // 1 rad is 20.37 positions.
    assert_eq!(positions, [20; 768]);
}
