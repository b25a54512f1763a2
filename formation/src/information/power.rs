use alloc::vec::Vec;

use foxhunt_core::{BeaconId, Reception};
use nalgebra::{Vector2, Vector3};

use super::{TurnInformation, cells::Cells};

/// Where beacons were heard: what is known of their power comes from there.
///
/// Every reception that a belief took in is heard, of whichever beacon. A search begins or is
/// resumed without saying whose it is: that is the first target of the next plan, or where a plan
/// does not say it either, the beacon that was heard first since, the one before left aside.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Heard {
    of: Vec<Places>,
    /// Whose search it is, where that is known.
    first: Option<BeaconId>,
    /// Whose search was over before.
    before: Option<BeaconId>,
    /// What is believed of the target begins anew, once it is known which one it is.
    anew: bool,
    /// Where the last plan had the targets.
    targets: Vec<(BeaconId, Vector2<f64>)>,
}

/// Where one beacon was heard.
#[derive(Clone, Debug, PartialEq)]
struct Places {
    beacon: BeaconId,
    places: Vec<Vector3<f64>>,
    /// How many of them were heard before the present search began.
    earlier: usize,
}

impl Heard {
    pub(super) fn hear(&mut self, reception: &Reception) {
        let (beacon, place) = (reception.beacon, reception.receiver.position);
        match self.of.iter_mut().find(|known| known.beacon == beacon) {
            Some(known) => known.places.push(place),
            None => self.of.push(Places { beacon, places: alloc::vec![place], earlier: 0 }),
        }
    }

    /// A search begins of a target that nothing is believed of: its levels heard before now are
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
        (self.before, self.first) = (self.first.or(self.before), beacon);
        self.targets.clear();
        for known in &mut self.of {
            known.earlier = known.places.len();
        }
    }

    /// Which beacon is resumed with this mean of its belief: the one that the last plan had
    /// nearest to there, or else the only other one that was heard.
    pub(super) fn resumed(&self, mean: &Vector2<f64>) -> Option<BeaconId> {
        let off = |target: &&(BeaconId, Vector2<f64>)| (target.1 - mean).norm_squared();
        let others = self.targets.iter().filter(|target| Some(target.0) != self.first);
        if let Some(nearest) = others.min_by(|a, b| off(a).total_cmp(&off(b))) {
            return Some(nearest.0);
        }
        let mut others = self.of.iter().filter(|known| Some(known.beacon) != self.first);
        others.next().filter(|_| others.next().is_none()).map(|known| known.beacon)
    }

    /// Whose search it is, where the plan does not say.
    pub(super) fn first(&self) -> Option<BeaconId> {
        let now = || self.of.iter().filter(|known| known.places.len() > known.earlier);
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

    /// From where a beacon was heard.
    pub(super) fn places(&self, beacon: Option<BeaconId>) -> &[Vector3<f64>] {
        let of = self.of.iter().find(|known| Some(known.beacon) == beacon);
        of.map_or(&[], |known| &known.places)
    }
}

/// What the levels heard so far say of the power if the target is in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PowerIn {
    /// The mean level that is expected of the places where it was heard, weighted with how much
    /// they say, and its gradient over the target's place.
    pub(super) level_db: f64,
    pub(super) level_gradient: Vector2<f64>,
    /// The variance of the power that is left, in dB².
    pub(super) variance: f64,
}

/// The same for each cell.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Power {
    cells: Vec<PowerIn>,
}

impl Power {
    /// Given the place, the power is the prior and the mean of what was heard over what was
    /// expected, weighted by their information.
    pub(super) fn of<S: TurnInformation + ?Sized>(
        turn: &S,
        belief: &Cells,
        heard: &[Vector3<f64>],
        sigma_db: f64,
    ) -> Self {
        let known = PowerIn { level_db: 0.0, level_gradient: Vector2::zeros(), variance: 0.0 };
        let cells = belief.cells.iter().map(|cell| {
            if sigma_db <= 0.0 {
                return known;
            }
            let mut sum = PowerIn { variance: 1.0 / (sigma_db * sigma_db), ..known };
            for place in heard {
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
        });
        Self { cells: cells.collect() }
    }

    pub(super) fn at(&self, cell: usize) -> &PowerIn {
        &self.cells[cell]
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{BearingModes, Pose};

    use super::*;

    fn heard(beacon: u16, east: f64) -> Reception {
        Reception {
            beacon: BeaconId(beacon),
            time: 0.0,
            receiver: Pose::at(east, 0.0, 3.0),
            rss_dbm: -70.0,
            rss_sigma_db: 4.0,
            bearing: None,
            covariance: 0.0,
            modes: BearingModes::default(),
            receiver_sigma_m: None,
        }
    }

    #[test]
    fn a_target_keeps_what_was_heard_of_it_unless_it_begins_anew() {
        let (zero, one) = (Some(BeaconId(0)), Some(BeaconId(1)));
        let mut all = Heard::default();
        all.begin();
        assert_eq!(all.first(), None);
        all.hear(&heard(0, 1.0));
        all.hear(&heard(1, 2.0));
        assert_eq!(all.first(), zero);
        all.search(&[(one, Vector2::new(9.0, 9.0)), (zero, Vector2::zeros())]);
        assert_eq!((all.first(), all.places(one).len()), (one, 1));
        // The other one goes on with what is known of its power.
        assert_eq!(all.resumed(&Vector2::new(8.0, 8.0)), zero);
        all.resume(zero);
        all.search(&[(all.first(), Vector2::zeros())]);
        assert_eq!((all.first(), all.places(zero).len()), (zero, 1));
        // One that is over is still heard: the next search is not its own.
        all.begin();
        all.hear(&heard(0, 3.0));
        all.hear(&heard(1, 4.0));
        assert_eq!(all.first(), one);
        all.search(&[(all.first(), Vector2::zeros())]);
        assert_eq!(all.places(one), [Vector3::new(4.0, 0.0, 3.0)]);
        assert_eq!(all.places(zero).len(), 2);
        all.hear(&heard(1, 5.0));
        all.search(&[(all.first(), Vector2::zeros())]);
        assert_eq!(all.places(one).len(), 2);
    }
}
