//! foxhunt sim
