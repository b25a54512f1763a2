//! The archive through its public interface: recordings, receptions, locating, replay.

mod differences;
mod locate;
mod pictures;
mod recordings {
    mod errors;
    mod generated;
    mod joined;
    mod quantities;
    mod real;
    mod round_trip;
    mod standards;
    mod sweeps;
    mod values;
}
mod pulses;
mod remarks;
mod replay;
mod silences;
mod station;
mod support;
