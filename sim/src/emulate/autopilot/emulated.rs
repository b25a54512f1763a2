use std::io;

use foxhunt_wire::{
    ByteStream,
    mavlink::{Codec, CommonFrame, FlightMode, Signing},
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{AutopilotConfig, brain::Brain, params};
use crate::{Emulator, SimError, World};

/// An autopilot on a drone of a world, behind a stream of bytes.
///
/// What is imitated of ArduCopter: it sends nothing but heartbeats until it is requested; a
/// take-off is refused unless it is armed in GUIDED and knows where it is; the first set-point in
/// GUIDED, and after a take-off, has it fly at WPNAV_SPEED, whatever was ordered before, and a
/// speed is refused in other modes; it can be armed in STABILIZE without knowing; motors that do
/// not take off stop after 10 s; a relative CONDITION_YAW counts from the heading that it is
/// slewing to; a set-point without yaw turns the nose to the goal; it stops its motors on the
/// ground after landing; it comes back when the ground station falls silent (system 255). Of PX4:
/// its modes, set-points flown to at MPC_XY_VEL_MAX, heights of take-off above sea level, telemetry
/// without a request, and OFFBOARD, which needs set-points at 2 Hz and ends without them.
///
/// A drone of a world begins in the air; one with an emulated autopilot begins on the ground below,
/// at an Up of 0.
#[derive(Debug)]
pub struct EmulatedAutopilot<S> {
    stream: S,
    codec: Codec,
    connections: u32,
    brain: Brain,
    /// Bytes on their way, with the time at which they arrive.
    late: Vec<(f64, Vec<u8>)>,
    random: Xoshiro256PlusPlus,
}

/// The share of late messages that come twice.
const TWICE: f64 = 0.1;

/// MAV_COMP_ID_AUTOPILOT1.
const COMPONENT: u8 = 1;

impl<S: ByteStream> EmulatedAutopilot<S> {
    /// Puts an autopilot on a drone and the drone on the ground.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Field`], [`SimError::Place`] and
    /// [`SimError::FlightMode`] name what is wrong in `config`.
    pub fn new(
        config: AutopilotConfig,
        world: &World,
        drone: usize,
        stream: S,
    ) -> Result<Self, SimError> {
        config.check()?;
        params::check(&config)?;
        let frame = CommonFrame::new(config.origin.lat_deg, config.origin.lon_deg)?;
        let codec = Codec::new(config.system_id, COMPONENT);
        let codec = match config.signing {
            Some(key) => codec.with_signing(Signing::new(key, 0)),
            None => codec,
        };
        let connections = stream.connections();
        let random = Xoshiro256PlusPlus::seed_from_u64(u64::from(config.system_id));
        let brain = Brain::new(config, frame, world.on_board(drone)?);
        Ok(Self { stream, codec, connections, brain, late: Vec::new(), random })
    }

    /// Its mode.
    #[must_use]
    pub fn mode(&self) -> FlightMode {
        self.brain.flight.mode
    }

    /// Returns true if its motors run.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        self.brain.flight.armed
    }

    /// Returns true if it is in the air.
    #[must_use]
    pub fn is_airborne(&self) -> bool {
        self.brain.flight.is_airborne()
    }

    /// Returns the number of pictures that its camera has taken.
    #[must_use]
    pub fn pictures(&self) -> u32 {
        self.brain.pictures
    }
}

impl<S: ByteStream> Emulator for EmulatedAutopilot<S> {
    fn serve(&mut self) -> io::Result<()> {
        self.brain.step();
        let hears = self.brain.hears();
        let unix_s = self.brain.unix_s();
        let mut into = [0; 2048];
        loop {
            let count = self.stream.receive(&mut into)?;
            let Some(bytes) = into.get(..count).filter(|bytes| !bytes.is_empty()) else { break };
            // What was sent in the meantime is gone.
            if hears {
                self.codec.push(bytes);
            }
            while let Some(frame) = self.codec.next_frame(unix_s) {
                self.brain.take(&frame);
            }
        }
        if self.stream.connections() != self.connections {
            self.connections = self.stream.connections();
            self.codec.restart();
        }
        let now = self.brain.now;
        let late = self.brain.is_within(&self.brain.config.faults.late);
        for message in self.brain.emit() {
            let bytes = self.codec.encode(&message, unix_s);
            if late && self.random.random::<f64>() < TWICE {
                self.late.push((now + self.random.random::<f64>(), bytes.clone()));
            }
            let delay = if late { self.random.random::<f64>() } else { 0.0 };
            self.late.push((now + delay, bytes));
        }
        let mut due: Vec<_> = self.late.extract_if(.., |(at, _)| *at <= now).collect();
        due.sort_by(|one, other| one.0.total_cmp(&other.0));
        for (_, bytes) in due {
            match self.stream.send(&bytes) {
                // Nobody is there yet.
                Err(error) if error.kind() == io::ErrorKind::NotConnected => {}
                other => other?,
            }
        }
        Ok(())
    }
}
