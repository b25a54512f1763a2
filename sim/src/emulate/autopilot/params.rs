use foxhunt_wire::mavlink::{
    Autopilot, CharArray,
    dialect::{
        MavMessage, MavParamType, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA,
    },
};

use super::AutopilotConfig;
use crate::SimError;

/// The few parameters that ground stations request. All are single precision numbers.
#[derive(Debug)]
pub(super) struct Params {
    all: Vec<(&'static str, f32)>,
}

/// The parameters of a firmware, as they are at first.
fn usual(autopilot: Autopilot) -> &'static [(&'static str, f32)] {
    match autopilot {
        Autopilot::ArduPilot => &[
            ("SYSID_THISMAV", 1.0),
            ("SYSID_MYGCS", 255.0),
            ("RTL_ALT", 1500.0),
            ("FS_GCS_ENABLE", 1.0),
            ("FS_GCS_TIMEOUT", 5.0),
            ("FS_THR_ENABLE", 1.0),
            ("BATT_FS_LOW_ACT", 0.0),
            ("FENCE_ENABLE", 0.0),
            ("FENCE_TYPE", 7.0),
            ("FENCE_ACTION", 1.0),
            ("FENCE_RADIUS", 300.0),
            ("FENCE_ALT_MAX", 100.0),
            ("FENCE_ALT_MIN", -10.0),
            ("FENCE_MARGIN", 2.0),
            ("FENCE_TOTAL", 0.0),
            ("DISARM_DELAY", 10.0),
            ("WPNAV_SPEED", 1000.0),
        ],
        Autopilot::Px4 => &[
            ("MAV_SYS_ID", 1.0),
            ("MIS_TAKEOFF_ALT", 2.5),
            ("RTL_RETURN_ALT", 15.0),
            ("NAV_DLL_ACT", 2.0),
            ("NAV_RCL_ACT", 2.0),
            ("COM_LOW_BAT_ACT", 0.0),
            ("GF_ACTION", 0.0),
            ("GF_MAX_HOR_DIST", 0.0),
            ("GF_MAX_VER_DIST", 0.0),
            ("COM_OF_LOSS_T", 1.0),
            ("COM_OBL_RC_ACT", 0.0),
            ("MPC_XY_VEL_MAX", 12.0),
            ("CAL_GYRO0_ID", 1.0),
            ("CAL_ACC0_ID", 1.0),
            ("CAL_MAG0_ID", 1.0),
        ],
    }
}

/// Refuses parameters to set up that the firmware does not have.
pub(super) fn check(config: &AutopilotConfig) -> Result<(), SimError> {
    let usual = usual(config.autopilot);
    let unknown = |name: &&String| usual.iter().all(|(known, _)| known != *name);
    match config.faults.parameters.keys().find(unknown) {
        Some(name) => Err(SimError::Parameter { name: name.clone() }),
        None => Ok(()),
    }
}

impl Params {
    pub(super) fn new(config: &AutopilotConfig) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "parameters have no more digits")]
        let return_up = config.return_up_m as f32;
        let system = f32::from(config.system_id);
        let failsafe = f32::from(u8::from(config.ground_failsafe_s.is_some()));
        let all = usual(config.autopilot).iter().map(|(name, value)| {
            let usual = match *name {
                "SYSID_THISMAV" | "MAV_SYS_ID" => system,
                "RTL_ALT" => return_up * 100.0,
                "RTL_RETURN_ALT" => return_up,
                "FS_GCS_ENABLE" => failsafe,
                "NAV_DLL_ACT" => 2.0 * failsafe,
                _ => *value,
            };
            #[expect(clippy::cast_possible_truncation, reason = "parameters have no more digits")]
            let set_up = config.faults.parameters.get(*name).map(|value| *value as f32);
            (*name, set_up.unwrap_or(usual))
        });
        Self { all: all.collect() }
    }

    pub(super) fn value(&self, name: &str) -> Option<f32> {
        self.all.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    }

    pub(super) fn all(&self) -> Vec<MavMessage> {
        (0..self.all.len()).filter_map(|index| self.message(index)).collect()
    }

    pub(super) fn read(&self, query: &PARAM_REQUEST_READ_DATA) -> Option<MavMessage> {
        match usize::try_from(query.param_index) {
            Ok(index) => self.message(index),
            Err(_) => self.message(self.position(&query.param_id)?),
        }
    }

    /// Sets one, and returns its value.
    pub(super) fn set(&mut self, set: &PARAM_SET_DATA) -> Option<MavMessage> {
        let index = self.position(&set.param_id)?;
        if let Some((_, value)) = self.all.get_mut(index).filter(|_| set.param_value.is_finite()) {
            *value = set.param_value;
        }
        self.message(index)
    }

    fn position(&self, name: &CharArray<16>) -> Option<usize> {
        let name = name.to_str().ok()?;
        self.all.iter().position(|(known, _)| *known == name)
    }

    fn message(&self, index: usize) -> Option<MavMessage> {
        let (name, param_value) = *self.all.get(index)?;
        Some(MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
            param_value,
            param_count: u16::try_from(self.all.len()).ok()?,
            param_index: u16::try_from(index).ok()?,
            param_id: CharArray::from(name),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        }))
    }
}
