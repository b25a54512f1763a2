//! foxhunt filters
