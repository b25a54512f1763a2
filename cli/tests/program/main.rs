//! The program as its users meet it: what it prints, where, and how it ends.

mod antenna;
mod calibration;
mod campaign;
mod exit_codes;
mod extractors;
mod help;
mod hunt;
mod pipes;
mod planners;
mod recorded;
mod replay;
mod support;
