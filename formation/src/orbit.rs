use core::{f64::consts::FRAC_PI_6, fmt};

use foxhunt_core::{Belief, Decision, FormationPlanner, PlanError, Station, angle};
use nalgebra::Vector2;

use crate::{
    AltitudeRule, ParameterError, Polygon, SettlingRule, Shape,
    parameter::positive,
    places::{self, centroid, nearest_direction},
    settling::{Settling, at_radius, mean_distance, turning},
};

/// What [`Orbit`] is told.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct OrbitConfig {
    /// From the estimate to each drone over ground, in metres.
    pub radius_m: f64,
    /// How far the drones go round from one formation position to the next, in radians
    /// counter-clockwise; not 0.
    pub step_rad: f64,
    /// How high they fly.
    pub altitude: AltitudeRule,
    /// When they have finished.
    pub settling: SettlingRule,
}

impl Default for OrbitConfig {
    /// The reference's circumradius, 6 m, steps of 30°, and the defaults of [`AltitudeRule`] and [`SettlingRule`].
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
    direction: Option<f64>,
    settling: Settling,
}

impl Orbit {
    /// A planner that has seen no target yet.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn new(config: OrbitConfig) -> Result<Self, ParameterError> {
        positive("radius_m", config.radius_m)?;
        turning("step_rad", config.step_rad)?;
        config.altitude.check()?;
        config.settling.check()?;
        Ok(Self { config, direction: None, settling: Settling::default() })
    }

    fn circle(&self, centre: &Vector2<f64>, direction: f64, stations: &mut [Station]) {
        let ring = Polygon { circumradius: self.config.radius_m };
        let altitude = self.config.altitude.altitude(self.config.radius_m);
        let count = stations.len();
        for (index, station) in stations.iter_mut().enumerate() {
            station.goal = ring.goal(centre, direction, altitude, index, count);
        }
    }
}

impl FormationPlanner for Orbit {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        let centre = centroid(stations)?;
        (self.direction, self.settling) = (None, Settling::default());
        if let [alone] = stations {
            alone.goal.position = centre.push(self.config.altitude.most_m);
        } else {
            self.circle(&centre, 0.0, stations);
        }
        Ok(())
    }

    fn resume(&mut self, belief: &dyn Belief, stations: &mut [Station]) -> Result<(), PlanError> {
        let estimate = places::finite(belief.position().mean)?;
        centroid(stations)?;
        let direction = nearest_direction(&estimate, stations);
        (self.direction, self.settling) = (Some(direction), Settling::default());
        self.circle(&estimate, direction, stations);
        Ok(())
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let estimate = belief.position();
        let centre = places::finite(estimate.mean)?;
        centroid(stations)?;
        let OrbitConfig { radius_m, step_rad, settling, .. } = self.config;
        let near = at_radius(mean_distance(&centre, stations), radius_m);
        let decision = self.settling.take(&settling, estimate, step_rad, stations.len(), near);
        let direction = match self.direction {
            Some(direction) => angle::wrap(direction + step_rad),
            None => nearest_direction(&centre, stations),
        };
        self.direction = Some(direction);
        self.circle(&centre, direction, stations);
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
    use crate::fake::{Shrinking, stations};

    fn orbit() -> Orbit {
        let config = OrbitConfig { radius_m: 10.0, ..OrbitConfig::default() };
        Orbit::new(config).expect("the values are in range")
    }

    #[test]
    fn it_goes_round_the_estimate_and_ends() {
        let mut drones = stations::<3>();
        let mut target = Shrinking::towards(30.0, -20.0);
        let end = target.search(&mut orbit(), &mut drones, |_, stations| {
            for station in stations {
                let (goal, centre) = (station.goal.position, Vector2::new(30.0, -20.0));
                assert!((goal.z - 4.0).abs() < 1e-12);
                assert!((goal.xy() - centre).norm() < 10.0 + 1e-9 + 45.0);
            }
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
            assert_eq!(Orbit::new(bad).map_err(|error| error.field), Err(field));
        }
    }
}
