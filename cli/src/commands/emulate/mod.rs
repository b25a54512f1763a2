//! Emulated devices as programs: what a driver, ours or another's, meets instead of a real one.

mod bench;
mod device;
mod field;
mod gnss;
mod motion_capture;
mod pose;
mod rtl_tcp;
mod sample_file;
mod stepper;
mod vehicle;
mod xbee;

pub(crate) use bench::{Args, run};
pub(crate) use field::{Emulated, Emulation};
