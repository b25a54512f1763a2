/// The requests of a fence that is not known yet.
#[derive(Debug, Default)]
pub(super) struct FenceQuery {
    pub(super) made: u32,
    pub(super) last: f64,
}
