use nalgebra::Vector3;

use crate::{BeaconId, MeasuredList, Pose};

/// One power reading along one boresight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The time of the reading, in seconds.
    pub time: f64,
    /// The drone's pose.
    pub receiver: Pose,
    /// The antenna's direction, in radians in the world frame.
    pub boresight: f64,
    /// Index of the turn's position that this reading belongs to, from 0.
    pub position: u16,
    /// Received power in dBm.
    pub rss_dbm: f64,
}

/// A question that stayed without an answer: it was lost, or too weak to be received.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unanswered {
    /// The time at which the wait for an answer ended, in seconds.
    pub time: f64,
    /// The antenna's direction, in radians in the world frame.
    pub boresight: f64,
    /// The turn's position at which its question was sent, from 0.
    pub position: u16,
}

/// Readings of one beacon over one turn of a directional antenna, lent by their source until the
/// next poll.
///
/// The default is an empty one, to be filled in with `..Sweep::default()`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sweep<'a> {
    /// The beacon that was listened for.
    pub beacon: BeaconId,
    /// The time of the turn's end, in seconds.
    pub time: f64,
    /// The receiver's pose: the mean over the turn.
    pub receiver: Pose,
    /// Number of equal positions in a turn; position `i` is nominally at 2πi over this.
    pub positions: u16,
    /// The readings, in the order in which they were taken; empty where nothing was received.
    pub samples: &'a [Sample],
    /// The questions that are known to have stayed without an answer; empty where the source does
    /// not know.
    pub unanswered: &'a [Unanswered],
    /// The weakest reading that the receiver reports, in dBm, where that is known: then an answer
    /// that did not come may have been weaker.
    pub floor_dbm: Option<f64>,
    /// σ of the receiver's place at its worst: East, North and Up in metres; `None` where the
    /// source does not know.
    pub receiver_sigma_m: Option<Vector3<f64>>,
    /// Values that the source measured besides power along boresights: a range, a Doppler shift.
    pub measured: MeasuredList,
}

/// Something that turns an antenna: a stepper under the drone, or the whole airframe.
///
/// # Laws
///
/// Checked by `laws::pattern_source`, feature `laws`: there is one sweep for each beacon of
/// `begin`, in their order; its samples' times do not decrease and their positions are below
/// `positions`, as are those of the unanswered questions; a source without a turn lends nothing.
pub trait PatternSource {
    /// Failure of a turn.
    type Error: core::error::Error + 'static;

    /// Begins a turn in which every position listens for each of `beacons`, which differ from each
    /// other; a turn that is under way is given up, with the sweeps that it has not lent yet.
    /// Without beacons there is no turn.
    ///
    /// # Errors
    ///
    /// Any failure of the hardware; a turn may be begun again after an error.
    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), Self::Error>;

    /// Takes all steps that can be taken now. Once the turn is complete, lends its sweeps, one at
    /// each poll and each once: that of the first beacon, then of the second.
    ///
    /// Never blocks, so one loop can serve several sources and a simulator can own the clock.
    ///
    /// # Errors
    ///
    /// Any failure of the hardware; a source may be polled again after an error.
    fn poll(&mut self) -> Result<Option<Sweep<'_>>, Self::Error>;

    /// The next time at which a [`poll`](Self::poll) may do anything, in seconds of the clock of
    /// its devices: before it, a poll takes no step and lends nothing, unless somebody else uses
    /// these devices. Infinite where nothing happens before the next [`begin`](Self::begin);
    /// `None`, unless overridden, where it is not known.
    ///
    /// A simulation goes from one event to the next and leaves out the polls in between. It may be
    /// too early, which costs a poll, and never too late.
    fn next_event(&self) -> Option<f64> {
        None
    }
}
