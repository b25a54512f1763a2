//! The plan of a flight before it, and its report after it.

use foxhunt_core::{BeaconId, Ellipse, Outcome, PatternSource, Pose, Station};
use foxhunt_hardware::Aircraft;
use foxhunt_hunt::hunt::{Command, Fix, Hunt, HuntConfig, PlaceEstimate};
use nalgebra::Vector2;
use serde::Serialize;

use super::{Check, DroneConfig, FlightConfig, FlightRules, FlyError, Mission, Site};

/// The plan of a flight, as far as it is known before any device is opened.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlightPlan {
    /// Name of the flight.
    pub name: String,
    /// The origin of the common frame.
    pub site: Site,
    /// The beacons that are searched for, with address or frequency.
    pub beacons: Vec<String>,
    /// The drones.
    pub drones: Vec<PlannedDrone>,
    /// Rules by which it begins and ends.
    pub rules: FlightRules,
    /// Fences, separation, batteries, time-outs, rules to stop.
    pub hunt: HuntConfig,
    /// Remarks for the pilot about open points.
    pub remarks: Vec<String>,
    /// Checks before take-off.
    pub checklist: Vec<Check>,
}

/// A drone of a [`FlightPlan`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannedDrone {
    /// Name of the drone.
    pub name: String,
    /// Place of the drone before take-off, East and North in metres.
    pub launch_m: Option<[f64; 2]>,
    /// Height of the ground at the launch place, in metres above the zero of the elevation model.
    pub ground_m: Option<f64>,
    /// The height of the ground at its first goal, in metres above what the elevation model counts
    /// from.
    pub first_ground_m: Option<f64>,
    /// First goal, East, North and Up in metres.
    pub first_goal_m: Option<[f64; 3]>,
    /// Limits of the drone's driver, in words.
    pub limits: String,
    /// Devices of the drone, each with its endpoint.
    pub devices: Vec<(&'static str, String)>,
}

impl FlightConfig {
    /// The plan of a flight. `hunt` is the flight's own, which has not begun; it gives the first
    /// goals where all drones have a place of launch.
    ///
    /// # Errors
    ///
    /// [`FlyError`] when the hunt could not begin from there.
    pub fn plan(&self, mut hunt: Hunt) -> Result<FlightPlan, FlyError> {
        let mut drones: Vec<PlannedDrone> = self.drones.iter().map(PlannedDrone::new).collect();
        let mut remarks = Vec::new();
        let takeoff_up = self.flight.takeoff_up_m;
        let station = |drone: &DroneConfig| {
            let [east, north] = drone.launch_m?;
            let up = drone.own_up_m().unwrap_or(takeoff_up);
            Some(Station::holding(Pose::at(east, north, up)))
        };
        let launches: Option<Vec<Station>> = self.drones.iter().map(station).collect();
        if let Some(launches) = launches {
            hunt.start(0.0, launches).map_err(FlyError::Plan)?;
            hunt.advance(0.0).map_err(FlyError::Plan)?;
            for (drone, station) in drones.iter_mut().zip(hunt.stations()) {
                drone.first_goal_m = Some(station.goal.position.into());
            }
            let mut sent = 0;
            while let Some(command) = hunt.poll_command() {
                sent += usize::from(matches!(command, Command::GoTo { .. }));
            }
            if sent == 0 {
                remarks.push("the drones listen where they take off first".to_owned());
            }
        } else {
            remarks.push("the first goals are not known: not every drone has launch_m".to_owned());
        }
        if let Some(ground) = self.ground()? {
            for drone in &mut drones {
                let height = |east, north| ground.height(&Vector2::new(east, north));
                drone.ground_m = drone.launch_m.and_then(|[east, north]| height(east, north));
                drone.first_ground_m = drone.first_goal_m.and_then(|[e, n, _]| height(e, n));
            }
        }
        let address = |text: &Option<String>| text.as_ref().map(|text| format!(" at {text}"));
        let tuned = |mhz: f64| format!(" at {mhz} MHz");
        let beacons = self.beacons.iter().map(|beacon| {
            let place = address(&beacon.address).or(beacon.frequency_mhz.map(tuned));
            format!("{}{}", beacon.name, place.unwrap_or_default())
        });
        Ok(FlightPlan {
            name: self.name.clone(),
            site: self.site,
            beacons: beacons.collect(),
            drones,
            rules: self.flight,
            hunt: self.hunt.clone(),
            remarks,
            checklist: self.checklist(&self.drones, None),
        })
    }
}

impl PlannedDrone {
    fn new(drone: &DroneConfig) -> Self {
        let endpoints = drone.endpoints();
        Self {
            name: drone.name.clone(),
            launch_m: drone.launch_m,
            ground_m: None,
            first_ground_m: None,
            first_goal_m: None,
            limits: drone.limits(),
            devices: endpoints.map(|(device, endpoint)| (device, endpoint.to_string())).collect(),
        }
    }
}

/// The result of a flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlightReport {
    /// Name of the flight.
    pub name: String,
    /// Duration of the flight, in seconds.
    pub duration_s: f64,
    /// Reason why it ended before its time, if it did.
    pub failure: Option<String>,
    /// Beacons, in the order in which their searches ended.
    pub beacons: Vec<FlownFix>,
}

/// One beacon of a [`FlightReport`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlownFix {
    /// Name of the beacon.
    pub name: String,
    /// Estimated place.
    pub estimate: PlaceEstimate,
    /// The ellipse that holds it with 95 %, if the covariance is positive definite.
    pub ellipse_95: Option<Ellipse>,
    /// Number of receptions that went through the estimator.
    pub steps: u32,
    /// Outcome of the search.
    pub outcome: Outcome,
    /// True place and error of the estimate, if the truth is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<FlownTruth>,
}

/// A fix against the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FlownTruth {
    /// East coordinate of the beacon's true place, in metres.
    pub east_m: f64,
    /// North coordinate of it, in metres.
    pub north_m: f64,
    /// From the estimate to it, in metres.
    pub error_m: f64,
    /// Normalised estimation error squared: 2 on average where the estimator is consistent.
    pub nees: Option<f64>,
}

impl FlightReport {
    /// The result of a flight of that name after `duration_s` seconds; `truth` gives the true place
    /// of a beacon where that is known, East and North in metres.
    #[must_use]
    pub fn new<A: Aircraft, S: PatternSource>(
        name: &str,
        mission: &Mission<A, S>,
        duration_s: f64,
        truth: impl Fn(BeaconId) -> Option<Vector2<f64>>,
    ) -> Self {
        let fixes = mission.hunt().fixes();
        Self {
            name: name.to_owned(),
            duration_s,
            failure: mission.failure().map(str::to_owned),
            beacons: fixes.iter().map(|fix| FlownFix::new(fix, truth(fix.beacon))).collect(),
        }
    }
}

impl FlownFix {
    /// A fix, against the true place of its beacon where that is known, East and North in metres.
    #[must_use]
    pub fn new(fix: &Fix, place: Option<Vector2<f64>>) -> Self {
        let truth = place.map(|place| FlownTruth {
            east_m: place.x,
            north_m: place.y,
            error_m: (fix.estimate.mean - place).norm(),
            nees: fix.estimate.nees(&place),
        });
        Self {
            truth,
            name: fix.name.clone(),
            estimate: (&fix.estimate).into(),
            ellipse_95: fix.estimate.ellipse(0.95),
            steps: fix.steps,
            outcome: fix.outcome,
        }
    }
}
