use alloc::vec::Vec;

use foxhunt_core::{BeaconId, Reception};
use nalgebra::{Vector2, Vector3};

use super::{
    TurnInformation,
    cells::{Cell, Cells},
    columns::{Column, blocks},
};

/// Places where the levels of beacons were received: they tell what is known of their power.
///
/// Every reception that an estimator fused comes in, of whichever beacon. A search begins or is
/// resumed without its beacon being named: that is the first target of the next plan, or where a
/// plan does not name it either, the beacon that was received first since; the one before is left
/// aside.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct LevelRecord {
    of: Vec<Places>,
    /// Beacon that is searched for, where known.
    first: Option<BeaconId>,
    /// Beacon of the search before.
    before: Option<BeaconId>,
    /// True if the target's earlier levels are forgotten once its beacon is known.
    anew: bool,
    /// Places of the targets in the last plan.
    targets: Vec<(BeaconId, Vector2<f64>)>,
}

/// Places where the levels of one beacon were received.
#[derive(Clone, Debug, PartialEq)]
struct Places {
    beacon: BeaconId,
    places: Vec<Vector3<f64>>,
    /// Number of places from before the present search began.
    earlier: usize,
    /// True if anything was received since then, a level or not.
    received: bool,
}

impl LevelRecord {
    pub(super) fn add(&mut self, reception: &Reception) {
        let beacon = reception.beacon;
        let index = self.of.iter().position(|known| known.beacon == beacon);
        let index = index.unwrap_or_else(|| {
            self.of.push(Places { beacon, places: Vec::new(), earlier: 0, received: false });
            self.of.len() - 1
        });
        let known = &mut self.of[index];
        known.received = true;
        known.places.extend(reception.level.map(|_| reception.receiver.position));
    }

    /// A search begins of a target that nothing is believed of: its levels received before now are
    /// forgotten.
    pub(super) fn begin(&mut self) {
        self.start(None);
        self.anew = true;
    }

    /// A search goes on for a target that something is believed of already: its levels stay.
    pub(super) fn resume(&mut self, beacon: Option<BeaconId>) {
        self.start(beacon);
        self.anew = false;
    }

    fn start(&mut self, beacon: Option<BeaconId>) {
        self.before = self.first.or(self.before);
        self.first = beacon;
        self.targets.clear();
        for known in &mut self.of {
            known.earlier = known.places.len();
            known.received = false;
        }
    }

    /// Returns the beacon that is resumed with this mean of its belief: the one that the last plan
    /// had nearest to there, or else the only other one that was received.
    pub(super) fn resumed(&self, mean: &Vector2<f64>) -> Option<BeaconId> {
        let off = |target: &&(BeaconId, Vector2<f64>)| (target.1 - mean).norm_squared();
        let others = self.targets.iter().filter(|target| Some(target.0) != self.first);
        if let Some(nearest) = others.min_by(|a, b| off(a).total_cmp(&off(b))) {
            return Some(nearest.0);
        }
        let mut others = self.of.iter().filter(|known| Some(known.beacon) != self.first);
        others.next().filter(|_| others.next().is_none()).map(|known| known.beacon)
    }

    /// Returns the beacon that is searched for, also where the plan does not name it.
    pub(super) fn first(&self) -> Option<BeaconId> {
        let now = || self.of.iter().filter(|known| known.received);
        let other = || now().find(|known| Some(known.beacon) != self.before);
        self.first.or_else(|| other().or_else(|| now().next()).map(|known| known.beacon))
    }

    /// Takes note of the targets of a plan, of which the first is the one that is searched for.
    pub(super) fn search(&mut self, targets: &[(Option<BeaconId>, Vector2<f64>)]) {
        let known = |(beacon, mean): &(Option<BeaconId>, _)| beacon.map(|beacon| (beacon, *mean));
        self.targets = targets.iter().filter_map(known).collect();
        let Some((Some(first), _)) = targets.first() else { return };
        self.first = Some(*first);
        if core::mem::take(&mut self.anew)
            && let Some(known) = self.of.iter_mut().find(|known| known.beacon == *first)
        {
            known.places.drain(..known.earlier);
            known.earlier = 0;
        }
    }

    /// Returns the places where the levels of a beacon were received.
    pub(super) fn places(&self, beacon: Option<BeaconId>) -> &[Vector3<f64>] {
        let of = self.of.iter().find(|known| Some(known.beacon) == beacon);
        of.map_or(&[], |known| &known.places)
    }
}

/// Evidence of the power from the levels received so far, if the target is in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PowerIn {
    level_db: f64,
    level_gradient: Vector2<f64>,
    variance: f64,
}

/// Evidence of the power for many cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PowerBlock {
    /// The mean level expected at the places where it was received, weighted with its information,
    /// and its gradient over the target's place.
    pub(super) level_db: Column,
    pub(super) level_gradient: [Column; 2],
    /// The variance of the power that is left, in dB².
    pub(super) variance: Column,
}

/// The power of a transmitter, given each cell of the belief of its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Power {
    pub(super) blocks: Vec<PowerBlock>,
}

impl Power {
    /// Given the place, the power is the prior and the mean of received over expected levels,
    /// weighted by their information.
    pub(super) fn of<S: TurnInformation + ?Sized>(
        turn: &S,
        belief: &Cells,
        received_at: &[Vector3<f64>],
        sigma_db: f64,
    ) -> Self {
        let known = PowerIn { level_db: 0.0, level_gradient: Vector2::zeros(), variance: 0.0 };
        let in_cell = |cell: &Cell| {
            if sigma_db <= 0.0 {
                return known;
            }
            let mut sum = PowerIn { variance: 1.0 / (sigma_db * sigma_db), ..known };
            for place in received_at {
                let fisher = turn.fisher(&cell.mean, place);
                let level = turn.expected(&cell.mean, place).level_db;
                sum.level_db += level * fisher.level_information;
                sum.level_gradient += fisher.level_gradient * fisher.level_information;
                sum.variance += fisher.level_information;
            }
            PowerIn {
                level_db: sum.level_db / sum.variance,
                level_gradient: sum.level_gradient / sum.variance,
                variance: 1.0 / sum.variance,
            }
        };
        let numbers = |cell: &Cell| {
            let power = in_cell(cell);
            [power.level_db, power.level_gradient.x, power.level_gradient.y, power.variance]
        };
        let block = |[level_db, x, y, variance]: [Column; 4]| PowerBlock {
            level_db,
            level_gradient: [x, y],
            variance,
        };
        Self { blocks: blocks(&belief.cells, numbers).into_iter().map(block).collect() }
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{Level, Pose};

    use super::*;

    fn reception(beacon: u16, east: f64) -> Reception {
        Reception {
            beacon: BeaconId(beacon),
            receiver: Pose::at(east, 0.0, 3.0),
            level: Some(Level { rss_dbm: -70.0, sigma_db: 4.0 }),
            ..Reception::default()
        }
    }

    #[test]
    fn a_reception_without_a_level_teaches_nothing_of_the_power() {
        let mut all = LevelRecord::default();
        all.begin();
        all.add(&Reception { level: None, ..reception(0, 1.0) });
        assert_eq!(all.first(), Some(BeaconId(0)));
        assert!(all.places(Some(BeaconId(0))).is_empty());
    }

    #[test]
    fn a_target_keeps_its_levels_unless_it_begins_anew() {
        let zero = Some(BeaconId(0));
        let one = Some(BeaconId(1));
        let mut all = LevelRecord::default();
        all.begin();
        assert_eq!(all.first(), None);
        all.add(&reception(0, 1.0));
        all.add(&reception(1, 2.0));
        assert_eq!(all.first(), zero);
        all.search(&[(one, Vector2::new(9.0, 9.0)), (zero, Vector2::zeros())]);
        assert_eq!((all.first(), all.places(one).len()), (one, 1));
        // The other one goes on with what is known of its power.
        assert_eq!(all.resumed(&Vector2::new(8.0, 8.0)), zero);
        all.resume(zero);
        all.search(&[(all.first(), Vector2::zeros())]);
        assert_eq!((all.first(), all.places(zero).len()), (zero, 1));
        // One that is over is still received: the next search is not its own.
        all.begin();
        all.add(&reception(0, 3.0));
        all.add(&reception(1, 4.0));
        assert_eq!(all.first(), one);
        all.search(&[(all.first(), Vector2::zeros())]);
        assert_eq!(all.places(one), [Vector3::new(4.0, 0.0, 3.0)]);
        assert_eq!(all.places(zero).len(), 2);
        all.add(&reception(1, 5.0));
        all.search(&[(all.first(), Vector2::zeros())]);
        assert_eq!(all.places(one).len(), 2);
    }
}
