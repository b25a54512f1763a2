/// Failure of a turn of the whole body.
///
/// The source may be polled again; nothing that it has collected is lost.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BodyError<R, V> {
    /// The radio failed.
    #[error("the radio failed: {0}")]
    Radio(#[source] R),
    /// The aircraft failed that carries the antenna, turns it and reports its pose.
    #[error("the vehicle failed: {0}")]
    Vehicle(#[source] V),
    /// The body did not come round in the turn's time. Its sweeps are lent all the same.
    #[error("the body turned by {turned:.3} rad in {seconds:.1} s and not all the way round")]
    NotAround {
        /// Angle that it turned, by its own heading, in radians.
        turned: f64,
        /// The time that it had, in seconds.
        seconds: f64,
    },
}
