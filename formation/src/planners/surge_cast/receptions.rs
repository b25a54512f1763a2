use foxhunt_core::{BeaconId, Reception, angle::Resultant};

/// The bearings of a formation position point nowhere below this mean resultant length.
const AGREE: f64 = 0.3;

/// Number of beacons kept apart while it is not known which one is followed.
const BEACONS: usize = 16;

/// Levels and bearings received of the target since the last decision.
///
/// Receptions of every beacon come in, and one beacon is followed: that of the first target of the
/// last plan. As long as no plan has named it, it is the one that was received first; the one that
/// was followed in the search before is left aside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Receptions {
    followed: Option<BeaconId>,
    before: Option<BeaconId>,
    sums: [Option<Sums>; BEACONS],
}

/// Sums over the receptions of one beacon.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sums {
    beacon: BeaconId,
    level: f64,
    levels: u32,
    bearings: Resultant,
}

impl Receptions {
    /// Follows no beacon yet.
    pub(super) fn begin(&mut self) {
        *self = Self { before: self.followed.or(self.before), ..Self::default() };
    }

    /// Follows this beacon from now on. Whether it was another one until now.
    pub(super) fn follow(&mut self, beacon: BeaconId) -> bool {
        self.followed.replace(beacon).is_some_and(|known| known != beacon)
    }

    /// Adds a reception.
    pub(super) fn add(&mut self, reception: &Reception) {
        let beacon = reception.beacon;
        let other = self.followed.is_some_and(|followed| followed != beacon);
        let level = reception.level.map(|level| level.rss_dbm);
        if other || level.is_some_and(|level| !level.is_finite()) {
            return;
        }
        let free = |slot: &&mut Option<Sums>| slot.is_none_or(|known| known.beacon == beacon);
        let Some(slot) = self.sums.iter_mut().find(free) else { return };
        let none = Sums { beacon, level: 0.0, levels: 0, bearings: Resultant::default() };
        let sums = slot.get_or_insert(none);
        if let Some(level) = level {
            sums.level += level;
            sums.levels += 1;
        }
        let proper = |sigma: f64| sigma > 0.0 && sigma.is_finite();
        if let Some(bearing) = reception.bearing
            && proper(bearing.sigma)
            && bearing.angle.is_finite()
        {
            sums.bearings.add(bearing.angle, 1.0 / (bearing.sigma * bearing.sigma));
        }
    }

    /// Takes the mean level in dBm and the direction of the bearings, weighted with 1/σ².
    pub(super) fn take(&mut self) -> (Option<f64>, Option<f64>) {
        let received = || self.sums.iter().flatten();
        if self.followed.is_none() {
            let new = received().find(|sums| Some(sums.beacon) != self.before);
            self.followed = new.map(|sums| sums.beacon);
        }
        // The one before may be the target again, as long as no other one is received.
        let beacon = self.followed.or(self.before);
        let sums = self.sums.iter().flatten().find(|sums| Some(sums.beacon) == beacon);
        let with_level = sums.filter(|sums| sums.levels > 0);
        let level = with_level.map(|sums| sums.level / f64::from(sums.levels));
        let direction = sums.and_then(|sums| sums.bearings.direction(AGREE));
        self.sums = [None; BEACONS];
        (level, direction)
    }
}
