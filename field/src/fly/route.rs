//! Routes of drones, and the files in which ground stations upload them to autopilots:
//! QGroundControl's plans and the text files of waypoints that Mission Planner and MAVProxy read.

use std::{fmt::Write, path::Path, str::FromStr};

use foxhunt_core::{Decision, Estimate, Pose, Station};
use foxhunt_hunt::{
    config::{PlannerConfig, PlannerConfigError},
    registry::Registry,
};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use nalgebra::{Vector2, Vector3};
use serde_json::json;

use super::{Ending, FlightConfig, FlyError};

/// Maximum number of places of a route.
const MOST_PLACES: usize = 10_000;

/// `MAV_FRAME_GLOBAL_RELATIVE_ALT`: heights are above where the drone took off.
const RELATIVE: u8 = 3;

/// `MAV_FRAME_MISSION`: the item has no place.
const NO_PLACE: u8 = 2;

/// The speed that a plan states if the flight gives no speed, in metres per second: times are
/// estimated with it, and nothing is ordered.
const ASSUMED_SPEED_MPS: f64 = 5.0;

/// Route of a drone, as far as its planner knows it before anything is received.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// The drone's name.
    pub drone: String,
    /// Place before take-off, East and North of the site's origin in metres.
    pub launch_m: Vector2<f64>,
    /// Height of the first climb, in metres above the launch place.
    pub takeoff_up_m: f64,
    /// Speed in metres per second; the autopilot's own speed where absent.
    pub speed_mps: Option<f64>,
    /// Places at which the drone listens, in their order: East, North and Up in metres.
    pub places_m: Vec<Vector3<f64>>,
    /// Action after the last place.
    pub ending: Ending,
}

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

/// A format of mission files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissionFormat {
    /// `.plan`: a plan of QGroundControl, version 1, in JSON.
    Plan,
    /// `.waypoints`: `QGC WPL 110`, a line for each item, its fields parted by tabs.
    Waypoints,
}

/// Error for a file whose ending belongs to no mission format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the ending {ending:?} is neither .plan nor .waypoints")]
pub struct MissionFormatError {
    /// The ending.
    pub ending: String,
}

impl MissionFormat {
    /// The format of a file, by its ending.
    ///
    /// # Errors
    ///
    /// [`MissionFormatError`] for any other ending.
    pub fn of_file(path: &Path) -> Result<Self, MissionFormatError> {
        path.extension().unwrap_or_default().to_string_lossy().parse()
    }
}

impl FromStr for MissionFormat {
    type Err = MissionFormatError;

    fn from_str(ending: &str) -> Result<Self, MissionFormatError> {
        match ending {
            "plan" => Ok(Self::Plan),
            "waypoints" => Ok(Self::Waypoints),
            _ => Err(MissionFormatError { ending: ending.to_owned() }),
        }
    }
}

/// `MAV_CMD` of the MAVLink common message set.
#[derive(Clone, Copy)]
#[repr(u16)]
enum Order {
    Waypoint = 16,
    LoiterUnlimited = 17,
    ReturnToLaunch = 20,
    Land = 21,
    TakeOff = 22,
    ChangeSpeed = 178,
}

/// One item of a mission.
struct Item {
    order: Order,
    /// The first four parameters; an absent one leaves the autopilot its own choice.
    params: [Option<f64>; 4],
    place: Option<Geodetic>,
}

impl Item {
    fn new(order: Order, params: [Option<f64>; 4], place: Option<Geodetic>) -> Self {
        Self { order, params, place }
    }

    fn frame(&self) -> u8 {
        if self.place.is_some() { RELATIVE } else { NO_PLACE }
    }

    /// Latitude and longitude in degrees and the height in metres; zeros without a place.
    fn at(&self) -> [f64; 3] {
        self.place.map_or([0.0; 3], |place| [place.lat_deg, place.lon_deg, place.alt_m])
    }
}

impl Route {
    /// The text of a file that a ground station uploads: take-off, each place in turn with
    /// `hold_s` seconds for a turn of the antenna, and the end of the flight. Heights are above
    /// the place of launch.
    #[must_use]
    pub fn mission(&self, frame: &LocalFrame, hold_s: f64, format: MissionFormat) -> String {
        let items = self.items(frame, hold_s);
        let home = frame.to_geodetic(&self.launch_m.push(0.0));
        match format {
            MissionFormat::Plan => plan(&home, self.speed_mps, &items),
            MissionFormat::Waypoints => waypoints(&home, &items),
        }
    }

    fn items(&self, frame: &LocalFrame, hold_s: f64) -> Vec<Item> {
        // Heights of the frame are above the ground of its origin, as those of the drones are.
        let above = |at: &Vector3<f64>| Geodetic { alt_m: at.z, ..frame.to_geodetic(at) };
        let up = above(&self.launch_m.push(self.takeoff_up_m));
        let mut items = vec![Item::new(Order::TakeOff, [Some(0.0), None, None, None], Some(up))];
        if let Some(speed_mps) = self.speed_mps {
            // Speed over ground, whatever throttle it takes.
            let params = [Some(1.0), Some(speed_mps), Some(-1.0), Some(0.0)];
            items.push(Item::new(Order::ChangeSpeed, params, None));
        }
        // Autopilots keep whole seconds.
        let hold = [Some(hold_s.ceil()), Some(0.0), Some(0.0), None];
        let places =
            self.places_m.iter().map(|at| Item::new(Order::Waypoint, hold, Some(above(at))));
        items.extend(places);
        let last = self.places_m.last().map_or(up, above);
        items.push(match self.ending {
            Ending::Return => Item::new(Order::ReturnToLaunch, [Some(0.0); 4], None),
            Ending::Land => {
                let ground = Geodetic { alt_m: 0.0, ..last };
                Item::new(Order::Land, [Some(0.0), Some(0.0), None, None], Some(ground))
            }
            Ending::Hold => Item::new(Order::LoiterUnlimited, [None; 4], Some(last)),
        });
        items
    }
}

fn plan(home: &Geodetic, speed_mps: Option<f64>, items: &[Item]) -> String {
    let item = |(index, item): (usize, &Item)| {
        let [latitude, longitude, height] = item.at();
        let [a, b, c, d] = item.params;
        let mut written = json!({
            "type": "SimpleItem",
            "command": item.order as u16,
            "frame": item.frame(),
            "autoContinue": true,
            "doJumpId": index + 1,
            "params": [a, b, c, d, latitude, longitude, height],
        });
        if item.place.is_some() {
            written["Altitude"] = height.into();
            // Above the place of launch.
            written["AltitudeMode"] = 1.into();
            written["AMSLAltAboveTerrain"] = serde_json::Value::Null;
        }
        written
    };
    let speed = speed_mps.unwrap_or(ASSUMED_SPEED_MPS);
    let whole = json!({
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": { "version": 2, "circles": [], "polygons": [] },
        "rallyPoints": { "version": 2, "points": [] },
        "mission": {
            "version": 2,
            // MAV_AUTOPILOT_GENERIC: the items are those that ArduPilot and PX4 share.
            "firmwareType": 0,
            // MAV_TYPE_QUADROTOR.
            "vehicleType": 2,
            "cruiseSpeed": speed,
            "hoverSpeed": speed,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [home.lat_deg, home.lon_deg, home.alt_m],
            "items": items.iter().enumerate().map(item).collect::<Vec<_>>(),
        },
    });
    format!("{whole:#}\n")
}

fn waypoints(home: &Geodetic, items: &[Item]) -> String {
    let mut text = "QGC WPL 110\n".to_owned();
    let mut line = |index: usize, frame: u8, order: u16, numbers: [f64; 7]| {
        let [a, b, c, d, latitude, longitude, height] = numbers;
        let current = u8::from(index == 0);
        // A string takes whatever is written.
        let _ = writeln!(
            text,
            "{index}\t{current}\t{frame}\t{order}\t{a}\t{b}\t{c}\t{d}\t\
             {latitude:.8}\t{longitude:.8}\t{height:.3}\t1"
        );
    };
    // The first line is the place of launch, above the ellipsoid.
    let at_home = [0.0, 0.0, 0.0, 0.0, home.lat_deg, home.lon_deg, home.alt_m];
    line(0, 0, Order::Waypoint as u16, at_home);
    for (index, item) in items.iter().enumerate() {
        let [a, b, c, d] = item.params.map(Option::unwrap_or_default);
        let [latitude, longitude, height] = item.at();
        let numbers = [a, b, c, d, latitude, longitude, height];
        line(index + 1, item.frame(), item.order as u16, numbers);
    }
    text
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use serde_json::Value;

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

    fn route(ending: Ending) -> Route {
        Route {
            drone: "one".to_owned(),
            launch_m: Vector2::new(3.0, -4.0),
            takeoff_up_m: 4.0,
            speed_mps: Some(2.5),
            places_m: vec![Vector3::new(100.0, 0.0, 12.0), Vector3::new(0.0, -200.0, 14.0)],
            ending,
        }
    }

    fn frame() -> LocalFrame {
        LocalFrame::new(Geodetic { lat_deg: 50.0, lon_deg: 14.0, alt_m: 312.0 }).expect("a place")
    }

    #[test]
    fn a_plan_has_the_places_and_their_turns() {
        let text = route(Ending::Return).mission(&frame(), 11.2, MissionFormat::Plan);
        let plan: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!((&plan["fileType"], &plan["version"]), (&"Plan".into(), &1.into()));
        let items = plan["mission"]["items"].as_array().expect("a list");
        let orders: Vec<u64> = items.iter().filter_map(|item| item["command"].as_u64()).collect();
        assert_eq!(orders, [22, 178, 16, 16, 20]);
        let first = &items[2]["params"];
        assert_eq!((&first[0], &first[3]), (&12.0.into(), &Value::Null));
        // 100 m to the East at 50° North: cos 50° of the prime vertical's radius of 6 390 702 m.
        let east_deg = (100.0_f64 / (6_390_702.0 * 50.0_f64.to_radians().cos())).to_degrees();
        let lon = first[5].as_f64().expect("a number");
        assert_relative_eq!(lon, 14.0 + east_deg, epsilon = 1e-6);
        assert_eq!(first[6], 12.0);
        assert_eq!(plan["mission"]["hoverSpeed"], 2.5);
        assert_relative_eq!(
            plan["mission"]["plannedHomePosition"][2].as_f64().expect("a number"),
            312.0,
            epsilon = 1e-3
        );
    }

    #[test]
    fn the_end_is_the_flights() {
        for (ending, order, height) in [
            (Ending::Return, 20, "0.000"),
            (Ending::Land, 21, "0.000"),
            (Ending::Hold, 17, "14.000"),
        ] {
            let text = route(ending).mission(&frame(), 5.0, MissionFormat::Waypoints);
            let last: Vec<&str> = text.lines().last().expect("items").split('\t').collect();
            assert_eq!((last[3], last[10]), (order.to_string().as_str(), height), "{ending:?}");
        }
    }

    #[test]
    fn waypoints_are_lines_of_twelve_fields() {
        let text = route(Ending::Hold).mission(&frame(), 5.0, MissionFormat::Waypoints);
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("QGC WPL 110"));
        for (index, line) in lines.enumerate() {
            let fields: Vec<&str> = line.split('\t').collect();
            assert_eq!((fields.len(), fields[0]), (12, index.to_string().as_str()), "{line}");
            assert!(fields.iter().all(|field| field.parse::<f64>().is_ok()), "{line}");
        }
        assert_eq!(text.lines().count(), 2 + 5);
    }

    #[test]
    fn formats_go_by_endings() {
        assert_eq!(MissionFormat::of_file(Path::new("a/b.plan")), Ok(MissionFormat::Plan));
        assert_eq!(MissionFormat::of_file(Path::new("b.waypoints")), Ok(MissionFormat::Waypoints));
        let error = MissionFormat::of_file(Path::new("b.kml")).expect_err("another one");
        assert!(error.to_string().contains("\"kml\""), "{error}");
    }
}
