//! The program as its users meet it: what it prints, where, and how it ends.

#[cfg(all(feature = "batch", feature = "maps"))]
mod answers;
mod antenna;
mod calibration;
mod campaign;
mod compare;
mod completions;
mod convert;
#[cfg(unix)]
mod documents;
mod exit_codes;
mod fly;
mod gazebo;
mod help;
mod hunt;
#[cfg(feature = "batch")]
mod kinds;
mod listen;
mod lists;
mod live;
mod mqtt;
mod network;
mod page;
mod pipes;
mod plot;
mod pulses;
mod recorded;
mod replay;
mod rows;
mod screen;
mod store;
mod support;
mod tags;
#[cfg(feature = "batch")]
mod unknown_number;
mod views;
