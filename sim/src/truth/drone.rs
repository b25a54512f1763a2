//! A drone: a body, an antenna that turns under it, and a radio; and the whole state of a world.

use foxhunt_core::{BeaconId, Pose, SteadyMotion, angle};
use foxhunt_sensors::{MagneticDipole, SharedTerrain};
use nalgebra::Vector3;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{
    Channel, Course, Free, Port, Streams, Turntable,
    body::Body,
    receiver::{Answer, Arrival, Receiver, Signal},
};
use crate::{
    BeaconConfig, DroneConfig, RangeDifferenceConfig, SimError, SimStepperConfig, ThreeAxisConfig,
    VehicleConfig, WorldConfig,
};

/// Spacing of the frequencies of beacons without a given one, in MHz.
const SPACING_MHZ: f64 = 0.05;

/// A drone: a body, an antenna that turns under it, and a radio at the antenna.
#[derive(Debug)]
pub(crate) struct Drone {
    pub body: Body,
    pub motor: Turntable,
    pub receiver: Receiver,
    pub failures: DroneConfig,
    course: Course,
    /// The goal that it was last sent to.
    order: Option<Vector3<f64>>,
    /// True if the drone hovers instead of flying to its goal.
    held: bool,
    /// The angle that the antenna was turned to by something else than orders, until a request is
    /// sent there.
    turned_to: Option<f64>,
    reports_velocity: bool,
    /// The time of its devices, in seconds, where that is ahead of the world's.
    ahead: f64,
    /// The ground; `None` if it is level.
    terrain: Option<SharedTerrain>,
    /// Height of the ground that its body's heights count from, where they do not count from the
    /// ground below.
    launch: Option<f64>,
}

impl Drone {
    fn new(
        config: &DroneConfig,
        vehicle: VehicleConfig,
        stepper: SimStepperConfig,
        streams: Streams,
        terrain: Option<SharedTerrain>,
    ) -> Result<Self, SimError> {
        let pose = Pose::level(
            Vector3::new(config.east_m, config.north_m, config.up_m),
            angle::wrap(config.heading_deg_ccw_from_east.to_radians()),
        );
        Ok(Self {
            body: Body::new(vehicle, pose, streams.gust.clone())?,
            motor: Turntable::new(stepper.rotator_speed_rad_s),
            receiver: Receiver::new(streams, stepper.radio_latency_s, config),
            failures: config.clone(),
            course: Course::at(0.0),
            order: None,
            held: false,
            turned_to: None,
            reports_velocity: vehicle.reports_velocity(),
            ahead: f64::NEG_INFINITY,
            terrain,
            launch: None,
        })
    }

    /// Returns the drone's pose; Up is the height above the ground below.
    #[inline]
    pub(crate) fn pose(&self) -> Pose {
        let mut pose = self.body.pose();
        if let Some(launch) = self.launch {
            pose.position.z += launch - self.ground(&pose.position).unwrap_or(launch);
        }
        pose
    }

    /// Height of the ground below a place; `None` if that is not known.
    fn ground(&self, place: &Vector3<f64>) -> Option<f64> {
        self.terrain.as_ref()?.height(&place.xy())
    }

    /// Puts it on the ground. From then on its body flies as an autopilot does, whose heights count
    /// from there whatever the ground below.
    #[cfg(feature = "emulators")]
    pub(crate) fn launch(&mut self) {
        self.body.put_down();
        self.launch = self.ground(&self.body.pose().position);
    }

    /// Puts it where something outside of the world flies it, whose heights count from the ground
    /// where that has it first.
    #[cfg(feature = "emulators")]
    pub(crate) fn carry(&mut self, pose: Pose) {
        if !matches!(self.body, Body::Carried(_)) {
            self.launch = self.ground(&pose.position);
        }
        self.body.carry(pose);
    }

    /// The time of its devices, of which the world's is `world`.
    #[inline]
    pub(crate) fn time(&self, world: f64) -> f64 {
        if self.ahead > world { self.ahead } else { world }
    }

    /// Takes its devices' time to the first step at which `event` has come, the next one at least,
    /// if it stays as it is until then; whether it did.
    pub(crate) fn go_ahead(&mut self, event: f64, world: f64, free: Free) -> bool {
        let reached = self.body.rests().then(|| {
            let next = free.step_from(self.time(world))?;
            free.reach(event, next)
        });
        let Some(time) = reached.flatten() else { return false };
        self.ahead = time;
        true
    }

    /// Sends it somewhere; while it is stuck, later.
    pub(crate) fn go_to(&mut self, goal: Vector3<f64>, now: f64) -> Result<(), SimError> {
        if self.failures.stuck.iter().any(|stuck| stuck.contains(now)) {
            // Refused as the body would refuse it.
            self.body.clone().go_to(goal)?;
        } else {
            self.body.go_to(goal)?;
            self.held = false;
        }
        self.order = Some(goal);
        Ok(())
    }

    /// Flies for `dt` seconds from `begin` on.
    #[inline]
    fn advance(&mut self, begin: f64, dt: f64) {
        if !self.rests() {
            self.fly(begin, dt);
        }
    }

    /// Returns true if the drone stays at its place until its next order.
    #[inline]
    fn rests(&self) -> bool {
        self.body.rests() && self.failures.stuck.is_empty()
    }

    fn fly(&mut self, begin: f64, dt: f64) {
        self.receiver.forget_last();
        let stuck = self.failures.stuck.iter().any(|stuck| stuck.contains(begin));
        if stuck != self.held {
            let here = self.body.pose().position;
            let goal = if stuck { here } else { self.order.unwrap_or(here) };
            if self.body.go_to(goal).is_ok() {
                self.held = stuck;
            }
        }
        self.body.advance(dt);
    }

    /// Returns true if anyone has a link to it.
    #[inline]
    pub(crate) fn is_linked(&self, now: f64) -> bool {
        !self.failures.lost.iter().any(|lost| lost.contains(now))
    }

    /// Returns the drone's motion, and its end unless another order comes first; `None` if the
    /// motion changes at any moment.
    pub(crate) fn steady_motion(&self, now: f64) -> Option<SteadyMotion> {
        let DroneConfig { stuck, lost, .. } = &self.failures;
        let held = stuck.iter().any(|stuck| stuck.contains(now));
        // One that may get stuck on its way is looked at all the time.
        let predictable = self.body.rests() || stuck.is_empty();
        if held != self.held || !predictable || !self.is_linked(now) {
            return None;
        }
        let (velocity, left_s) = self.body.steady_motion()?;
        let changes = stuck.iter().chain(lost).flat_map(|time| [Some(time.from_s), time.to_s]);
        let changes = changes.flatten().filter(|change| *change > now);
        Some(SteadyMotion { velocity, until: changes.fold(now + left_s, f64::min) })
    }

    /// Returns true if its radio works.
    #[inline]
    fn receives(&self, now: f64) -> bool {
        self.failures.silent_after_s.is_none_or(|silent| now < silent)
            && !self.failures.silent.iter().any(|silent| silent.contains(now))
    }

    /// Orders the antenna to `angle` radians from the nose.
    pub(crate) fn turn_to(&mut self, angle: f64, now: f64) {
        if !self.course.follow(angle) {
            self.receiver.end_patterns();
        }
        self.motor.order(angle, now);
    }

    /// Turns the antenna to `angle` radians from the nose, at once. Only the angles at which
    /// requests are sent belong to a pattern.
    #[cfg(feature = "emulators")]
    pub(crate) fn hold_antenna_at(&mut self, angle: f64, now: f64) {
        self.motor.hold_at(angle, now);
        self.turned_to = Some(angle);
    }

    /// Sends a request to a beacon, whose answer comes in through `port`.
    pub(crate) fn request(
        &mut self,
        channel: &Channel,
        id: BeaconId,
        beacon: &BeaconConfig,
        port: Port<'_>,
        now: f64,
    ) {
        let signal = self.aimed(channel, (id, beacon), port, now);
        let answer = self.transmit(channel, beacon, signal, now);
        self.receiver.await_answer(answer);
    }

    /// Transmits a request to a beacon whose signal is known: the answer to come, if one does.
    #[inline(always)]
    fn transmit(
        &mut self,
        channel: &Channel,
        beacon: &BeaconConfig,
        signal: Signal,
        now: f64,
    ) -> Option<Answer> {
        let time = beacon.answer_after(now, self.receiver.latency());
        let transmitted = signal.reaches && beacon.answers_at(now) && self.receives(time);
        let reading = self.receiver.draw(channel, signal.power_dbm, transmitted);
        reading.map(|rss_dbm| Answer { time, rss_dbm })
    }

    /// Sends requests one after the other while it may go ahead: the times and powers of the
    /// answers, and how many these are.
    pub(crate) fn interrogate(
        &mut self,
        channel: &Channel,
        (id, beacon): (BeaconId, &BeaconConfig),
        port: Port<'_>,
        (world, free): (f64, Free),
        answers: &mut [(f64, f64)],
    ) -> usize {
        let mut now = self.time(world);
        let mut signal = self.aimed(channel, (id, beacon), port, now);
        // Nobody goes ahead of a drone that moves.
        let free = if self.body.rests() { free } else { Free::default() };
        let lasts = beacon.course.is_none() && self.motor.standing(now).is_some();
        for (count, answer) in answers.iter_mut().enumerate() {
            if count > 0 && !lasts {
                signal = self.aimed(channel, (id, beacon), port, now);
            }
            let answered = self.transmit(channel, beacon, signal, now);
            let known = answered.and_then(|answer| Some((free.reach(answer.time, now)?, answer)));
            let Some((time, Answer { rss_dbm, .. })) = known else {
                self.receiver.await_answer(answered);
                return count;
            };
            *answer = (time, rss_dbm);
            (now, self.ahead) = (time, time);
        }
        self.receiver.await_answer(None);
        answers.len()
    }

    /// Ends a pattern where the antenna, which something else than orders turned, begins another.
    fn follow_antenna(&mut self) {
        // One that stays is interrogated again, and begins nothing new.
        if let Some(angle) = self.turned_to.take_if(|angle| !self.course.stays(*angle))
            && !self.course.follow(angle)
        {
            self.receiver.end_patterns();
        }
    }

    /// The power in dBm that comes in of a beacon through an antenna at the time `now`, at a
    /// receiver that neither rounds nor has a floor; `None` where nothing does. Whether the
    /// beacon sends just then is the caller's matter.
    #[cfg(feature = "emulators")]
    pub(crate) fn incoming(
        &mut self,
        channel: &Channel,
        id: BeaconId,
        beacon: &BeaconConfig,
        port: Port<'_>,
        now: f64,
    ) -> Option<f64> {
        let signal = self.aimed(channel, (id, beacon), port, now);
        let sent = signal.reaches && beacon.answers_at(now) && self.receives(now);
        self.receiver.faded(channel, signal.power_dbm).filter(|_| sent)
    }

    /// The reading of one sample of a beacon at the time `now`, through an antenna that is turned
    /// by `turned` radians from the nose.
    pub(crate) fn receive(
        &mut self,
        channel: &Channel,
        id: BeaconId,
        beacon: &BeaconConfig,
        port: Port<'_>,
        turned: f64,
        now: f64,
    ) -> Option<f64> {
        let signal = self.signal(channel, (id, beacon), port, turned, now);
        let transmitted = signal.reaches && beacon.sends_at(now) && self.receives(now);
        self.receiver.draw(channel, signal.power_dbm, transmitted)
    }

    /// The magnetic field of a beacon that a receiver of three axes measures, East, North and Up in
    /// microamperes a metre, with a sign by chance; `None` where there is too little of it.
    pub(crate) fn magnetic_field(
        &mut self,
        channel: &Channel,
        beacon: &BeaconConfig,
        receiver: &ThreeAxisConfig,
        now: f64,
    ) -> Option<Vector3<f64>> {
        let pose = self.pose();
        let place = beacon.place_at(now);
        // What is drawn does not depend on what is received.
        let (noise, sign) = self.receiver.field_noise();
        let moment = beacon.dipole?.moment();
        let model = MagneticDipole::new().with_target_up(place.z).ok()?;
        let field = model.field_per_moment(&place.xy(), &pose) * moment;
        let measured = (field + noise * receiver.sigma(field.norm())) * sign;
        let sent = channel.reaches(&pose.position) && beacon.answers_at(now) && self.receives(now);
        (sent && measured.norm() >= receiver.floor()).then_some(measured)
    }

    /// Returns the range difference of a beacon that a receiver measures against its reference, in
    /// metres; `None` if the receiver gets nothing.
    pub(crate) fn range_difference(
        &mut self,
        channel: &Channel,
        beacon: &BeaconConfig,
        receiver: &RangeDifferenceConfig,
        now: f64,
    ) -> Option<f64> {
        let own = self.pose().position;
        let place = beacon.place_at(now);
        // What is drawn does not depend on what is received.
        let (noise, _) = self.receiver.field_noise();
        let farther = (place - own).norm() - (place - Vector3::from(receiver.reference_m)).norm();
        let sent = channel.reaches(&own) && beacon.answers_at(now) && self.receives(now);
        sent.then_some(farther + receiver.sigma_m * noise.x)
    }

    /// The signal of a beacon through the antenna as it is turned at the time `now`.
    fn aimed(
        &mut self,
        channel: &Channel,
        beacon: (BeaconId, &BeaconConfig),
        port: Port<'_>,
        now: f64,
    ) -> Signal {
        self.follow_antenna();
        let turned = self.motor.angle(now);
        self.signal(channel, beacon, port, turned, now)
    }

    /// The signal of a beacon that transmits at a time, and of all others on its frequency: while
    /// neither of them moves, by the last one.
    fn signal(
        &mut self,
        channel: &Channel,
        (id, beacon): (BeaconId, &BeaconConfig),
        port: Port<'_>,
        turned: f64,
        sent: f64,
    ) -> Signal {
        // The last one is kept of one transmitter alone.
        let still = self.body.rests() && beacon.course.is_none() && beacon.others.is_empty();
        if still && let Some(last) = self.receiver.last(channel, id, port, turned) {
            return last;
        }
        let receiver = self.pose();
        let to = beacon.place_at(sent);
        let spun = self.body.heading();
        let arrival = Arrival { beacon: id, receiver, to, turned, spun, port };
        let mut signal = self.receiver.signal(channel, &arrival, still);
        for (index, other) in (0..).zip(&beacon.others) {
            let beacon = channel.other(id, index);
            let other = Arrival { beacon, to: other.place(), ..arrival };
            let beside = self.receiver.signal(channel, &other, false).power_dbm;
            // They are not coherent: their powers add.
            let powers = [signal.power_dbm, beside].map(|dbm| libm::exp10(0.1 * dbm));
            signal.power_dbm = 10.0 * libm::log10(powers.iter().sum());
        }
        signal
    }

    /// Returns the pose that the drone reports: with a velocity if its autopilot measures one.
    #[inline]
    pub(crate) fn reported_pose(&self) -> Pose {
        let velocity = self.reports_velocity.then(|| self.body.velocity());
        Pose { velocity, ..self.pose() }
    }
}

/// A world's state.
#[derive(Debug)]
pub(crate) struct Truth {
    /// Seconds since the beginning.
    pub time: f64,
    /// The time that its drones' clocks may go ahead of it.
    pub free: Free,
    pub channel: Channel,
    pub beacons: Vec<BeaconConfig>,
    pub drones: Vec<Drone>,
}

impl Truth {
    /// The state at time 0 of a world that is drawn from `seed`.
    pub(crate) fn new(config: &WorldConfig, seed: u64) -> Result<Self, SimError> {
        config.check()?;
        // What belongs to places has a generator of its own: fields more or less leave the drones'
        // streams as they are.
        let mut fields = Xoshiro256PlusPlus::seed_from_u64(!seed);
        let terrain = config.terrain.as_ref();
        let channel = Channel::new(&config.channel, terrain, &config.beacons, &mut fields)?;
        let mut root = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut drone = |drone| {
            let streams = Streams::fork(&mut root);
            let ground = channel.terrain().cloned();
            Drone::new(drone, config.vehicle, config.stepper, streams, ground)
        };
        let drones = config.drones.iter().map(&mut drone).collect::<Result<_, _>>()?;
        let beacons = config.drawn_beacons(seed);
        Ok(Self { time: 0.0, free: Free::default(), channel, beacons, drones })
    }

    /// The frequency that a beacon sends at, in MHz.
    pub(crate) fn frequency_mhz(&self, beacon: BeaconId) -> Option<f64> {
        let own = self.beacons.get(usize::from(beacon.0))?.frequency_mhz;
        let spaced = || self.channel.frequency_mhz + SPACING_MHZ * f64::from(beacon.0);
        Some(own.unwrap_or_else(spaced))
    }

    /// Returns true if every drone stays at its place until its next order.
    pub(crate) fn rests(&self) -> bool {
        self.drones.iter().all(Drone::rests)
    }

    /// Lets `dt` seconds pass.
    pub(crate) fn advance(&mut self, dt: f64) {
        let begin = self.time;
        self.time += dt;
        for drone in &mut self.drones {
            drone.advance(begin, dt);
        }
    }
}

/// A beacon of a world.
///
/// # Errors
///
/// [`SimError::Beacon`] if there is no such beacon.
pub(crate) fn beacon_of(beacons: &[BeaconConfig], id: BeaconId) -> Result<&BeaconConfig, SimError> {
    let error = || SimError::Beacon { beacon: id.0, beacons: beacons.len() };
    beacons.get(usize::from(id.0)).ok_or_else(error)
}
