//! The archive through its public interface: recordings, receptions, locating.

mod calibrated;
mod clocks;
mod differences;
mod height;
mod levels;
mod locate;
mod recordings {
    mod believed;
    mod errors;
    mod flight_logs;
    mod generated;
    mod joined;
    mod json;
    mod paths;
    mod quantities;
    mod real;
    mod receivers;
    mod round_trip;
    mod shapes;
    mod standards;
    mod sweeps;
    mod tables;
    mod values;
    mod wildlife;
}
mod pulses;
mod ranges;
mod receiver_place;
mod remarks;
mod silences;
mod station;
mod support;
