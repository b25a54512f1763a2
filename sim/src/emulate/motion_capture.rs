//! A motion-capture system about a drone of the world.

use std::io;

use foxhunt_core::{
    Pose,
    parameter::{FieldError, in_range, not_negative},
};
use foxhunt_wire::{ByteStream, motion_capture::CapturedPose};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::Emulator;
use crate::{Interval, SimError, World, devices::OnBoard};

/// An emulated motion-capture system.
///
/// By default the body `drone-1`, a hundred poses a second, each good to a millimetre, never
/// hidden.
#[derive(Clone, Debug, PartialEq)]
pub struct EmulatedMotionCaptureConfig {
    /// Name of the rigid body.
    pub body: String,
    /// Number of poses in a second.
    pub rate_hz: f64,
    /// σ of a position in metres, on each axis.
    pub sigma_m: f64,
    /// Times when the body is hidden from the cameras.
    pub hidden: Vec<Interval>,
}

impl Default for EmulatedMotionCaptureConfig {
    fn default() -> Self {
        Self { body: "drone-1".into(), rate_hz: 100.0, sigma_m: 0.001, hidden: Vec::new() }
    }
}

impl EmulatedMotionCaptureConfig {
    fn check(&self) -> Result<(), FieldError> {
        in_range("rate_hz", self.rate_hz, 1.0..=1000.0, "from 1 to 1000")?;
        not_negative("sigma_m", self.sigma_m)?;
        for (i, hidden) in self.hidden.iter().enumerate() {
            hidden.check().map_err(|error| error.within(format_args!("hidden[{i}]")))?;
        }
        Ok(())
    }
}

/// A motion-capture system that sees a drone of a world, and sends its true pose with errors of
/// the position.
#[derive(Debug)]
pub struct EmulatedMotionCapture<S> {
    stream: S,
    on_board: OnBoard,
    config: EmulatedMotionCaptureConfig,
    random: Xoshiro256PlusPlus,
    /// Number of the pose that was sent last.
    sent: Option<f64>,
}

impl<S: ByteStream> EmulatedMotionCapture<S> {
    /// A system that sees a drone; its errors are drawn from `seed`.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone, [`SimError::Field`] for a setting that is out
    /// of range.
    pub fn new(
        world: &World,
        drone: usize,
        config: EmulatedMotionCaptureConfig,
        seed: u64,
        stream: S,
    ) -> Result<Self, SimError> {
        config.check().map_err(|error| error.within("motion_capture"))?;
        let random = Xoshiro256PlusPlus::seed_from_u64(seed);
        Ok(Self { stream, on_board: world.on_board(drone)?, config, random, sent: None })
    }
}

impl<S: ByteStream> Emulator for EmulatedMotionCapture<S> {
    fn serve(&mut self) -> io::Result<()> {
        let (pose, now) = self.on_board.with(|drone, now| (drone.body.pose(), now));
        // A nanosecond is forgiven: time is a sum of steps.
        let due = libm::floor((now + 1e-9) * self.config.rate_hz);
        if self.sent.is_some_and(|sent| due <= sent) {
            return Ok(());
        }
        self.sent = Some(due);
        let Self { config, random, .. } = self;
        let error = Vector3::from_fn(|_, _| random.sample::<f64, _>(StandardNormal));
        if config.hidden.iter().any(|hidden| hidden.contains(now)) {
            return Ok(());
        }
        let seen = Pose { position: pose.position + error * config.sigma_m, ..pose };
        let line = CapturedPose::new(now, config.body.clone(), &seen).line();
        self.stream.send(line.map_err(io::Error::other)?.as_bytes())
    }
}
