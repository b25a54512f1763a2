use foxhunt_core::{BeaconId, Pose, angle};
use nalgebra::Vector3;

use super::{
    Channel,
    body::Body,
    course::Course,
    receiver::{Arrival, Port, Receiver},
    streams::Streams,
    turntable::Turntable,
};
use crate::{BeaconConfig, DroneConfig, SimError, SimStepperConfig, VehicleConfig};

/// A drone: a body, an antenna that turns under it, and a radio at the antenna.
#[derive(Debug)]
pub(crate) struct Drone {
    pub(crate) body: Body,
    pub(crate) motor: Turntable,
    pub(crate) receiver: Receiver,
    pub(crate) failures: DroneConfig,
    course: Course,
    /// Where it was last sent.
    order: Option<Vector3<f64>>,
    /// Whether it hovers where it is instead of going there.
    held: bool,
    /// Where the antenna was turned by something else than orders, until a request is sent there.
    turned_to: Option<f64>,
    reports_velocity: bool,
}

impl Drone {
    pub(crate) fn new(
        config: &DroneConfig,
        vehicle: VehicleConfig,
        stepper: SimStepperConfig,
        streams: Streams,
    ) -> Result<Self, SimError> {
        let pose = Pose::level(
            Vector3::new(config.east_m, config.north_m, config.up_m),
            angle::wrap(config.heading_deg_ccw_from_east.to_radians()),
        );
        Ok(Self {
            body: Body::new(vehicle, pose, streams.gust.clone())?,
            motor: Turntable::new(stepper.rotator_speed_rad_s),
            receiver: Receiver::new(streams, stepper.radio_latency_s),
            failures: config.clone(),
            course: Course::at(0.0),
            order: None,
            held: false,
            turned_to: None,
            reports_velocity: vehicle.reports_velocity(),
        })
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
    pub(super) fn advance(&mut self, begin: f64, dt: f64) {
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

    /// Whether anyone has a link to it.
    pub(crate) fn is_linked(&self, now: f64) -> bool {
        !self.failures.lost.iter().any(|lost| lost.contains(now))
    }

    /// Whether its radio works.
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
        // One that stays is interrogated again, and begins nothing new.
        if let Some(angle) = self.turned_to.take_if(|angle| !self.course.stays(*angle))
            && !self.course.follow(angle)
        {
            self.receiver.end_patterns();
        }
        let latency = self.receiver.latency();
        let arrival =
            self.arrival(channel, (id, beacon), port, self.motor.angle(now), [now, now + latency]);
        self.receiver.request(channel, &arrival, now);
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
        let arrival = self.arrival(channel, (id, beacon), port, turned, [now, now]);
        self.receiver.draw(channel, &arrival)
    }

    /// The signal of a beacon that transmits at the first of two times and is read at the second.
    fn arrival<'a>(
        &self,
        channel: &Channel,
        (id, beacon): (BeaconId, &BeaconConfig),
        port: Port<'a>,
        turned: f64,
        [sent, read]: [f64; 2],
    ) -> Arrival<'a> {
        let receiver = self.body.pose();
        let reached = channel.reaches(&receiver.position);
        Arrival {
            beacon: id,
            receiver,
            to: beacon.place_at(sent),
            turned,
            spun: self.body.heading(),
            port,
            transmitted: reached && beacon.answers_at(sent) && self.receives(read),
        }
    }

    /// Its pose as it reports it: with a velocity if its autopilot measures one.
    pub(crate) fn reported_pose(&self) -> Pose {
        let velocity = self.reports_velocity.then(|| self.body.velocity());
        Pose { velocity, ..self.body.pose() }
    }
}
