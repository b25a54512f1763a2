use foxhunt_core::{BeaconId, Pose, angle};
use nalgebra::Vector3;

use super::{
    Channel,
    body::Body,
    course::Course,
    receiver::{Question, Receiver},
    streams::Streams,
    turntable::Turntable,
};
use crate::{DroneConfig, SimError, SimStepperConfig, VehicleConfig};

/// A drone: a body, an antenna that turns under it, and a radio at the antenna.
#[derive(Debug)]
pub(crate) struct Drone {
    pub(crate) body: Body,
    pub(crate) motor: Turntable,
    pub(crate) receiver: Receiver,
    course: Course,
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
            receiver: Receiver::new(streams, stepper.radio_latency_s, config.silent_after_s),
            course: Course::at(0.0),
        })
    }

    /// Orders the antenna to `angle` radians from the nose.
    pub(crate) fn turn_to(&mut self, angle: f64, now: f64) {
        if !self.course.follow(angle) {
            self.receiver.end_patterns();
        }
        self.motor.order(angle, now);
    }

    /// Asks the beacon at `place` for an answer, through the antenna or through one without a
    /// direction.
    pub(crate) fn ask(
        &mut self,
        channel: &Channel,
        beacon: BeaconId,
        place: Vector3<f64>,
        directional: bool,
        now: f64,
    ) {
        let (receiver, turned) = (self.body.pose(), self.motor.angle(now));
        let spun = self.body.heading();
        let question =
            Question { time: now, beacon, receiver, to: place, turned, spun, directional };
        self.receiver.ask(channel, &question);
    }
}
