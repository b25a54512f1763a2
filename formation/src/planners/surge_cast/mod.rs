//! Surges along the bearings while the level rises, and casts across them else.

#[cfg(test)]
mod tests;

use core::{
    f64::consts::{FRAC_PI_2, FRAC_PI_6},
    fmt,
};

use foxhunt_core::{
    BeaconId, Belief, Decision, FormationPlanner, PlanError, Reception, Station, Target,
    angle::Resultant,
    parameter::{ParameterError, in_range, not_negative, positive},
};
use nalgebra::Vector2;

use super::{
    AltitudeRule, Circle, Settling, SettlingRule, at_radius, away, centroid, direction,
    estimate_and_centroid, mean_distance, turning,
};
use crate::shape::{Polygon, arrange_or_centre};

/// The bearings of a formation position point nowhere below this mean resultant length.
const AGREE: f64 = 0.3;

/// Number of beacons kept apart while it is not known which one is followed.
const BEACONS: usize = 16;

/// Configuration of [`SurgeCast`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SurgeCastConfig {
    /// Largest length of a surge, in metres; it never passes the estimate.
    pub surge_m: f64,
    /// Length of the first cast across the surge, in metres.
    pub cast_m: f64,
    /// Factor of each further cast's length, to the other side; at least 1.
    pub cast_growth: f64,
    /// Number of casts in a row after which the formation surges towards the estimate.
    pub most_casts: u32,
    /// The level has fallen when it is this many dB below that of the last surge.
    pub fall_db: f64,
    /// From the centre of the formation to each of several drones on the way, in metres.
    pub circumradius_m: f64,
    /// The distance to the estimate over ground, in metres, at which the drones circle it.
    pub standoff_m: f64,
    /// Angle that they then go round from one formation position to the next, in radians; not 0.
    pub step_rad: f64,
    /// Rule for the altitude.
    pub altitude: AltitudeRule,
    /// Rule that ends the search.
    pub settling: SettlingRule,
}

impl Default for SurgeCastConfig {
    /// Surges of 20 m; casts of 8 m, each 1.5 times the one before, 4 in a row; a fall of 2 dB;
    /// a formation of 6 m (Pritzl 2018, §5.2); circles at 6 m in steps of 30°; and the defaults
    /// of [`AltitudeRule`] and [`SettlingRule`].
    fn default() -> Self {
        Self {
            surge_m: 20.0,
            cast_m: 8.0,
            cast_growth: 1.5,
            most_casts: 4,
            fall_db: 2.0,
            circumradius_m: 6.0,
            standoff_m: 6.0,
            step_rad: FRAC_PI_6,
            altitude: AltitudeRule::default(),
            settling: SettlingRule::default(),
        }
    }
}

/// The last move, for the log.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Move {
    Begin,
    Surge { length: f64 },
    Cast { number: u32, length: f64 },
    Circle,
}

/// Surge and cast, as moths fly up a plume: straight on along the bearing while the signal becomes
/// stronger, and where it is lost, across that course with ever longer legs to either side
/// (Kennedy & Marsh 1974; counter-turning after the loss, Balkovsky & Shraiman 2002).
///
/// It goes by the receptions that it [observes](FormationPlanner::observe), the mean level and the
/// resultant of the bearings at a formation position; the estimate only replaces a bearing that is
/// missing, and for the end: near it the drones circle it until it has settled.
#[derive(Clone, Debug, PartialEq)]
pub struct SurgeCast {
    config: SurgeCastConfig,
    receptions: Receptions,
    /// The level where it last rose, and that place.
    best: Option<(f64, Vector2<f64>)>,
    /// The present level, if there is one.
    level: Option<f64>,
    heading: f64,
    casts: u32,
    circle: Circle,
    last: Move,
    settling: Settling,
}

impl SurgeCast {
    /// A planner before its first target.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn new(config: SurgeCastConfig) -> Result<Self, ParameterError> {
        positive("surge_m", config.surge_m)?;
        positive("cast_m", config.cast_m)?;
        in_range("cast_growth", config.cast_growth, 1.0..=10.0, "from 1 to 10")?;
        in_range("most_casts", f64::from(config.most_casts), 1.0..=32.0, "from 1 to 32")?;
        not_negative("fall_db", config.fall_db)?;
        positive("circumradius_m", config.circumradius_m)?;
        positive("standoff_m", config.standoff_m)?;
        turning("step_rad", config.step_rad)?;
        config.altitude.check()?;
        config.settling.check()?;
        Ok(Self {
            config,
            receptions: Receptions::default(),
            best: None,
            level: None,
            heading: 0.0,
            casts: 0,
            circle: Circle::default(),
            last: Move::Begin,
            settling: Settling::default(),
        })
    }

    fn form(&self, centre: &Vector2<f64>, altitude: f64, stations: &mut [Station]) {
        let polygon = Polygon { circumradius: self.config.circumradius_m };
        arrange_or_centre(&polygon, centre, self.heading, altitude, stations);
    }

    fn go_round(&mut self, estimate: &Vector2<f64>, stations: &mut [Station]) {
        self.casts = 0;
        self.last = Move::Circle;
        let SurgeCastConfig { standoff_m, step_rad, altitude, .. } = &self.config;
        self.circle.advance(estimate, *standoff_m, *step_rad, altitude, stations);
    }

    /// Returns the next centre of the formation.
    fn surge_or_cast(
        &mut self,
        here: Vector2<f64>,
        estimate: &Vector2<f64>,
        bearing: Option<f64>,
    ) -> Vector2<f64> {
        let fell = match (self.level, self.best) {
            (Some(level), Some((best, _))) => level < best - self.config.fall_db,
            (None, Some(_)) => true,
            (_, None) => false,
        };
        let limit = self.config.most_casts;
        if let Some((_, place)) = self.best
            && fell
            && self.casts < limit
        {
            let growth = f64::from(self.casts);
            let length = self.config.cast_m * libm::pow(self.config.cast_growth, growth);
            let side = if self.casts.is_multiple_of(2) { FRAC_PI_2 } else { -FRAC_PI_2 };
            self.casts += 1;
            self.last = Move::Cast { number: self.casts, length };
            return away(&place, length, self.heading + side);
        }
        let to_estimate = direction(&here, estimate);
        // What nothing came of before is not followed again.
        let lost = fell && self.casts >= limit;
        self.heading = if lost { to_estimate } else { bearing.unwrap_or(to_estimate) };
        self.best = self.level.map(|level| (level, here));
        self.casts = 0;
        let length = self.config.surge_m.min((estimate - here).norm());
        self.last = Move::Surge { length };
        away(&here, length, self.heading)
    }

    /// Starts again on a target.
    fn reset(&mut self) {
        self.receptions.begin();
        self.best = None;
        self.level = None;
        self.circle = Circle::default();
        self.casts = 0;
        self.last = Move::Begin;
        self.settling = Settling::default();
    }
}

impl FormationPlanner for SurgeCast {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        let centre = centroid(stations)?;
        self.reset();
        self.form(&centre, self.config.altitude.most_m, stations);
        Ok(())
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let (estimate, here) = estimate_and_centroid(belief, stations)?;
        let (level, bearing) = self.receptions.take();
        self.level = level;
        let SurgeCastConfig { standoff_m, step_rad, settling, .. } = self.config;
        let distance = (estimate.mean - here).norm();
        let near = distance <= standoff_m;
        // A lone drone on its circle is as far from the estimate as that is wide, or more as the
        // estimate moves.
        let circling = self.circle.direction.is_some() && distance <= 2.0 * standoff_m;
        let close = near || circling;
        let around = close && at_radius(mean_distance(&estimate.mean, stations), standoff_m);
        let decision = self.settling.take(&settling, estimate, step_rad, stations.len(), around);
        if close {
            self.go_round(&estimate.mean, stations);
        } else {
            self.circle = Circle::default();
            let centre = self.surge_or_cast(here, &estimate.mean, bearing);
            let altitude = self.config.altitude.altitude((centre - estimate.mean).norm());
            self.form(&centre, altitude, stations);
        }
        Ok(decision)
    }

    fn plan_together(
        &mut self,
        targets: &[Target<'_>],
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let target = targets.first().ok_or(PlanError::NoPlace)?;
        // Nothing is changed where there is no plan.
        estimate_and_centroid(target.belief, stations)?;
        if self.receptions.follow(target.beacon) {
            // Levels of another one are no measure of its own.
            self.best = None;
            self.casts = 0;
        }
        self.plan(target.belief, stations)
    }

    /// Takes receptions of any beacon. Only the followed beacon counts: the first target of a plan
    /// or, where no plan names it, the first beacon that was received since the beginning.
    fn observe(&mut self, reception: &Reception) {
        self.receptions.add(reception);
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        match self.last {
            Move::Begin => to.write_str("form up")?,
            Move::Surge { length } => write!(to, "surge {length:.1} m")?,
            Move::Cast { number, length } => write!(to, "cast {number}, {length:.1} m across")?,
            Move::Circle => write!(to, "circle at {:.1} m", self.config.standoff_m)?,
        }
        match (self.level, self.best) {
            (Some(level), Some((best, _))) => {
                write!(to, ", {level:.1} dBm here, {best:.1} dBm at the last surge")?;
            }
            (Some(level), None) => write!(to, ", {level:.1} dBm here")?,
            (None, _) => to.write_str(", no signal here")?,
        }
        write!(to, ": {}", self.settling)
    }
}

/// Levels and bearings received of the target since the last decision.
///
/// Receptions of every beacon come in, and one beacon is followed: that of the first target of the
/// last plan. As long as no plan has named it, the beacon that was received first is followed; the
/// beacon of the search before is left aside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Receptions {
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
    fn begin(&mut self) {
        *self = Self { before: self.followed.or(self.before), ..Self::default() };
    }

    /// Follows this beacon from now on. Whether it was another one until now.
    fn follow(&mut self, beacon: BeaconId) -> bool {
        self.followed.replace(beacon).is_some_and(|known| known != beacon)
    }

    /// Adds a reception.
    fn add(&mut self, reception: &Reception) {
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
    fn take(&mut self) -> (Option<f64>, Option<f64>) {
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
