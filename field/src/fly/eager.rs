//! A source that listens between the turns of its hunt, too.

use std::{cell::Cell, rc::Rc};

use foxhunt_core::{BeaconId, PatternSource, Sweep};
use foxhunt_hunt::hunt::Tap;

/// Order of the hunt to an [`Eager`] source: the number of sweeps that the hunt still gets.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ordered(Rc<Cell<usize>>);

impl Ordered {
    /// Ends the order, because the hunt does not await its sweeps any more.
    pub(super) fn end(&self) {
        self.0.set(0);
    }
}

/// A source that listens all the time: between the sweeps that the hunt has it make it makes its
/// own, which go to the [`Tap`] alone. A person who walks hears the level on the way.
pub(super) struct Eager<S> {
    source: S,
    drone: usize,
    beacons: Vec<BeaconId>,
    tap: Tap,
    ordered: Ordered,
    /// Number of sweeps left of the present turn of its own.
    own: usize,
}

impl<S: PatternSource> Eager<S> {
    /// Passes the sweeps of a drone's source to `tap`, of as many beacons as there are.
    pub(super) fn new(source: S, drone: usize, beacons: u16, tap: Tap) -> Self {
        let beacons = (0..beacons).map(BeaconId).collect();
        Self { source, drone, beacons, tap, ordered: Ordered::default(), own: 0 }
    }

    /// The order, which its giver may end.
    pub(super) fn ordered(&self) -> Ordered {
        self.ordered.clone()
    }
}

impl<S: PatternSource> PatternSource for Eager<S> {
    type Error = S::Error;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), S::Error> {
        self.own = 0;
        self.ordered.end();
        self.source.begin(beacons)?;
        self.ordered.0.set(beacons.len());
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, S::Error> {
        let ordered = self.ordered.0.get();
        if ordered == 0 && self.own == 0 {
            self.source.begin(&self.beacons)?;
            self.own = self.beacons.len();
            return Ok(None);
        }
        // After an error the turn is over, and the next poll begins one of its own.
        let own = std::mem::take(&mut self.own);
        self.ordered.end();
        let sweep = self.source.poll()?;
        let taken = usize::from(sweep.is_some());
        if let Some(sweep) = &sweep {
            (self.tap.borrow_mut())(self.drone, sweep);
        }
        if ordered > 0 {
            self.ordered.0.set(ordered - taken);
            return Ok(sweep);
        }
        self.own = own - taken;
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use std::{cell::RefCell, fmt};

    use foxhunt_core::{MeasuredList, Pose};

    use super::*;

    /// A source whose turn ends at every second poll.
    #[derive(Default)]
    struct Quick {
        begun: Vec<Vec<BeaconId>>,
        left: Vec<BeaconId>,
        polled: u32,
        /// True if the next call fails, and ends its turn.
        fails: bool,
    }

    impl Quick {
        fn fail(&mut self) -> Result<(), fmt::Error> {
            if std::mem::take(&mut self.fails) {
                self.left.clear();
                return Err(fmt::Error);
            }
            Ok(())
        }
    }

    impl PatternSource for Quick {
        type Error = fmt::Error;

        fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), fmt::Error> {
            self.fail()?;
            self.left = beacons.iter().rev().copied().collect();
            self.begun.push(beacons.to_vec());
            Ok(())
        }

        fn poll(&mut self) -> Result<Option<Sweep<'_>>, fmt::Error> {
            self.fail()?;
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
                got.extend(source.poll().expect("a source").map(|sweep| sweep.beacon.0));
            }
            got
        };
        assert_eq!(polls(&mut source, 6), [0_u16; 0]);
        assert_eq!(*heard.borrow(), [(3, 0), (3, 1)]);
        // An order takes the place of its own turn, and its own ones go on afterwards.
        source.begin(&[BeaconId(1)]).expect("it begins");
        assert_eq!(polls(&mut source, 10), [1]);
        assert_eq!(heard.borrow()[2..4], [(3, 1), (3, 0)]);
        assert_eq!(source.source.begun[2], [BeaconId(1)]);
        assert!(source.source.begun.len() >= 4);
    }

    #[test]
    fn the_tap_hears_on_after_a_turn_that_failed_or_is_given_up() {
        let heard = Rc::new(RefCell::new(0));
        let kept = Rc::clone(&heard);
        let tap: Tap = Rc::new(RefCell::new(move |_: usize, _: &Sweep<'_>| {
            *kept.borrow_mut() += 1;
        }));
        let mut source = Eager::new(Quick::default(), 0, 2, tap);
        let hears = |source: &mut Eager<Quick>| {
            let before = *heard.borrow();
            for _ in 0..12 {
                assert!(!matches!(source.poll(), Ok(Some(_))), "nothing is ordered");
            }
            *heard.borrow() > before
        };
        assert!(hears(&mut source));
        // Its own turn fails, one that was ordered does, and one cannot begin.
        source.source.fails = true;
        assert!(hears(&mut source));
        source.begin(&[BeaconId(1)]).expect("it begins");
        source.source.fails = true;
        assert_eq!(source.poll().err(), Some(fmt::Error));
        assert!(hears(&mut source));
        source.source.fails = true;
        assert_eq!(source.begin(&[BeaconId(1)]), Err(fmt::Error));
        assert!(hears(&mut source));
        // The source forgets its turn, and the hunt gives it up.
        source.begin(&[BeaconId(1)]).expect("it begins");
        source.source.left.clear();
        source.ordered().end();
        assert!(hears(&mut source));
    }
}
