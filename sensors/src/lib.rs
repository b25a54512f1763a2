//! foxhunt sensors
