use foxhunt_core::Clock;
use foxhunt_wire::{ByteStream, mavlink::Autopilot};
use nalgebra::Vector3;

use super::{MavlinkError, MavlinkVehicle};
use crate::{Finding, OwnFence};

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

const ARDUPILOT: [&str; 7] = [
    "FENCE_ENABLE",
    "FENCE_TYPE",
    "FENCE_RADIUS",
    "FENCE_ALT_MAX",
    "FENCE_ALT_MIN",
    "FENCE_MARGIN",
    "FENCE_TOTAL",
];
const PX4: [&str; 3] = ["GF_ACTION", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"];

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
            Autopilot::ArduPilot => &ARDUPILOT,
            Autopilot::Px4 => &PX4,
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
    pub(super) fn own_fence(&self) -> Finding {
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
