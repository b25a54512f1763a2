//! Trains of pulses that are too weak one by one: the energies of several are added up before it is
//! decided, over all starts, intervals, frequencies and drifts (fast folding, Staelin 1969).

mod alarms;
mod comb;
mod config;
mod hit;
mod map;
mod search;
mod train;

pub use config::FoldConfig;
pub use search::TrainDetector;
pub use train::Train;
