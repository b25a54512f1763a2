//! The crate against exact vectors, exported laws, simulated sweeps and fake devices.

mod antenna;
#[cfg(feature = "std")]
mod antenna_files;
mod bearing_calibration;
mod bearing_error;
mod body_turns;
mod calibrated;
mod calibration;
mod combined_models;
mod devices;
mod elevation_models;
mod every_extractor;
mod extractor_laws;
#[cfg(feature = "serde")]
mod files;
mod learned_pattern;
mod likelihood;
mod model_laws;
mod model_vectors;
mod preprocess_vectors;
mod propagation;
mod pulsed_turns;
mod station;
mod stepper_faults;
mod stepper_turns;
mod sweeps;
mod terrain;
mod vectors;
