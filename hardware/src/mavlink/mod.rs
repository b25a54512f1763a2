//! ArduPilot and PX4 over MAVLink 2: the state of a vehicle, which the modules read and drive.

mod authority;
mod config;
mod doubt;
mod error;
mod examine;
mod failsafes;
mod flight;
mod goal;
mod ground;
mod link;
mod orders;
mod phase;
mod quality;
mod reports;
#[cfg(test)]
mod safety;
mod setpoint;
mod take_off;
mod telemetry;
mod vehicle;

pub use config::{
    FlightLimits, MavlinkConfig, MavlinkOrigin, MavlinkSigning, PositionRequirements,
};
pub use error::MavlinkError;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use foxhunt_wire::mavlink::{
    Autopilot, CommonFrame, FlightMode,
    dialect::{
        ATTITUDE_DATA, AUTOPILOT_VERSION_DATA, GLOBAL_POSITION_INT_DATA, GPS_RAW_INT_DATA,
        HEARTBEAT_DATA, HOME_POSITION_DATA, LOCAL_POSITION_NED_DATA, MavLandedState, MavModeFlag,
        MavResult, MavState, POSITION_TARGET_GLOBAL_INT_DATA, POSITION_TARGET_LOCAL_NED_DATA,
        SYS_STATUS_DATA,
    },
};
use nalgebra::Vector3;

use crate::ReportedHeight;
use authority::Authority;
use doubt::Doubt;
use ground::GroundReports;
use link::{Link, Streams};
use orders::Order;
use phase::{Camera, Cruise, Goal, Ordered, Phase};
use reports::{Texts, Timed};

/// Greatest age of its landed state, in seconds.
const LANDED_S: f64 = 3.0;

/// An ArduCopter or a PX4 multicopter behind any stream of bytes.
///
/// It is served in every call, which is to be several times a second. East and
/// North count from the common origin, Up from its own launch place.
///
/// **Who flies.** It is ours from a [`take_off`](crate::Aircraft::take_off) until it is landed or
/// returned, until its link is lost, or until its mode is one that we did not order: the pilot's,
/// or a failsafe's ([`Hands`](crate::Hands)). From that moment nothing is sent but heartbeats and
/// questions, and orders are errors; without a heartbeat of it for `link_timeout_s` our own end,
/// too, so that its failsafe acts. Orders that change its mode or its motors follow one of its
/// heartbeats within half a second. It is ours again when the pilot has given the mode back
/// (GUIDED; with PX4 HOLD, where the caller knows that) *and* [`take_over`](Self::take_over) is
/// called; it then hovers until the next goal. If another station sends it elsewhere in GUIDED, it
/// is that station's until its mode has been another one. A vehicle that lands or returns without
/// our order is left to do so, and stays down until its pilot [clears
/// it](crate::Aircraft::clear_to_take_off) or sets GUIDED on the ground.
#[derive(Debug)]
pub struct MavlinkVehicle<S, C> {
    config: MavlinkConfig,
    link: Link<S>,
    clock: C,
    telemetry: Telemetry,
    streams: Option<Streams>,
    frame: Option<CommonFrame>,
    /// Place of the vehicle at take-off, for an autopilot that does not send its home.
    launch: Option<Vector3<f64>>,
    phase: Phase,
    ordered: Ordered,
    /// Height to which its take-off is to bring it, in metres, until it is up there.
    climbs_to: Option<f64>,
    /// Time since which a position is waited for that shows whether it has climbed.
    undecided: Option<f64>,
    /// Number of heartbeats in a row that have shown another mode than the accepted one.
    ignored: u32,
    /// Holder of it, and hence what may be sent to it.
    authority: Authority,
    /// True if it was ordered to come down and has not been observed to.
    leaving: bool,
    /// True if it lands because it has refused to return.
    settles: bool,
    /// Description of its place outside the limits, while it is there.
    strayed: Option<String>,
    goal: Option<Goal>,
    /// The order that the phase waits for.
    order: Option<Order>,
    /// A heading that it was ordered to, and the order.
    turning: Option<Order>,
    cruise: Cruise,
    camera: Camera,
    /// Reason why a take-off or an order was given up.
    failure: String,
    version_requested: f64,
    fence_query: FenceQuery,
}

/// The requests of a fence that is not known yet.
#[derive(Debug, Default)]
struct FenceQuery {
    made: u32,
    last: f64,
}

/// A SiK telemetry radio's report of its link (RADIO_STATUS).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadioStatus {
    /// Time at which it came, in seconds of the driver's clock.
    pub time: f64,
    /// Signal strength of the other radio here, in the radio's own units; 255 is invalid.
    pub rssi: u8,
    /// Signal strength of this radio there.
    pub remote_rssi: u8,
    /// The noise here.
    pub noise: u8,
    /// The noise there.
    pub remote_noise: u8,
}

/// The newest of each message of the autopilot.
#[derive(Debug, Default)]
struct Telemetry {
    /// System, component and firmware of the autopilot.
    who: Option<(u8, u8, Autopilot)>,
    /// Time of its last message.
    last: Option<f64>,
    heartbeat: Option<Timed<HEARTBEAT_DATA>>,
    /// The number of its frame.
    beat_sequence: u8,
    position: Option<Timed<GLOBAL_POSITION_INT_DATA>>,
    attitude: Option<Timed<ATTITUDE_DATA>>,
    gps: Option<Timed<GPS_RAW_INT_DATA>>,
    /// Flags of the estimator, the same bits from both firmwares.
    estimator: Option<Timed<u16>>,
    status: Option<Timed<SYS_STATUS_DATA>>,
    home: Option<Timed<HOME_POSITION_DATA>>,
    target: Option<Timed<POSITION_TARGET_GLOBAL_INT_DATA>>,
    /// Place and target of the vehicle in the frame of its own estimator.
    local: Option<Timed<LOCAL_POSITION_NED_DATA>>,
    local_target: Option<Timed<POSITION_TARGET_LOCAL_NED_DATA>>,
    landed: Option<Timed<MavLandedState>>,
    /// Signs that its place is false.
    doubt: Doubt,
    ground: GroundReports,
    version: Option<AUTOPILOT_VERSION_DATA>,
    /// Ground stations whose heartbeats came over this link.
    stations: BTreeSet<u8>,
    /// The parameters that it has sent, by their names.
    parameters: BTreeMap<String, f64>,
    radio: Option<RadioStatus>,
    /// Receiver of the SiK radio's reports.
    #[cfg(feature = "receivers")]
    feed: Option<crate::SikFeed>,
    /// The last texts, the newest last.
    texts: Texts,
    /// Answers to orders that nobody has looked at yet: the order's number and what was answered.
    acks: VecDeque<(u32, MavResult)>,
}

impl Telemetry {
    fn autopilot(&self) -> Autopilot {
        self.who.map_or(Autopilot::default(), |(_, _, autopilot)| autopilot)
    }

    /// Returns true for a PX4 1 that reports a minor version of at least `minor`.
    fn is_px4_since(&self, minor: u8) -> bool {
        let version = self.version.as_ref().map(|version| version.flight_sw_version.to_be_bytes());
        self.autopilot() == Autopilot::Px4
            && version.is_some_and(|[major, of, ..]| major > 1 || (major == 1 && of >= minor))
    }

    /// The mode of the last heartbeat.
    fn mode(&self) -> Option<FlightMode> {
        let custom = self.heartbeat.as_ref()?.value.custom_mode;
        Some(FlightMode { autopilot: self.autopilot(), custom })
    }

    fn armed(&self) -> bool {
        let armed = MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        self.heartbeat.as_ref().is_some_and(|beat| beat.value.base_mode.contains(armed))
    }

    /// Returns true if its last heartbeat reports that a failsafe acts.
    fn failsafe(&self) -> bool {
        let critical = MavState::MAV_STATE_CRITICAL;
        self.heartbeat.as_ref().is_some_and(|beat| beat.value.system_status == critical)
    }

    /// Seconds since its last heartbeat.
    fn without_heartbeat(&self, now: f64) -> f64 {
        self.heartbeat.as_ref().map_or(f64::INFINITY, |beat| now - beat.at)
    }

    /// Seconds since anything of it came: any message shows that the link lives. Heartbeats, which
    /// alone have its mode, may be away for twice as long.
    fn silence(&self, now: f64) -> f64 {
        let any = self.last.map_or(f64::INFINITY, |last| now - last);
        any.max(0.5 * self.without_heartbeat(now))
    }

    /// Returns true if it is in the air, by its last reports.
    fn airborne(&self, now: f64) -> bool {
        let landed = self.landed.filter(|landed| now - landed.at <= LANDED_S);
        match landed.map(|landed| landed.value) {
            Some(MavLandedState::MAV_LANDED_STATE_ON_GROUND) => false,
            Some(MavLandedState::MAV_LANDED_STATE_UNDEFINED) | None => {
                self.armed() && self.up().is_some_and(|up| up > 0.5)
            }
            Some(_) => true,
        }
    }

    /// Metres above its launch place.
    fn up(&self) -> Option<f64> {
        Some(f64::from(self.position.as_ref()?.value.relative_alt) * 1e-3)
    }

    /// Returns its height above the ground by its own devices.
    fn above_ground(&self, now: f64) -> Option<ReportedHeight> {
        self.ground.height(now, self.attitude.as_ref())
    }

    /// Returns the charge of the battery, from 0 to 1.
    fn battery(&self) -> Option<f64> {
        let percent = self.status.as_ref()?.value.battery_remaining;
        (0..=100).contains(&percent).then(|| f64::from(percent) / 100.0)
    }
}
