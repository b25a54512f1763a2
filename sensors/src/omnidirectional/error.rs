/// Failure of one of an omnidirectional source's devices.
///
/// The source may be polled again; nothing that it has collected is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OmnidirectionalError<R, V> {
    /// The radio.
    #[error("the radio failed: {0}")]
    Radio(#[source] R),
    /// The aircraft that carries the antenna and reports its pose.
    #[error("the vehicle failed: {0}")]
    Vehicle(#[source] V),
}
