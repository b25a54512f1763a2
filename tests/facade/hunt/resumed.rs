//! A hunt that goes on from its log.

use super::*;

/// A hunt as `fly` flies it, that has not begun.
fn fresh(beacons: [&str; 2]) -> Hunt {
    hunt_for(&beacons, hunt_config(), TrackConfig::pritzl2018(), triangle()).expect("two beacons")
}

fn stations() -> Vec<Station> {
    stations_of(&toys(&Time::default()))
}

/// Contents of a log.
#[derive(Default)]
struct Past {
    /// The last estimate of every beacon.
    believed: Vec<(BeaconId, Estimate<2>)>,
    /// Receptions, each with its drone.
    received: Vec<(usize, Reception)>,
    /// The beacons with a fix.
    found: Vec<BeaconId>,
}

impl Past {
    fn of(events: &[Event]) -> Self {
        let mut past = Self::default();
        for event in events {
            match event {
                Event::BeaconStarted { beacon, prior, .. } => {
                    past.believed.push((*beacon, *prior));
                }
                Event::Received { drone, reception, .. } => {
                    past.received.push((*drone, *reception));
                }
                Event::Corrected { estimate, .. } => {
                    let (_, last) = past.received.last().expect("it was received before");
                    let known = past.believed.iter_mut().find(|(id, _)| *id == last.beacon);
                    known.expect("it was begun").1 = *estimate;
                }
                Event::BeaconFinished { fix, .. } => past.found.push(fix.beacon),
                _ => {}
            }
        }
        past
    }
}

#[test]
fn what_was_believed_found_and_received_is_there_again_to_the_bit() {
    let outing = fly(triangle(), [Health::Good; 3], false);
    let last = outing.events.len();
    for cut in (1..=last).step_by(11).chain([last]) {
        // A cut between a reception and its correction is one that replays the correction.
        let after = |event: Option<&Event>| matches!(event, Some(Event::Corrected { .. }));
        let cut = if after(outing.events.get(cut)) { cut + 1 } else { cut };
        let past = &outing.events[..cut];
        let mut hunt = fresh(["first", "second"]);
        hunt.resume(1e4, stations(), &[], past).expect("its own log");
        let Past { believed, received, found } = Past::of(past);
        let again: Vec<_> = hunt.believed().iter().map(|b| (b.beacon, b.estimate)).collect();
        let bits = |known: &[(BeaconId, Estimate<2>)]| {
            let of = |e: &Estimate<2>| -> Vec<u64> {
                e.mean.iter().chain(&e.covariance).map(|number| number.to_bits()).collect()
            };
            known.iter().map(|(beacon, estimate)| (*beacon, of(estimate))).collect::<Vec<_>>()
        };
        let known: Vec<_> = bits(&again).into_iter().take(believed.len()).collect();
        assert_eq!(known, bits(&believed), "after {cut} events");
        assert_eq!(hunt.fixes().iter().map(|fix| fix.beacon).collect::<Vec<_>>(), found);
        while hunt.poll_event().is_some() {}
        for (drone, reception) in &received {
            assert!(hunt.has_fused(*drone, reception));
            hunt.reception(1e4 + 1.0, *drone, reception);
        }
        assert_eq!(hunt.poll_event(), None, "something was counted twice");
        assert_eq!(hunt.is_finished(), found.len() == 2);
    }
}

#[test]
fn a_reception_of_another_time_or_drone_is_another_one() {
    let outing = fly(triangle(), [Health::Good; 3], false);
    let first = outing.events.iter().position(|e| matches!(e, Event::Corrected { .. }));
    let past = &outing.events[..=first.expect("something was received")];
    let (drone, reception) = Past::of(past).received[0];
    let mut hunt = fresh(["first", "second"]);
    hunt.resume(100.0, stations(), &[], past).expect("its own log");
    let later = Reception { time: reception.time + 1e-9, ..reception };
    for (drone, reception) in [(drone, later), (drone + 1, reception)] {
        while hunt.poll_event().is_some() {}
        hunt.reception(101.0, drone, &reception);
        assert!(matches!(hunt.poll_event(), Some(Event::Received { .. })), "{drone}");
    }
}

#[test]
fn another_hunts_log_is_refused_and_changes_nothing() {
    let outing = fly(Hold::new(1), [Health::Good; 3], false);
    let mut hunt = fresh(["first", "other"]);
    let error = hunt.resume(100.0, stations(), &[], &outing.events).expect_err("another name");
    assert!(matches!(error, HuntError::OtherHunt { beacon: 1, .. }), "{error}");
    assert!(error.to_string().contains("second") && error.to_string().contains("other"));
    assert!(hunt.stations().is_empty() && hunt.phase() == Phase::Idle);
    assert_eq!(hunt.poll_event(), None);
    hunt.start(0.0, stations()).expect("it has not begun");
}
