use crate::BeaconId;

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
