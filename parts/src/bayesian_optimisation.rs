//! Planners that need an estimator of their own.

use std::fmt;

use foxhunt_core::{
    BeaconId, Belief, Decision, FormationPlanner, Outcome, PlanError, Pose, Reception, Stage,
    Station, Target, Waypoint,
    parameter::{ParameterError, at_least_one, finite, in_range, not_negative, positive},
};
use foxhunt_filters::{FieldMap, FieldMapConfig};
use foxhunt_formation::Polygon;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

/// Configuration of [`BayesianOptimisation`]. Lengths are metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BayesianOptimisationConfig {
    /// Reach of goals beyond the places of the readings.
    pub reach_m: f64,
    /// Number of examined places per side of the area.
    pub places_a_side: u16,
    /// The drones' altitude.
    pub up_m: f64,
    /// No two goals are nearer to each other than this.
    pub separation_m: f64,
    /// The search ends when the semi-major axis of the 95 % ellipse is below this …
    pub ellipse_m: f64,
    /// … or after this many formation positions.
    pub most_positions: u32,
}

impl Default for BayesianOptimisationConfig {
    /// A reach of 60 m, 32 places a side, the reference's 4 m up (Pritzl 2018, §5.2), 3 m between
    /// drones; the search ends at 1.6 m or after 30 positions.
    fn default() -> Self {
        Self {
            reach_m: 60.0,
            places_a_side: 32,
            up_m: 4.0,
            separation_m: 3.0,
            ellipse_m: 1.6,
            most_positions: 30,
        }
    }
}

/// Maximum number of readings kept of a beacon, the most recent: the field is fitted again at every
/// decision, which takes the cube of their number.
const MOST_READINGS: usize = 200;

/// Bayesian optimisation of the level (Močkus 1975; Jones, Schonlau & Welch 1998): the levels
/// received make a Gaussian process over places, and the drones listen where the largest level so
/// far is expected to be improved most. For each further drone the level expected at the goals
/// before is taken for received (Ginsbourger, Le Riche & Carraro 2010, the kriging believer).
///
/// It knows of no law of propagation and uses no bearing, and the belief only to decide when it is
/// over: a baseline. It ends with [`Outcome::EllipseReached`] or [`Outcome::MoveLimit`].
#[derive(Clone, Debug)]
pub struct BayesianOptimisation {
    config: BayesianOptimisationConfig,
    standard: Normal,
    levels: Vec<(BeaconId, Pose, f64)>,
    /// Beacon that is searched for: the last decision's, or else the first one received since it
    /// began.
    beacon: Option<BeaconId>,
    measured: u32,
    account: String,
}

impl BayesianOptimisation {
    /// A planner without any reading yet.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn new(config: BayesianOptimisationConfig) -> Result<Self, ParameterError> {
        positive("reach_m", config.reach_m)?;
        let places = f64::from(config.places_a_side);
        in_range("places_a_side", places, 4.0..=200.0, "from 4 to 200")?;
        finite("up_m", config.up_m)?;
        not_negative("separation_m", config.separation_m)?;
        positive("ellipse_m", config.ellipse_m)?;
        at_least_one("most_positions", config.most_positions)?;
        Ok(Self {
            config,
            standard: Normal::standard(),
            levels: Vec::new(),
            beacon: None,
            measured: 0,
            account: String::new(),
        })
    }

    /// Returns the goals, one for each drone, and the largest expected improvement in dB; `None`
    /// while there are too few readings for a field.
    fn goals(&self, beacon: Option<BeaconId>, drones: usize) -> Option<(Vec<Vector2<f64>>, f64)> {
        let mut readings: Vec<(Pose, f64)> = self
            .levels
            .iter()
            .filter(|(of, ..)| Some(*of) == beacon)
            .map(|(_, pose, level)| (*pose, *level))
            .collect();
        let mut config = FieldMapConfig { segment_m: 0.0, ..FieldMapConfig::default() };
        let mut map = FieldMap::fit(&readings, &config).ok()?;
        // The model stays while the goals before are taken for received.
        config.lengths_m = vec![map.model().length_m];
        config.noise_shares = vec![map.model().noise_share];
        let places = self.places(&readings);
        let mut goals: Vec<Vector2<f64>> = Vec::with_capacity(drones);
        let mut largest: f64 = 0.0;
        while goals.len() < drones {
            let best = readings
                .iter()
                .map(|(pose, _)| map.level(&pose.position.xy()).0)
                .fold(f64::NEG_INFINITY, f64::max);
            let apart = |place: &&Vector2<f64>| {
                goals.iter().all(|goal| (goal - **place).norm() >= self.config.separation_m)
            };
            let improvement = |place: &Vector2<f64>| self.improvement(map.level(place), best);
            let (gain, goal) = places
                .iter()
                .filter(apart)
                .map(|place| (improvement(place), *place))
                .max_by(|a, b| a.0.total_cmp(&b.0))?;
            largest = largest.max(gain);
            goals.push(goal);
            let believed = map.level(&goal).0;
            readings.push((Pose::at(goal.x, goal.y, self.config.up_m), believed));
            if let Ok(next) = FieldMap::fit(&readings, &config) {
                map = next;
            }
        }
        Some((goals, largest))
    }

    /// The expected improvement over the largest level, in dB (Jones, Schonlau & Welch 1998, eq.
    /// 15).
    fn improvement(&self, (mean, sigma): (f64, f64), best: f64) -> f64 {
        let off = mean - best;
        if sigma <= 0.0 {
            return off.max(0.0);
        }
        off * self.standard.cdf(off / sigma) + sigma * self.standard.pdf(off / sigma)
    }

    /// A grid over the places of the readings and the reach about them.
    fn places(&self, readings: &[(Pose, f64)]) -> Vec<Vector2<f64>> {
        let nowhere = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        let (low, high) = readings.iter().fold(nowhere, |(low, high), (pose, _)| {
            let place = pose.position.xy();
            (low.inf(&place), high.sup(&place))
        });
        let margin = Vector2::repeat(self.config.reach_m);
        let (low, side) = (low - margin, high - low + 2.0 * margin);
        let count = self.config.places_a_side;
        let share = |index: u16| (f64::from(index) + 0.5) / f64::from(count);
        let place = |i, j| low + side.component_mul(&Vector2::new(share(i), share(j)));
        (0..count).flat_map(|i| (0..count).map(move |j| place(i, j))).collect()
    }

    fn decide(
        &mut self,
        beacon: Option<BeaconId>,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        if stations.is_empty() {
            return Err(PlanError::TooFew { needed: 1, have: 0 });
        }
        let position = belief.position();
        let east = position.mean.x;
        let north = position.mean.y;
        let ellipse = position.ellipse(0.95).map(|ellipse| ellipse.semi_major);
        let finite = position.mean.iter().chain(position.covariance.iter()).all(|n| n.is_finite());
        let from: Vec<_> = stations.iter().map(|s| s.pose.position.xy()).collect();
        if !(finite && from.iter().all(|place| place.iter().all(|n| n.is_finite()))) {
            return Err(PlanError::NotFinite { east, north });
        }
        self.measured = self.measured.saturating_add(1);
        let end = if ellipse.is_some_and(|axis| axis <= self.config.ellipse_m) {
            Some(Outcome::EllipseReached)
        } else {
            (self.measured >= self.config.most_positions).then_some(Outcome::MoveLimit)
        };
        if let Some(outcome) = end {
            self.account = format!("{outcome} after {} positions", self.measured);
            for station in stations {
                station.goal = Waypoint { position: station.pose.position };
            }
            return Ok(Decision::Finish(outcome));
        }
        let places = match self.goals(beacon, stations.len()) {
            Some((places, gain)) => {
                self.account = format!("{gain:.1} dB of improvement expected");
                places
            }
            None => {
                self.account = "too few readings for a field: spread out".to_owned();
                ring(&from, 0.5 * self.config.reach_m, self.measured)
            }
        };
        for (station, place) in stations.iter_mut().zip(places) {
            station.goal = Waypoint { position: place.push(self.config.up_m) };
        }
        Ok(Decision::Listen(Stage::Searching))
    }
}

/// Places on a circle about the middle of the drones, turned from one time to the next.
fn ring(from: &[Vector2<f64>], radius: f64, turn: u32) -> Vec<Vector2<f64>> {
    let count = u32::try_from(from.len()).unwrap_or(u32::MAX);
    let middle = from.iter().sum::<Vector2<f64>>() / f64::from(count);
    let polygon = Polygon { circumradius: radius };
    let vertex = |index| polygon.vertex(&middle, f64::from(turn), 0.0, index, from.len()).xy();
    (0..from.len()).map(vertex).collect()
}

impl FormationPlanner for BayesianOptimisation {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        for station in stations {
            *station = Station::holding(station.pose);
        }
        if self.measured > 0 {
            // Its search is over.
            self.levels.retain(|(of, ..)| Some(*of) != self.beacon);
        }
        (self.measured, self.beacon) = (0, None);
        "listen here, there is no reading yet".clone_into(&mut self.account);
        Ok(())
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        self.decide(self.beacon, belief, stations)
    }

    fn plan_together(
        &mut self,
        targets: &[Target<'_>],
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let target = targets.first().ok_or(PlanError::NoPlace)?;
        // Turns that all share bring readings of every beacon; this is about the first.
        self.beacon = Some(target.beacon);
        self.decide(self.beacon, target.belief, stations)
    }

    fn observe(&mut self, reception: &Reception) {
        self.beacon.get_or_insert(reception.beacon);
        let Some(level) = reception.level else { return };
        let own = |(of, ..): &(BeaconId, Pose, f64)| *of == reception.beacon;
        if self.levels.iter().filter(|reading| own(reading)).count() >= MOST_READINGS
            && let Some(oldest) = self.levels.iter().position(own)
        {
            self.levels.remove(oldest);
        }
        self.levels.push((reception.beacon, reception.receiver, level.rss_dbm));
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        to.write_str(&self.account)
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::{Estimate, Level, laws};

    use super::*;

    fn reception(east: f64, north: f64) -> Reception {
        let range = (east - 70.0).hypot(north - 20.0).hypot(4.0);
        Reception {
            receiver: Pose::at(east, north, 4.0),
            level: Some(Level { rss_dbm: -30.0 - 27.65 * range.log10(), sigma_db: 4.0 }),
            ..Reception::default()
        }
    }

    fn planner() -> BayesianOptimisation {
        BayesianOptimisation::new(BayesianOptimisationConfig::default()).expect("in range")
    }

    #[test]
    fn it_climbs_to_where_the_level_is_highest() {
        let mut planner = planner();
        let wide = Estimate::isotropic(Vector2::zeros(), 50.0);
        let mut stations = [Station::default(); 3];
        for (index, station) in stations.iter_mut().enumerate() {
            station.pose = Pose::at(f64::from(u8::try_from(index).expect("few")), 0.0, 4.0);
        }
        planner.begin(&mut stations).expect("there are drones");
        for _ in 0..12 {
            for station in &stations {
                let place = station.goal.position;
                planner.observe(&reception(place.x, place.y));
            }
            for station in &mut stations {
                station.pose.position = station.goal.position;
            }
            assert!(matches!(planner.plan(&wide, &mut stations), Ok(Decision::Listen(_))));
            for (index, a) in stations.iter().enumerate() {
                for b in &stations[..index] {
                    assert!((a.goal.position - b.goal.position).norm() >= 3.0 - 1e-9);
                }
            }
        }
        let loudest = planner.levels.iter().max_by(|a, b| a.2.total_cmp(&b.2)).expect("12 turns");
        let miss = (loudest.1.position.xy() - Vector2::new(70.0, 20.0)).norm();
        assert!(miss < 8.0, "the loudest place is {miss} m off");
    }

    #[test]
    fn it_keeps_the_latest_readings_of_each_beacon_until_its_search_is_over() {
        let mut planner = planner();
        let mut stations = [Station::default(); 2];
        let of = |beacon, east| Reception { beacon: BeaconId(beacon), ..reception(east, 0.0) };
        let known = |planner: &BayesianOptimisation, beacon| {
            planner.levels.iter().filter(|(of, ..)| *of == BeaconId(beacon)).count()
        };
        planner.begin(&mut stations).expect("there are drones");
        // The other one is received first, as in turns that all share.
        planner.observe(&of(1, 0.0));
        for index in 0..250_u8 {
            planner.observe(&of(0, f64::from(index)));
        }
        assert_eq!((known(&planner, 0), known(&planner, 1)), (MOST_READINGS, 1));
        let oldest = planner.levels.iter().find(|(of, ..)| *of == BeaconId(0)).expect("200");
        assert_abs_diff_eq!(oldest.1.position.x, 50.0, epsilon = 1e-12);
        let belief = Estimate::isotropic(Vector2::zeros(), 20.0);
        let target = |beacon| Target { beacon: BeaconId(beacon), belief: &belief };
        let small = Estimate::isotropic(Vector2::zeros(), 0.5);
        let first = Target { beacon: BeaconId(0), belief: &small };
        let end = planner.plan_together(&[first, target(1)], &mut stations);
        assert_eq!(end, Ok(Decision::Finish(Outcome::EllipseReached)));
        planner.resume(&belief, &mut stations).expect("there are drones");
        assert_eq!((known(&planner, 0), known(&planner, 1)), (0, 1));
        assert!(planner.plan_together(&[target(1)], &mut stations).is_ok());
        assert_eq!(planner.beacon, Some(BeaconId(1)));
    }

    #[test]
    fn it_ends_keeps_the_laws_and_names_what_is_wrong() {
        let mut stations = [Station::default(); 2];
        let belief = Estimate::isotropic(Vector2::new(5.0, 5.0), 20.0);
        laws::formation_planner(planner, &belief, &mut stations);
        let mut planner = planner();
        planner.begin(&mut stations).expect("there are drones");
        let small = Estimate::isotropic(Vector2::zeros(), 0.5);
        let end = planner.plan(&small, &mut stations);
        assert_eq!(end, Ok(Decision::Finish(Outcome::EllipseReached)));
        planner.begin(&mut stations).expect("there are drones");
        for _ in 1..30 {
            assert!(matches!(planner.plan(&belief, &mut stations), Ok(Decision::Listen(_))));
        }
        let end = planner.plan(&belief, &mut stations);
        assert_eq!(end, Ok(Decision::Finish(Outcome::MoveLimit)));
        let config = BayesianOptimisationConfig { reach_m: 0.0, ..Default::default() };
        let error = BayesianOptimisation::new(config).expect_err("no reach");
        assert_eq!((error.name, error.value), ("reach_m", 0.0));
    }
}
