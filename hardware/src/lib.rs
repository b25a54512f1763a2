//! Drivers that implement the device traits of `foxhunt_core`, one feature each.
//!
//! A driver is made of a codec of `foxhunt_wire`, any [`ByteStream`](foxhunt_wire::ByteStream) and a clock.
//! None of them blocks, prints or starts a thread that it does not end. The same drivers run over memory,
//! pseudo-terminals and cables.

mod aircraft;
#[cfg(feature = "ardrone")]
mod ardrone;
mod clock;
mod finding;
#[cfg(feature = "gnss")]
mod gnss;
pub mod link;
#[cfg(feature = "mavlink")]
mod mavlink;
mod reconnecting;
#[cfg(feature = "firmata")]
mod stepper;
#[cfg(feature = "xbee")]
mod xbee;

pub use aircraft::{Aircraft, AircraftState, Shared};
#[cfg(feature = "ardrone")]
pub use ardrone::{ArDrone, ArDroneConfig, ArDroneError};
pub use clock::SystemClock;
pub use finding::Finding;
#[cfg(feature = "gnss")]
pub use foxhunt_wire::FixQuality;
#[cfg(feature = "gnss")]
pub use gnss::{
    GnssConfig, GnssConfigError, GnssDecoder, GnssError, GnssFix, GnssFloors, GnssKind,
    GnssPosition, GnssReceiver, GpsdDecoder, NmeaDecoder, Placed, PlacedError, Positioning,
    StillVehicle, UbloxDecoder,
};
#[cfg(feature = "mavlink")]
pub use mavlink::{
    FlightLimits, MavlinkConfig, MavlinkError, MavlinkOrigin, MavlinkSigning, MavlinkVehicle,
    PositionRequirements, RadioStatus,
};
pub use reconnecting::Reconnecting;
#[cfg(feature = "firmata")]
pub use stepper::{
    Approach, BeyondCable, FirmataConfig, FirmataConfigError, FirmataStepper, FirmataStepperError,
    Homing, LostPosition,
};
#[cfg(feature = "xbee")]
pub use xbee::{
    XbeeConfig, XbeeConfigError, XbeeCounts, XbeeError, XbeeIdentity, XbeeQuestion, XbeeRadio,
};
