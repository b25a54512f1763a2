use foxhunt_formation::StopWatch;

use super::Track;

/// A beacon that is to be found.
#[derive(Debug)]
pub(super) struct Quarry<E, const N: usize, const M: usize> {
    pub(super) name: String,
    pub(super) stand: Stand<E, N, M>,
}

/// How far the hunt for a beacon is.
#[derive(Debug)]
pub(super) enum Stand<E, const N: usize, const M: usize> {
    /// It has not begun.
    Waiting,
    /// It is on.
    Searched(Box<Search<E, N, M>>),
    /// There is a fix.
    Done,
}

/// Where the search for one beacon stands.
#[derive(Debug)]
pub(super) struct Search<E, const N: usize, const M: usize> {
    pub(super) track: Track<E, N, M>,
    /// Formation positions, before the present one, at which it was heard.
    pub(super) measured: u32,
    /// Receptions used at the present position.
    pub(super) heard: u32,
    /// How often it was not heard where others were.
    pub(super) put_off: u32,
    pub(super) watch: StopWatch,
    /// When the search began, in seconds, and how far all drones had flown by then, in metres.
    pub(super) began: (f64, f64),
}

impl<E, const N: usize, const M: usize> Quarry<E, N, M> {
    pub(super) fn waiting(name: String) -> Self {
        Self { name, stand: Stand::Waiting }
    }

    /// As if it had not begun.
    pub(super) fn reset(&mut self) {
        self.stand = Stand::Waiting;
    }

    pub(super) fn is_done(&self) -> bool {
        matches!(self.stand, Stand::Done)
    }

    pub(super) fn search(&self) -> Option<&Search<E, N, M>> {
        match &self.stand {
            Stand::Searched(search) => Some(search),
            _ => None,
        }
    }

    pub(super) fn search_mut(&mut self) -> Option<&mut Search<E, N, M>> {
        match &mut self.stand {
            Stand::Searched(search) => Some(search),
            _ => None,
        }
    }
}
