/// A message's content, and its time in seconds of the driver's clock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timed<T> {
    pub(super) at: f64,
    pub(super) value: T,
}
