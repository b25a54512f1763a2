//! The handles through which a simulated world is met: the traits of the hardware.

mod clock;
mod fleet;
mod on_board;
mod radio;
mod rotator;
mod vehicle;

pub use clock::SimClock;
pub use fleet::SimFleet;
pub use radio::SimRadio;
pub use rotator::SimRotator;
pub use vehicle::SimVehicle;

pub(crate) use on_board::OnBoard;

use foxhunt_sensors::StepperSource;

/// A stepped antenna under a simulated drone.
pub type SimStepper = StepperSource<SimRadio, SimRotator, SimVehicle, SimClock>;
