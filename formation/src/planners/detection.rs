//! A search by the probability of detection, until the target is received.

use alloc::vec::Vec;
use core::{
    f64::consts::{FRAC_1_SQRT_2, LN_10},
    fmt,
};

use foxhunt_core::{
    BeaconId, Belief, Decision, FormationPlanner, Outcome, PlanError, Reception, Stage, Station,
    Target, Waypoint,
    parameter::{ParameterError, at_least_one, finite, in_range, not_negative, positive, require},
};
use nalgebra::{Vector2, Vector3};

use super::{Coverage, CoverageConfig, CoverageError};
use crate::shape::number;

/// Number of ranges that stand for an unknown power.
const RANGES: usize = 8;

/// The most places in an area: what each receives of each is kept.
const MOST: f64 = 400.0;

/// Configuration of [`Detection`]. Lengths are metres, times seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct DetectionConfig {
    /// The most from one place of the area to the next.
    pub spacing_m: f64,
    /// Range at which the level of the weakest transmitter meets the receiver's floor.
    pub least_range_m: f64,
    /// Range at which the level of the strongest transmitter meets the floor. Equal ratios of
    /// ranges are as likely.
    pub most_range_m: f64,
    /// The path-loss exponent.
    pub exponent: f64,
    /// σ of a turn's level in dB.
    pub level_sigma_db: f64,
    /// Altitude of the drones.
    pub up_m: f64,
    /// Speed of a drone over ground, in metres per second.
    pub speed_mps: f64,
    /// Duration of a turn of the antenna.
    pub turn_s: f64,
    /// No two goals are nearer to each other than this.
    pub separation_m: f64,
    /// The search ends when a transmitter in the area would have been received with this
    /// probability …
    pub success: f64,
    /// … or after this many formation positions.
    pub most_positions: u32,
}

impl Default for DetectionConfig {
    /// Places 10 m apart; ranges from 10 m to 10 km; exponent, altitude, speed and turn of
    /// [`InformationConfig`](super::InformationConfig), σ 6 dB; an end at 95 % or 60 positions.
    fn default() -> Self {
        Self {
            spacing_m: 10.0,
            least_range_m: 10.0,
            most_range_m: 10_000.0,
            exponent: 2.765,
            level_sigma_db: 6.0,
            up_m: 4.0,
            speed_mps: 2.0,
            turn_s: 45.0,
            separation_m: 3.0,
            success: 0.95,
            most_positions: 60,
        }
    }
}

impl DetectionConfig {
    fn check(&self) -> Result<(), ParameterError> {
        positive("spacing_m", self.spacing_m)?;
        positive("least_range_m", self.least_range_m)?;
        finite("most_range_m", self.most_range_m)?;
        let is_range = self.most_range_m >= self.least_range_m;
        require(is_range, "most_range_m", self.most_range_m, "at least least_range_m")?;
        positive("exponent", self.exponent)?;
        positive("level_sigma_db", self.level_sigma_db)?;
        not_negative("up_m", self.up_m)?;
        positive("speed_mps", self.speed_mps)?;
        positive("turn_s", self.turn_s)?;
        not_negative("separation_m", self.separation_m)?;
        in_range("success", self.success, 0.0..=1.0, "from 0 to 1")?;
        at_least_one("most_positions", self.most_positions)?;
        Ok(())
    }

    /// Returns the ranges that stand for an unknown power.
    fn ranges_m(&self) -> [f64; RANGES] {
        let ratio = libm::log(self.most_range_m / self.least_range_m) / number(RANGES);
        core::array::from_fn(|i| self.least_range_m * libm::exp((number(i) + 0.5) * ratio))
    }
}

/// Goals where a transmitter that was missed would most probably be received per second, until it
/// is; the goals of another planner from then on.
///
/// The transmitter is anywhere in an area, and its power is unknown. Each turn in which it is not
/// received makes places near the drones less probable, those of a strong transmitter more than
/// those of a weak one (Koopman, *Search and Screening*, 1980). The next places are those with the
/// most to gain for the time of the way and of the turn, one drone after the other (Stone, *Theory
/// of Optimal Search*, 1975). The shadowing of turns at different places counts as independent.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection<P> {
    config: DetectionConfig,
    places: Vec<Vector2<f64>>,
    ranges_m: [f64; RANGES],
    /// The probabilities that a receiver at each place receives a transmitter at each place.
    received_from: Vec<Vec<[f64; RANGES]>>,
    /// The probability that the transmitter is at a place, has a range, and was missed.
    missed: Vec<[f64; RANGES]>,
    positions: u32,
    /// Beacons that were received.
    received: Vec<BeaconId>,
    then: P,
    /// True once the other planner plans.
    is_found: bool,
}

impl<P: FormationPlanner> Detection<P> {
    /// A search of the polygon with these corners, East and North in metres, and the planner for a
    /// target that was received.
    ///
    /// # Errors
    ///
    /// [`CoverageError`] when that is no simple polygon, a parameter is out of its range, or
    /// there were more than 400 places.
    pub fn new(
        corners: &[Vector2<f64>],
        config: DetectionConfig,
        then: P,
    ) -> Result<Self, CoverageError> {
        config.check()?;
        let laid_out = Coverage::new(
            corners,
            &CoverageConfig {
                row_spacing_m: config.spacing_m,
                along_spacing_m: config.spacing_m,
                margin_m: 0.25 * config.spacing_m,
                direction_rad: None,
            },
        )?;
        let places = laid_out.places().to_vec();
        let fits = number(places.len()) <= MOST;
        let requirement = "so large that 400 places are enough";
        require(fits, "spacing_m", config.spacing_m, requirement)?;
        let ranges_m = config.ranges_m();
        let mut search = Self {
            config,
            places,
            ranges_m,
            received_from: Vec::new(),
            missed: Vec::new(),
            positions: 0,
            received: Vec::new(),
            then,
            is_found: false,
        };
        let receivers = search.places.iter().map(|place| place.push(config.up_m));
        search.received_from = receivers.map(|receiver| search.received_at(&receiver)).collect();
        search.reset();
        Ok(search)
    }

    /// Returns the probability that a transmitter in the area would have been received by now
    /// (probability of success).
    #[must_use]
    pub fn success(&self) -> f64 {
        1.0 - self.missed.as_flattened().iter().sum::<f64>()
    }

    fn reset(&mut self) {
        let share = 1.0 / (number(self.places.len()) * number(RANGES));
        self.missed.clear();
        self.missed.resize(self.places.len(), [share; RANGES]);
        self.positions = 0;
        self.received.clear();
        self.is_found = false;
    }

    /// The probabilities that a receiver receives a transmitter at each place, range by range.
    fn received_at(&self, receiver: &Vector3<f64>) -> Vec<[f64; RANGES]> {
        let scale = 10.0 * self.config.exponent / (LN_10 * self.config.level_sigma_db);
        let log_ranges = self.ranges_m.map(libm::log);
        let of_place = |place: &Vector2<f64>| {
            let square = (receiver - place.push(0.0)).norm_squared().max(f64::MIN_POSITIVE);
            let log_away = 0.5 * libm::log(square);
            log_ranges.map(|log_range| {
                let above = scale * (log_range - log_away);
                0.5 * libm::erfc(-above * FRAC_1_SQRT_2)
            })
        };
        self.places.iter().map(of_place).collect()
    }

    /// Sets the goals of the next turn, one drone after the other.
    fn search(&self, stations: &mut [Station]) {
        let mut missed = self.missed.clone();
        let mut goals: Vec<Vector2<f64>> = Vec::with_capacity(stations.len());
        let mut slowest_s: f64 = 0.0;
        for station in stations {
            let from = station.pose.position.xy();
            let mut best: Option<(f64, f64, usize)> = None;
            for (index, (place, received)) in
                self.places.iter().zip(&self.received_from).enumerate()
            {
                if goals.iter().any(|goal| (goal - place).norm() < self.config.separation_m) {
                    continue;
                }
                // Everyone waits for the drone with the longest way.
                let way_s = ((place - from).norm() / self.config.speed_mps).max(slowest_s);
                let rate = gain(received, &missed) / (way_s + self.config.turn_s);
                if best.is_none_or(|(most, ..)| rate > most) {
                    best = Some((rate, way_s, index));
                }
            }
            let chosen = best.and_then(|(_, way_s, index)| {
                Some((way_s, self.places.get(index)?, self.received_from.get(index)?))
            });
            let Some((way_s, place, received)) = chosen else {
                station.goal = Waypoint { position: station.pose.position };
                continue;
            };
            slowest_s = way_s;
            miss(received, &mut missed);
            goals.push(*place);
            station.goal = Waypoint { position: place.push(self.config.up_m) };
        }
    }

    /// Goes on after a turn in which nothing was received.
    fn search_on(&mut self, stations: &mut [Station]) -> Result<Decision, PlanError> {
        refuse_none(stations)?;
        for station in &*stations {
            let received = self.received_at(&station.pose.position);
            miss(&received, &mut self.missed);
        }
        self.positions = self.positions.saturating_add(1);
        self.search(stations);
        let is_over =
            self.success() >= self.config.success || self.positions >= self.config.most_positions;
        Ok(if is_over {
            Decision::Finish(Outcome::PathDone)
        } else {
            Decision::Listen(Stage::Searching)
        })
    }

    /// Plans with the other planner, which begins with the first plan.
    fn follow(
        &mut self,
        stations: &mut [Station],
        plan: impl FnOnce(&mut P, &mut [Station]) -> Result<Decision, PlanError>,
    ) -> Result<Decision, PlanError> {
        if !self.is_found {
            self.then.begin(&mut stations.to_vec())?;
        }
        let decided = plan(&mut self.then, stations)?;
        self.is_found = true;
        Ok(decided)
    }
}

/// Takes a turn into account in which nothing was received.
fn miss(received: &[[f64; RANGES]], missed: &mut [[f64; RANGES]]) {
    for (missed, received) in missed.as_flattened_mut().iter_mut().zip(received.as_flattened()) {
        *missed *= 1.0 - received;
    }
}

/// The probability that a turn receives the transmitter, and those before did not.
fn gain(received: &[[f64; RANGES]], missed: &[[f64; RANGES]]) -> f64 {
    let both = received.as_flattened().iter().zip(missed.as_flattened());
    both.map(|(received, missed)| received * missed).sum()
}

fn refuse_none(stations: &[Station]) -> Result<(), PlanError> {
    if stations.is_empty() { Err(PlanError::TooFew { needed: 1, have: 0 }) } else { Ok(()) }
}

impl<P: FormationPlanner> FormationPlanner for Detection<P> {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        refuse_none(stations)?;
        self.reset();
        self.search(stations);
        Ok(())
    }

    fn resume(&mut self, belief: &dyn Belief, stations: &mut [Station]) -> Result<(), PlanError> {
        self.then.resume(belief, stations)?;
        self.reset();
        self.is_found = true;
        Ok(())
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        if self.is_found || !self.received.is_empty() {
            return self.follow(stations, |then, stations| then.plan(belief, stations));
        }
        self.search_on(stations)
    }

    fn plan_together(
        &mut self,
        targets: &[Target<'_>],
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let first = targets.first().map(|target| target.beacon);
        if self.is_found || first.is_some_and(|beacon| self.received.contains(&beacon)) {
            return self.follow(stations, |then, stations| then.plan_together(targets, stations));
        }
        self.search_on(stations)
    }

    fn goes_on_without_signal(&self) -> bool {
        !self.is_found || self.then.goes_on_without_signal()
    }

    fn observe(&mut self, reception: &Reception) {
        if !self.received.contains(&reception.beacon) {
            self.received.push(reception.beacon);
        }
        self.then.observe(reception);
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        if self.is_found {
            return self.then.explain(to);
        }
        let percent = 100.0 * self.success();
        write!(to, "POS {percent:.0} % after {} places", self.positions)
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{Estimate, Level, Pose, laws};
    use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::StandardNormal;

    use super::*;
    use crate::{
        planners::{
            Hold, Waypoints,
            fake::{arrive, stations},
        },
        shape::Polygon,
    };

    /// An area of 600 by 400 m.
    const CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [600.0, 0.0], [600.0, 400.0], [0.0, 400.0]];

    fn config() -> DetectionConfig {
        DetectionConfig {
            spacing_m: 40.0,
            least_range_m: 30.0,
            most_range_m: 300.0,
            most_positions: 200,
            ..DetectionConfig::default()
        }
    }

    fn planner() -> Detection<Hold> {
        let corners = CORNERS.map(Vector2::from);
        Detection::new(&corners, config(), Hold::new(3)).expect("an area")
    }

    fn nowhere() -> Estimate<2> {
        Estimate::isotropic(Vector2::new(300.0, 200.0), 200.0)
    }

    /// Seconds until a transmitter is received; `None` if the planner ends before.
    fn seconds_to_reception(planner: &mut impl FormationPlanner, seed: u64) -> Option<f64> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let target = Vector2::new(rng.random_range(0.0..600.0), rng.random_range(0.0..400.0));
        let log_range = rng.random_range(libm::log(30.0)..libm::log(300.0));
        let mut drone = [Station::holding(Pose::at(0.0, 0.0, 4.0))];
        planner.begin(&mut drone).expect("a drone");
        let mut time_s = 0.0;
        loop {
            let [Station { pose, goal }] = &drone;
            time_s += (goal.position - pose.position).norm() / 2.0 + 45.0;
            arrive(&mut drone);
            let [Station { pose, .. }] = &drone;
            let log_away = libm::log((pose.position - target.push(0.0)).norm());
            let above_db = 27.65 / LN_10 * (log_range - log_away);
            let shadow_db: f64 = 6.0 * rng.sample::<f64, _>(StandardNormal);
            if above_db + shadow_db > 0.0 {
                return Some(time_s);
            }
            let decided = planner.plan(&nowhere(), &mut drone).expect("a plan");
            if matches!(decided, Decision::Finish(_)) {
                return None;
            }
        }
    }

    #[test]
    fn it_receives_as_soon_as_a_sweep_of_rows_and_ends_as_sure_as_it_says() {
        const RUNS: usize = 400;
        let corners = CORNERS.map(Vector2::from);
        let spaced = CoverageConfig {
            row_spacing_m: 100.0,
            along_spacing_m: 100.0,
            margin_m: 50.0,
            direction_rad: None,
        };
        let rows = Coverage::new(&corners, &spaced).expect("an area");
        let rows: Vec<Vector3<f64>> = rows.places().iter().map(|place| place.push(4.0)).collect();
        let seeds = 0..u64::try_from(RUNS).expect("few");
        let searched: Vec<Option<f64>> =
            seeds.clone().map(|seed| seconds_to_reception(&mut planner(), seed)).collect();
        let swept: Vec<Option<f64>> = seeds
            .map(|seed| {
                let polygon = Polygon { circumradius: 0.0 };
                let mut sweep = Waypoints::new(&rows, polygon, 0.0).expect("places");
                seconds_to_reception(&mut sweep, seed)
            })
            .collect();
        let within = |runs: &[Option<f64>], most_s: f64| {
            runs.iter().flatten().filter(|seconds| **seconds <= most_s).count()
        };
        for most_s in [600.0, 900.0, 1200.0] {
            let counts = [within(&searched, most_s), within(&swept, most_s)];
            assert!(counts[0] >= counts[1], "{counts:?} in {most_s} s");
        }
        // 95 % of 400 and three standard deviations of a share; the last turn ends a little above.
        let found = within(&searched, f64::INFINITY);
        assert!((367..=397).contains(&found), "{found} of {RUNS}");
        assert!(found > within(&swept, f64::INFINITY) + 20);
    }

    #[test]
    fn silence_makes_the_rest_of_the_area_more_worth() {
        let mut planner = planner();
        let mut drones = stations::<3>();
        planner.begin(&mut drones).expect("drones");
        let mut success = 0.0;
        loop {
            arrive(&mut drones);
            let places = drones.map(|drone| drone.pose.position);
            assert!((places[0] - places[1]).norm() >= 3.0);
            let decided = planner.plan(&nowhere(), &mut drones).expect("a plan");
            assert!(planner.success() > success, "{success}");
            success = planner.success();
            if let Decision::Finish(outcome) = decided {
                assert_eq!(outcome, Outcome::PathDone);
                break;
            }
            assert!(planner.goes_on_without_signal());
        }
        assert!(success >= 0.95, "{success}");
    }

    #[test]
    fn a_reception_hands_over_and_others_do_not() {
        let mut planner = planner();
        let mut drones = stations::<2>();
        planner.begin(&mut drones).expect("drones");
        let belief = nowhere();
        let targets = [Target { beacon: BeaconId(1), belief: &belief }];
        let reception = |beacon| Reception {
            beacon: BeaconId(beacon),
            level: Some(Level { rss_dbm: -90.0, sigma_db: 2.0 }),
            ..Reception::default()
        };
        planner.observe(&reception(2));
        arrive(&mut drones);
        planner.plan_together(&targets, &mut drones).expect("a plan");
        assert!(drones[0].goal.position != drones[0].pose.position);
        planner.observe(&reception(1));
        arrive(&mut drones);
        planner.plan_together(&targets, &mut drones).expect("a plan");
        assert_eq!(drones[0].goal.position, drones[0].pose.position);
        assert!(!planner.goes_on_without_signal());
        // The next target is searched for again.
        planner.begin(&mut drones).expect("drones");
        assert!(planner.goes_on_without_signal() && planner.success() < 1e-9);
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        let corners = CORNERS.map(Vector2::from);
        let refused = |config| {
            let error = Detection::new(&corners, config, Hold::new(1)).expect_err("refused");
            alloc::string::ToString::to_string(&error)
        };
        for (config, field) in [
            (DetectionConfig { spacing_m: 0.0, ..config() }, "spacing_m"),
            (DetectionConfig { spacing_m: 10.0, ..config() }, "spacing_m"),
            (DetectionConfig { least_range_m: 400.0, ..config() }, "most_range_m"),
            (DetectionConfig { exponent: 0.0, ..config() }, "exponent"),
            (DetectionConfig { level_sigma_db: -1.0, ..config() }, "level_sigma_db"),
            (DetectionConfig { success: 1.5, ..config() }, "success"),
            (DetectionConfig { most_positions: 0, ..config() }, "most_positions"),
        ] {
            let error = refused(config);
            assert!(error.contains(field), "{error}");
        }
        assert!(planner().begin(&mut []).is_err());
    }

    #[test]
    fn it_keeps_the_laws_of_planners() {
        laws::formation_planner(planner, &nowhere(), &mut stations::<2>());
    }
}
