use std::{fmt, io};

use foxhunt_core::{Clock, Vehicle};
use foxhunt_hardware::{MavlinkConfig, MavlinkError, MavlinkVehicle};
use foxhunt_sim::{Emulator, SimClock, SimError, World};
use foxhunt_wire::{ByteStream, Endpoint};
use serde::{Deserialize, Serialize};

/// A vehicle outside of the emulated field, such as an autopilot's own simulator: it flies, the
/// field's radios and motors go along.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForeignVehicle {
    /// Endpoint by which the flight reaches the vehicle.
    pub flown: Endpoint,
    /// Endpoint of its telemetry, on a link of its own: nothing is sent there.
    pub pose: Endpoint,
    /// System number of the vehicle; if absent, that of the first autopilot received.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub system_id: Option<u8>,
}

/// A drone of a simulated world that is wherever the telemetry of a vehicle outside has it.
///
/// Until the first position, and during silence of the telemetry, the drone stays at its last
/// place.
pub struct CarriedDrone {
    vehicle: MavlinkVehicle<Box<dyn ByteStream>, SimClock>,
    world: World,
    drone: usize,
    /// Time of its last known place, in seconds of the world's time.
    known_s: f64,
    patience_s: f64,
    lost: bool,
}

impl fmt::Debug for CarriedDrone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { drone, lost, .. } = self;
        f.debug_struct("CarriedDrone").field("drone", drone).field("lost", lost).finish()
    }
}

impl CarriedDrone {
    /// Follows the vehicle at the other end of `stream`, to which nothing is sent. The field's East
    /// and North count from the configured origin; without one, from the vehicle's first good
    /// position.
    ///
    /// # Errors
    ///
    /// [`CarriedDroneError`] when a number is out of its range or the world has no such drone.
    pub fn new(
        world: &World,
        drone: usize,
        config: MavlinkConfig,
        stream: Box<dyn ByteStream>,
    ) -> Result<Self, CarriedDroneError> {
        world.pose(drone)?;
        let patience_s = config.link_timeout_s;
        let config = MavlinkConfig { listen_only: true, ..config };
        let vehicle = MavlinkVehicle::new(config, stream, world.clock())?;
        let (world, known_s) = (world.clone(), world.time());
        Ok(Self { vehicle, world, drone, known_s, patience_s, lost: false })
    }
}

impl Emulator for CarriedDrone {
    /// # Errors
    ///
    /// The errors of the stream; and each time that its place has not been known for as long as a
    /// link may be silent, once the reason.
    fn serve(&mut self) -> io::Result<()> {
        let now = self.world.clock().now();
        let unknown = match self.vehicle.pose() {
            Ok(pose) => {
                (self.known_s, self.lost) = (now, false);
                return self.world.carry(self.drone, pose).map_err(io::Error::other);
            }
            Err(MavlinkError::Link(error)) => return Err(error),
            Err(unknown) => unknown,
        };
        if self.lost || now - self.known_s < self.patience_s {
            return Ok(());
        }
        self.lost = true;
        Err(io::Error::other(format!("the drone stays where it was: {unknown}")))
    }
}

/// Reason why a vehicle cannot be followed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CarriedDroneError {
    /// There is no such drone.
    #[error(transparent)]
    Drone(#[from] SimError),
    /// A setting is out of its range.
    #[error(transparent)]
    Vehicle(#[from] MavlinkError),
}
