//! The settings of an emulated autopilot, and the faults that happen to it.

use std::collections::BTreeMap;

use foxhunt_core::parameter::{ParameterError, finite, in_range, not_negative, positive};
use foxhunt_wire::{
    geodesy::Geodetic,
    mavlink::{Autopilot, FlightMode, SigningKey},
};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::{Interval, SimError};

/// The settings of an emulated autopilot.
#[derive(Clone, Debug, PartialEq)]
pub struct AutopilotConfig {
    /// The autopilot that it behaves like.
    pub autopilot: Autopilot,
    /// The minor version of a PX4: from 1.16 on its estimator's CONST_POS_MODE is set whenever it
    /// stands still.
    pub px4_minor: u8,
    /// System number of the autopilot.
    pub system_id: u8,
    /// The place where the world's East, North and Up are 0, heights above sea level.
    pub origin: Geodetic,
    /// Second of the world's time from which on the autopilot knows its place.
    pub position_good_after_s: f64,
    /// Reported error of the GPS over ground, in metres. The reported places are exact.
    pub horizontal_accuracy_m: f64,
    /// Reported error of the GPS in height, in metres.
    pub vertical_accuracy_m: f64,
    /// The least height at which it comes back, in metres above the ground.
    pub return_up_m: f64,
    /// The battery's endurance, in seconds with motors running.
    pub endurance_s: f64,
    /// The least and the greatest distance, in metres, that its rangefinder measures downwards;
    /// absent if it has no rangefinder.
    pub rangefinder_m: Option<[f64; 2]>,
    /// True if it has the world's terrain, and reports its height above it.
    pub terrain_data: bool,
    /// True if it has a camera, which counts its [pictures](super::EmulatedAutopilot::pictures).
    pub camera: bool,
    /// Time without a ground station's heartbeat after which it comes back, in seconds; never if
    /// absent.
    pub ground_failsafe_s: Option<f64>,
    /// The key of its link.
    pub signing: Option<SigningKey>,
    /// UNIX time at the beginning of the world's: signatures carry the time.
    pub clock_origin_unix_s: f64,
    /// The faults that happen to it.
    pub faults: AutopilotFaults,
}

impl Default for AutopilotConfig {
    /// An ArduCopter (or a PX4 1.16), system 1, at the place of ArduPilot's own simulator; a
    /// position after 3 s, good to 0.5 m and 0.8 m; returns at 15 m; 20 minutes of battery; no
    /// rangefinder, terrain or camera; comes back 5 s after the last heartbeat of a ground station;
    /// no signing, no faults.
    fn default() -> Self {
        Self {
            autopilot: Autopilot::ArduPilot,
            px4_minor: 16,
            system_id: 1,
            origin: Geodetic { lat_deg: -35.363_262, lon_deg: 149.165_237, alt_m: 584.0 },
            position_good_after_s: 3.0,
            horizontal_accuracy_m: 0.5,
            vertical_accuracy_m: 0.8,
            return_up_m: 15.0,
            endurance_s: 1200.0,
            rangefinder_m: None,
            terrain_data: false,
            camera: false,
            ground_failsafe_s: Some(5.0),
            signing: None,
            clock_origin_unix_s: 0.0,
            faults: AutopilotFaults::default(),
        }
    }
}

/// The faults of an emulated autopilot, with their times in seconds of the world's time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AutopilotFaults {
    /// Nothing is received of it, and it receives nothing. The world's own `lost` intervals have
    /// the same effect.
    pub silent: Vec<Interval>,
    /// Nothing is received of it, and what is sent to it arrives.
    pub unheard: Vec<Interval>,
    /// It receives nothing, and is received.
    pub deaf: Vec<Interval>,
    /// Times during which messages of the autopilot come late by up to a second each, out of order,
    /// and some of them twice.
    pub late: Vec<Interval>,
    /// The modes that the pilot chooses on his remote control, with their times.
    pub pilot: Vec<PilotOrder>,
    /// Modes that a failsafe of its own chooses, with their times.
    pub failsafes: Vec<FailsafeOrder>,
    /// Times during which another station sends it northwards at 3 m/s, in the mode of orders.
    pub velocities: Vec<Interval>,
    /// Times during which another station runs its motors on the ground.
    pub motors: Vec<Interval>,
    /// Times at which it starts again; in the air it does not.
    pub restarts_s: Vec<f64>,
    /// Height of the zero of a PX4's estimator above its home, in metres: its barometer has drifted
    /// since it was switched on.
    pub reference_m: f64,
    /// Drift of that zero's altitude, in metres per second.
    pub reference_drift_mps: f64,
    /// Heights of set-points are flown so much too high, in metres.
    pub misread_up_m: f64,
    /// Times during which its GPS is aside.
    pub gps_steps: Vec<GpsStep>,
    /// Reason why the checks before arming fail; they pass if it is empty.
    pub preflight: String,
    /// Parameters that are set up differently, by their names.
    pub parameters: BTreeMap<String, f64>,
}

/// A time during which the GPS is aside: its estimator calls that a glitch at first, takes the
/// other place after [`GpsStep::TAKEN_S`], and calls the glitch cleared when it has had it for as
/// long.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GpsStep {
    /// Beginning of the step, in seconds of the world's time.
    pub from_s: f64,
    /// End of the step, in seconds of the world's time.
    pub to_s: f64,
    /// Distance aside, to the East and to the North in metres.
    pub aside_m: [f64; 2],
}

impl GpsStep {
    /// Time after which an estimator takes a place that its GPS insists on, in seconds.
    pub const TAKEN_S: f64 = 10.0;

    fn is_glitch(&self, now: f64) -> bool {
        let within = |from: f64| (from..from + 2.0 * Self::TAKEN_S).contains(&now);
        within(self.from_s) || within(self.to_s)
    }

    fn is_taken(&self, now: f64) -> bool {
        (self.from_s + Self::TAKEN_S..self.to_s + Self::TAKEN_S).contains(&now)
    }
}

impl AutopilotFaults {
    /// Returns the estimator's error of place, estimated minus true, in metres.
    pub(super) fn aside(&self, now: f64) -> Vector3<f64> {
        let taken = self.gps_steps.iter().filter(|step| step.is_taken(now));
        taken.map(|step| Vector3::new(step.aside_m[0], step.aside_m[1], 0.0)).sum()
    }

    /// Returns true if its estimator finds that its GPS jumps.
    pub(super) fn is_glitch(&self, now: f64) -> bool {
        self.gps_steps.iter().any(|step| step.is_glitch(now))
    }
}

/// A failsafe that acts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailsafeOrder {
    /// Time of the failsafe.
    pub at_s: f64,
    /// Text that the autopilot sends, such as `Battery Failsafe`.
    pub text: String,
    /// The mode that it chooses.
    pub mode: String,
}

/// A mode that the pilot chooses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PilotOrder {
    /// Time of the choice.
    pub at_s: f64,
    /// Name of the mode, such as `LOITER`.
    pub mode: String,
}

impl AutopilotConfig {
    pub(super) fn check(&self) -> Result<(), SimError> {
        self.check_numbers().map_err(|error| error.within("autopilot"))?;
        let pilots = self.faults.pilot.iter().map(|order| &order.mode);
        for mode in pilots.chain(self.faults.failsafes.iter().map(|order| &order.mode)) {
            if FlightMode::named(self.autopilot, mode).is_none() {
                return Err(SimError::FlightMode { mode: mode.clone() });
            }
        }
        Ok(())
    }

    fn check_numbers(&self) -> Result<(), ParameterError> {
        positive("system_id", f64::from(self.system_id))?;
        not_negative("position_good_after_s", self.position_good_after_s)?;
        positive("horizontal_accuracy_m", self.horizontal_accuracy_m)?;
        positive("vertical_accuracy_m", self.vertical_accuracy_m)?;
        positive("return_up_m", self.return_up_m)?;
        positive("endurance_s", self.endurance_s)?;
        positive("ground_failsafe_s", self.ground_failsafe_s.unwrap_or(1.0))?;
        finite("clock_origin_unix_s", self.clock_origin_unix_s)?;
        if let Some([least, most]) = self.rangefinder_m {
            not_negative("rangefinder_m", least)?;
            // Messages hold 65535 cm.
            let requirement = "greater than the least distance, at most 655 m";
            in_range("rangefinder_m", most, least.next_up()..=655.0, requirement)?;
        }
        for order in &self.faults.pilot {
            not_negative("faults.pilot.at_s", order.at_s)?;
        }
        for order in &self.faults.failsafes {
            not_negative("faults.failsafes.at_s", order.at_s)?;
        }
        for at_s in &self.faults.restarts_s {
            not_negative("faults.restarts_s", *at_s)?;
        }
        for step in &self.faults.gps_steps {
            finite("faults.gps_steps.from_s", step.from_s)?;
            finite("faults.gps_steps.to_s", step.to_s)?;
            finite("faults.gps_steps.aside_m", step.aside_m[0] + step.aside_m[1])?;
        }
        for value in self.faults.parameters.values() {
            finite("faults.parameters", *value)?;
        }
        finite("faults.reference_m", self.faults.reference_m)?;
        finite("faults.reference_drift_mps", self.faults.reference_drift_mps)?;
        finite("faults.misread_up_m", self.faults.misread_up_m)?;
        Ok(())
    }
}
