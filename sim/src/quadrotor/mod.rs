//! A quadrotor that spins while it flies (Isaacs et al. 2014, §III, corrected).

mod body;
mod config;
mod control;
mod dynamics;
mod gains;
mod reference;
mod wind;

pub use body::Quadrotor;
pub use config::{Piloting, QuadrotorConfig, WindConfig};
pub use gains::Gains;

use control::Controller;
use dynamics::{Inputs, State};
use reference::Reference;
use wind::Wind;
