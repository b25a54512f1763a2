use foxhunt_core::{Decision, Estimate, Pose, Station};
use foxhunt_hunt::{
    config::{PlannerConfig, PlannerConfigError},
    registry::Registry,
};
use nalgebra::{Vector2, Vector3};

use super::{Ending, FlightConfig, FlyError};

/// Route of a drone, as far as its planner knows it before anything is received.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// The drone's name.
    pub drone: String,
    /// Place before take-off, East and North of the site's origin in metres.
    pub launch_m: Vector2<f64>,
    /// Height of the first climb, in metres above where it stands.
    pub takeoff_up_m: f64,
    /// Speed in metres per second; the autopilot's own speed where absent.
    pub speed_mps: Option<f64>,
    /// Places where it listens, in their order: East, North and Up in metres.
    pub places_m: Vec<Vector3<f64>>,
    /// Action after the last place.
    pub ending: Ending,
}

/// Maximum number of places of a route.
const MOST_PLACES: usize = 10_000;

impl FlightConfig {
    /// The routes of all drones. A place that is the one before once more is another turn there.
    ///
    /// # Errors
    ///
    /// [`FlyError::Route`] where the planner goes by what is received, or never ends;
    /// [`FlyError::Planner`] where there is no such planner.
    pub fn routes(&self, registry: &Registry) -> Result<Vec<Route>, FlyError> {
        let planner = match &self.planner {
            PlannerConfig::Registered { name } => {
                let entry = registry.planner(name).map_err(PlannerConfigError::from)?;
                &entry.config(&self.field())
            }
            own => own,
        };
        if !planner.is_known_beforehand() {
            return Err(FlyError::Route);
        }
        let mut planner = registry.build_planner(planner, &self.field())?;
        let up = self.flight.takeoff_up_m;
        let mut routes: Vec<Route> = self
            .drones
            .iter()
            .map(|drone| {
                let [east, north] = drone.launch_m.unwrap_or_default();
                Route {
                    drone: drone.name.clone(),
                    launch_m: Vector2::new(east, north),
                    takeoff_up_m: up,
                    speed_mps: drone.speed_mps(),
                    places_m: Vec::new(),
                    ending: self.flight.at_end,
                }
            })
            .collect();
        let stand =
            |route: &Route| Station::holding(Pose::at(route.launch_m.x, route.launch_m.y, up));
        let mut stations: Vec<Station> = routes.iter().map(stand).collect();
        // These planners look at no belief; the trait wants one.
        let belief = Estimate::isotropic(Vector2::zeros(), self.hunt.prior_sigma_m);
        planner.begin(&mut stations).map_err(PlannerConfigError::from)?;
        for _ in 0..MOST_PLACES {
            for (route, station) in routes.iter_mut().zip(&mut stations) {
                route.places_m.push(station.goal.position);
                station.pose.position = station.goal.position;
            }
            let decision = planner.plan(&belief, &mut stations);
            if let Decision::Finish(_) = decision.map_err(PlannerConfigError::from)? {
                return Ok(routes);
            }
        }
        Err(FlyError::Route)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLIGHT: &str = r#"
        name = "meadow"
        site = { lat_deg = 50.0, lon_deg = 14.0 }
        beacons = [{ name = "fox", address = "0013A20041234567" }]
        model = { reference_dbm = -29.06, exponent = 2.765, antenna = "dipole" }
        extractor = { kind = "maximum-likelihood", antenna = "dipole" }
        planner = { PLANNER }

        [[drones]]
        name = "alpha"
        launch_m = [1.0, 2.0]
        vehicle = { kind = "mavlink", endpoint = "udpin:127.0.0.1:14550", settings = { cruise_speed_mps = 3.0 } }
        radio = { kind = "xbee", endpoint = "serial:/dev/ttyUSB0:57600" }
        rotator = { kind = "firmata", endpoint = "serial:/dev/ttyUSB1:57600" }
        source = { kind = "stepper", position_timeout = 1.0, first_timeout = 10.0 }
    "#;

    fn routes(planner: &str) -> Result<Vec<Route>, FlyError> {
        let text = FLIGHT.replace("PLANNER", planner);
        let flight = FlightConfig::parse(&text, "meadow.toml").expect("a flight");
        flight.routes(&Registry::builtin())
    }

    #[test]
    fn a_path_is_flown_place_by_place() {
        let path = r#"kind = "waypoints", places_m = [[10.0, 0.0], [20.0, 5.0]], up_m = 6.0"#;
        let routes = routes(path).expect("a path is known");
        let [route] = &routes[..] else { panic!("one drone: {routes:?}") };
        assert_eq!(route.places_m, [[10.0, 0.0, 6.0], [20.0, 5.0, 6.0]].map(Vector3::from));
        assert_eq!((route.speed_mps, route.launch_m), (Some(3.0), Vector2::new(1.0, 2.0)));
        assert_eq!(routes.len(), 1);
    }

    #[test]
    fn names_stand_for_paths_too() {
        let named = routes(r#"kind = "registered", name = "lawn-mower""#).expect("it is known");
        // 4 by 4 places.
        assert_eq!(named[0].places_m.len(), 16);
        let held = routes(r#"kind = "hold", turns = 3"#).expect("it is known");
        assert_eq!(held[0].places_m, [Vector3::new(1.0, 2.0, 4.0); 3]);
    }

    #[test]
    fn who_goes_by_what_is_received_has_no_route() {
        for planner in [r#"kind = "follow-estimate""#, r#"kind = "registered", name = "orbit""#] {
            assert!(matches!(routes(planner), Err(FlyError::Route)), "{planner}");
        }
        let nobody = routes(r#"kind = "registered", name = "nobody""#).expect_err("no planner");
        assert!(nobody.to_string().contains("nobody"), "{nobody}");
    }
}
