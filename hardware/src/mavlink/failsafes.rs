//! Failsafes of the autopilot and its own fence, as its parameters have them.

use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    mavlink::{
        Autopilot, CharArray,
        dialect::{MavMessage, PARAM_REQUEST_READ_DATA},
    },
};
use nalgebra::Vector3;

use super::{MavlinkError, MavlinkVehicle};
use crate::{Finding, OwnFence, finding::Watch};

/// Time for which parameters are awaited, in seconds.
const ANSWERS_S: f64 = 2.0;

const ARDUPILOT: [Failsafe; 2] = [
    Failsafe {
        subject: "failsafe: battery",
        parameter: "BATT_FS_LOW_ACT",
        remedy: "set BATT_FS_LOW_ACT to 2 (RTL) and BATT_LOW_VOLT to your battery's",
    },
    Failsafe {
        subject: "failsafe: remote control",
        parameter: "FS_THR_ENABLE",
        remedy: "set FS_THR_ENABLE to 1 (RTL)",
    },
];

const PX4: [Failsafe; 3] = [
    Failsafe {
        subject: "failsafe: battery",
        parameter: "COM_LOW_BAT_ACT",
        remedy: "set COM_LOW_BAT_ACT to 3 (return, then land)",
    },
    Failsafe {
        subject: "failsafe: ground station",
        parameter: "NAV_DLL_ACT",
        remedy: "set NAV_DLL_ACT to 2 (return)",
    },
    Failsafe {
        subject: "failsafe: remote control",
        parameter: "NAV_RCL_ACT",
        remedy: "set NAV_RCL_ACT to 2 (return)",
    },
];

/// Parameters that are read besides, and parameters of some versions only.
const ARDUPILOT_ALSO: [&str; 11] = [
    "FS_GCS_ENABLE",
    "FENCE_ENABLE",
    "FENCE_TYPE",
    "FENCE_ACTION",
    "FENCE_RADIUS",
    "FENCE_ALT_MAX",
    "FENCE_ALT_MIN",
    "FENCE_MARGIN",
    "FENCE_TOTAL",
    "RTL_ALT",
    "SYSID_MYGCS",
];
const ARDUPILOT_SOME: [&str; 3] = ["FS_GCS_TIMEOUT", "MAV_GCS_SYSID", "RTL_ALT_M"];
const PX4_ALSO: [&str; 7] = [
    "COM_OF_LOSS_T",
    "COM_OBL_RC_ACT",
    "GF_ACTION",
    "GF_MAX_HOR_DIST",
    "GF_MAX_VER_DIST",
    "RTL_RETURN_ALT",
    "MPC_XY_VEL_MAX",
];

/// Action of PX4 by COM_OBL_RC_ACT when set-points have stopped.
const WITHOUT_SETPOINTS: [&str; 8] = [
    "POSITION, which is flown by hand",
    "ALTITUDE, which is flown by hand",
    "STABILIZED, which is flown by hand",
    "it returns",
    "it lands",
    "it holds, for as long as its battery lasts",
    "it ends its flight and falls",
    "its motors are stopped",
];

/// Time in seconds after which ArduPilot acts if FS_GCS_TIMEOUT is not reported.
const USUAL_TIMEOUT_S: f64 = 5.0;

/// Share by which it may be set up to fly faster than it is ordered.
const FASTER: f64 = 1.2;

/// Bits of ArduPilot's FENCE_TYPE.
const HEIGHT: u32 = 1;
const CIRCLE: u32 = 2;
const POLYGONS: u32 = 4;
const LEAST_HEIGHT: u32 = 8;

/// Distance that is kept from PX4's fence, which has no margin, in metres.
const MARGIN_M: f64 = 2.0;

const SUBJECT: &str = "failsafe: fence";

/// The parameters are requested so often, and so far apart, in seconds.
const REQUESTS: u32 = 3;
const AGAIN_S: f64 = 2.0;

const ARDUPILOT_FENCE: [&str; 7] = [
    "FENCE_ENABLE",
    "FENCE_TYPE",
    "FENCE_RADIUS",
    "FENCE_ALT_MAX",
    "FENCE_ALT_MIN",
    "FENCE_MARGIN",
    "FENCE_TOTAL",
];

const PX4_FENCE: [&str; 3] = ["GF_ACTION", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"];

/// Action of the autopilot itself when something fails, in one of its parameters.
struct Failsafe {
    subject: &'static str,
    parameter: &'static str,
    /// The setting that switches it on.
    remedy: &'static str,
}

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    /// Findings on the autopilot's own rules: battery, links, fence, the death of foxhunt, speed,
    /// and the height at which it comes home. Parameters are read, none is set.
    pub(super) fn failsafes(
        &mut self,
        pause: &mut dyn FnMut(),
    ) -> Result<Vec<Finding>, MavlinkError> {
        let Some((_, _, autopilot)) = self.telemetry.who else { return Ok(Vec::new()) };
        let (failsafes, also, some): (&[Failsafe], &[&str], &[&str]) = match autopilot {
            Autopilot::ArduPilot => (&ARDUPILOT, &ARDUPILOT_ALSO, &ARDUPILOT_SOME),
            Autopilot::Px4 => (&PX4, &PX4_ALSO, &[]),
        };
        let names = failsafes.iter().map(|of| of.parameter).chain(also.iter().copied());
        let names: Vec<&'static str> = names.collect();
        // Datagrams are lost.
        for _ in 0..2 {
            for name in names.iter().chain(some) {
                self.query(name)?;
            }
            self.wait(ANSWERS_S, pause, |vehicle| {
                names.iter().all(|name| vehicle.parameter(name).is_some())
            })?;
            if names.iter().all(|name| self.parameter(name).is_some()) {
                break;
            }
        }
        let mut findings: Vec<Finding> = failsafes.iter().map(|of| self.failsafe(of)).collect();
        match autopilot {
            Autopilot::ArduPilot => findings.push(self.ground_station()),
            Autopilot::Px4 => findings.extend([self.set_points(), self.speed()]),
        }
        findings.push(self.own_fence());
        findings.push(self.way_home());
        Ok(findings.into_iter().map(|finding| finding.watched(Watch::Autopilot)).collect())
    }

    /// Requests a parameter by its name.
    fn query(&mut self, name: &str) -> Result<(), MavlinkError> {
        let Some((target_system, target_component, _)) = self.telemetry.who else { return Ok(()) };
        let request = PARAM_REQUEST_READ_DATA {
            target_system,
            target_component,
            param_id: CharArray::from(name),
            // By its name.
            param_index: -1,
        };
        self.send(self.clock.now(), &MavMessage::PARAM_REQUEST_READ(request))
    }

    pub(super) fn parameter(&self, name: &str) -> Option<f64> {
        self.telemetry.parameters.get(name).copied()
    }

    fn failsafe(&self, Failsafe { subject, parameter, remedy }: &Failsafe) -> Finding {
        match self.parameter(parameter) {
            None => Finding::bad(subject, format!("{parameter} is not reported"), remedy),
            Some(value) if value > 0.0 => Finding::good(subject, format!("{parameter} is {value}")),
            Some(_) => Finding::bad(subject, format!("off ({parameter} is 0)"), remedy),
        }
    }

    /// Finding on an ArduPilot when foxhunt dies: its failsafe follows the heartbeats of one
    /// number, whoever sends them.
    fn ground_station(&self) -> Finding {
        const SUBJECT: &str = "failsafe: ground station";
        const ON: &str = "set FS_GCS_ENABLE to 1 (RTL): it acts when foxhunt's heartbeats stop";
        let ours = self.config.ground_system_id;
        match self.parameter("FS_GCS_ENABLE") {
            None => return Finding::bad(SUBJECT, "FS_GCS_ENABLE is not reported", ON),
            Some(value) if value <= 0.0 => {
                let text = "off (FS_GCS_ENABLE is 0): if foxhunt dies it stays in GUIDED";
                return Finding::bad(SUBJECT, text, ON);
            }
            Some(_) => {}
        }
        let number = ["MAV_GCS_SYSID", "SYSID_MYGCS"]
            .into_iter()
            .find_map(|name| Some((name, self.parameter(name)?)));
        let Some((name, followed)) = number else {
            let text = "SYSID_MYGCS is not reported: which station it follows is unknown";
            return Finding::bad(
                SUBJECT,
                text,
                "see in a ground station that it is foxhunt's number",
            );
        };
        if (followed - f64::from(ours)).abs() > 0.5 {
            let text = format!(
                "{name} is {followed}, and foxhunt is {ours}: if foxhunt dies nothing happens"
            );
            let remedy = format!(
                "set {name} to {ours}, or vehicle.settings.ground_system_id to {followed} if no \
                 other station has that number"
            );
            return Finding::bad(SUBJECT, text, &remedy);
        }
        if self.telemetry.stations.contains(&ours) {
            let other = if ours == 254 { 253 } else { 254 };
            let text = format!(
                "another station on this link has foxhunt's number {ours}: if foxhunt dies its \
                 heartbeats keep the failsafe quiet"
            );
            let remedy = format!(
                "set vehicle.settings.ground_system_id and {name} to {other}, which nobody else has"
            );
            return Finding::bad(SUBJECT, text, &remedy);
        }
        let after_s = self.parameter("FS_GCS_TIMEOUT").unwrap_or(USUAL_TIMEOUT_S);
        let text = format!(
            "FS_GCS_ENABLE is {}; it acts {after_s} s after foxhunt's last heartbeat",
            self.parameter("FS_GCS_ENABLE").unwrap_or_default()
        );
        Finding::good(SUBJECT, text)
    }

    /// Finding on a PX4 when set-points stop, as when foxhunt dies, whoever else is on the link.
    fn set_points(&self) -> Finding {
        const SUBJECT: &str = "failsafe: set-points";
        let (Some(after_s), Some(action)) =
            (self.parameter("COM_OF_LOSS_T"), self.parameter("COM_OBL_RC_ACT"))
        else {
            let text = "COM_OF_LOSS_T and COM_OBL_RC_ACT are not reported";
            let remedy = "see in a ground station what it does when set-points stop";
            return Finding::bad(SUBJECT, text, remedy);
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
        let index = action as usize;
        let what = WITHOUT_SETPOINTS.get(index).unwrap_or(&"unknown");
        let text = format!(
            "{after_s} s after the last one, as when foxhunt dies: {what} (COM_OBL_RC_ACT is \
             {action})"
        );
        let gap_s = self.config.link_timeout_s;
        if index != 3 && index != 4 {
            let remedy = "set COM_OBL_RC_ACT to 3 (return), or have the pilot take it";
            return Finding::bad(SUBJECT, text, remedy);
        }
        if after_s < gap_s {
            let text = format!("{text}; foxhunt waits {gap_s} s for a link that is lost");
            let remedy =
                format!("set COM_OF_LOSS_T to {gap_s}: shorter gaps do not end the hunt then");
            return Finding::bad(SUBJECT, text, &remedy);
        }
        Finding::good(SUBJECT, text)
    }

    /// Finding on whether a PX4 flies as fast as it is ordered: in OFFBOARD its own limit alone
    /// counts.
    fn speed(&self) -> Finding {
        let fastest = self.parameter("MPC_XY_VEL_MAX");
        match (fastest, self.config.cruise_speed_mps) {
            (None, _) => Finding::bad(
                "speed",
                "MPC_XY_VEL_MAX is not reported",
                "see in a ground station how fast it flies to set-points",
            ),
            (Some(fastest), Some(cruise)) if fastest > FASTER * cruise => Finding::bad(
                "speed",
                format!("up to {fastest} m/s (MPC_XY_VEL_MAX); cruise_speed_mps is {cruise}"),
                &format!("set MPC_XY_VEL_MAX to {cruise}: OFFBOARD knows no other speed"),
            ),
            (Some(fastest), _) => Finding::good("speed", format!("up to {fastest} m/s")),
        }
    }

    /// Judges the height at which it comes home, against the limits of the file.
    fn way_home(&self) -> Finding {
        const SUBJECT: &str = "way home";
        let (name, scale) = match self.telemetry.autopilot() {
            Autopilot::Px4 => ("RTL_RETURN_ALT", 1.0),
            Autopilot::ArduPilot if self.parameter("RTL_ALT_M").is_some() => ("RTL_ALT_M", 1.0),
            Autopilot::ArduPilot => ("RTL_ALT", 0.01),
        };
        let Some(up_m) = self.parameter(name).map(|value| value * scale) else {
            let remedy = "see in a ground station how high it comes home";
            return Finding::bad(SUBJECT, format!("{name} is not reported"), remedy);
        };
        let most_m = self.config.limits.max_up_m;
        let text = format!("{up_m:.1} m up");
        let finding = if up_m > most_m {
            let text = format!("{text}; limits.max_up_m is {most_m}");
            Finding::bad(SUBJECT, text, &format!("set {name} to {:.0}", most_m / scale))
        } else {
            Finding::good(SUBJECT, text)
        };
        Finding { home_up_m: Some(up_m), ..finding }
    }
}

impl OwnFence {
    /// Refuses a goal beyond the fence.
    pub(super) fn check(
        &self,
        goal: &Vector3<f64>,
        launch: Option<&Vector3<f64>>,
    ) -> Result<(), MavlinkError> {
        let refused = |why: String| Err(MavlinkError::OwnFence { why });
        let away_m = launch.map_or(0.0, |launch| (goal - launch).xy().norm());
        if let Some(radius_m) = self.radius_m.filter(|radius_m| away_m > *radius_m) {
            return refused(format!(
                "goals are sent up to {radius_m:.1} m from its launch place, and this one is \
                 {away_m:.1} m away"
            ));
        }
        let up_m = goal.z;
        match (self.min_up_m, self.max_up_m) {
            (_, Some(most)) if up_m > most => {
                refused(format!("goals are sent up to {most:.1} m, and this one is {up_m:.1} m up"))
            }
            (Some(least), _) if up_m < least => refused(format!(
                "goals are sent from {least:.1} m on, and this one is {up_m:.1} m up"
            )),
            _ => Ok(()),
        }
    }

    fn text(&self) -> String {
        let of =
            |name: &str, metres: Option<f64>| metres.map(|metres| format!("{name} {metres:.0} m"));
        let parts =
            [of("within", self.radius_m), of("up to", self.max_up_m), of("from", self.min_up_m)];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        format!("goals are planned {}", parts.join(", "))
    }
}

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    /// Requests what its own fence is, until that is known.
    pub(super) fn learn_fence(&mut self, now: f64) -> Result<(), MavlinkError> {
        let Some((_, _, autopilot)) = self.telemetry.who else { return Ok(()) };
        let names: &[&str] = match autopilot {
            Autopilot::ArduPilot => &ARDUPILOT_FENCE,
            Autopilot::Px4 => &PX4_FENCE,
        };
        let query = &mut self.fence_query;
        let due = query.made == 0 || now - query.last >= AGAIN_S;
        if query.made >= REQUESTS || !due {
            return Ok(());
        }
        (query.made, query.last) = (query.made + 1, now);
        let missing = names.iter().filter(|name| self.parameter(name).is_none());
        let missing: Vec<&str> = missing.copied().collect();
        missing.into_iter().try_for_each(|name| self.query(name))
    }

    /// Returns where its own fence lets it be sent, as far as it is known: less the fence's margin,
    /// as it brakes before the border.
    pub(super) fn fence(&self) -> Option<OwnFence> {
        let value = |name: &str| self.parameter(name);
        let positive = |name: &str| value(name).filter(|metres| *metres > 0.0);
        let centre_m = self.launch_place().map(|home| home.xy().into());
        match self.telemetry.autopilot() {
            Autopilot::ArduPilot => {
                value("FENCE_ENABLE").filter(|on| *on > 0.0)?;
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bits")]
                let kinds = value("FENCE_TYPE").map_or(0, |bits| bits as u32);
                let margin_m = value("FENCE_MARGIN").unwrap_or(MARGIN_M);
                let of = |bit: u32, name: &str| value(name).filter(|_| kinds & bit != 0);
                Some(OwnFence {
                    centre_m,
                    radius_m: of(CIRCLE, "FENCE_RADIUS").map(|metres| (metres - margin_m).max(0.0)),
                    max_up_m: of(HEIGHT, "FENCE_ALT_MAX").map(|metres| metres - margin_m),
                    min_up_m: of(LEAST_HEIGHT, "FENCE_ALT_MIN").map(|metres| metres + margin_m),
                    has_polygons: kinds & POLYGONS != 0 && positive("FENCE_TOTAL").is_some(),
                })
            }
            Autopilot::Px4 => {
                value("GF_ACTION").filter(|action| *action > 0.0)?;
                let of = |name: &str| positive(name).map(|metres| (metres - MARGIN_M).max(0.0));
                Some(OwnFence {
                    centre_m,
                    radius_m: of("GF_MAX_HOR_DIST"),
                    max_up_m: of("GF_MAX_VER_DIST"),
                    min_up_m: None,
                    has_polygons: false,
                })
            }
        }
    }

    /// Judges its own fence against the limits of the file.
    fn own_fence(&self) -> Finding {
        let autopilot = self.telemetry.autopilot();
        let (switch, remedy) = match autopilot {
            Autopilot::ArduPilot => (
                "FENCE_ENABLE",
                "set FENCE_ENABLE to 1 and FENCE_RADIUS beyond the hunt's own fence",
            ),
            Autopilot::Px4 => (
                "GF_ACTION",
                "set GF_ACTION to 3 (return) and GF_MAX_HOR_DIST beyond the hunt's own fence",
            ),
        };
        let Some(value) = self.parameter(switch) else {
            return Finding::bad(SUBJECT, format!("{switch} is not reported"), remedy);
        };
        let Some(fence) = self.fence() else {
            return Finding::bad(SUBJECT, format!("off ({switch} is {value})"), remedy);
        };
        let limits = &self.config.limits;
        let least = limits.min_up_m.max(fence.min_up_m.unwrap_or(f64::NEG_INFINITY));
        let most = limits.max_up_m.min(fence.max_up_m.unwrap_or(f64::INFINITY));
        let finding = if fence.has_polygons {
            let remedy = "see in a ground station that hunt.airspace lies inside of them";
            let text = format!("{switch} is {value}; its polygons are not read; {}", fence.text());
            Finding::bad(SUBJECT, text, remedy)
        } else if fence.radius_m.is_none() && fence.max_up_m.is_none() {
            let text = format!("{switch} is {value}, but all its distances are 0: there is none");
            Finding::bad(SUBJECT, text, remedy)
        } else if least >= most {
            let text =
                format!("{}, and limits are {} m up at least", fence.text(), limits.min_up_m);
            Finding::bad(SUBJECT, text, "raise the fence or lower limits.min_up_m")
        } else {
            Finding::good(SUBJECT, format!("{switch} is {value}; {}", fence.text()))
        };
        Finding { own_fence: Some(fence), ..finding }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goals_beyond_the_own_fence_are_refused_in_words() {
        let fence = OwnFence {
            centre_m: None,
            radius_m: Some(10.0),
            max_up_m: Some(18.0),
            min_up_m: Some(3.0),
            has_polygons: false,
        };
        let launch = Vector3::new(5.0, 0.0, 0.0);
        let check = |east, up| {
            let goal = Vector3::new(east, 0.0, up);
            fence.check(&goal, Some(&launch)).map_err(|error| error.to_string())
        };
        assert_eq!(check(14.0, 10.0), Ok(()));
        let why = "the autopilot's own fence: goals are sent up to 10.0 m from its launch place, \
                   and this one is 12.0 m away";
        assert_eq!(check(17.0, 10.0), Err(why.into()));
        assert!(check(14.0, 18.5).is_err_and(|why| why.contains("up to 18.0 m")));
        assert!(check(14.0, 2.5).is_err_and(|why| why.contains("from 3.0 m")));
    }
}
