//! Drivers that implement the device traits of `foxhunt_core`, one feature each.
//!
//! A driver is made of a codec of `foxhunt_wire`, any [`ByteStream`](foxhunt_wire::ByteStream) and a clock.
//! None of them blocks, prints or starts a thread that it does not end. The same drivers run over memory,
//! pseudo-terminals and cables.

mod aircraft;
mod clock;
mod finding;
#[cfg(feature = "gnss")]
mod gnss;
mod reconnecting;
#[cfg(feature = "firmata")]
pub use stepper::{
    Approach, BeyondCable, FirmataConfig, FirmataConfigError, FirmataStepper, FirmataStepperError,
    Homing, LostPosition,
};
#[cfg(feature = "xbee")]
pub use xbee::{
    XbeeConfig, XbeeConfigError, XbeeCounts, XbeeError, XbeeIdentity, XbeeProtocol, XbeeQuestion,
    XbeeRadio,
};
