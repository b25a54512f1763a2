use foxhunt_formation::AirspaceError;
use foxhunt_hardware::{Finding, Watch};
use serde::Serialize;

use super::{DroneConfig, FlightConfig, FlyError, VehicleDevice};

/// Something that has to hold before a flight, and who watches it during the flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Name of the drone; absent for a check of all drones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drone: Option<String>,
    /// State of the check.
    pub state: CheckState,
    /// Subject of the check, and who watches it.
    #[serde(flatten)]
    pub finding: Finding,
}

/// State of a check before a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CheckState {
    /// It was looked at and holds.
    Good,
    /// It was looked at and does not.
    Bad,
    /// The pilot has to look at it.
    Open,
}

/// Findings about a drone's device.
#[derive(Clone, Debug, PartialEq)]
pub struct Examined {
    /// The drone's name.
    pub drone: String,
    /// Kind of the device.
    pub device: &'static str,
    /// Findings about the device.
    pub findings: Vec<Finding>,
}

impl FlightConfig {
    /// Returns all that has to hold before these of its drones fly: settings of the file, findings
    /// about their devices ([`DroneConfig::examine`]) if they were examined, and checks that only a
    /// pilot can make. In the order of who watches it: foxhunt, autopilots, the pilot.
    #[must_use]
    pub fn checklist(&self, drones: &[DroneConfig], examined: Option<&[Examined]>) -> Vec<Check> {
        let mut checks = self.rules();
        for drone in drones {
            checks.extend(drone.checks(examined.is_some()));
        }
        for Examined { drone, device, findings } in examined.unwrap_or_default() {
            checks.extend(findings.iter().map(|finding| {
                let state = if finding.is_good() { CheckState::Good } else { CheckState::Bad };
                let subject = format!("{device}: {}", finding.subject);
                let finding = Finding { subject, ..finding.clone() };
                Check { drone: Some(drone.clone()), state, finding }
            }));
        }
        checks.extend(self.ways_home(examined.unwrap_or_default()));
        // What holds for all comes before what is of one drone.
        checks.sort_by_key(|check| check.finding.watch);
        checks
    }

    /// Narrows the airspace to what the autopilots' own fences permit, as they were read: goals
    /// beyond them would be refused. What is left is planned in.
    ///
    /// # Errors
    ///
    /// [`FlyError::Drone`] names the drone whose fence leaves nothing.
    pub fn stay_inside(&mut self, examined: &[Examined]) -> Result<(), FlyError> {
        for Examined { drone, findings, .. } in examined {
            let wrong = |error: AirspaceError| {
                let reason = format!("its autopilot's own fence and hunt.airspace: {error}");
                FlyError::Drone { drone: drone.clone(), reason }
            };
            for fence in findings.iter().filter_map(|finding| finding.own_fence) {
                let airspace = &mut self.hunt.airspace;
                if let (Some(centre_m), Some(radius_m)) = (fence.centre_m, fence.radius_m) {
                    *airspace = airspace.within_disc(centre_m, radius_m).map_err(wrong)?;
                }
                // Heights over terrain count from another zero.
                if self.terrain.is_none() && (fence.min_up_m.is_some() || fence.max_up_m.is_some())
                {
                    let lowest = fence.min_up_m.unwrap_or(0.0);
                    let highest = fence.max_up_m.unwrap_or(HIGHEST_M);
                    *airspace = airspace.within_band(lowest, highest).map_err(wrong)?;
                }
            }
        }
        Ok(())
    }

    /// Judges whether drones come home at heights that keep them apart: autopilots return by
    /// themselves when their links or batteries fail, and may do so at the same time.
    fn ways_home(&self, examined: &[Examined]) -> Option<Check> {
        let height = |of: &Examined| Some((of.drone.clone(), home_up_m(of)?));
        let mut heights: Vec<(String, f64)> = examined.iter().filter_map(height).collect();
        heights.sort_by(|a, b| a.1.total_cmp(&b.1));
        let apart_m = self.hunt.separation_m.max(HOME_APART_M);
        let near = heights.windows(2).find_map(|pair| {
            let [(one, low), (other, high)] = pair else { return None };
            let text = format!("{one} and {other} come home {low:.0} and {high:.0} m up");
            (high - low < apart_m).then_some(text)
        })?;
        let remedy = format!(
            "set their return heights (RTL_ALT, RTL_RETURN_ALT) at least {apart_m:.0} m apart: \
             failsafes may bring them home at the same time"
        );
        let finding = Finding::bad("ways home", near, &remedy).watched(Watch::Autopilot);
        Some(Check { drone: None, state: CheckState::Bad, finding })
    }

    fn rules(&self) -> Vec<Check> {
        if self.is_on_the_ground() {
            return Vec::new();
        }
        let airspace = &self.hunt.airspace;
        let flight = &self.flight;
        let mut checks = Vec::new();
        checks.push(match airspace.fence_m.len() {
            0 => open("borders", "hunt.airspace has no fence: drones may be sent anywhere"),
            corners => good("borders", &format!("hunt.airspace has a fence of {corners} corners")),
        });
        checks.push(match (&self.terrain, airspace.altitude_m) {
            (Some(terrain), _) => {
                let clearance = terrain.clearance_m;
                good("heights", &format!("above the ground, {clearance} m over all of it"))
            }
            (None, Some([least, most])) => open(
                "heights",
                &format!(
                    "{least} to {most} m above where each drone stands: nothing on its way is \
                     higher"
                ),
            ),
            (None, None) => open("heights", "from where each drone stands, without a limit"),
        });
        if self.drones.len() > 1 {
            let metres = self.hunt.separation_m;
            checks.push(good("separation", &format!("drones stay {metres} m apart")));
            let pilots = format!("one remote control in hand for each of {}", self.drones.len());
            checks.push(open("pilots", &pilots));
        }
        checks.push(match &self.hunt.endurance {
            Some(endurance) => {
                let back_s = endurance.endurance_s - endurance.reserve_s;
                good("endurance", &format!("each is back {back_s:.0} s after take-off"))
            }
            None => {
                open("endurance", "hunt.endurance is absent: nobody comes back for the battery")
            }
        });
        let end = format!("in the end {}, if it is broken off {}", flight.at_end, flight.on_abort);
        checks.push(good("end", &end));
        checks.push(open("place", "permission to fly here, and nobody below"));
        checks
    }
}

impl DroneConfig {
    fn checks(&self, is_examined: bool) -> Vec<Check> {
        let mut checks = vec![good("limits", &self.limits())];
        if let VehicleDevice::Mavlink { settings, .. } = &self.vehicle {
            if !is_examined {
                let text = "of battery, links and fence are read before take-off";
                let failsafes = open("failsafes", text);
                let finding = failsafes.finding.watched(Watch::Autopilot);
                checks.push(Check { finding, ..failsafes });
            }
            checks.push(open(
                "remote control",
                "on and in reach: any other mode takes the drone from foxhunt",
            ));
            let turns = matches!(self.source, super::ListenConfig::RotatingBody { .. });
            if turns {
                let speed = settings.spin_limit_deg_s;
                let text = format!("it turns about itself, by up to {speed}° a second");
                checks.push(open("body", &text));
            }
        } else if matches!(self.vehicle, VehicleDevice::ArDrone { .. }) {
            checks.push(open("remote control", "the application that lands it is at hand"));
        }
        let stands = !matches!(self.vehicle, VehicleDevice::Carried { .. });
        if let Some([east, north]) = self.launch_m.filter(|_| stands) {
            let text = format!("it stands {east:.1} m East, {north:.1} m North of the origin");
            checks.push(open("launch", &text));
        }
        if self.rotator.is_some() {
            checks.push(open("antenna", "it turns freely, and its cable has slack for a turn"));
        }
        for check in &mut checks {
            check.drone = Some(self.name.clone());
        }
        checks
    }
}

/// Least difference of the heights at which two drones come home, in metres: the autopilots' own
/// heights are some 2 m off.
const HOME_APART_M: f64 = 5.0;

/// No drone flies higher, in metres: the upper border of a fence without one.
const HIGHEST_M: f64 = 10_000.0;

/// Height in metres at which a drone comes home, if that was read.
fn home_up_m(examined: &Examined) -> Option<f64> {
    examined.findings.iter().find_map(|finding| finding.home_up_m)
}

/// Something that foxhunt sees to.
fn good(subject: &str, text: &str) -> Check {
    Check { drone: None, state: CheckState::Good, finding: Finding::good(subject, text) }
}

/// Something that the pilot sees to.
fn open(subject: &str, text: &str) -> Check {
    let finding = Finding::good(subject, text).watched(Watch::Pilot);
    Check { drone: None, state: CheckState::Open, finding }
}

#[cfg(test)]
mod tests {
    use super::{super::config::tests::MEADOW, *};

    fn of<'c>(checks: &'c [Check], subject: &str) -> &'c Check {
        checks.iter().find(|check| check.finding.subject == subject).expect(subject)
    }

    #[test]
    fn what_is_not_limited_is_for_the_pilot() {
        let flight = FlightConfig::parse(MEADOW, "meadow.toml").expect("in order");
        let checks = flight.checklist(&flight.drones, None);
        for subject in ["borders", "heights", "endurance", "place", "remote control", "antenna"] {
            let check = of(&checks, subject);
            assert_eq!((check.finding.watch, check.state), (Watch::Pilot, CheckState::Open));
        }
        let failsafes = of(&checks, "failsafes");
        assert_eq!(failsafes.finding.watch, Watch::Autopilot);
        assert_eq!(failsafes.drone.as_deref(), Some("alpha"));
        assert!(checks.is_sorted_by_key(|check| check.finding.watch));
        let limits = "hunt = { separation_m = 5.0, endurance = { endurance_s = 600.0, reserve_s = \
                      120.0 }, airspace = { altitude_m = [3.0, 20.0], fence_m = [[0.0, 0.0], \
                      [50.0, 0.0], [50.0, 50.0]] } }";
        let limited = MEADOW.replace("hunt = { separation_m = 5.0 }", limits);
        let flight = FlightConfig::parse(&limited, "meadow.toml").expect("in order");
        let checks = flight.checklist(&flight.drones, None);
        let borders = of(&checks, "borders");
        assert_eq!((borders.finding.watch, borders.state), (Watch::Foxhunt, CheckState::Good));
        assert!(of(&checks, "endurance").finding.text.contains("480 s"));
        assert!(of(&checks, "heights").finding.text.starts_with("3 to 20 m"));
    }

    #[test]
    fn what_was_found_of_devices_is_in_it() {
        let flight = FlightConfig::parse(MEADOW, "meadow.toml").expect("in order");
        let findings = vec![
            Finding::good("firmware", "4.5.7"),
            Finding::bad("failsafe: fence", "off", "switch it on").watched(Watch::Autopilot),
        ];
        let examined = [Examined { drone: "alpha".to_owned(), device: "vehicle", findings }];
        let checks = flight.checklist(&flight.drones, Some(&examined));
        assert!(checks.iter().all(|check| check.finding.subject != "failsafes"));
        assert_eq!(of(&checks, "vehicle: firmware").state, CheckState::Good);
        let fence = of(&checks, "vehicle: failsafe: fence");
        assert_eq!((fence.finding.watch, fence.state), (Watch::Autopilot, CheckState::Bad));
    }
}
