//! A source that listens between the turns of its hunt, too.

use foxhunt_core::{BeaconId, PatternSource, Sweep};
use foxhunt_hunt::hunt::Tap;

/// A source that listens all the time: between the sweeps that the hunt has it make it makes its
/// own, which go to the [`Tap`] alone. A person who walks hears the level on the way.
pub(super) struct Eager<S> {
    source: S,
    drone: usize,
    beacons: Vec<BeaconId>,
    tap: Tap,
    /// Number of sweeps that the hunt still gets.
    ordered: usize,
    /// Number of sweeps left of the present turn of its own.
    own: usize,
}

impl<S: PatternSource> Eager<S> {
    /// Passes the sweeps of a drone's source to `tap`, of as many beacons as there are.
    pub(super) fn new(source: S, drone: usize, beacons: u16, tap: Tap) -> Self {
        let beacons = (0..beacons).map(BeaconId).collect();
        Self { source, drone, beacons, tap, ordered: 0, own: 0 }
    }
}

impl<S: PatternSource> PatternSource for Eager<S> {
    type Error = S::Error;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), S::Error> {
        self.own = 0;
        self.ordered = beacons.len();
        self.source.begin(beacons)
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, S::Error> {
        if self.ordered > 0 {
            let sweep = self.source.poll()?;
            if let Some(sweep) = &sweep {
                self.ordered -= 1;
                (self.tap.borrow_mut())(self.drone, sweep);
            }
            return Ok(sweep);
        }
        if self.own == 0 {
            self.source.begin(&self.beacons)?;
            self.own = self.beacons.len();
        } else if let Some(sweep) = self.source.poll()? {
            self.own -= 1;
            (self.tap.borrow_mut())(self.drone, &sweep);
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use std::{cell::RefCell, convert::Infallible, rc::Rc};

    use foxhunt_core::{MeasuredList, Pose};

    use super::*;

    /// A source whose turn ends at every second poll.
    #[derive(Default)]
    struct Quick {
        begun: Vec<Vec<BeaconId>>,
        left: Vec<BeaconId>,
        polled: u32,
    }

    impl PatternSource for Quick {
        type Error = Infallible;

        fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), Infallible> {
            self.left = beacons.iter().rev().copied().collect();
            self.begun.push(beacons.to_vec());
            Ok(())
        }

        fn poll(&mut self) -> Result<Option<Sweep<'_>>, Infallible> {
            self.polled += 1;
            if !self.polled.is_multiple_of(2) {
                return Ok(None);
            }
            let Some(beacon) = self.left.pop() else { return Ok(None) };
            Ok(Some(Sweep {
                beacon,
                time: f64::from(self.polled),
                receiver: Pose::default(),
                positions: 1,
                samples: &[],
                unanswered: &[],
                floor_dbm: None,
                receiver_sigma_m: None,
                measured: MeasuredList::default(),
            }))
        }
    }

    #[test]
    fn the_hunt_gets_its_own_sweeps_alone_and_the_tap_gets_all() {
        let heard = Rc::new(RefCell::new(Vec::new()));
        let kept = Rc::clone(&heard);
        let tap: Tap = Rc::new(RefCell::new(move |drone: usize, sweep: &Sweep<'_>| {
            kept.borrow_mut().push((drone, sweep.beacon.0));
        }));
        let mut source = Eager::new(Quick::default(), 3, 2, tap);
        let polls = |source: &mut Eager<Quick>, count: u32| {
            let mut got = Vec::new();
            for _ in 0..count {
                got.extend(source.poll().expect("infallible").map(|sweep| sweep.beacon.0));
            }
            got
        };
        assert_eq!(polls(&mut source, 6), [0_u16; 0]);
        assert_eq!(*heard.borrow(), [(3, 0), (3, 1)]);
        // An order takes the place of its own turn, and its own ones go on afterwards.
        source.begin(&[BeaconId(1)]).expect("infallible");
        assert_eq!(polls(&mut source, 10), [1]);
        assert_eq!(heard.borrow()[2..4], [(3, 1), (3, 0)]);
        assert_eq!(source.source.begun[2], [BeaconId(1)]);
        assert!(source.source.begun.len() >= 4);
    }
}
