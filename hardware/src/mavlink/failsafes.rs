use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    mavlink::{
        Autopilot, CharArray,
        dialect::{MavMessage, PARAM_REQUEST_READ_DATA},
    },
};

use super::{MavlinkError, MavlinkVehicle};
use crate::{Finding, finding::Watch};

/// How long parameters are waited for, in seconds.
const ANSWERS_S: f64 = 2.0;

/// What the autopilot does by itself when something fails, in a parameter of it.
struct Failsafe {
    subject: &'static str,
    parameter: &'static str,
    /// What switches it on.
    remedy: &'static str,
}

const ARDUPILOT: [Failsafe; 4] = [
    Failsafe {
        subject: "failsafe: battery",
        parameter: "BATT_FS_LOW_ACT",
        remedy: "set BATT_FS_LOW_ACT to 2 (RTL) and BATT_LOW_VOLT to your battery's",
    },
    Failsafe {
        subject: "failsafe: ground station",
        parameter: "FS_GCS_ENABLE",
        remedy: "set FS_GCS_ENABLE to 1 (RTL): it acts when foxhunt's link is lost",
    },
    Failsafe {
        subject: "failsafe: remote control",
        parameter: "FS_THR_ENABLE",
        remedy: "set FS_THR_ENABLE to 1 (RTL)",
    },
    Failsafe {
        subject: "failsafe: fence",
        parameter: "FENCE_ENABLE",
        remedy: "set FENCE_ENABLE to 1 and FENCE_RADIUS beyond the hunt's own fence",
    },
];

const PX4: [Failsafe; 4] = [
    Failsafe {
        subject: "failsafe: battery",
        parameter: "COM_LOW_BAT_ACT",
        remedy: "set COM_LOW_BAT_ACT to 3 (return, then land)",
    },
    Failsafe {
        subject: "failsafe: ground station",
        parameter: "NAV_DLL_ACT",
        remedy: "set NAV_DLL_ACT to 2 (return): it acts when foxhunt's link is lost",
    },
    Failsafe {
        subject: "failsafe: remote control",
        parameter: "NAV_RCL_ACT",
        remedy: "set NAV_RCL_ACT to 2 (return)",
    },
    Failsafe {
        subject: "failsafe: fence",
        parameter: "GF_ACTION",
        remedy: "set GF_ACTION to 3 (return) and GF_MAX_HOR_DIST beyond the hunt's own fence",
    },
];

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    /// What the autopilot does by itself when battery, links or fence fail, and how high it comes
    /// home. Parameters are read, none is set.
    pub(super) fn failsafes(
        &mut self,
        pause: &mut dyn FnMut(),
    ) -> Result<Vec<Finding>, MavlinkError> {
        let Some((system, component, autopilot)) = self.telemetry.who else {
            return Ok(Vec::new());
        };
        let (failsafes, home) = match autopilot {
            Autopilot::ArduPilot => (ARDUPILOT, ("RTL_ALT", 0.01)),
            Autopilot::Px4 => (PX4, ("RTL_RETURN_ALT", 1.0)),
        };
        let names = failsafes.iter().map(|of| of.parameter).chain([home.0]);
        let names: Vec<&'static str> = names.collect();
        for name in &names {
            let request = PARAM_REQUEST_READ_DATA {
                target_system: system,
                target_component: component,
                param_id: CharArray::from(*name),
                // By its name.
                param_index: -1,
            };
            self.send(self.clock.now(), &MavMessage::PARAM_REQUEST_READ(request))?;
        }
        self.wait(ANSWERS_S, pause, |vehicle| {
            names.iter().all(|name| vehicle.telemetry.parameters.contains_key(*name))
        })?;
        let known = |name: &str| self.telemetry.parameters.get(name).copied();
        let finding = |failsafe: &Failsafe| {
            let Failsafe { subject, parameter, remedy } = failsafe;
            match known(parameter) {
                None => Finding::bad(subject, format!("{parameter} is not reported"), remedy),
                Some(value) if value > 0.0 => {
                    Finding::good(subject, format!("{parameter} is {value}"))
                }
                Some(_) => Finding::bad(subject, format!("off ({parameter} is 0)"), remedy),
            }
        };
        let mut findings: Vec<Finding> = failsafes.iter().map(finding).collect();
        findings.push(match known(home.0) {
            Some(value) => Finding::good("way home", format!("{:.1} m up", value * home.1)),
            None => Finding::bad(
                "way home",
                format!("{} is not reported", home.0),
                "see in a ground station how high it comes home",
            ),
        });
        Ok(findings.into_iter().map(|finding| finding.watched(Watch::Autopilot)).collect())
    }
}
