use core::{f64::consts::FRAC_PI_6, fmt};

use foxhunt_core::{
    Belief, Decision, FormationPlanner, PlanError, Station,
    parameter::{ParameterError, positive},
};
use nalgebra::Vector2;

use super::{
    altitude::AltitudeRule,
    circle::Circle,
    places::{centroid, estimate_and_centroid},
    settling::{Settling, SettlingRule, at_radius, mean_distance, turning},
};
use crate::shape::{Polygon, arrange_or_centre};

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

#[cfg(test)]
mod tests {
    use foxhunt_core::{Estimate, Outcome, Pose, Stage, laws};

    use super::*;
    use crate::planners::{
        fake::{Shrinking, stations},
        places,
    };

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
            assert!(goals().all(|goal| (goal.z - 4.0).abs() < 1e-12));
            assert!(goals().all(|goal| ((goal.xy() - centre).norm() - 10.0).abs() < 1e-9));
        });
        assert_eq!(end.outcome, Outcome::Converged);
        // The last goals are a triangle about the estimate.
        for drone in &drones {
            let radius = (drone.goal.position.xy() - target.estimate().mean).norm();
            assert!((radius - 10.0).abs() < 1e-9, "{radius}");
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
        let next = places::away(&known.mean, 10.0, core::f64::consts::PI + FRAC_PI_6);
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
}
