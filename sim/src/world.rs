use std::{cell::RefCell, rc::Rc};

use foxhunt_core::{BeaconId, Pose};
use foxhunt_sensors::{
    BodyConfig, BodySource, OmnidirectionalConfig, OmnidirectionalSource, StepperConfig,
    StepperSource,
};
use nalgebra::Vector3;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::{
    LateSource, SimBody, SimClock, SimError, SimFleet, SimOmnidirectional, SimRadio, SimRotator,
    SimStepper, SimVehicle, WorldConfig,
    devices::OnBoard,
    truth::{Channel, Drone, Streams, Truth},
};

/// A simulated world. Clones and devices are handles to the same one.
///
/// All that is random comes from one seed, through a stream for each drone and purpose: the same
/// seed gives the same world whatever the order in which its devices are polled.
#[derive(Clone, Debug)]
pub struct World {
    truth: Rc<RefCell<Truth>>,
}

impl World {
    /// The world of a configuration at time 0, its antennas at 0, its drones where they begin.
    ///
    /// # Errors
    ///
    /// [`SimError::Field`] names the field that is out of range, with its value;
    /// [`SimError::Antenna`] and [`SimError::PathLoss`] what is wrong with these.
    pub fn new(config: &WorldConfig, seed: u64) -> Result<Self, SimError> {
        config.check()?;
        // What belongs to places has a generator of its own: fields more or less leave the drones'
        // streams as they are.
        let mut fields = Xoshiro256PlusPlus::seed_from_u64(!seed);
        let channel = Channel::new(&config.channel, config.beacons.len(), &mut fields)?;
        let mut root = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut drone = |drone| {
            let streams = Streams::fork(&mut root);
            Drone::new(drone, config.vehicle, config.stepper, streams)
        };
        let drones = config.drones.iter().map(&mut drone).collect::<Result<_, _>>()?;
        let truth = Truth { time: 0.0, channel, beacons: config.drawn_beacons(seed), drones };
        Ok(Self { truth: Rc::new(RefCell::new(truth)) })
    }

    /// Lets `dt` seconds pass: vehicles fly, antennas turn, answers come in.
    ///
    /// # Errors
    ///
    /// [`SimError::TimeStep`] for a step that is negative or not finite; no time passes then.
    pub fn advance(&self, dt: f64) -> Result<(), SimError> {
        let mut truth = self.truth.borrow_mut();
        if !(dt >= 0.0 && (truth.time + dt).is_finite()) {
            return Err(SimError::TimeStep { dt });
        }
        truth.advance(dt);
        Ok(())
    }

    /// Seconds since the beginning.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.truth.borrow().time
    }

    /// How many drones there are.
    #[must_use]
    pub fn drone_count(&self) -> usize {
        self.truth.borrow().drones.len()
    }

    /// Where a beacon is now: East, North and Up in metres; `None` if there is no such beacon.
    #[must_use]
    pub fn truth(&self, beacon: BeaconId) -> Option<Vector3<f64>> {
        self.truth_at(beacon, self.time())
    }

    /// Where a beacon is after `time` seconds, East, North and Up in metres; `None` if there is no
    /// such beacon.
    #[must_use]
    pub fn truth_at(&self, beacon: BeaconId, time: f64) -> Option<Vector3<f64>> {
        Some(self.truth.borrow().beacons.get(usize::from(beacon.0))?.place_at(time))
    }

    /// What people call a beacon; `None` if there is no such beacon.
    #[must_use]
    pub fn beacon_name(&self, beacon: BeaconId) -> Option<String> {
        Some(self.truth.borrow().beacons.get(usize::from(beacon.0))?.name.clone())
    }

    /// From which second on a beacon answers; `None` if there is no such beacon, or it always did.
    #[must_use]
    pub fn appears_after_s(&self, beacon: BeaconId) -> Option<f64> {
        self.truth.borrow().beacons.get(usize::from(beacon.0))?.appears_after_s
    }

    /// Where a drone truly is, whether there is a link to it or not.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn pose(&self, drone: usize) -> Result<Pose, SimError> {
        Ok(self.on_board(drone)?.with(|drone, _| drone.body.pose()))
    }

    /// How far a drone has flown, in metres.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn path_length(&self, drone: usize) -> Result<f64, SimError> {
        Ok(self.on_board(drone)?.with(|drone, _| drone.body.path_length()))
    }

    /// The world's clock.
    #[must_use]
    pub fn clock(&self) -> SimClock {
        SimClock(Rc::clone(&self.truth))
    }

    /// A drone's radio.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn radio(&self, drone: usize) -> Result<SimRadio, SimError> {
        Ok(SimRadio { on_board: self.on_board(drone)?, directional: true })
    }

    /// The motor that turns a drone's antenna, which looks along the nose at 0.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn rotator(&self, drone: usize) -> Result<SimRotator, SimError> {
        self.on_board(drone).map(SimRotator)
    }

    /// A drone as a vehicle.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn vehicle(&self, drone: usize) -> Result<SimVehicle, SimError> {
        self.on_board(drone).map(SimVehicle)
    }

    /// All drones.
    #[must_use]
    pub fn fleet(&self) -> SimFleet {
        SimFleet(Rc::clone(&self.truth))
    }

    /// A source made of a drone's radio, rotator and vehicle. A mount offset in `config` is one
    /// that the simulated antenna does not have: a misalignment. The receiver's floor is told
    /// unless `config` tells one.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn stepper(&self, drone: usize, config: StepperConfig) -> Result<SimStepper, SimError> {
        let (radio, rotator) = (self.radio(drone)?, self.rotator(drone)?);
        let floor = self.truth.borrow().channel.floor_dbm();
        let config = match floor.filter(|_| config.floor_dbm().is_none()) {
            Some(floor) => config.with_floor_dbm(floor).expect("it was checked with the channel"),
            None => config,
        };
        Ok(StepperSource::new(config, radio, rotator, self.vehicle(drone)?, self.clock()))
    }

    /// A source made of a drone's radio and of the drone, which turns as a whole; its antenna
    /// looks along the nose. A mount offset in `config` is one that it does not have: a
    /// misalignment. A floor is the channel's unless `config` has one.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Source`] names what is out of
    /// range in `config`.
    pub fn body(&self, drone: usize, config: BodyConfig) -> Result<SimBody, SimError> {
        let floor_dbm = config.floor_dbm.or(self.truth.borrow().channel.floor_dbm());
        let config = BodyConfig { floor_dbm, ..config };
        let vehicle = self.vehicle(drone)?;
        BodySource::new(config, self.radio(drone)?, vehicle, self.clock()).map_err(SimError::Source)
    }

    /// A source that does not turn, made of a drone's radio at an antenna that hears alike from
    /// everywhere, as much as the channel's on the average over a turn. A floor is the channel's
    /// unless `config` has one.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Source`] names what is out of
    /// range in `config`.
    pub fn omnidirectional(
        &self,
        drone: usize,
        config: OmnidirectionalConfig,
    ) -> Result<SimOmnidirectional, SimError> {
        let floor_dbm = config.floor_dbm.or(self.truth.borrow().channel.floor_dbm());
        let config = OmnidirectionalConfig { floor_dbm, ..config };
        let radio = SimRadio { directional: false, ..self.radio(drone)? };
        OmnidirectionalSource::new(config, radio, self.vehicle(drone)?, self.clock())
            .map_err(SimError::Source)
    }

    /// A source of a drone whose sweeps come as late as its [`late_s`](crate::DroneConfig::late_s)
    /// says.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn late<S>(&self, drone: usize, source: S) -> Result<LateSource<S>, SimError> {
        Ok(LateSource::new(self.on_board(drone)?, source))
    }

    pub(crate) fn on_board(&self, drone: usize) -> Result<OnBoard, SimError> {
        OnBoard::new(&self.truth, drone)
    }
}
