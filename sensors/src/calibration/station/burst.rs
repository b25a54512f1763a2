use alloc::vec::Vec;

/// A burst of the transmitter as a station received it.
#[derive(Clone, Debug, PartialEq)]
pub struct StationBurst {
    /// The direction from the station to the transmitter, in radians counter-clockwise from East.
    pub truth: f64,
    /// The day, or another name for bursts that belong together and go through the same places.
    pub group: i64,
    /// The reading of each antenna in dBm; `None` where it received nothing.
    pub readings_dbm: Vec<Option<f64>>,
}

/// A station and the bursts that it received of a transmitter at known places.
#[derive(Clone, Debug, PartialEq)]
pub struct StationRecord {
    /// The antennas' boresights as recordings have them, in radians; they also name the antennas.
    pub recorded: Vec<f64>,
    /// The bursts, in the order of time.
    pub bursts: Vec<StationBurst>,
}
