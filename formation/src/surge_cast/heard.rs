use foxhunt_core::{BeaconId, Reception, angle::Resultant};

/// The bearings of a formation position point nowhere below this mean resultant length.
const AGREE: f64 = 0.3;

/// What was heard of the target since the last decision.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Heard {
    beacon: Option<BeaconId>,
    level_sum: f64,
    levels: u32,
    bearings: Resultant,
}

impl Heard {
    /// Goes by this beacon from now on; what was heard of another one is forgotten.
    pub(super) fn follow(&mut self, beacon: BeaconId) {
        if self.beacon != Some(beacon) {
            let known = self.beacon.is_some();
            self.beacon = Some(beacon);
            if known {
                (self.level_sum, self.levels) = (0.0, 0);
                self.bearings = Resultant::default();
            }
        }
    }

    pub(super) fn hear(&mut self, reception: &Reception) {
        let other = self.beacon.is_some_and(|beacon| beacon != reception.beacon);
        if other || !reception.rss_dbm.is_finite() {
            return;
        }
        self.level_sum += reception.rss_dbm;
        self.levels += 1;
        let sure = |sigma: f64| sigma > 0.0 && sigma.is_finite();
        if let Some(bearing) = reception.bearing
            && sure(bearing.sigma)
            && bearing.angle.is_finite()
        {
            self.bearings.add(bearing.angle, 1.0 / (bearing.sigma * bearing.sigma));
        }
    }

    /// The mean level in dBm and the direction of the bearings, weighted with 1/σ²; begins anew.
    pub(super) fn take(&mut self) -> (Option<f64>, Option<f64>) {
        let level = (self.levels > 0).then(|| self.level_sum / f64::from(self.levels));
        let direction = self.bearings.direction(AGREE);
        *self = Self { beacon: self.beacon, ..Self::default() };
        (level, direction)
    }
}
