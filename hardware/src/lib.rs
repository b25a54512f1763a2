//! foxhunt hardware
