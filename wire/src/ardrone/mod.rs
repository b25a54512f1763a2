//! Messages that the Parrot AR.Drone 2.0 receives (AT commands, UDP 5556) and sends (navdata, UDP
//! 5554).

mod command;
mod navdata;

pub use command::{ArDroneCommand, ArDroneCommandError, encode_commands, parse_commands};
pub use navdata::{ArDroneDemo, ArDroneNavdata, ArDroneNavdataError, DroneState, FlightState};
