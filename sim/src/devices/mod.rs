//! The handles through which a simulated world is met: the traits of the hardware.

mod clock;
mod instrument;
mod late;
mod on_board;
mod radio;
mod rotator;
mod vehicle;

pub use clock::SimClock;
pub use instrument::SimInstrument;
pub use late::LateSource;
pub use radio::SimRadio;
pub use rotator::SimRotator;
pub use vehicle::SimVehicle;

pub(crate) use instrument::Instrument;
pub(crate) use on_board::OnBoard;

use foxhunt_sensors::{BodySource, OmnidirectionalSource, StepperSource};

/// A stepped antenna under a simulated drone.
pub type SimStepper = StepperSource<SimRadio, SimRotator, SimVehicle, SimClock>;

/// A simulated drone that turns as a whole, with its antenna.
pub type SimBody = BodySource<SimRadio, SimVehicle, SimClock>;

/// A simulated drone whose antenna has no direction.
pub type SimOmnidirectional = OmnidirectionalSource<SimRadio, SimVehicle, SimClock>;
