//! The crate against exact vectors, exported laws, simulated sweeps and fake devices.

mod antenna;
mod bearing_error;
mod calibration;
mod combined_models;
mod devices;
mod every_extractor;
mod extractor_laws;
#[cfg(feature = "serde")]
mod files;
mod likelihood;
mod model_laws;
mod model_vectors;
mod preprocess_vectors;
mod stepper_faults;
mod stepper_turns;
mod sweeps;
mod vectors;
