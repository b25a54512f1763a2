//! The world as a whole: its time, its truth, and the devices that it lends.

use std::{cell::RefCell, rc::Rc};

use foxhunt_core::{BeaconId, Pose, parameter::FieldError};
use foxhunt_sensors::{
    Antenna, BodyConfig, BodySource, OmnidirectionalConfig, OmnidirectionalSource, StepperConfig,
    StepperSource,
};
use nalgebra::Vector3;

use super::{
    Instrument, LateSource, OnBoard, SimBody, SimClock, SimInstrument, SimOmnidirectional,
    SimRadio, SimRotator, SimStepper, SimVehicle,
};
use crate::{
    OtherConfig, PulseTrain, RangeDifferenceConfig, SimError, ThreeAxisConfig, WorldConfig,
    truth::{Free, Port, Truth, beacon_of, is_due},
};

/// A simulated world. Clones and devices are handles to the same one.
///
/// All that is random comes from one seed, through a stream for each drone and purpose: the same
/// seed gives the same world whatever the order in which its devices are polled.
#[derive(Clone, Debug)]
pub struct World {
    truth: Rc<RefCell<Truth>>,
    seed: u64,
}

/// A number that separates the generators of users' own sources from the generators of the world
/// and of estimators.
const SOURCE: u64 = 0x5042_ce00_0000_0000;

impl World {
    /// The world of a configuration at time 0, its antennas at 0, its drones where they begin.
    ///
    /// # Errors
    ///
    /// [`SimError::Field`] names the field that is out of range, with its value;
    /// [`SimError::Antenna`], [`SimError::PathLoss`] and [`SimError::Terrain`] what is wrong with
    /// these.
    pub fn new(config: &WorldConfig, seed: u64) -> Result<Self, SimError> {
        let truth = Truth::new(config, seed)?;
        Ok(Self { truth: Rc::new(RefCell::new(truth)), seed })
    }

    /// Seed for the noise of a user's own source on a drone. It differs from drone to drone and
    /// from world to world.
    ///
    /// A source with a fixed seed has the same noise in every hunt of a campaign. The campaign's
    /// errors and its ANEES are then those of one hunt.
    ///
    /// ```
    /// use foxhunt_sim::{BeaconConfig, DroneConfig, World, WorldConfig};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let beacons = vec![BeaconConfig { name: "fox".into(), ..Default::default() }];
    /// let drones = vec![DroneConfig::default(), DroneConfig::default()];
    /// let config = WorldConfig { beacons, drones, ..Default::default() };
    /// let [first, second] = [World::new(&config, 1)?, World::new(&config, 2)?];
    /// assert_ne!(first.source_seed(0), first.source_seed(1));
    /// assert_ne!(first.source_seed(0), second.source_seed(0));
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn source_seed(&self, drone: usize) -> u64 {
        // The odd constant is 2⁶⁴ over the golden ratio (Steele et al. 2014, SplitMix).
        self.seed ^ SOURCE ^ 0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(drone as u64 + 1)
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

    /// Lets time pass in steps of `dt` seconds, one at least, until the moment `until` has come: as
    /// [`advance`](Self::advance) does step by step.
    ///
    /// # Errors
    ///
    /// [`SimError::TimeStep`] for a step that is not positive or too small to be added to the time,
    /// or a moment that never comes.
    pub fn advance_until(&self, until: f64, dt: f64) -> Result<(), SimError> {
        let truth = &mut *self.truth.borrow_mut();
        if until.is_nan() || until == f64::INFINITY {
            return Err(SimError::TimeStep { dt: until });
        }
        // Drones that rest go on to rest.
        let rests = truth.rests();
        loop {
            let next = truth.time + dt;
            if !(next > truth.time && next.is_finite()) {
                return Err(SimError::TimeStep { dt });
            }
            if rests {
                truth.time = next;
            } else {
                truth.advance(dt);
            }
            if is_due(until, truth.time) {
                return Ok(());
            }
        }
    }

    /// Lets the [steppers](Self::stepper) of drones that rest take their steps before `until`
    /// ahead of the world's time: at which moments, steps of `dt` seconds from now, and with what
    /// result remains the same, and so does when they deliver. It is for those who know that
    /// nobody orders any of these drones, or begins another turn, before that time or the end of
    /// the turn that is under way; the last such permission holds.
    pub fn allow_ahead(&self, until: f64, dt: f64) {
        self.truth.borrow_mut().free = Free { until, step: dt };
    }

    /// Returns true if every drone stays at its place until its next order.
    #[must_use]
    pub fn rests(&self) -> bool {
        self.truth.borrow().rests()
    }

    /// Seconds since the beginning.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.truth.borrow().time
    }

    /// Returns the number of drones.
    #[must_use]
    pub fn drone_count(&self) -> usize {
        self.truth.borrow().drones.len()
    }

    /// The place of a beacon now: East, North and Up in metres; `None` if there is no such beacon.
    #[must_use]
    pub fn truth(&self, beacon: BeaconId) -> Option<Vector3<f64>> {
        self.truth_at(beacon, self.time())
    }

    /// The place of a beacon after `time` seconds, East, North and Up in metres; `None` if there is
    /// no such beacon.
    #[must_use]
    pub fn truth_at(&self, beacon: BeaconId, time: f64) -> Option<Vector3<f64>> {
        Some(self.truth.borrow().beacons.get(usize::from(beacon.0))?.place_at(time))
    }

    /// The places of all transmitters on a beacon's frequency after `time` seconds, the beacon's
    /// own first: East, North and Up in metres; empty if there is no such beacon.
    #[must_use]
    pub fn transmitters_at(&self, beacon: BeaconId, time: f64) -> Vec<Vector3<f64>> {
        let truth = self.truth.borrow();
        let Some(beacon) = truth.beacons.get(usize::from(beacon.0)) else { return Vec::new() };
        let others = beacon.others.iter().map(OtherConfig::place);
        std::iter::once(beacon.place_at(time)).chain(others).collect()
    }

    /// The velocity of a beacon now: East, North and Up in metres per second; `None` if there is no
    /// such beacon.
    #[must_use]
    pub fn true_velocity(&self, beacon: BeaconId) -> Option<Vector3<f64>> {
        let truth = self.truth.borrow();
        Some(truth.beacons.get(usize::from(beacon.0))?.velocity_at(truth.time))
    }

    /// The name of a beacon; `None` if there is no such beacon.
    #[must_use]
    pub fn beacon_name(&self, beacon: BeaconId) -> Option<String> {
        Some(self.truth.borrow().beacons.get(usize::from(beacon.0))?.name.clone())
    }

    /// The frequency that a beacon sends at, in MHz; `None` if there is no such beacon.
    #[must_use]
    pub fn frequency_mhz(&self, beacon: BeaconId) -> Option<f64> {
        self.truth.borrow().frequency_mhz(beacon)
    }

    /// The pulses that a beacon sends by itself; `None` if there is no such beacon, or it answers.
    #[must_use]
    pub fn pulses(&self, beacon: BeaconId) -> Option<PulseTrain> {
        self.truth.borrow().beacons.get(usize::from(beacon.0))?.pulses
    }

    /// The second from which on a beacon answers; `None` if there is no such beacon, or it always
    /// did.
    #[must_use]
    pub fn appears_after_s(&self, beacon: BeaconId) -> Option<f64> {
        self.truth.borrow().beacons.get(usize::from(beacon.0))?.appears_after_s
    }

    /// The true pose of a drone, even if there is no link to it.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn pose(&self, drone: usize) -> Result<Pose, SimError> {
        Ok(self.on_board(drone)?.with(|drone, _| drone.pose()))
    }

    /// The true velocity of a drone: East, North and Up in metres per second.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn velocity(&self, drone: usize) -> Result<Vector3<f64>, SimError> {
        Ok(self.on_board(drone)?.with(|drone, _| drone.body.velocity()))
    }

    /// The distance that a drone has flown, in metres.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn path_length(&self, drone: usize) -> Result<f64, SimError> {
        Ok(self.on_board(drone)?.with(|drone, _| drone.body.path_length()))
    }

    /// Offset of a drone's bearings by its compass, in radians counter-clockwise.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    #[cfg(feature = "emulators")]
    pub(crate) fn bearing_offset(&self, drone: usize) -> Result<f64, SimError> {
        Ok(self.on_board(drone)?.with(|drone, _| drone.receiver.bearing_offset()))
    }

    /// Puts a drone where something outside of the world flies it: its antenna and its radio go
    /// along, and orders of this world move it no more. Over terrain its Up counts from the ground
    /// below its first place.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Pose`] for a pose that is not
    /// finite.
    #[cfg(feature = "emulators")]
    pub fn carry(&self, drone: usize, pose: Pose) -> Result<(), SimError> {
        let on_board = self.on_board(drone)?;
        if !pose.is_finite() {
            return Err(SimError::Pose { drone });
        }
        on_board.with(|drone, _| drone.carry(pose));
        Ok(())
    }

    /// Returns one sample of a beacon through an antenna on a drone, now, in dBm; `None` if it is
    /// lost, below the receiver's floor, or not transmitted.
    ///
    /// A user's own source is made of such samples, as a phased array or a receiver with a pattern
    /// of its own: the sample goes through the world's channel as that of a [radio](Self::radio)
    /// does, with the law of propagation, shadowing, reflectors, noise, rounding and losses, but
    /// through `antenna`, whose boresight is turned by `boresight` radians counter-clockwise from
    /// the nose, and without a delay. The antenna's mean over a level turn is taken off, so that
    /// the mean level over a turn follows the law of propagation.
    ///
    /// The samples of one pattern share an offset of the level and an error of the direction
    /// ([`ChannelConfig`](crate::ChannelConfig)). A pattern ends when the drone has moved by more
    /// than 0.5 m or turned all the way round, or with
    /// [`begin_pattern`](Self::begin_pattern). The random numbers come from the drone's radio,
    /// in the order in which samples are taken.
    ///
    /// ```
    /// use foxhunt_core::{BeaconId, Sample, angle};
    /// use foxhunt_sensors::Patch;
    /// use foxhunt_sim::{BeaconConfig, DroneConfig, World, WorldConfig};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let beacon = BeaconConfig { name: "fox".into(), east_m: 40.0, ..Default::default() };
    /// let drones = vec![DroneConfig { up_m: 20.0, ..Default::default() }];
    /// let world =
    ///     World::new(&WorldConfig { beacons: vec![beacon], drones, ..Default::default() }, 1)?;
    /// // Eight beams that are switched at once: a sweep without a motor.
    /// let beam = Patch::new(0.8, 0.8, 15.0)?;
    /// let receiver = world.pose(0)?;
    /// let mut samples = Vec::new();
    /// world.begin_pattern(0)?;
    /// for position in 0..8 {
    ///     let turned = f64::from(position) * core::f64::consts::FRAC_PI_4;
    ///     let Some(rss_dbm) = world.receive(0, BeaconId(0), &beam, turned)? else { continue };
    ///     let boresight = angle::wrap(receiver.heading + turned);
    ///     samples.push(Sample { time: world.time(), receiver, boresight, position, rss_dbm });
    /// }
    /// assert_eq!(samples.len(), 8);
    /// // A range finder of your own adds noise to this, from a generator that `source_seed` seeds.
    /// let truth = world.truth(BeaconId(0)).ok_or("no beacon")?;
    /// let range = (truth - receiver.position).norm();
    /// # assert!((range - 2000.0_f64.sqrt()).abs() < 1e-12);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] or [`SimError::Beacon`] if there is no such drone or beacon;
    /// [`SimError::Angle`] for a boresight that is not finite.
    pub fn receive(
        &self,
        drone: usize,
        beacon: BeaconId,
        antenna: &dyn Antenna,
        boresight: f64,
    ) -> Result<Option<f64>, SimError> {
        if !boresight.is_finite() {
            return Err(SimError::Angle { angle: boresight });
        }
        self.on_board(drone)?.with_truth(|truth, drone| {
            let Truth { time, channel, beacons, drones, .. } = &mut *truth;
            let from = beacon_of(beacons, beacon)?;
            let port = Port::Own(antenna);
            Ok(drones[drone].receive(channel, beacon, from, port, boresight, *time))
        })
    }

    /// Ends the patterns of a drone's receiver: the next sample of each beacon draws the offset and
    /// the error of direction that a new pattern's samples share.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn begin_pattern(&self, drone: usize) -> Result<(), SimError> {
        self.on_board(drone)?.with(|drone, _| drone.receiver.end_patterns());
        Ok(())
    }

    /// The world's clock.
    #[must_use]
    pub fn clock(&self) -> SimClock {
        SimClock { truth: Rc::clone(&self.truth), drone: None }
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

    /// A source made of a drone's radio, rotator and vehicle. A mount offset in `config` is one
    /// that the simulated antenna does not have: a misalignment. The receiver's floor is the
    /// channel's unless `config` has one.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone.
    pub fn stepper(&self, drone: usize, config: StepperConfig) -> Result<SimStepper, SimError> {
        let radio = self.radio(drone)?;
        let rotator = self.rotator(drone)?;
        let floor = self.truth.borrow().channel.floor_dbm();
        let config = match floor.filter(|_| config.floor_dbm().is_none()) {
            Some(floor) => config.with_floor_dbm(floor).expect("it was checked with the channel"),
            None => config,
        };
        let vehicle = self.vehicle(drone)?;
        let clock = radio.on_board.clock();
        Ok(StepperSource::new(config, radio, rotator, vehicle, clock))
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

    /// A source that does not turn, made of a drone's radio at an omnidirectional antenna, whose
    /// gain is the mean of that of the channel's over a turn. A floor is the channel's
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

    /// A receiver of three axes on a drone, for beacons with a
    /// [dipole](crate::BeaconConfig::dipole).
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Source`] names what is out of
    /// range in `config`; [`SimError::Field`] if no beacon has a dipole.
    pub fn three_axis(
        &self,
        drone: usize,
        config: ThreeAxisConfig,
    ) -> Result<SimInstrument, SimError> {
        config.check().map_err(SimError::Source)?;
        if self.truth.borrow().beacons.iter().all(|beacon| beacon.dipole.is_none()) {
            let lacks = "given for a receiver of three axes";
            return Err(FieldError::new("beacons[0].dipole", "absent", lacks).into());
        }
        Ok(SimInstrument::new(self.on_board(drone)?, Instrument::ThreeAxis(config)))
    }

    /// A receiver on a drone that measures range differences to a reference receiver.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Source`] names what is out of
    /// range in `config`.
    pub fn range_difference(
        &self,
        drone: usize,
        config: RangeDifferenceConfig,
    ) -> Result<SimInstrument, SimError> {
        config.check().map_err(SimError::Source)?;
        let instrument = Instrument::RangeDifference(config);
        Ok(SimInstrument::new(self.on_board(drone)?, instrument))
    }

    /// A source of a drone whose sweeps come later by its [`late_s`](crate::DroneConfig::late_s).
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
