use std::collections::VecDeque;

use foxhunt_core::{BeaconId, PatternSource, Sweep};

use super::RecordedSweep;

/// A pattern source that replays the turns of a recording instead of turning an antenna: for each
/// beacon of [`begin`](PatternSource::begin) it lends the next turn of that beacon.
#[derive(Clone, Debug, Default)]
pub struct RecordedSource {
    /// Remaining turns, in the order in which they ended.
    turns: VecDeque<(BeaconId, RecordedSweep)>,
    pending: VecDeque<BeaconId>,
    current: Option<RecordedSweep>,
}

impl RecordedSource {
    /// The turns of one drone. `beacons` are the names of the hunt's beacons in their order; a
    /// turn that names none of them is left out, and one without a name is of the first.
    #[must_use]
    pub fn new(
        sweeps: impl IntoIterator<Item = RecordedSweep>,
        drone: &str,
        beacons: &[String],
    ) -> Self {
        let id = |sweep: &RecordedSweep| match &sweep.beacon_name {
            None => Some(BeaconId(0)),
            Some(name) => {
                let index = beacons.iter().position(|known| known == name)?;
                u16::try_from(index).ok().map(BeaconId)
            }
        };
        let own = sweeps.into_iter().filter(|sweep| sweep.drone == drone);
        let turns = own.filter_map(|sweep| Some((id(&sweep)?, sweep))).collect();
        Self { turns, pending: VecDeque::new(), current: None }
    }

    /// Returns the number of turns that remain.
    #[must_use]
    pub fn left(&self) -> usize {
        self.turns.len()
    }
}

impl PatternSource for RecordedSource {
    type Error = RecordingEnded;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), RecordingEnded> {
        self.pending = beacons.iter().copied().collect();
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, RecordingEnded> {
        let Some(beacon) = self.pending.pop_front() else { return Ok(None) };
        let next = self.turns.iter().position(|(of, _)| *of == beacon);
        let (_, sweep) =
            next.and_then(|index| self.turns.remove(index)).ok_or(RecordingEnded { beacon })?;
        Ok(Some(self.current.insert(sweep).as_sweep(beacon)))
    }
}

/// A recording holds no more turns of a beacon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the recording holds no further turn of beacon {}", beacon.0)]
pub struct RecordingEnded {
    /// The beacon, counted from 0.
    pub beacon: BeaconId,
}
