//! Sweeps of an antenna, their sources, and the devices that a source is made of.

#[cfg(feature = "alloc")]
use alloc::vec::Vec;

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

impl Sample {
    /// σ of a sample's level in dB, where neither a turn nor a setting shows it.
    pub const SIGMA_DB: f64 = 2.0;
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

/// A receiver of a drone that measures in turns: an antenna that a stepper or the whole airframe
/// turns, or a receiver without a direction, whose turn is one measurement.
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

/// A [`Sweep`] that owns its samples.
#[cfg(feature = "alloc")]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnedSweep {
    /// The beacon that was listened for.
    pub beacon: BeaconId,
    /// The time of the turn's end, in seconds.
    pub time: f64,
    /// The receiver's pose: the mean over the turn.
    pub receiver: Pose,
    /// Number of equal positions in a turn.
    pub positions: u16,
    /// The readings, in the order in which they were taken.
    pub samples: Vec<Sample>,
    /// The questions that are known to have stayed without an answer.
    pub unanswered: Vec<Unanswered>,
    /// The weakest reading that the receiver reports, in dBm, where that is known.
    pub floor_dbm: Option<f64>,
    /// σ of the receiver's East, North and Up in metres, where that is known.
    pub receiver_sigma_m: Option<Vector3<f64>>,
    /// Values measured besides power along boresights.
    pub measured: MeasuredList,
}

#[cfg(feature = "alloc")]
impl OwnedSweep {
    /// The sweep, lent.
    #[must_use]
    pub fn as_sweep(&self) -> Sweep<'_> {
        Sweep {
            beacon: self.beacon,
            time: self.time,
            receiver: self.receiver,
            positions: self.positions,
            samples: &self.samples,
            unanswered: &self.unanswered,
            floor_dbm: self.floor_dbm,
            receiver_sigma_m: self.receiver_sigma_m,
            measured: self.measured,
        }
    }
}

#[cfg(feature = "alloc")]
impl From<&Sweep<'_>> for OwnedSweep {
    fn from(sweep: &Sweep<'_>) -> Self {
        Self {
            beacon: sweep.beacon,
            time: sweep.time,
            receiver: sweep.receiver,
            positions: sweep.positions,
            samples: sweep.samples.to_vec(),
            unanswered: sweep.unanswered.to_vec(),
            floor_dbm: sweep.floor_dbm,
            receiver_sigma_m: sweep.receiver_sigma_m,
            measured: sweep.measured,
        }
    }
}

/// A radio that sends a question to a beacon and measures the answer's power.
///
/// One question is outstanding at a time: a new request gives up the one before it, and an
/// answer to an older question is discarded.
pub trait Radio {
    /// Failure of the link to the radio.
    type Error: core::error::Error + 'static;

    /// Sends a question to `beacon`; returns when it is on its way.
    ///
    /// # Errors
    ///
    /// Any failure of the link.
    fn request(&mut self, beacon: BeaconId) -> Result<(), Self::Error>;

    /// Sends questions one after the other, each once the one before is answered, as long as the
    /// answers come before `until` and are known by now: a simulated radio may [go
    /// ahead](Clock::go_ahead). Fills `answers` with the time and the power of each, in dBm, and
    /// returns how many there are; one question is outstanding where these are fewer than there is
    /// room for. Unless overridden, no answer is known by now.
    ///
    /// # Errors
    ///
    /// Any failure of the link; then no answer is lost.
    fn interrogate(
        &mut self,
        beacon: BeaconId,
        until: f64,
        answers: &mut [(f64, f64)],
    ) -> Result<usize, Self::Error> {
        let _ = (until, answers);
        self.request(beacon).map(|()| 0)
    }

    /// The power of the answer in dBm, once; `None` until it has come. Never blocks.
    ///
    /// # Errors
    ///
    /// Any failure of the link.
    fn poll(&mut self) -> Result<Option<f64>, Self::Error>;

    /// The time in seconds of its clock at which the power polled last was measured. `None`, unless
    /// overridden, where the radio does not know: the source then estimates it from the times of
    /// request and answer.
    fn measured_at(&self) -> Option<f64> {
        None
    }

    /// The next time at which a [`poll`](Self::poll) may give an answer or fail, in seconds of its
    /// clock; infinite where no answer is outstanding. `None`, unless overridden, where that is not
    /// known.
    fn next_event(&self) -> Option<f64> {
        None
    }
}

/// A motor that turns the antenna about the drone's vertical axis.
pub trait Rotator {
    /// Failure of the link to the motor.
    type Error: core::error::Error + 'static;

    /// Orders a turn to `angle` radians, counter-clockwise from the drone's nose; returns when
    /// the order is accepted. Angles of more than a turn are different places to a cable, so
    /// they are not wrapped.
    ///
    /// # Errors
    ///
    /// Any failure of the link.
    fn turn_to(&mut self, angle: f64) -> Result<(), Self::Error>;

    /// The antenna's direction in radians from the nose while it stands still; `None` while it
    /// turns. Never blocks.
    ///
    /// # Errors
    ///
    /// Any failure of the link.
    fn poll(&mut self) -> Result<Option<f64>, Self::Error>;

    /// The next time at which a [`poll`](Self::poll) may differ from the one before, in seconds of
    /// its clock; infinite where it stands until it is ordered to turn. `None`, unless overridden,
    /// where that is not known.
    fn next_event(&self) -> Option<f64> {
        None
    }
}

/// A clock that is passed in: nothing in the libraries reads the system's time.
pub trait Clock {
    /// Seconds since an origin that stays the same for the whole hunt; never decreases.
    fn now(&self) -> f64;

    /// Goes ahead to the first moment at which `event` has come, and returns whether it did: a
    /// simulated clock may where nobody else interferes until then. It [is ahead](Self::is_ahead)
    /// until those who poll have come as far. False unless overridden.
    fn go_ahead(&self, event: f64) -> bool {
        let _ = event;
        false
    }

    /// Returns true if it has gone ahead of those who poll; findings made so must not be delivered
    /// yet. False unless overridden.
    fn is_ahead(&self) -> bool {
        false
    }
}

/// A closure is a clock.
impl<F: Fn() -> f64> Clock for F {
    fn now(&self) -> f64 {
        self()
    }
}
