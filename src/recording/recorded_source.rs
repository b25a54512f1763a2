use std::collections::VecDeque;

use foxhunt_core::{BeaconId, PatternSource, Sweep};

use super::OwnedSweep;

/// A pattern source that replays the turns of a recording instead of turning an antenna: each time
/// it is asked for a beacon it lends the next turn that heard it.
#[derive(Clone, Debug, Default)]
pub struct RecordedSource {
    /// What is left, in the order in which the turns ended.
    turns: VecDeque<(BeaconId, OwnedSweep)>,
    asked: VecDeque<BeaconId>,
    lent: Option<OwnedSweep>,
}

impl RecordedSource {
    /// The turns of one drone. `beacons` are the names of the hunt's beacons in their order; a
    /// turn that names none of them is left out, and one without a name is of the first.
    #[must_use]
    pub fn new(
        sweeps: impl IntoIterator<Item = OwnedSweep>,
        drone: &str,
        beacons: &[String],
    ) -> Self {
        let id = |sweep: &OwnedSweep| match &sweep.beacon {
            None => Some(BeaconId(0)),
            Some(name) => {
                let index = beacons.iter().position(|known| known == name)?;
                u16::try_from(index).ok().map(BeaconId)
            }
        };
        let own = sweeps.into_iter().filter(|sweep| sweep.drone == drone);
        let turns = own.filter_map(|sweep| Some((id(&sweep)?, sweep))).collect();
        Self { turns, asked: VecDeque::new(), lent: None }
    }

    /// How many turns are left.
    #[must_use]
    pub fn left(&self) -> usize {
        self.turns.len()
    }
}

impl PatternSource for RecordedSource {
    type Error = RecordingEnded;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), RecordingEnded> {
        self.asked = beacons.iter().copied().collect();
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, RecordingEnded> {
        let Some(beacon) = self.asked.pop_front() else { return Ok(None) };
        let next = self.turns.iter().position(|(heard, _)| *heard == beacon);
        let (_, sweep) =
            next.and_then(|index| self.turns.remove(index)).ok_or(RecordingEnded { beacon })?;
        Ok(Some(self.lent.insert(sweep).lend(beacon)))
    }
}

/// A recording holds no more turns of a beacon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the recording holds no further turn of beacon {}", beacon.0)]
pub struct RecordingEnded {
    /// Which beacon, counted from 0.
    pub beacon: BeaconId,
}
