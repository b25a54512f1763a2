//! What stands in files: it is read, written again, or refused by name.

mod calibrations;
mod estimators;
mod extractors;
mod keys;
mod planners;
mod registry;
mod scenarios;
