//! foxhunt formation
