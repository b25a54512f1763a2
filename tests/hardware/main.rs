//! Drivers against emulated devices of a simulated world, in its own time.
#![cfg(feature = "hardware")]

mod above_ground;
mod advised;
mod ardrone;
mod camera;
mod carried;
mod faults;
mod firmware;
mod flown;
mod flown_nodes;
mod gnss;
mod gnss_peer;
mod mavlink;
mod mavlink_link;
mod mission;
mod network;
mod nodes;
mod on_foot;
mod peers;
mod pulsed;
mod px4;
mod px4_hunts;
mod receivers;
mod samples;
mod stepper;
mod terrain;
mod xbee;
mod xbee_protocol;
