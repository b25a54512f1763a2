use foxhunt_core::Correction;

use crate::hunt::Event;

/// The semi-major axis of the 95 % ellipse that [`SearchProgress`] asks for, in metres.
const SEMI_MAJOR_M: f64 = 3.0;

/// How the search for one beacon came along, whatever its last estimate was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SearchProgress {
    /// After how many filter steps on this beacon the semi-major axis of its 95 % ellipse was
    /// below 3 m for the first time; `None` if it never was. A step is one reception.
    pub steps_to_3m: Option<u32>,
    /// The same in simulated seconds, from the moment at which the search began: for the first
    /// beacon, and for all where turns are shared, the beginning of the hunt.
    pub time_to_3m_s: Option<f64>,
    /// How far all drones together flew from the beginning of the search to its end, in metres.
    /// Where turns are shared, the same metres count for every beacon that is searched for.
    pub path_m: f64,
}

/// Follows the events of a hunt.
#[derive(Debug)]
pub(super) struct Milestones {
    searches: Vec<Milestone>,
    /// Whose reception the next correction is of.
    heard: usize,
}

#[derive(Clone, Copy, Debug, Default)]
struct Milestone {
    begun: f64,
    path_before_m: f64,
    steps: u32,
    progress: SearchProgress,
}

impl Milestones {
    pub(super) fn new(beacons: usize) -> Self {
        Self { searches: vec![Milestone::default(); beacons], heard: 0 }
    }

    /// Takes note of an event; `path_m` tells how far all drones together have flown until now.
    pub(super) fn note(&mut self, event: &Event, path_m: impl FnOnce() -> f64) {
        match event {
            Event::BeaconStarted { time, beacon, .. } => {
                if let Some(search) = self.searches.get_mut(usize::from(beacon.0)) {
                    *search =
                        Milestone { begun: *time, path_before_m: path_m(), ..Milestone::default() };
                }
            }
            Event::Received { reception, .. } => self.heard = usize::from(reception.beacon.0),
            Event::Corrected { time, correction, estimate, .. } => {
                let Some(search) = self.searches.get_mut(self.heard) else { return };
                search.steps += u32::from(*correction != Correction::Empty);
                let small = estimate.ellipse(0.95).is_some_and(|e| e.semi_major < SEMI_MAJOR_M);
                if small && search.progress.steps_to_3m.is_none() {
                    search.progress.steps_to_3m = Some(search.steps);
                    search.progress.time_to_3m_s = Some(time - search.begun);
                }
            }
            Event::BeaconFinished { fix, .. } => {
                if let Some(search) = self.searches.get_mut(usize::from(fix.beacon.0)) {
                    search.progress.path_m = path_m() - search.path_before_m;
                }
            }
            _ => {}
        }
    }

    pub(super) fn of(&self, beacon: usize) -> Option<SearchProgress> {
        Some(self.searches.get(beacon)?.progress)
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{
        BeaconId, BearingModes, Estimate, NoBearing, Outcome, Reading, Reception, Sweep,
    };
    use nalgebra::Vector2;

    use super::*;
    use crate::hunt::Fix;

    fn started(time: f64, beacon: u16) -> Event {
        let prior = Estimate::isotropic(Vector2::zeros(), 50.0);
        Event::BeaconStarted { time, beacon: BeaconId(beacon), name: String::new(), prior }
    }

    fn heard(time: f64, beacon: u16, sigma: f64) -> [Event; 2] {
        let sweep = Sweep { beacon: BeaconId(beacon), time, ..Sweep::default() };
        let reading = Reading {
            rss_dbm: -60.0,
            rss_sigma_db: 4.0,
            bearing: Err(NoBearing::TooSparse { heard: 1, needed: 16 }),
            covariance: 0.0,
            modes: BearingModes::default(),
        };
        let reception = Reception::new(&sweep, &reading);
        let correction =
            Correction::Fused { nis: None, log_evidence: 0.0, effective_sample_size: None };
        let estimate = Estimate::isotropic(Vector2::zeros(), sigma);
        [
            Event::Received { time, drone: 0, first_position: false, reception },
            Event::Corrected { time, drone: 0, correction, estimate },
        ]
    }

    fn finished(time: f64, beacon: u16) -> Event {
        let fix = Fix {
            beacon: BeaconId(beacon),
            name: String::new(),
            estimate: Estimate::isotropic(Vector2::zeros(), 1.0),
            steps: 0,
            formation_positions: 0,
            outcome: Outcome::Converged,
        };
        Event::BeaconFinished { time, fix }
    }

    /// Two beacons in shared turns; the semi-major axis is 2.4477 σ.
    #[test]
    fn corrections_belong_to_the_beacon_that_was_received_before_them() {
        let mut milestones = Milestones::new(2);
        let events = [
            vec![started(10.0, 0), started(10.0, 1)],
            heard(20.0, 0, 9.0).into(),
            heard(20.0, 1, 1.3).into(),
            heard(30.0, 0, 1.2).into(),
            heard(40.0, 1, 1.2).into(),
            heard(50.0, 0, 9.0).into(),
            heard(60.0, 0, 1.0).into(),
            vec![finished(70.0, 0), finished(90.0, 1)],
        ];
        for (event, path) in events.iter().flatten().zip(0..) {
            milestones.note(event, || 2.0 * f64::from(path));
        }
        let first = milestones.of(0).expect("there are two");
        assert_eq!((first.steps_to_3m, first.time_to_3m_s), (Some(2), Some(20.0)));
        let second = milestones.of(1).expect("there are two");
        assert_eq!((second.steps_to_3m, second.time_to_3m_s), (Some(2), Some(30.0)));
        // Begun at events 0 and 1, over at 14 and 15.
        assert!((first.path_m - 28.0).abs() + (second.path_m - 28.0).abs() < 1e-12);
        assert_eq!(milestones.of(2), None);
    }

    #[test]
    fn what_was_not_reached_is_not_told() {
        let mut milestones = Milestones::new(1);
        milestones.note(&started(0.0, 0), || 0.0);
        for event in heard(1.0, 0, 5.0) {
            milestones.note(&event, || 0.0);
        }
        let progress = milestones.of(0).expect("there is one");
        assert_eq!((progress.steps_to_3m, progress.time_to_3m_s), (None, None));
    }
}
