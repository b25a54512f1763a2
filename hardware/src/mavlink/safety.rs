//! Flights that are called down, taken over, or poorly received, against an ArduCopter that
//! obeys.

use std::{cell::Cell, rc::Rc};

use foxhunt_core::{Vehicle, Waypoint};
use foxhunt_wire::{
    ByteStream, MemoryStream,
    mavlink::{
        Codec, SigningKey,
        dialect::{
            ATTITUDE_DATA, COMMAND_ACK_DATA, EKF_STATUS_REPORT_DATA, EXTENDED_SYS_STATE_DATA,
            EkfStatusFlags, GLOBAL_POSITION_INT_DATA, GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA,
            MavAutopilot, MavCmd, MavLandedState, MavMessage, MavModeFlag, MavResult, MavSeverity,
            MavState, MavType, POSITION_TARGET_GLOBAL_INT_DATA, RADIO_STATUS_DATA, STATUSTEXT_DATA,
        },
    },
    memory_pair,
};
use nalgebra::Vector3;

use super::{FlightLimits, MavlinkConfig, MavlinkError, MavlinkSigning, MavlinkVehicle};
use crate::{Aircraft, AircraftState, Hands};

type Time = Box<dyn Fn() -> f64>;

const GUIDED: u32 = 4;
const LOITER: u32 = 5;
const RTL: u32 = 6;
const LAND: u32 = 9;

struct Copter {
    driver: MavlinkVehicle<MemoryStream, Time>,
    now: Rc<Cell<f64>>,
    stream: MemoryStream,
    codec: Codec,
    mode: u32,
    armed: bool,
    airborne: bool,
    up: f64,
    north_m: f64,
    yaw: f32,
    speaks: bool,
    /// True if the copter's heartbeats are lost, and nothing else.
    beatless: bool,
    /// Number of heartbeats that have come.
    beats: usize,
    refuses: Option<MavCmd>,
    /// The orders that came, with their first parameter.
    orders: Vec<(MavCmd, u32)>,
    goals: usize,
    /// Reported target of the copter: the last set-point, `moved_m` metres further north.
    target: Option<POSITION_TARGET_GLOBAL_INT_DATA>,
    moved_m: f64,
}

impl Copter {
    fn new(limits: FlightLimits) -> Self {
        Self::of(MavlinkConfig { limits, ..MavlinkConfig::default() })
    }

    fn of(config: MavlinkConfig) -> Self {
        let (near, stream) = memory_pair();
        let now = Rc::new(Cell::new(0.0));
        let time = Rc::clone(&now);
        let time: Time = Box::new(move || time.get());
        let mut copter = Self {
            driver: MavlinkVehicle::new(config, near, time).expect("a driver"),
            now,
            stream,
            codec: Codec::new(1, 1),
            mode: 0,
            armed: false,
            airborne: false,
            up: 0.0,
            north_m: 0.0,
            yaw: 0.0,
            speaks: true,
            beatless: false,
            beats: 0,
            refuses: None,
            orders: Vec::new(),
            goals: 0,
            target: None,
            moved_m: 0.0,
        };
        copter.run(1.0);
        copter
    }

    #[expect(clippy::cast_possible_truncation, reason = "the messages have no more digits")]
    fn speak(&mut self) {
        let armed = if self.armed { 128 } else { 0 };
        let landed_state = if self.airborne {
            MavLandedState::MAV_LANDED_STATE_IN_AIR
        } else {
            MavLandedState::MAV_LANDED_STATE_ON_GROUND
        };
        let messages = [
            MavMessage::HEARTBEAT(HEARTBEAT_DATA {
                custom_mode: self.mode,
                mavtype: MavType::MAV_TYPE_QUADROTOR,
                autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                base_mode: MavModeFlag::from_bits_retain(armed | 1),
                system_status: MavState::MAV_STATE_ACTIVE,
                mavlink_version: 3,
            }),
            MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
                lat: 480_000_000 + (self.north_m / 111_320.0 * 1e7) as i32,
                lon: 110_000_000,
                relative_alt: (self.up * 1e3) as i32,
                vx: 150,
                vy: -70,
                vz: 25,
                ..Default::default()
            }),
            MavMessage::ATTITUDE(ATTITUDE_DATA { yaw: self.yaw, ..Default::default() }),
            MavMessage::GPS_RAW_INT(GPS_RAW_INT_DATA {
                fix_type: GpsFixType::GPS_FIX_TYPE_3D_FIX,
                satellites_visible: 12,
                h_acc: 800,
                ..Default::default()
            }),
            MavMessage::EKF_STATUS_REPORT(EKF_STATUS_REPORT_DATA {
                flags: EkfStatusFlags::from_bits_retain(0x33F),
                ..Default::default()
            }),
            MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA {
                landed_state,
                ..Default::default()
            }),
        ];
        for message in messages.iter().skip(usize::from(self.beatless)) {
            self.send(message);
        }
        if let Some(target) = self.target.clone() {
            let lat_int = target.lat_int + (self.moved_m / 111_320.0 * 1e7) as i32;
            let target = POSITION_TARGET_GLOBAL_INT_DATA { lat_int, ..target };
            self.send(&MavMessage::POSITION_TARGET_GLOBAL_INT(target));
        }
    }

    fn write(&mut self, severity: MavSeverity, text: &str) {
        let data = STATUSTEXT_DATA { severity, text: text.into(), ..Default::default() };
        self.send(&MavMessage::STATUSTEXT(data));
    }

    fn send(&mut self, message: &MavMessage) {
        let bytes = self.codec.encode(message, self.now.get());
        self.stream.send(&bytes).expect("memory");
    }

    fn obey(&mut self) {
        let mut into = [0; 4096];
        loop {
            let count = self.stream.receive(&mut into).expect("memory");
            let Some(bytes) = into.get(..count).filter(|bytes| !bytes.is_empty()) else { break };
            self.codec.push(bytes);
        }
        while let Some(frame) = self.codec.next_frame(self.now.get()) {
            let order = match frame.message {
                MavMessage::COMMAND_LONG(order) => order,
                MavMessage::SET_POSITION_TARGET_GLOBAL_INT(goal) => {
                    self.goals += 1;
                    let lat_int = goal.lat_int;
                    let lon_int = goal.lon_int;
                    let alt = goal.alt;
                    self.target = Some(POSITION_TARGET_GLOBAL_INT_DATA {
                        lat_int,
                        lon_int,
                        alt,
                        ..Default::default()
                    });
                    continue;
                }
                MavMessage::HEARTBEAT(_) => {
                    self.beats += 1;
                    continue;
                }
                _ => continue,
            };
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "small whole numbers"
            )]
            let (first, second) = (order.param1 as u32, order.param2 as u32);
            self.orders.push((order.command, first));
            if !self.speaks {
                continue;
            }
            let refused = self.refuses == Some(order.command);
            match order.command {
                _ if refused => {}
                MavCmd::MAV_CMD_DO_SET_MODE => self.mode = second,
                MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => self.armed = first == 1,
                _ => {}
            }
            let result =
                if refused { MavResult::MAV_RESULT_DENIED } else { MavResult::MAV_RESULT_ACCEPTED };
            let command = order.command;
            self.send(&MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
                command,
                result,
                ..Default::default()
            }));
        }
    }

    fn tick(&mut self) -> AircraftState {
        self.now.set(self.now.get() + 0.1);
        if self.speaks {
            self.speak();
        }
        let state = self.driver.state().expect("memory");
        self.obey();
        state
    }

    fn run(&mut self, seconds: f64) -> AircraftState {
        let end = self.now.get() + seconds;
        loop {
            let state = self.tick();
            if self.now.get() >= end {
                return state;
            }
        }
    }

    fn count(&self, order: MavCmd, first: u32) -> usize {
        self.orders.iter().filter(|sent| **sent == (order, first)).count()
    }

    /// Runs until an order has come.
    fn until(&mut self, order: MavCmd) {
        while !self.orders.iter().any(|(command, _)| *command == order) {
            assert!(self.now.get() < 60.0, "no {order:?}");
            self.tick();
        }
    }

    fn fly(&mut self) {
        self.driver.take_off(10.0).expect("accepted");
        self.until(MavCmd::MAV_CMD_NAV_TAKEOFF);
        (self.airborne, self.up) = (true, 10.0);
        assert!(self.run(1.0).commanded);
    }
}

fn copter() -> Copter {
    Copter::new(FlightLimits::default())
}

const ARM: MavCmd = MavCmd::MAV_CMD_COMPONENT_ARM_DISARM;
const CLIMB: MavCmd = MavCmd::MAV_CMD_NAV_TAKEOFF;

#[test]
fn a_take_off_is_called_off_at_every_stage() {
    // Before anything was armed.
    let mut field = copter();
    field.driver.take_off(10.0).expect("accepted");
    field.driver.land().expect("it ends the take-off");
    field.run(20.0);
    assert!(!field.armed && field.count(ARM, 1) == 0, "{:?}", field.orders);
    assert!(field.driver.land().is_err(), "it is on the ground");
    // While it is armed.
    for back in [false, true] {
        let mut field = copter();
        field.driver.take_off(10.0).expect("accepted");
        field.until(ARM);
        if back { field.driver.return_to_launch() } else { field.driver.land() }.expect("ends it");
        field.run(20.0);
        assert!(!field.armed && field.count(ARM, 0) >= 1 && field.count(CLIMB, 0) == 0);
    }
    // When the climb was ordered, and it has not reported that it climbs: no way up to come back.
    let mut field = copter();
    field.driver.take_off(10.0).expect("accepted");
    field.until(CLIMB);
    field.driver.return_to_launch().expect("ends it");
    field.run(5.0);
    assert_eq!(field.mode, LAND);
    field.armed = false;
    assert!(!field.run(5.0).commanded && field.goals == 0);
    // On its way up.
    for (back, mode) in [(false, LAND), (true, RTL)] {
        let mut field = copter();
        field.driver.take_off(10.0).expect("accepted");
        field.until(CLIMB);
        (field.airborne, field.up) = (true, 4.0);
        field.tick();
        if back { field.driver.return_to_launch() } else { field.driver.land() }.expect("ends it");
        field.up = 10.0;
        let state = field.run(5.0);
        assert!(field.mode == mode && !state.commanded && field.goals == 0, "{state:?}");
        // Taking over does not end the landing, either.
        field.driver.take_over().expect("without effect");
        assert!(!field.run(2.0).commanded && field.mode == mode);
    }
}

#[test]
fn a_failed_take_off_lands_in_the_air_and_disarms_on_the_ground() {
    let mut field = copter();
    field.refuses = Some(CLIMB);
    field.driver.take_off(10.0).expect("accepted");
    let state = field.run(20.0);
    assert!(!field.armed && field.count(ARM, 0) == 1, "{:?}", field.orders);
    assert!(state.hindrance.contains("given up") && state.hindrance.contains("denied"));
    let mut field = copter();
    field.driver.take_off(10.0).expect("accepted");
    field.until(CLIMB);
    (field.airborne, field.up) = (true, 3.0);
    let state = field.run(70.0);
    assert!(field.mode == LAND && state.hindrance.contains("not up after 60 s"), "{state:?}");
}

#[test]
fn a_landing_outlasts_a_lost_link_and_refusals() {
    let mut field = copter();
    field.fly();
    field.speaks = false;
    assert!(!field.run(6.0).commanded);
    field.driver.land().expect("it is repeated until it arrives");
    field.run(10.0);
    field.speaks = true;
    field.run(3.0);
    assert_eq!(field.mode, LAND);
    let mut field = copter();
    field.fly();
    field.refuses = Some(MavCmd::MAV_CMD_DO_SET_MODE);
    field.driver.return_to_launch().expect("accepted");
    let state = field.run(8.0);
    assert!(state.hindrance.contains("RTL was given up"), "{state:?}");
    field.refuses = None;
    field.run(5.0);
    assert_eq!(field.mode, LAND, "it lands at least");
}

#[test]
fn whatever_we_did_not_order_is_the_pilots() {
    // During the first stages of a take-off.
    let taken = |change: fn(&mut Copter)| {
        let mut field = copter();
        field.driver.take_off(10.0).expect("accepted");
        change(&mut field);
        field.run(5.0);
        assert_eq!(field.count(ARM, 1), 0, "{:?}", field.orders);
        assert!(matches!(field.driver.land(), Err(MavlinkError::NotCommanded { .. })));
        field.mode
    };
    assert_eq!(taken(|field| field.mode = LOITER), LOITER);
    taken(|field| field.armed = true);
    // While it lands.
    let mut field = copter();
    field.fly();
    field.driver.land().expect("accepted");
    field.run(2.0);
    assert_eq!(field.mode, LAND);
    let sent = field.goals;
    field.mode = LOITER;
    field.run(3.0);
    assert!(field.mode == LOITER && field.goals == sent, "nothing is sent to the pilot's");
    assert!(field.driver.return_to_launch().is_err());
    // GUIDED at once is a mode that he has chosen, not one that he gives back.
    let mut field = copter();
    field.fly();
    field.driver.land().expect("accepted");
    field.run(2.0);
    field.mode = GUIDED;
    let state = field.run(3.0);
    assert!(field.mode == GUIDED && state.hands == Hands::Pilot, "{state:?}");
    assert!(field.driver.return_to_launch().is_err());
    // After a lost link.
    let mut field = copter();
    field.fly();
    field.speaks = false;
    field.run(6.0);
    (field.speaks, field.mode) = (true, LOITER);
    field.run(1.0);
    assert!(field.driver.land().is_err(), "he flies it");
}

#[test]
fn what_is_in_the_air_and_not_ours_is_left_alone() {
    for mode in [RTL, LAND, GUIDED, LOITER] {
        let mut field = copter();
        (field.mode, field.armed, field.airborne, field.up) = (mode, true, true, 10.0);
        let state = field.run(2.0);
        assert_eq!(state.offered, mode == GUIDED, "{state:?}");
        let refused = |result: Result<(), MavlinkError>| {
            assert!(matches!(result, Err(MavlinkError::NotCommanded { .. })), "{result:?}");
        };
        refused(field.driver.land());
        refused(field.driver.return_to_launch());
        if mode != GUIDED {
            refused(field.driver.take_over());
        }
        field.run(2.0);
        assert!(field.mode == mode && field.count(MavCmd::MAV_CMD_DO_SET_MODE, 1) == 0);
    }
    // A failsafe has it come back while its link is lost.
    for land in [false, true] {
        let mut field = copter();
        field.fly();
        field.speaks = false;
        field.run(6.0);
        if land {
            field.driver.land().expect("it is repeated until it arrives");
            field.run(0.2);
        }
        (field.mode, field.speaks) = (RTL, true);
        field.run(0.1);
        let _ = field.driver.land();
        let state = field.run(4.0);
        assert!(field.mode == RTL && !state.commanded, "{state:?}");
    }
}

#[test]
fn another_station_that_sends_it_elsewhere_has_it() {
    let mut field = copter();
    field.fly();
    assert!(field.run(5.0).commanded);
    let goals = field.goals;
    field.moved_m = 60.0;
    let state = field.run(2.5);
    assert!(!state.commanded && !state.offered, "{state:?}");
    assert_eq!(state.hindrance, "another station has sent it 60 m from its goal");
    assert!(field.driver.take_over().is_err(), "its mode does not show that it is given back");
    field.run(3.0);
    assert_eq!(field.goals, goals, "nobody fights for it");
    field.mode = LOITER;
    field.run(1.0);
    (field.mode, field.moved_m) = (GUIDED, 0.0);
    field.run(1.0);
    field.driver.take_over().expect("it was given back");
    assert!(field.run(3.0).commanded);
}

/// The other station's set-points alternate with ours, and the copter is pulled to and fro.
#[test]
fn another_station_whose_orders_alternate_with_ours_has_it() {
    let mut field = copter();
    field.fly();
    assert!(field.run(5.0).commanded);
    for moved_m in [25.0, 0.0].repeat(8) {
        field.moved_m = moved_m;
        field.run(0.2);
    }
    let state = field.run(0.1);
    assert_eq!(state.hindrance, "another station has sent it 25 m from its goal");
    assert_eq!(state.hands, Hands::Station);
}

/// Orders that change its mode or its motors.
fn changes(field: &Copter) -> usize {
    let asks = [MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, MavCmd::MAV_CMD_REQUEST_MESSAGE];
    field.orders.iter().filter(|(order, _)| !asks.contains(order)).count()
}

/// A receiver that died: its orders arrive, and nothing is heard.
#[test]
fn nothing_is_ordered_and_no_heartbeat_sent_while_nothing_is_heard() {
    for before_s in [0.0, 1.0, 2.5, 6.0] {
        let mut field = copter();
        field.fly();
        field.run(3.0);
        field.speaks = false;
        field.run(before_s);
        let sent = changes(&field);
        let _ = field.driver.return_to_launch();
        field.run(10.0);
        let given = changes(&field) - sent;
        assert!(given <= usize::from(before_s < 0.5), "{given} orders after {before_s} s");
        let beats = field.beats;
        let goals = field.goals;
        let state = field.run(30.0);
        assert_eq!((field.beats, field.goals), (beats, goals), "its failsafe is to act");
        assert!(state.hands == Hands::Unheard && state.hindrance.contains("no heartbeat"));
        assert_eq!(changes(&field) - sent, given);
        // Nobody has changed its mode: it is brought home.
        field.speaks = true;
        field.run(3.0);
        assert_eq!(field.mode, RTL);
    }
}

#[test]
fn a_mode_that_was_chosen_in_a_silence_is_the_pilots() {
    for leaves in [false, true] {
        let mut field = copter();
        field.fly();
        field.run(3.0);
        field.speaks = false;
        field.run(6.0);
        if leaves {
            field.driver.return_to_launch().expect("for when it is heard again");
        }
        let sent = changes(&field);
        // Everything but heartbeats comes back first.
        (field.speaks, field.beatless, field.mode) = (true, true, LOITER);
        field.run(4.0);
        assert_eq!(changes(&field), sent, "its mode is not known");
        field.beatless = false;
        let state = field.run(20.0);
        assert_eq!(changes(&field), sent);
        assert_eq!((state.hands, field.mode), (Hands::Pilot, LOITER));
        assert_eq!(state.hindrance, "its mode became LOITER, which we did not order");
    }
}

#[test]
fn what_came_down_without_our_order_stays_down() {
    let down = |words: &str, change: &dyn Fn(&mut Copter)| {
        let mut field = copter();
        field.driver.take_off(10.0).expect("accepted");
        field.until(CLIMB);
        (field.airborne, field.up) = (true, 4.0);
        field.run(1.0);
        change(&mut field);
        (field.armed, field.airborne, field.up, field.speaks) = (false, false, 0.0, true);
        field.run(1.0);
        let armed = field.count(ARM, 1);
        for _ in 0..10 {
            let refused = field.driver.take_off(10.0).expect_err("somebody may walk to it");
            assert!(refused.to_string().contains("stays down until"), "{refused}");
            let state = field.run(2.0);
            assert_eq!(state.hands, Hands::Grounded);
            assert!(state.hindrance.contains(words), "{state:?}");
        }
        assert!(!field.armed && field.count(ARM, 1) == armed);
        field
    };
    // Its link is lost, and its failsafe lands it in the meantime.
    let silent = |field: &mut Copter| {
        field.speaks = false;
        field.run(9.0);
        field.mode = RTL;
    };
    let mut field = down("while nothing was heard", &silent);
    field.driver.clear_to_take_off();
    field.driver.take_off(10.0).expect("by a word of its pilot");
    field.run(3.0);
    assert!(field.armed);
    // It lands where that is seen.
    let seen = |field: &mut Copter| {
        field.mode = LAND;
        field.run(9.0);
    };
    let mut field = down("its mode became LAND", &seen);
    (field.mode, _) = (LOITER, field.run(1.0));
    assert!(field.driver.take_off(10.0).is_err(), "LOITER is no word");
    (field.mode, _) = (GUIDED, field.run(1.0));
    field.run(1.0);
    field.driver.take_off(10.0).expect("its pilot has set GUIDED");
    // Another station stops its motors.
    down("its motors were stopped", &|_| {});
    // Another station starts them after a landing of ours, and stops them.
    let mut field = copter();
    field.fly();
    field.driver.land().expect("accepted");
    field.run(2.0);
    (field.armed, field.airborne, field.up) = (false, false, 0.0);
    assert_eq!(field.run(1.0).hands, Hands::Nobody);
    field.armed = true;
    assert_eq!(field.run(1.0).hindrance, "its motors run, which we did not order");
    field.armed = false;
    assert_eq!(field.run(1.0).hands, Hands::Grounded);
    assert!(field.driver.take_off(10.0).is_err());
}

#[test]
fn what_is_given_back_while_it_leaves_is_brought_home() {
    let mut field = copter();
    field.fly();
    field.driver.return_to_launch().expect("accepted");
    field.run(2.0);
    field.mode = LOITER;
    field.run(5.0);
    assert!(field.driver.return_to_launch().is_err(), "he has it");
    field.mode = GUIDED;
    let state = field.run(1.0);
    assert_eq!((state.hands, field.mode), (Hands::GivenBack, GUIDED), "{state:?}");
    field.driver.return_to_launch().expect("it was given back");
    field.run(2.0);
    assert_eq!(field.mode, RTL);
}

#[test]
fn words_go_with_the_change_that_they_explain() {
    let mut field = copter();
    field.fly();
    field.write(MavSeverity::MAV_SEVERITY_WARNING, "Radio Failsafe");
    field.mode = RTL;
    let state = field.run(3.0);
    let why = "its mode became RTL, which we did not order (Radio Failsafe)";
    assert_eq!((state.hands, state.hindrance.as_str()), (Hands::Autopilot, why));
    field.mode = LOITER;
    let state = field.run(3.0);
    let why = "its mode became LOITER, which we did not order";
    assert_eq!((state.hands, state.hindrance.as_str()), (Hands::Pilot, why));
    field.mode = GUIDED;
    let state = field.run(1.0);
    assert_eq!((state.hands, state.hindrance.as_str()), (Hands::GivenBack, "it was given back"));
}

/// Velocities of another station: it reports no target.
#[test]
fn another_station_that_sends_velocities_has_it() {
    let mut field = copter();
    field.fly();
    assert!(field.run(5.0).commanded);
    for _ in 0..60 {
        field.target = None;
        field.north_m += 0.2;
        field.tick();
    }
    let state = field.tick();
    assert!(!state.commanded && state.hands == Hands::Station, "{state:?}");
    assert!(state.hindrance.contains("another station flies it"), "{state:?}");
    let goals = field.goals;
    field.run(5.0);
    assert_eq!(field.goals, goals, "nobody fights for it");
    assert!(field.driver.return_to_launch().is_err() && field.driver.take_over().is_err());
}

#[test]
fn refusals_do_not_alternate() {
    let mut field = copter();
    field.fly();
    field.refuses = Some(MavCmd::MAV_CMD_DO_SET_MODE);
    for _ in 0..30 {
        field.driver.return_to_launch().expect("accepted");
        field.run(2.0);
    }
    // By their first parameter they are alike: so many of a landing after those of a return.
    let state = field.tick();
    assert!(state.hindrance.contains("it lands; the order to"), "{state:?}");
    field.refuses = None;
    field.run(3.0);
    assert_eq!(field.mode, LAND);
}

/// A heartbeat that comes late or twice shows nothing of now.
#[test]
fn late_heartbeats_do_not_give_it_back() {
    let mut field = copter();
    field.fly();
    field.run(2.0);
    let beat = |mode| {
        MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            custom_mode: mode,
            mavtype: MavType::MAV_TYPE_QUADROTOR,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode: MavModeFlag::from_bits_retain(129),
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        })
    };
    let older = field.codec.encode(&beat(GUIDED), 0.0);
    field.mode = LOITER;
    assert_eq!(field.run(1.0).hands, Hands::Pilot);
    for _ in 0..5 {
        field.stream.send(&older).expect("memory");
        assert_eq!(field.driver.state().expect("memory").hands, Hands::Pilot);
        assert_eq!(field.run(0.3).hands, Hands::Pilot);
    }
}

#[test]
fn good_news_is_no_complaint() {
    use MavSeverity::{MAV_SEVERITY_INFO as INFO, MAV_SEVERITY_WARNING as WARNING};
    let mut field = copter();
    field.fly();
    field.write(WARNING, "GCS Failsafe - RTL");
    field.write(INFO, "Arming motors");
    field.write(WARNING, "GCS Failsafe Cleared");
    field.write(WARNING, "EKF Failsafe Cleared");
    field.mode = RTL;
    let state = field.run(1.0);
    let why = "its mode became RTL, which we did not order (GCS Failsafe - RTL)";
    assert_eq!(state.hindrance, why);
}

#[test]
fn it_is_kept_inside_and_its_take_off_too() {
    let fence = vec![[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]];
    let mut field = Copter::new(FlightLimits { fence, ..FlightLimits::default() });
    assert!(matches!(field.driver.take_off(1.0), Err(MavlinkError::UpLimit { .. })));
    field.north_m = 25.0;
    field.driver.take_off(5.0).expect("it waits for a position");
    assert!(field.run(5.0).hindrance.contains("outside the fence") && !field.armed);
    field.north_m = 0.0;
    field.tick();
    // Its height counts from where it is armed, whatever it reported before.
    field.up = -3.0;
    field.fly();
    assert!((field.driver.goal.expect("a goal").place.z - 10.0).abs() < 1e-9);
    field.north_m = 25.0;
    let state = field.run(0.5);
    assert!(state.commanded && state.hindrance.contains("outside the fence"), "{state:?}");
    let place = field.driver.goal.expect("a goal").place;
    assert!((place - Vector3::new(0.0, 20.0, 10.0)).norm() < 0.1, "{place}");
    field.north_m = 10.0;
    assert_eq!(field.run(0.5).hindrance, "");
    // Without a launch place no distance from it is known.
    field.driver.launch = None;
    let goal = Waypoint { position: Vector3::new(1.0, 1.0, 10.0) };
    let error = field.driver.go_to(&goal).expect_err("refused").to_string();
    assert!(error.contains("fence_radius_m"), "{error}");
}

#[test]
fn a_pose_has_the_velocity_of_its_position() {
    let mut field = copter();
    let velocity = field.driver.pose().expect("a pose").velocity.expect("always sent");
    assert!((velocity - Vector3::new(-0.7, 1.5, -0.25)).norm() < 1e-12, "{velocity}");
}

#[test]
fn old_words_and_no_numbers_do_not_count() {
    let mut field = copter();
    field.fly();
    let now = field.now.get();
    field.driver.telemetry.landed.as_mut().expect("reported").value =
        MavLandedState::MAV_LANDED_STATE_ON_GROUND;
    assert!(!field.driver.telemetry.airborne(now + 2.9), "its word");
    assert!(field.driver.telemetry.airborne(now + 3.1), "armed and 10 m up");
    field.yaw = f32::NAN;
    field.tick();
    assert!(field.driver.pose().expect_err("no number").to_string().contains("not a number"));
}

#[test]
fn a_signed_link_has_its_radios_reports() {
    // RADIO_STATUS of MAVLink 1 with an RSSI of 201, as SiK radios send it.
    const OLD: [u8; 17] = [
        0xfe, 0x09, 0x01, 0x33, 0x44, 0x6d, 0x00, 0x00, 0x00, 0x00, 0xc9, 0x00, 0x00, 0x00, 0x00,
        0xfa, 0x85,
    ];
    let key = SigningKey::new([1; 32]);
    let signing = Some(MavlinkSigning { key, link_id: 0 });
    let mut field = Copter::of(MavlinkConfig { signing, ..MavlinkConfig::default() });
    assert!(field.driver.telemetry.who.is_none(), "nothing unsigned of an autopilot counts");
    field.send(&MavMessage::RADIO_STATUS(RADIO_STATUS_DATA { rssi: 200, ..Default::default() }));
    field.tick();
    assert_eq!(field.driver.radio_status().map(|radio| radio.rssi), Some(200));
    field.stream.send(&OLD).expect("memory");
    field.tick();
    assert_eq!(field.driver.radio_status().map(|radio| radio.rssi), Some(201));
    assert!(field.driver.telemetry.who.is_none());
}
