//! A user's devices, a source and a vehicle; shorthands for entries of the registry and
//! repetitions.

use std::{cell::Cell, f64::consts::TAU, fmt, rc::Rc};

use foxhunt::{
    campaign::Repetition,
    core::angle,
    prelude::*,
    sensors::{LogDistance, Propagation},
};
use nalgebra::Vector2;

/// The estimators of these names.
pub(crate) fn entries(names: &[&str]) -> Vec<EstimatorEntry> {
    let registry = Registry::builtin();
    names.iter().map(|name| registry.estimator(name).expect("it has a name").clone()).collect()
}

/// The estimator of a name.
pub(crate) fn entry(name: &str) -> EstimatorEntry {
    entries(&[name]).remove(0)
}

/// This number of runs from a seed on, on two threads.
pub(crate) fn repetition(runs: u32, seed: u64) -> Repetition<'static> {
    Repetition { runs, seed, jobs: 2, progress: &|| () }
}

/// A clock that the test moves.
pub(crate) type Time = Rc<Cell<f64>>;

/// A device that is broken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Unplugged;

impl fmt::Display for Unplugged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the cable is unplugged")
    }
}

impl std::error::Error for Unplugged {}

/// A drone of the test.
pub(crate) type Toy = Drone<Cardioid, Teleport>;

/// A vehicle that is wherever it was last sent to.
#[derive(Clone, Debug)]
pub(crate) struct Teleport {
    pub(crate) place: Rc<Cell<Pose>>,
    pub(crate) stuck: bool,
}

impl Teleport {
    pub(crate) fn at(east: f64, north: f64) -> Self {
        Self { place: Rc::new(Cell::new(Pose::at(east, north, 4.0))), stuck: false }
    }
}

impl Vehicle for Teleport {
    type Error = Unplugged;

    fn pose(&mut self) -> Result<Pose, Unplugged> {
        Ok(self.place.get())
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), Unplugged> {
        if !self.stuck {
            self.place.set(Pose::level(goal.position, 0.0));
        }
        Ok(())
    }
}

/// Behaviour of a [`Cardioid`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Health {
    Good,
    Silent,
    Broken,
    /// It listens, but nobody knows where.
    Astray,
}

/// An antenna with a cardioid pattern that takes one second for a turn and makes no error.
#[derive(Clone, Debug)]
pub(crate) struct Cardioid {
    pub(crate) time: Time,
    pub(crate) place: Rc<Cell<Pose>>,
    pub(crate) targets: Vec<Vector2<f64>>,
    pub(crate) health: Health,
    /// A beacon of which it receives nothing.
    pub(crate) deaf_to: Option<BeaconId>,
    /// The beacons of the turn, and when it is over.
    ready: (Vec<BeaconId>, f64),
    samples: Vec<Sample>,
}

pub(crate) const LAW: (f64, f64) = (-29.06, 2.765);

impl Cardioid {
    pub(crate) fn new(
        time: &Time,
        vehicle: &Teleport,
        targets: &[Vector2<f64>],
        health: Health,
    ) -> Self {
        Self {
            time: time.clone(),
            place: vehicle.place.clone(),
            targets: targets.to_vec(),
            health,
            deaf_to: None,
            ready: (Vec::new(), 0.0),
            samples: Vec::new(),
        }
    }
}

impl PatternSource for Cardioid {
    type Error = Unplugged;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), Unplugged> {
        self.ready = (beacons.to_vec(), self.time.get() + 1.0);
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, Unplugged> {
        const POSITIONS: u16 = 64;
        match self.health {
            Health::Good | Health::Astray => {}
            Health::Silent => return Ok(None),
            Health::Broken => return Err(Unplugged),
        }
        let due = self.ready.1;
        if self.time.get() < due || self.ready.0.is_empty() {
            return Ok(None);
        }
        let beacon = self.ready.0.remove(0);
        if self.deaf_to == Some(beacon) {
            return Ok(Some(Sweep {
                beacon,
                time: due,
                receiver: self.place.get(),
                positions: POSITIONS,
                samples: &[],
                ..Sweep::default()
            }));
        }
        let receiver = self.place.get();
        let law = LogDistance::new(LAW.0, LAW.1).expect("in range");
        let sight = self.targets[usize::from(beacon.0)].push(0.0) - receiver.position;
        let range = sight.norm();
        let bearing = sight.y.atan2(sight.x);
        let gain = |a: f64| 10.0 * (0.55 + 0.45 * a.cos()).log10();
        let boresight = |i: u16| TAU * f64::from(i) / f64::from(POSITIONS);
        let mean = (0..POSITIONS).map(|i| gain(boresight(i))).sum::<f64>() / f64::from(POSITIONS);
        self.samples.clear();
        self.samples.extend((0..POSITIONS).map(|position| Sample {
            time: due,
            receiver,
            boresight: angle::wrap(boresight(position)),
            position,
            rss_dbm: law.rss_dbm(range) + gain(boresight(position) - bearing) - mean,
        }));
        Ok(Some(Sweep {
            beacon,
            time: due,
            receiver,
            positions: POSITIONS,
            samples: &self.samples,
            ..Sweep::default()
        }))
    }
}
