use super::Track;

/// Where the search for one beacon stands.
#[derive(Debug)]
pub(super) struct Search<E, const N: usize, const M: usize> {
    pub(super) track: Track<E, N, M>,
    /// Formation positions, before the present one, at which it was heard.
    pub(super) measured: u32,
    /// Receptions used at the present position.
    pub(super) heard: u32,
}
