use foxhunt_core::{BeaconId, Reception, angle::Resultant};

/// The bearings of a formation position point nowhere below this mean resultant length.
const AGREE: f64 = 0.3;

/// How many beacons are told apart while it is not known which one is followed.
const BEACONS: usize = 16;

/// What was heard of the target since the last decision.
///
/// Every beacon is heard, and one is followed: that of the first target of the last plan. As long
/// as no plan has said which one that is, it is the one that was heard first, the one that was
/// followed in the search before left aside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Heard {
    followed: Option<BeaconId>,
    before: Option<BeaconId>,
    of: [Option<Sums>; BEACONS],
}

/// What was heard of one beacon.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sums {
    beacon: BeaconId,
    level: f64,
    levels: u32,
    bearings: Resultant,
}

impl Heard {
    /// Follows nobody yet.
    pub(super) fn begin(&mut self) {
        *self = Self { before: self.followed.or(self.before), ..Self::default() };
    }

    /// Follows this beacon from now on. Whether it was another one until now.
    pub(super) fn follow(&mut self, beacon: BeaconId) -> bool {
        self.followed.replace(beacon).is_some_and(|known| known != beacon)
    }

    pub(super) fn hear(&mut self, reception: &Reception) {
        let beacon = reception.beacon;
        let other = self.followed.is_some_and(|followed| followed != beacon);
        if other || !reception.rss_dbm.is_finite() {
            return;
        }
        let free = |slot: &&mut Option<Sums>| slot.is_none_or(|known| known.beacon == beacon);
        let Some(slot) = self.of.iter_mut().find(free) else { return };
        let none = Sums { beacon, level: 0.0, levels: 0, bearings: Resultant::default() };
        let sums = slot.get_or_insert(none);
        sums.level += reception.rss_dbm;
        sums.levels += 1;
        let sure = |sigma: f64| sigma > 0.0 && sigma.is_finite();
        if let Some(bearing) = reception.bearing
            && sure(bearing.sigma)
            && bearing.angle.is_finite()
        {
            sums.bearings.add(bearing.angle, 1.0 / (bearing.sigma * bearing.sigma));
        }
    }

    /// The mean level in dBm and the direction of the bearings, weighted with 1/σ²; begins anew.
    pub(super) fn take(&mut self) -> (Option<f64>, Option<f64>) {
        let heard = || self.of.iter().flatten();
        if self.followed.is_none() {
            let new = heard().find(|sums| Some(sums.beacon) != self.before);
            self.followed = new.map(|sums| sums.beacon);
        }
        // The one before may be the target again, as long as no other one is heard.
        let beacon = self.followed.or(self.before);
        let sums = self.of.iter().flatten().find(|sums| Some(sums.beacon) == beacon);
        let level = sums.map(|sums| sums.level / f64::from(sums.levels));
        let direction = sums.and_then(|sums| sums.bearings.direction(AGREE));
        self.of = [None; BEACONS];
        (level, direction)
    }
}
