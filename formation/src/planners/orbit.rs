//! Planners that go around the estimate: on a circle, or on a spiral towards it first.

use core::{
    f64::consts::{FRAC_PI_4, FRAC_PI_6, TAU},
    fmt,
};

use foxhunt_core::{
    Belief, Decision, FormationPlanner, PlanError, Station, Waypoint,
    angle::{self, Resultant},
    parameter::{ParameterError, positive, require},
};
use nalgebra::Vector2;

use super::{
    AltitudeRule, Circle, Settling, SettlingRule, at_radius, away, centroid, direction,
    estimate_and_centroid, mean_distance, nearest_direction, turning,
};
use crate::shape::{Polygon, arrange_or_centre, number};

/// Less than this mean resultant length, the drones are around the estimate and not on a side of
/// it.
const ON_A_SIDE: f64 = 0.3;

/// Configuration of [`Orbit`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct OrbitConfig {
    /// From the estimate to each drone over ground, in metres.
    pub radius_m: f64,
    /// Angle that the drones go round from one formation position to the next, in radians
    /// counter-clockwise; not 0.
    pub step_rad: f64,
    /// Rule for the altitude.
    pub altitude: AltitudeRule,
    /// Rule that ends the search.
    pub settling: SettlingRule,
}

impl Default for OrbitConfig {
    /// The reference's circumradius, 6 m, steps of 30°, and the defaults of [`AltitudeRule`] and
    /// [`SettlingRule`].
    fn default() -> Self {
        Self {
            radius_m: 6.0,
            step_rad: FRAC_PI_6,
            altitude: AltitudeRule::default(),
            settling: SettlingRule::default(),
        }
    }
}

/// Drones that circle the estimate, spread evenly around it, so that every direction is listened
/// from.
///
/// A target that nothing is known of begins with the same circle about the drones' centroid; one
/// drone listens at that place itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Orbit {
    config: OrbitConfig,
    circle: Circle,
    settling: Settling,
}

impl Orbit {
    /// A planner before its first target.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn new(config: OrbitConfig) -> Result<Self, ParameterError> {
        positive("radius_m", config.radius_m)?;
        turning("step_rad", config.step_rad)?;
        config.altitude.check()?;
        config.settling.check()?;
        Ok(Self { config, circle: Circle::default(), settling: Settling::default() })
    }

    fn advance(&mut self, centre: &Vector2<f64>, stations: &mut [Station]) {
        let OrbitConfig { radius_m, step_rad, altitude, .. } = &self.config;
        self.circle.advance(centre, *radius_m, *step_rad, altitude, stations);
    }
}

impl FormationPlanner for Orbit {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        let centre = centroid(stations)?;
        self.circle = Circle::default();
        self.settling = Settling::default();
        let OrbitConfig { radius_m, altitude, .. } = self.config;
        let alone = stations.len() == 1;
        let up = if alone { altitude.most_m } else { altitude.altitude(radius_m) };
        let ring = Polygon { circumradius: radius_m };
        arrange_or_centre(&ring, &centre, 0.0, up, stations);
        Ok(())
    }

    fn resume(&mut self, belief: &dyn Belief, stations: &mut [Station]) -> Result<(), PlanError> {
        let (estimate, _) = estimate_and_centroid(belief, stations)?;
        self.circle = Circle::default();
        self.settling = Settling::default();
        self.advance(&estimate.mean, stations);
        Ok(())
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let (estimate, _) = estimate_and_centroid(belief, stations)?;
        let OrbitConfig { radius_m, step_rad, settling, .. } = self.config;
        let near = at_radius(mean_distance(&estimate.mean, stations), radius_m);
        let decision = self.settling.take(&settling, estimate, step_rad, stations.len(), near);
        self.advance(&estimate.mean, stations);
        Ok(decision)
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        write!(to, "orbit at {:.1} m: {}", self.config.radius_m, self.settling)
    }
}

/// Configuration of [`Arcs`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct ArcsConfig {
    /// Factor of each move on the distance to the estimate; above 0 and below 1.
    pub shrink: f64,
    /// Angle of each move round the estimate, in radians counter-clockwise; not 0.
    pub turn_rad: f64,
    /// Distance of neighbours along their circle about the estimate, in metres, where the circle
    /// has room for that; else they are spread evenly around it.
    pub spacing_m: f64,
    /// The distance to the estimate over ground, in metres, that the approach ends at.
    pub standoff_m: f64,
    /// Rule for the altitude.
    pub altitude: AltitudeRule,
    /// Rule that ends the search.
    pub settling: SettlingRule,
}

impl Default for ArcsConfig {
    /// 0.6 times the distance and 45° for each move, drones 40 m apart, down to 6 m, and the
    /// defaults of [`AltitudeRule`] and [`SettlingRule`].
    fn default() -> Self {
        Self {
            shrink: 0.6,
            turn_rad: FRAC_PI_4,
            spacing_m: 40.0,
            standoff_m: 6.0,
            altitude: AltitudeRule::default(),
            settling: SettlingRule::default(),
        }
    }
}

/// An approach on a logarithmic spiral about the estimate, so that the bearings differ on the way
/// in, and then a circle: what Pritzl 2018 proposes in place of the straight way.
///
/// Several drones fly side by side on an arc about the estimate, which closes to a circle as they
/// come near. The distance is that from where they really are. A target that nothing is known of
/// is first listened for from where they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Arcs {
    config: ArcsConfig,
    direction: Option<f64>,
    distance: f64,
    settling: Settling,
}

impl Arcs {
    /// A planner before its first target.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn new(config: ArcsConfig) -> Result<Self, ParameterError> {
        let shrink = config.shrink;
        require(shrink > 0.0 && shrink < 1.0, "shrink", shrink, "above 0 and below 1")?;
        turning("turn_rad", config.turn_rad)?;
        positive("spacing_m", config.spacing_m)?;
        positive("standoff_m", config.standoff_m)?;
        config.altitude.check()?;
        config.settling.check()?;
        Ok(Self { config, direction: None, distance: 0.0, settling: Settling::default() })
    }

    /// Sets the next goals about the estimate from where the drones are.
    fn approach(&mut self, estimate: &Vector2<f64>, distance: f64, stations: &mut [Station]) {
        let directions: Resultant =
            stations.iter().map(|s| direction(estimate, &s.pose.position.xy())).collect();
        let now = directions
            .direction(ON_A_SIDE)
            .or(self.direction)
            .unwrap_or_else(|| nearest_direction(estimate, stations));
        let middle = angle::wrap(now + self.config.turn_rad);
        self.direction = Some(middle);
        self.distance = (distance * self.config.shrink).max(self.config.standoff_m);
        let altitude = self.config.altitude.altitude(self.distance);
        let drones = number(stations.len());
        let apart = (TAU / drones).min(self.config.spacing_m / self.distance);
        for (index, station) in stations.iter_mut().enumerate() {
            let direction = middle + (number(index) - 0.5 * (drones - 1.0)) * apart;
            let position = away(estimate, self.distance, direction).push(altitude);
            station.goal = Waypoint { position };
        }
    }

    fn reset(&mut self) {
        self.direction = None;
        self.settling = Settling::default();
    }
}

impl FormationPlanner for Arcs {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        centroid(stations)?;
        self.reset();
        for station in stations {
            let position = station.pose.position.xy().push(self.config.altitude.most_m);
            station.goal = Waypoint { position };
        }
        Ok(())
    }

    fn resume(&mut self, belief: &dyn Belief, stations: &mut [Station]) -> Result<(), PlanError> {
        let (estimate, _) = estimate_and_centroid(belief, stations)?;
        self.reset();
        let distance = mean_distance(&estimate.mean, stations);
        self.approach(&estimate.mean, distance, stations);
        Ok(())
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let (estimate, _) = estimate_and_centroid(belief, stations)?;
        let ArcsConfig { turn_rad, standoff_m, settling, .. } = self.config;
        let distance = mean_distance(&estimate.mean, stations);
        let near = at_radius(distance, standoff_m);
        let decision = self.settling.take(&settling, estimate, turn_rad, stations.len(), near);
        self.approach(&estimate.mean, distance, stations);
        Ok(decision)
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        write!(to, "arc to {:.1} m from the estimate: {}", self.distance, self.settling)
    }
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use foxhunt_core::{Estimate, Outcome, Pose, Stage, laws};

    use super::*;
    use crate::planners::fake::{Shrinking, arrive, stations};

    fn orbit() -> Orbit {
        let config = OrbitConfig { radius_m: 10.0, ..OrbitConfig::default() };
        Orbit::new(config).expect("the values are in range")
    }

    #[test]
    fn it_goes_round_the_estimate_and_ends() {
        let mut drones = stations::<3>();
        let mut target = Shrinking::towards(30.0, -20.0);
        let end = target.search(&mut orbit(), &mut drones, |_, stations| {
            let goals = || stations.iter().map(|station| station.goal.position);
            let centre = goals().map(|goal| goal.xy()).sum::<Vector2<f64>>() / 3.0;
            assert!(goals().all(|goal| abs_diff_eq!(goal.z, 4.0, epsilon = 1e-12)));
            assert!(goals().all(|goal| ((goal.xy() - centre).norm() - 10.0).abs() < 1e-9));
        });
        assert_eq!(end.outcome, Outcome::Converged);
        // The last goals are a triangle about the estimate.
        for drone in &drones {
            let radius = (drone.goal.position.xy() - target.estimate().mean).norm();
            assert_abs_diff_eq!(radius, 10.0, epsilon = 1e-9);
        }
    }

    #[test]
    fn one_drone_goes_all_the_way_round() {
        let mut drone = stations::<1>();
        let mut target = Shrinking::towards(8.0, 3.0);
        let mut finishing = 0;
        let end = target.search(&mut orbit(), &mut drone, |decision, _| {
            finishing += u32::from(*decision == Decision::Listen(Stage::Finishing));
        });
        assert_eq!((end.outcome, finishing), (Outcome::Converged, 12));
    }

    #[test]
    fn drones_that_never_get_there_meet_the_cap() {
        let mut still = stations::<3>();
        let mut orbit = orbit();
        orbit.begin(&mut still).expect("drones");
        let mut target = Shrinking::towards(90.0, 0.0);
        let last = (0..60).map(|_| {
            target.listen();
            orbit.plan(target.estimate(), &mut still).expect("a place")
        });
        assert_eq!(last.last(), Some(Decision::Finish(Outcome::MoveLimit)));
    }

    #[test]
    fn a_target_that_is_known_is_circled_at_once() {
        let mut drone = [Station::holding(Pose::at(0.0, 0.0, 4.0))];
        let known = Estimate::isotropic(Vector2::new(40.0, 0.0), 3.0);
        let mut orbit = orbit();
        orbit.resume(&known, &mut drone).expect("a place");
        assert!((drone[0].goal.position.xy() - Vector2::new(30.0, 0.0)).norm() < 1e-9);
        orbit.plan(&known, &mut drone).expect("a place");
        let next = away(&known.mean, 10.0, core::f64::consts::PI + FRAC_PI_6);
        assert!((drone[0].goal.position.xy() - next).norm() < 1e-9);
        laws::formation_planner(self::orbit, &known, &mut stations::<3>());
    }

    #[test]
    fn values_out_of_range_are_named() {
        for (bad, field) in [
            (OrbitConfig { radius_m: 0.0, ..Default::default() }, "radius_m"),
            (OrbitConfig { step_rad: f64::NAN, ..Default::default() }, "step_rad"),
            (OrbitConfig { step_rad: 0.0, ..Default::default() }, "step_rad"),
        ] {
            assert_eq!(Orbit::new(bad).map_err(|error| error.name), Err(field));
        }
    }

    fn arcs() -> Arcs {
        Arcs::new(ArcsConfig::default()).expect("the defaults are in range")
    }

    #[test]
    fn one_drone_flies_a_logarithmic_spiral() {
        let target = |sigma| Estimate::isotropic(Vector2::new(100.0, 0.0), sigma);
        let mut drone = [Station::holding(Pose::at(0.0, 0.0, 2.0))];
        let mut arcs = arcs();
        arcs.begin(&mut drone).expect("a drone");
        assert!((drone[0].goal.position - nalgebra::Vector3::new(0.0, 0.0, 4.0)).norm() < 1e-12);
        let mut distance = 100.0;
        let mut towards = core::f64::consts::PI;
        let mut sigma = 50.0;
        for _ in 0..9 {
            arrive(&mut drone);
            sigma *= 0.9;
            arcs.plan(&target(sigma), &mut drone).expect("a place");
            distance = f64::max(0.6 * distance, 6.0);
            towards += FRAC_PI_4;
            let expected = away(&Vector2::new(100.0, 0.0), distance, towards);
            assert!((drone[0].goal.position.xy() - expected).norm() < 1e-9);
        }
    }

    #[test]
    fn several_fly_abreast_and_end_around_the_target() {
        let mut drones = stations::<3>();
        let mut target = Shrinking::towards(300.0, 100.0);
        let truth = Vector2::new(300.0, 100.0);
        let mut nearest = f64::INFINITY;
        let mut farthest = 0.0_f64;
        let end = target.search(&mut arcs(), &mut drones, |_, drones| {
            let goal = |drone: usize| drones[drone].goal.position.xy();
            for apart in [(goal(0) - goal(1)).norm(), (goal(1) - goal(2)).norm()] {
                (nearest, farthest) = (nearest.min(apart), farthest.max(apart));
            }
        });
        assert_eq!(end.outcome, Outcome::Converged);
        assert!(nearest > 10.0, "two goals are {nearest} m apart");
        assert!((35.0..40.0).contains(&farthest), "two neighbours are {farthest} m apart");
        let sum: Vector2<f64> = drones.iter().map(|d| d.goal.position.xy() - truth).sum();
        assert!(sum.norm() < 1.0, "they are not around it: {sum}");
    }

    #[test]
    fn a_drone_that_stands_still_meets_the_cap() {
        let mut drone = [Station::holding(Pose::at(0.0, 0.0, 2.0))];
        let mut arcs = arcs();
        arcs.begin(&mut drone).expect("a drone");
        let mut target = Shrinking::towards(90.0, 0.0);
        let decision = (0..60).map(|_| {
            target.listen();
            arcs.plan(target.estimate(), &mut drone).expect("a place")
        });
        assert_eq!(decision.last(), Some(Decision::Finish(Outcome::MoveLimit)));
    }

    #[test]
    fn it_keeps_the_laws_and_refuses_bad_values() {
        let belief = Estimate::isotropic(Vector2::new(3.0, 1.0), 3.0);
        laws::formation_planner(arcs, &belief, &mut stations::<2>());
        for (bad, field) in [
            (ArcsConfig { shrink: 1.0, ..Default::default() }, "shrink"),
            (ArcsConfig { turn_rad: 0.0, ..Default::default() }, "turn_rad"),
            (ArcsConfig { spacing_m: 0.0, ..Default::default() }, "spacing_m"),
            (ArcsConfig { standoff_m: f64::INFINITY, ..Default::default() }, "standoff_m"),
        ] {
            assert_eq!(Arcs::new(bad).map_err(|error| error.name), Err(field));
        }
    }
}
