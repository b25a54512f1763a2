//! Fake devices on a clock that the test moves.

use std::{cell::RefCell, rc::Rc};

use foxhunt_core::{BeaconId, Pose, Radio, Rotator, Vehicle, Waypoint};
use foxhunt_sensors::{StepperConfig, StepperSource};

/// How a device behaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Health {
    Good,
    /// It never has anything to say.
    Silent,
    /// It fails whenever it is asked.
    Broken,
}

/// The state of all devices.
#[derive(Debug)]
pub(crate) struct World {
    pub(crate) now: f64,
    pub(crate) radio: Health,
    pub(crate) rotator: Health,
    pub(crate) vehicle: Health,
    pub(crate) pose: Pose,
    /// Seconds from a question to its answer.
    pub(crate) latency: f64,
    /// Seconds from an order to standstill.
    pub(crate) turning: f64,
    /// Where the motor stands whatever it is told.
    pub(crate) stuck_at: Option<f64>,
    /// Every so-manieth question stays without an answer.
    pub(crate) lose_every: usize,
    /// A beacon that never answers.
    pub(crate) mute: Option<BeaconId>,
    /// Every so-manieth answer is not a number.
    pub(crate) nan_every: usize,
    /// The angles ordered, and when.
    pub(crate) orders: Vec<(f64, f64)>,
    /// The questions asked: of whom, and when.
    pub(crate) questions: Vec<(BeaconId, f64)>,
    /// Answers given.
    pub(crate) answers: usize,
    pending: bool,
}

/// A device that fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Failed;

impl core::fmt::Display for Failed {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("out of order")
    }
}

impl core::error::Error for Failed {}

/// A handle on the world: one for each device, one for the test.
#[derive(Clone, Debug)]
pub(crate) struct Handle(Rc<RefCell<World>>);

impl Default for Handle {
    fn default() -> Self {
        Self(Rc::new(RefCell::new(World {
            now: 100.0,
            radio: Health::Good,
            rotator: Health::Good,
            vehicle: Health::Good,
            pose: Pose { heading: 0.7, ..Pose::at(3.0, -2.0, 4.0) },
            latency: 0.01,
            turning: 0.02,
            stuck_at: None,
            lose_every: usize::MAX,
            mute: None,
            nan_every: usize::MAX,
            orders: Vec::new(),
            questions: Vec::new(),
            answers: 0,
            pending: false,
        })))
    }
}

impl Handle {
    /// Looks at the world or changes it.
    pub(crate) fn with<T>(&self, change: impl FnOnce(&mut World) -> T) -> T {
        change(&mut self.0.borrow_mut())
    }

    pub(crate) fn wait(&self, seconds: f64) {
        self.with(|w| w.now += seconds);
    }

    /// A stepper source on these devices.
    pub(crate) fn source(&self, config: StepperConfig) -> Source {
        let clock = self.clone();
        let clock: Box<dyn Fn() -> f64> = Box::new(move || clock.with(|w| w.now));
        StepperSource::new(config, self.clone(), self.clone(), self.clone(), clock)
    }
}

pub(crate) type Source = StepperSource<Handle, Handle, Handle, Box<dyn Fn() -> f64>>;

/// What a device of that health makes of its answer.
fn tell<T>(health: Health, answer: Option<T>) -> Result<Option<T>, Failed> {
    match health {
        Health::Good => Ok(answer),
        Health::Silent => Ok(None),
        Health::Broken => Err(Failed),
    }
}

impl Radio for Handle {
    type Error = Failed;

    fn request(&mut self, beacon: BeaconId) -> Result<(), Failed> {
        self.with(|w| {
            tell(w.radio, Some(()))?;
            w.questions.push((beacon, w.now));
            w.pending = w.questions.len() % w.lose_every != 0 && w.mute != Some(beacon);
            Ok(())
        })
    }

    fn poll(&mut self) -> Result<Option<f64>, Failed> {
        self.with(|w| {
            let asked = w.questions.last().map_or(f64::INFINITY, |q| q.1);
            let due = w.pending && w.now >= asked + w.latency;
            let told = tell(w.radio, due.then_some(()))?;
            Ok(told.map(|()| {
                w.pending = false;
                w.answers += 1;
                if w.answers % w.nan_every == 0 { f64::NAN } else { -50.0 }
            }))
        })
    }
}

impl Rotator for Handle {
    type Error = Failed;

    fn turn_to(&mut self, angle: f64) -> Result<(), Failed> {
        self.with(|w| {
            tell(w.rotator, Some(()))?;
            w.orders.push((angle, w.now));
            Ok(())
        })
    }

    fn poll(&mut self) -> Result<Option<f64>, Failed> {
        self.with(|w| {
            let stands = w.orders.last().filter(|order| w.now >= order.1 + w.turning);
            tell(w.rotator, stands.map(|order| w.stuck_at.unwrap_or(order.0)))
        })
    }
}

impl Vehicle for Handle {
    type Error = Failed;

    fn pose(&mut self) -> Result<Pose, Failed> {
        self.with(|w| if w.vehicle == Health::Good { Ok(w.pose) } else { Err(Failed) })
    }

    fn go_to(&mut self, _: &Waypoint) -> Result<(), Failed> {
        Ok(())
    }
}
