use std::{fs, path::Path};

use foxhunt_core::{Quantity, parameter::FieldError};
use foxhunt_hardware::cot::CotConfig;
use foxhunt_hunt::{
    calibration::BearingCalibration,
    config::{ExtractorConfig, ModelConfig, PlannerConfig},
    document,
    hunt::HuntConfig,
    log::{LOG_VERSION, LogHeader, LoggedBeacon},
    registry::{DEFAULT_ESTIMATOR, EstimatorEntry, Field, HuntParts, Registry},
};
use foxhunt_sensors::{TurnGoal, TurnGoalConfig};
use foxhunt_sim::ReliefConfig;
use foxhunt_wire::Endpoint;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{
    DroneConfig, FlightRules, FlownBeacon, FlyError, Ground, Site, TerrainConfig, VehicleDevice,
    drone::MOTION_CAPTURE,
};

/// A hunt on real devices, as it stands in a file. Where a
/// [`Scenario`](foxhunt_hunt::scenario::Scenario) has a simulated world, it has devices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightConfig {
    /// Name of the flight.
    pub name: String,
    /// The origin of the common frame, from which East and North are counted.
    pub site: Site,
    /// The beacons to be found, in this order.
    pub beacons: Vec<FlownBeacon>,
    /// The estimator's name in the [`Registry`].
    #[serde(default = "default_estimator")]
    pub estimator: String,
    /// Law of propagation that the estimator assumes.
    pub model: ModelConfig,
    /// Extractor of a level and a bearing from a turn.
    pub extractor: ExtractorConfig,
    /// Systematic error and σ correction of the bearings, from a calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bearings: Option<BearingCalibration>,
    /// Required certainty of a turn's bearings, for which the turn goes on; a turn is one round
    /// unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turns: Option<TurnGoalConfig>,
    /// Planner that decides where to listen.
    pub planner: PlannerConfig,
    /// Time-outs, tolerances, the prior, the airspace, the batteries.
    #[serde(default)]
    pub hunt: HuntConfig,
    /// The ground that heights are above, by an elevation model; as high everywhere as where each
    /// drone stands where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terrain: Option<TerrainConfig>,
    /// Rules by which the flight begins and ends.
    #[serde(default)]
    pub flight: FlightRules,
    /// TAK servers and teams that the flight is shown to while it goes on, in Cursor on Target;
    /// nobody where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cot: Option<CotConfig>,
    /// The drones.
    pub drones: Vec<DroneConfig>,
}

/// Distance within which a pilot reaches the place where he is advised to fly, in metres.
const BY_HAND_M: f64 = 2.0;

/// Distance within which somebody who carries a receiver has arrived, in metres: twice the σ of a
/// GNSS receiver without corrections.
const CARRIED_M: f64 = 3.0;

/// Time without a place after which a carried receiver takes no part, in seconds: a bridge.
const CARRIED_LOST_S: f64 = 20.0;

/// A day, in seconds: nobody flies longer.
const DAY_S: f64 = 86_400.0;

/// The limits of a hunt that a carried receiver needs wide, by the names of their fields, with the
/// least that each may be.
fn carriers_limits(hunt: &mut HuntConfig) -> [(&'static str, &mut f64, f64); 4] {
    let attendance = &mut hunt.attendance;
    [
        ("hunt.arrival_tolerance_m", &mut hunt.arrival_tolerance_m, CARRIED_M),
        ("hunt.separation_m", &mut hunt.separation_m, CARRIED_M),
        ("hunt.attendance.still_m", &mut attendance.still_m, CARRIED_M),
        ("hunt.attendance.lost_after_s", &mut attendance.lost_after_s, CARRIED_LOST_S),
    ]
}

fn default_estimator() -> String {
    DEFAULT_ESTIMATOR.to_owned()
}

impl FlightConfig {
    /// Reads a TOML file.
    ///
    /// # Errors
    ///
    /// [`FlyError`] names the file, the line and the field.
    pub fn read(path: &Path) -> Result<Self, FlyError> {
        let file = path.display().to_string();
        let text = fs::read_to_string(path)
            .map_err(|source| FlyError::Read { file: file.clone(), source })?;
        let mut config = Self::parse(&text, &file)?;
        if let (Some(terrain), Some(folder)) = (&mut config.terrain, path.parent()) {
            terrain.folder = terrain.folder.as_ref().map(|tiles| folder.join(tiles));
            config.model = config.model.in_folder(folder);
        }
        if let (Some(cot), Some(folder)) = (config.cot.take(), path.parent()) {
            config.cot = Some(cot.in_folder(folder));
        }
        for gnss in config.drones.iter_mut().filter_map(|drone| drone.gnss.as_mut()) {
            if let (Some(corrections), Some(folder)) = (gnss.corrections.take(), path.parent()) {
                gnss.corrections = Some(corrections.in_folder(folder));
            }
        }
        Ok(config)
    }

    /// Takes it from TOML; `file` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`FlyError`] names the file, the line and the field.
    pub fn parse(text: &str, file: &str) -> Result<Self, FlyError> {
        let mut config: Self = document::from_toml(text)
            .map_err(|source| FlyError::Parse { file: file.to_owned(), source })?;
        let there = || {
            let terrain = config.terrain.as_ref()?;
            let mut relief = ReliefConfig::of_hills(terrain.hills.clone());
            if let Some(folder) = &terrain.folder {
                relief.folder = Some(folder.clone());
                (relief.lat_deg, relief.lon_deg) =
                    (Some(config.site.lat_deg), Some(config.site.lon_deg));
                relief.reach_m = Some(terrain.reach_m);
            }
            relief.frequency_mhz = config.beacons.first().and_then(|beacon| beacon.frequency_mhz);
            Some(relief)
        };
        config.model.resolve_terrain(there).map_err(|error| error.within("model"))?;
        if let Some(cot) = &config.cot {
            let refused = |source| FlyError::Cot { file: file.to_owned(), source };
            cot.check().map_err(refused)?;
        }
        config.check()?;
        if config.is_on_the_ground() {
            config.widen_for_carriers();
        }
        Ok(config)
    }

    /// Widens tolerances and time-outs where receivers are carried: a GNSS receiver on foot wanders
    /// by metres, and people take their time. Time-outs of moves and of the flight are widened only
    /// where nothing flies.
    pub(super) fn widen_for_carriers(&mut self) {
        let carried = self.drones.iter().filter(|drone| drone.vehicle.is_carried());
        let Some([least, most]) =
            carried.filter_map(DroneConfig::own_up_m).fold(None, |band: Option<[f64; 2]>, up_m| {
                let [least, most] = band.unwrap_or([up_m; 2]);
                Some([least.min(up_m), most.max(up_m)])
            })
        else {
            return;
        };
        let nothing_flies = self.is_on_the_ground();
        for (_, limit, least) in carriers_limits(&mut self.hunt) {
            *limit = limit.max(least);
        }
        if nothing_flies {
            let hunt = &mut self.hunt;
            // Planners of drones send them up, where nobody goes. A station may stand on a mast.
            hunt.airspace.altitude_m.get_or_insert([least, most]);
            hunt.move_timeout_s = hunt.move_timeout_s.max(DAY_S);
            let rules = &mut self.flight;
            rules.ready_timeout_s = rules.ready_timeout_s.max(DAY_S);
            rules.deserted_timeout_s = rules.deserted_timeout_s.max(DAY_S);
        }
    }

    /// Refuses limits that are too small for a carried receiver beside drones: wider ones hold for
    /// the drones, too, and are no choice of this program.
    fn check_mixed(&self) -> Result<(), FieldError> {
        let is_carried = |drone: &DroneConfig| drone.vehicle.is_carried();
        if self.is_on_the_ground() || !self.drones.iter().any(is_carried) {
            return Ok(());
        }
        for (field, limit, least) in carriers_limits(&mut self.hunt.clone()) {
            if *limit < least {
                let requirement = if least < CARRIED_LOST_S {
                    "at least 3 where a receiver is carried beside drones"
                } else {
                    "at least 20 where a receiver is carried beside drones"
                };
                return Err(FieldError::new(field, *limit, requirement));
            }
        }
        Ok(())
    }

    /// Returns true if nothing flies: every receiver is carried, or stands.
    #[must_use]
    pub fn is_on_the_ground(&self) -> bool {
        self.drones.iter().all(|drone| drone.vehicle.is_on_the_ground())
    }

    /// Returns the ground, if the flight has an elevation model.
    ///
    /// # Errors
    ///
    /// [`FlyError`] where tiles cannot be read, are missing, or have a void.
    pub fn ground(&self) -> Result<Option<Ground>, FlyError> {
        let Some(terrain) = &self.terrain else { return Ok(None) };
        Ok(Some(terrain.read(self.site.frame()?)?))
    }

    /// Refuses what cannot be flown; no device is opened.
    ///
    /// # Errors
    ///
    /// [`FlyError`] names what cannot be.
    pub fn check(&self) -> Result<(), FlyError> {
        self.site.frame()?;
        self.flight.check().map_err(|error| error.within("flight"))?;
        if let Some(turns) = &self.turns {
            self.hunt.check_turns(turns).map_err(|error| error.within("turns"))?;
            let turns = |drone: &DroneConfig| drone.source.turns();
            if let Some(drone) = self.drones.iter().find(|drone| !turns(drone)) {
                let reason = "it does not turn, and turns.bearing_sigma_deg is given".to_owned();
                return Err(FlyError::Drone { drone: drone.name.clone(), reason });
            }
        }
        if let Some(terrain) = &self.terrain {
            terrain.check().map_err(|error| error.within("terrain"))?;
            for drone in &self.drones {
                let own = match (&drone.vehicle, &drone.gnss) {
                    (vehicle, _) if vehicle.is_on_the_ground() => continue,
                    (VehicleDevice::ArDrone { .. }, _) => "vehicle.kind is \"ar-drone\"",
                    (_, Some(_)) => "there is a gnss of its own",
                    _ => continue,
                };
                let reason = format!("{own}, whose heights do not go with those of [terrain]");
                return Err(FlyError::Drone { drone: drone.name.clone(), reason });
            }
        }
        if self.model.terrain.is_some() && self.terrain.is_none() {
            let requirement = "left out without [terrain], which puts heights above the ground";
            return Err(FieldError::new("model.terrain", "given", requirement).into());
        }
        if self.drones.is_empty() || self.beacons.is_empty() {
            let missing = if self.drones.is_empty() { "drones" } else { "beacons" };
            return Err(FlyError::Nothing { missing });
        }
        let mut names: Vec<&str> = self.drones.iter().map(|drone| drone.name.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(FlyError::Twice { drone: twice[0].to_owned() });
        }
        self.check_shared()?;
        self.check_mixed()?;
        self.drones.iter().try_for_each(|drone| {
            let named = |reason| FlyError::Drone { drone: drone.name.clone(), reason };
            drone.check(&self.site, &self.beacons, self.flight.takeoff_up_m).map_err(named)
        })
    }

    /// Several vehicles may be behind one endpoint, if it is known which is which; nothing else
    /// may.
    fn check_shared(&self) -> Result<(), FlyError> {
        let mut known: Vec<(&Endpoint, &str, &str, Option<u8>)> = Vec::new();
        for drone in &self.drones {
            let wrong = |reason| FlyError::Drone { drone: drone.name.clone(), reason };
            for (device, endpoint) in drone.endpoints() {
                // A caster serves many receivers.
                if device == "corrections" && matches!(endpoint, Endpoint::Tcp { .. }) {
                    continue;
                }
                let system = match &drone.vehicle {
                    VehicleDevice::Mavlink { settings, .. } if device == "vehicle" => {
                        settings.system_id
                    }
                    _ => None,
                };
                for (_, shared, of, other) in known.iter().filter(|known| known.0 == endpoint) {
                    // A motion-capture system sends all bodies to one port.
                    if device == MOTION_CAPTURE && *shared == device {
                        continue;
                    }
                    if device != "vehicle" || *of == drone.name {
                        let text =
                            format!("{device}: {endpoint} is that of another device of {of}");
                        return Err(wrong(text));
                    }
                    if system.is_none() || system == *other {
                        return Err(wrong(format!(
                            "{endpoint} is that of {of} too: both need a \
                             vehicle.settings.system_id of their own"
                        )));
                    }
                }
                known.push((endpoint, device, &drone.name, system));
            }
        }
        Ok(())
    }

    /// Returns this flight with pilots who fly: nothing is sent to any vehicle, what would be an
    /// order is advice, and everybody has as much time as he takes. The tolerance of arrival
    /// becomes at least 2 m.
    ///
    /// # Errors
    ///
    /// [`FlyError::Drone`] where a drone cannot be listened to alone, or its source turns it.
    pub fn advised(mut self) -> Result<Self, FlyError> {
        for drone in &mut self.drones {
            let name = drone.name.clone();
            drone.listen_only().map_err(|reason| FlyError::Drone { drone: name, reason })?;
        }
        let tolerance_m = &mut self.hunt.arrival_tolerance_m;
        *tolerance_m = tolerance_m.max(BY_HAND_M);
        let rules = &mut self.flight;
        for timeout_s in [
            &mut rules.ready_timeout_s,
            &mut rules.climb_timeout_s,
            &mut rules.leaving_timeout_s,
            &mut rules.deserted_timeout_s,
            &mut self.hunt.move_timeout_s,
        ] {
            *timeout_s = timeout_s.max(DAY_S);
        }
        self.check()?;
        Ok(self)
    }

    /// Returns the goal of its turns, by the extractor of the registry; `None` if it is not given.
    ///
    /// # Errors
    ///
    /// [`FlyError`] when the extractor cannot be built, or a number is out of its range.
    pub fn goal(&self, registry: &Registry) -> Result<Option<TurnGoal>, FlyError> {
        let Some(turns) = self.turns else { return Ok(None) };
        let extractor = registry.build_extractor(&self.extractor)?;
        let goal = TurnGoal::new(turns, extractor.into());
        Ok(Some(goal.map_err(|error| error.within("turns"))?))
    }

    /// Returns its estimator.
    ///
    /// # Errors
    ///
    /// [`FlyError::Estimator`] when the registry has no estimator of its name.
    pub fn estimator<'a>(&self, registry: &'a Registry) -> Result<&'a EstimatorEntry, FlyError> {
        Ok(registry.estimator(&self.estimator)?)
    }

    /// Returns the field as planners need it. Speeds of autopilots that are not set, and the
    /// duration of a real antenna's turn, are unknown.
    #[must_use]
    pub fn field(&self) -> Field {
        let rooted = |drone: &&DroneConfig| matches!(drone.vehicle, VehicleDevice::Fixed { .. });
        let movers = self.drones.iter().filter(|drone| !rooted(drone));
        let speeds: Option<Vec<f64>> = movers.map(DroneConfig::speed_mps).collect();
        let up = self.flight.takeoff_up_m;
        let launches = self
            .drones
            .iter()
            .filter_map(|drone| Some((drone.launch_m?, drone.own_up_m().unwrap_or(up))));
        Field {
            planner: self.planner.clone(),
            exponent: self.model.exponent,
            speed_mps: speeds.and_then(|speeds| speeds.into_iter().reduce(f64::min)),
            climb_mps: None,
            turn_s: None,
            hunt: self.hunt.clone(),
            drones_m: launches.map(|([east, north], up)| Vector3::new(east, north, up)).collect(),
        }
    }

    /// Returns the parts of its hunt with an estimator and a seed.
    #[must_use]
    pub fn parts<'a>(
        &'a self,
        registry: &'a Registry,
        estimator: &'a EstimatorEntry,
        seed: u64,
    ) -> HuntParts<'a> {
        HuntParts {
            registry,
            extractor: &self.extractor,
            bearings: self.bearings,
            field: self.field(),
            model: &self.model,
            estimator,
            hunt: &self.hunt,
            beacons: self.beacons.iter().map(|beacon| beacon.name.clone()).collect(),
            quantities: vec![Quantity::BORESIGHT],
            seed,
        }
    }

    /// The header that a log of this flight begins with, whose time 0 is `epoch_unix_s` in whole
    /// seconds of UNIX time.
    #[must_use]
    pub fn log_header(
        &self,
        estimator: &EstimatorEntry,
        seed: u64,
        epoch_unix_s: Option<i64>,
    ) -> LogHeader {
        let beacon = |b: &FlownBeacon| LoggedBeacon {
            name: b.name.clone(),
            truth: None,
            course: None,
            others: Vec::new(),
        };
        LogHeader {
            foxhunt_log: LOG_VERSION,
            scenario: self.name.clone(),
            seed,
            estimator_name: estimator.name.clone().into_owned(),
            estimator: estimator.settings().copied(),
            model: self.model.clone(),
            planner: Some(self.planner.clone()),
            beacons: self.beacons.iter().map(beacon).collect(),
            epoch_unix_s,
            homes: Vec::new(),
            origin: self.site.frame().ok().map(|frame| frame.origin()),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_hunt::config::ModelTerrain;
    use foxhunt_sensors::AntennaConfig;

    use super::*;

    pub(crate) const MEADOW: &str = r#"
        name = "meadow"
        site = { lat_deg = 50.0755, lon_deg = 14.4378 }
        beacons = [{ name = "fox", address = "0013A20041234567" }]
        model = { reference_dbm = -29.06, exponent = 2.765, antenna = "dipole" }
        extractor = { kind = "maximum-likelihood", antenna = "dipole" }
        planner = { kind = "follow-estimate" }
        hunt = { separation_m = 5.0 }
        flight = { takeoff_up_m = 4.0 }

        [[drones]]
        name = "alpha"
        launch_m = [1.0, 2.0]
        vehicle = { kind = "mavlink", endpoint = "udpin:0.0.0.0:14550", settings = { cruise_speed_mps = 3.0 } }
        radio = { kind = "xbee", endpoint = "serial:/dev/ttyUSB0:57600" }
        rotator = { kind = "firmata", endpoint = "serial:/dev/ttyUSB1:57600" }
        source = { kind = "stepper", position_timeout = 1.0, first_timeout = 10.0 }
    "#;

    fn refused(text: &str) -> String {
        FlightConfig::parse(text, "meadow.toml").expect_err("it is refused").to_string()
    }

    #[test]
    fn addresses_of_teams_are_checked_with_the_flight() {
        let with = |cot: &str| format!("{MEADOW}\n[cot]\n{cot}");
        let nobody = refused(&with("to = []"));
        assert!(nobody.starts_with("meadow.toml: cot.to: "), "{nobody}");
        let unchecked = refused(&with("to = ['tls://tak.example']"));
        assert!(unchecked.starts_with("meadow.toml: cot.ca: "), "{unchecked}");
        let flight = FlightConfig::parse(&with("to = ['udp://239.2.3.1']"), "meadow.toml");
        assert_eq!(flight.expect("in order").cot.map(|cot| cot.to.len()), Some(1));
    }

    #[test]
    fn a_flight_takes_the_names_of_antennas() {
        let registry = Registry::builtin();
        for name in AntennaConfig::NAMES {
            let text = MEADOW.replace("\"dipole\"", &format!("\"{name}\""));
            let flight = FlightConfig::parse(&text, "meadow.toml").expect("a name");
            let antenna = AntennaConfig::named(name).expect("it is listed");
            assert_eq!(flight.model.antenna, Some(antenna.clone()), "{name}");
            let with = flight.extractor.clone().with_antenna(&antenna).expect("it has an antenna");
            assert_eq!(flight.extractor, with, "{name}");
            let written = toml::to_string(&flight).expect("plain fields");
            let again = FlightConfig::parse(&written, "written.toml").expect("as written");
            assert_eq!(again, flight, "{written}");
            let estimator = flight.estimator(&registry).expect("the default");
            assert!(flight.parts(&registry, estimator, 1).build().is_ok(), "{name}");
        }
        let with_figures = MEADOW.replace("\"dipole\"", "{ yagi = { elements = 7 } }");
        assert!(FlightConfig::parse(&with_figures, "meadow.toml").is_ok());
        let error = refused(&MEADOW.replace("\"dipole\"", "\"horn\""));
        assert!(error.contains("`horn`") && error.contains("`yagi`"), "{error}");
    }

    #[test]
    fn a_model_takes_the_terrain_of_its_flight() {
        let with_terrain = MEADOW.replace("exponent = 2.765,", "exponent = 2.765, terrain = true,");
        assert!(
            refused(&with_terrain).contains("model.terrain is true"),
            "{}",
            refused(&with_terrain)
        );
        let text = format!("{with_terrain}\n[terrain]\nfolder = \"tiles\"\nreach_m = 800.0\n");
        let flight = FlightConfig::parse(&text, "meadow.toml").expect("in order");
        let Some(ModelTerrain::Own(relief)) = &flight.model.terrain else { panic!("{text}") };
        assert_eq!(relief.folder.as_deref(), Some(Path::new("tiles")));
        assert_eq!((relief.lat_deg, relief.reach_m), (Some(50.0755), Some(800.0)));
        let written = toml::to_string(&flight).expect("plain fields");
        let mut alone = flight.clone();
        assert_eq!(FlightConfig::parse(&written, "written.toml").expect("as written"), flight);
        alone.terrain = None;
        let error = alone.check().expect_err("heights are not above the ground").to_string();
        assert!(error.starts_with("model.terrain is given"), "{error}");
    }

    #[test]
    fn a_flight_gives_planners_what_it_knows_of_its_field() {
        let flight = FlightConfig::parse(MEADOW, "meadow.toml").expect("in order");
        let field = flight.field();
        assert_eq!(field.speed_mps, Some(3.0));
        assert_eq!(field.drones_m, [Vector3::new(1.0, 2.0, 4.0)]);
        let planner = MEADOW.replace(
            "{ kind = \"follow-estimate\" }",
            "{ kind = \"registered\", name = \"information\" }",
        );
        let registry = Registry::builtin();
        let named = FlightConfig::parse(&planner, "meadow.toml").expect("in order");
        let estimator = named.estimator(&registry).expect("the default");
        assert!(named.parts(&registry, estimator, 1).build().is_ok());
        let header = named.log_header(estimator, 1, Some(5));
        assert_eq!(header.estimator_name, DEFAULT_ESTIMATOR);
        assert_eq!(header.estimator.as_ref(), estimator.settings());
    }

    #[test]
    fn vehicles_behind_one_endpoint_need_numbers() {
        let (head, alpha) = MEADOW.split_once("[[drones]]").expect("a drone");
        let with = |system: &str| {
            let settings = format!("settings = {{ {system}cruise_speed_mps");
            alpha.replace("settings = { cruise_speed_mps", &settings)
        };
        let beta = |system: &str| {
            let beta = with(system).replace("alpha", "beta").replace("ttyUSB", "ttyACM");
            beta.replace("[1.0, 2.0]", "[9.0, 2.0]")
        };
        let two = |first: &str, second: &str| {
            format!("{head}[[drones]]{}[[drones]]{}", with(first), beta(second))
        };
        let flight = two("system_id = 1, ", "system_id = 2, ");
        assert_eq!(
            FlightConfig::parse(&flight, "two.toml").map(|_| ()).map_err(|e| e.to_string()),
            Ok(())
        );
        for (first, second) in
            [("", ""), ("system_id = 1, ", "system_id = 1, "), ("system_id = 1, ", "")]
        {
            let error = refused(&two(first, second));
            assert!(error.contains("beta") && error.contains("system_id"), "{error}");
        }
        let radio = two("system_id = 1, ", "system_id = 2, ").replace("ttyACM0", "ttyUSB0");
        let error = refused(&radio);
        assert!(error.contains("radio: serial:/dev/ttyUSB0:57600"), "{error}");
    }

    const WALKER: &str = r#"
        [[drones]]
        name = "me"
        launch_m = [20.0, 2.0]
        vehicle = { kind = "carried" }
        gnss = { endpoint = "serial:/dev/ttyACM0:9600" }
        radio = { kind = "rtl-tcp", endpoint = "tcp:127.0.0.1:1234" }
        source = { kind = "omnidirectional", questions = 8, answer_timeout_s = 1.0 }
    "#;

    #[test]
    fn a_walker_beside_drones_changes_none_of_their_limits() {
        let fox = "name = \"fox\", frequency_mhz = 433.92";
        let meadow = MEADOW.replace("name = \"fox\"", fox).replace("separation_m", "#") + WALKER;
        let with =
            |hunt: &str| meadow.replace("hunt = { # = 5.0 }", &format!("hunt = {{ {hunt} }}"));
        let mut hunt = String::new();
        for (key, named) in [
            ("arrival_tolerance_m = 3.0", "hunt.arrival_tolerance_m is 0.3; it must be at least 3"),
            ("separation_m = 5.0", "hunt.separation_m is 2; it must be at least 3"),
            ("attendance.still_m = 3.0", "hunt.attendance.still_m is 0.5; it must be at least 3"),
            (
                "attendance.lost_after_s = 20.0",
                "hunt.attendance.lost_after_s is 5; it must be at least 20",
            ),
        ] {
            let error = refused(&with(&hunt));
            assert!(error.contains(named), "{error}");
            hunt = format!("{hunt}{}{key}", if hunt.is_empty() { "" } else { ", " });
        }
        let flight = FlightConfig::parse(&with(&hunt), "meadow.toml").expect("wide enough");
        assert_eq!(flight.hunt.airspace.altitude_m, None);
        let timeouts = [flight.hunt.move_timeout_s, flight.flight.deserted_timeout_s];
        let expected = [HuntConfig::default().move_timeout_s, 30.0];
        assert!(timeouts.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{timeouts:?}");
    }

    #[test]
    fn corrections_are_those_of_a_receiver() {
        let (head, _) = MEADOW.split_once("[[drones]]").expect("a drone");
        let head = head.replace("name = \"fox\"", "name = \"fox\", frequency_mhz = 433.92");
        let walkers = |corrections: &str| {
            let gnss = "\"serial:/dev/ttyACM0:9600\"";
            let walker = WALKER.replace(gnss, &format!("{gnss}, corrections = {corrections}"));
            let other = walker.replace("\"me\"", "\"you\"").replace("20.0, 2.0", "9.0, 2.0");
            let other = other.replace("ttyACM0", "ttyACM1").replace("1234", "1235");
            format!("{head}{walker}{other}")
        };
        let caster = "{ endpoint = \"tcp:caster:2101\", mountpoint = \"FOX\", gga_s = 10.0 }";
        let flight = FlightConfig::parse(&walkers(caster), "walkers.toml").expect("one caster");
        let gnss = flight.drones[1].gnss.as_ref().expect("given");
        let corrections = gnss.corrections.as_ref().expect("given");
        assert_eq!(corrections.to_string(), "FOX at tcp:caster:2101");
        for (own, named) in [
            ("{ endpoint = \"tcp:caster:2101\", user = \"me\" }", "user has no effect"),
            ("{ endpoint = \"serial:/dev/ttyACM0:9600\" }", "that of another device of me"),
            ("{ mountpoint = \"FOX\" }", "gnss.corrections: corrections come from either"),
            ("{ caster = \"here\" }", "caster"),
        ] {
            let error = refused(&walkers(own));
            assert!(error.contains(named), "{error}");
        }
    }

    #[test]
    fn motion_capture_places_ar_drones_alone() {
        let (head, _) = MEADOW.split_once("[[drones]]").expect("a drone");
        let ar_drone = |number: u8, more: &str| {
            format!(
                "[[drones]]\nname = \"bird-{number}\"\nlaunch_m = [{number}.0, 2.0]\n\
                 vehicle = {{ kind = \"ar-drone\", endpoint = \"udpout:192.168.1.{number}:5556\", \
                 navdata = \"udpout:192.168.1.{number}:5554\", motion_capture = {more} }}\n\
                 radio = {{ kind = \"xbee\", endpoint = \"serial:/dev/ttyUSB{number}:57600\" }}\n\
                 source = {{ kind = \"rotating-body\" }}\n"
            )
        };
        let of = |own: &str| format!("{head}{}", ar_drone(1, own));
        let port = "endpoint = \"udpin:0.0.0.0:5005\"";
        let body = |number: u8| format!("{{ {port}, body = \"bird-{number}\" }}");
        let two = format!("{head}{}{}", ar_drone(1, &body(1)), ar_drone(2, &body(2)));
        let flight = FlightConfig::parse(&two, "room.toml").expect("two bodies of one system");
        let endpoints: Vec<_> = flight.drones[1].endpoints().map(|(device, _)| device).collect();
        assert!(endpoints.contains(&"motion capture"), "{endpoints:?}");
        let written = toml::to_string(&flight).expect("plain fields");
        assert_eq!(FlightConfig::parse(&written, "written.toml").expect("as written"), flight);
        for (own, named) in [
            (format!("{{ {port}, body = \"\" }}"), "vehicle.motion_capture.body is \"\""),
            (
                "{ endpoint = \"tcp:a:1\", body = \"a\" }".into(),
                "motion_capture.endpoint is tcp:a:1",
            ),
            (format!("{{ {port}, body = \"a\", rate = 1 }}"), "rate"),
        ] {
            let error = refused(&of(&own));
            assert!(error.contains(named), "{error}");
        }
        let other = of(&body(1)).replace("serial:/dev/ttyUSB1:57600", "udpin:0.0.0.0:5005");
        let error = refused(&other);
        assert!(error.contains("that of another device of bird-1"), "{error}");
        let with_gnss = of(&body(1)) + "gnss = { endpoint = \"serial:/dev/ttyACM0:9600\" }\n";
        let with_gnss =
            with_gnss.replace("lon_deg = 14.4378", "lon_deg = 14.4378, ground_alt_m = 250.0");
        let error = refused(&with_gnss);
        assert!(error.contains("vehicle.motion_capture and gnss"), "{error}");
        let autopilot = MEADOW.replace("settings = {", "motion_capture = 1, settings = {");
        assert!(refused(&autopilot).contains("motion_capture"));
    }

    #[test]
    fn a_walker_is_not_sent_up_to_the_top_of_a_mast() {
        let (head, _) = MEADOW.split_once("[[drones]]").expect("a drone");
        let head = head.replace("name = \"fox\"", "name = \"fox\", frequency_mhz = 433.92");
        let mast = WALKER
            .replace("\"me\"", "\"mast\"")
            .replace("20.0, 2.0", "50.0, 2.0")
            .replace("gnss =", "#")
            .replace("1234", "1235")
            .replace("\"carried\"", "\"fixed\", settings = { up_m = 30.0 }");
        let walker = WALKER.replace("launch_m", "#");
        let text = format!("{head}{walker}{mast}");
        let flight = FlightConfig::parse(&text, "walker.toml").expect("in order");
        assert_eq!(flight.hunt.airspace.altitude_m, Some([1.5, 1.5]));
        let limits = [flight.hunt.arrival_tolerance_m, flight.hunt.attendance.lost_after_s];
        assert!(limits.iter().zip([3.0, 20.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{limits:?}");
        assert_abs_diff_eq!(flight.flight.deserted_timeout_s, DAY_S, epsilon = 1e-9);
    }

    #[test]
    fn what_a_flight_cannot_do_is_named() {
        for (there, instead, expected) in [
            ("takeoff_up_m = 4.0", "takeoff_up_m = -4.0", "flight.takeoff_up_m is -4;"),
            ("lat_deg = 50.0755", "lat_deg = 91.0", "91"),
            (
                "kind = \"stepper\", position_timeout = 1.0, first_timeout = 10.0",
                "kind = \"omnidirectional\"",
                "there is a rotator",
            ),
            (
                "cruise_speed_mps = 3.0",
                "cruise_speed_mps = -3.0",
                "drone \"alpha\": vehicle.settings.cruise_speed_mps is -3;",
            ),
            (
                "address = \"0013A20041234567\"",
                "frequency_mhz = 433.9",
                "beacon \"fox\" has no address",
            ),
            ("takeoff_up_m = 4.0", "takeoff_up_m = 4000.0", "vehicle.settings allow"),
        ] {
            let text = MEADOW.replace(there, instead);
            assert_ne!(text, MEADOW);
            let error = refused(&text);
            assert!(error.contains(expected), "{error}");
        }
        let unknown = format!("estimator = \"kalman\"\n{MEADOW}");
        let flight = FlightConfig::parse(&unknown, "meadow.toml").expect("a name");
        let error = flight.estimator(&Registry::builtin()).expect_err("unknown").to_string();
        assert!(error.starts_with("estimator: \"kalman\""), "{error}");
    }
}
