//! Orders to an AR.Drone when its take-off is called off, fails, or was never ours.

use std::{cell::Cell, rc::Rc};

use foxhunt_core::Vehicle;
use foxhunt_wire::{
    ByteStream, MemoryStream,
    ardrone::{
        ArDroneCommand, ArDroneDemo, ArDroneNavdata, DroneState, FlightState, parse_commands,
    },
    memory_pair,
};
use nalgebra::Vector3;

use super::{ArDrone, ArDroneConfig};
use crate::{Aircraft, AircraftState};

const FLYING: u32 = 1;
const EMERGENCY: u32 = 1 << 31;

struct Drone {
    driver: ArDrone<MemoryStream, MemoryStream, Box<dyn Fn() -> f64>>,
    now: Rc<Cell<f64>>,
    ordered: MemoryStream,
    sent: MemoryStream,
    state: u32,
    sequence: u32,
    up_m: f64,
    forward_mps: f64,
}

impl Drone {
    fn new(state: u32) -> Self {
        let ((orders, ordered), (navdata, sent)) = (memory_pair(), memory_pair());
        let now = Rc::new(Cell::new(0.0));
        let time = Rc::clone(&now);
        let clock: Box<dyn Fn() -> f64> = Box::new(move || time.get());
        let driver = ArDrone::new(ArDroneConfig::default(), orders, navdata, clock);
        let driver = driver.expect("a driver");
        Self { driver, now, ordered, sent, state, sequence: 1, up_m: 0.0, forward_mps: 0.0 }
    }

    /// A tenth of a second; the orders to fly and to change its emergency that were sent.
    fn tick(&mut self) -> (AircraftState, Vec<(bool, bool)>) {
        self.now.set(self.now.get() + 0.1);
        self.sequence += 1;
        let flies = self.state & FLYING != 0;
        let demo = ArDroneDemo {
            flight: if flies { FlightState::TakingOff } else { FlightState::Landed },
            battery_percent: 80,
            pitch: 0.0,
            roll: 0.0,
            yaw: 0.0,
            altitude_m: self.up_m,
            forward_mps: self.forward_mps,
            right_mps: 0.0,
        };
        let state = DroneState(self.state);
        let navdata = ArDroneNavdata { state, sequence: self.sequence, demo: Some(demo) };
        self.sent.send(&navdata.encode()).expect("memory");
        let state = self.driver.state().expect("memory");
        (state, self.take_orders())
    }

    fn take_orders(&mut self) -> Vec<(bool, bool)> {
        let mut into = [0; 4096];
        let mut bytes = Vec::new();
        loop {
            let count = self.ordered.receive(&mut into).expect("memory");
            let Some(more) = into.get(..count).filter(|more| !more.is_empty()) else { break };
            bytes.extend_from_slice(more);
        }
        let reference = |command| match command {
            ArDroneCommand::Reference { fly, emergency } => Some((fly, emergency)),
            _ => None,
        };
        let commands =
            if bytes.is_empty() { Vec::new() } else { parse_commands(&bytes).expect("commands") };
        commands.into_iter().filter_map(|(_, command)| reference(command)).collect()
    }

    fn run(&mut self, seconds: f64) -> (AircraftState, Vec<(bool, bool)>) {
        let end = self.now.get() + seconds;
        let mut all = Vec::new();
        loop {
            let (state, sent) = self.tick();
            all.extend(sent);
            if self.now.get() >= end {
                return (state, all);
            }
        }
    }
}

const LAND: (bool, bool) = (false, false);

#[test]
fn a_take_off_is_called_off() {
    let mut field = Drone::new(0);
    field.run(1.0);
    field.driver.take_off(2.0).expect("accepted");
    assert!(field.run(1.0).1.contains(&(true, false)));
    field.driver.land().expect("it ends the take-off");
    field.take_orders();
    // It was on its way up already.
    field.state = FLYING;
    let (state, sent) = field.run(5.0);
    assert!(sent.len() > 20 && sent.iter().all(|sent| *sent == LAND), "{sent:?}");
    assert!(!state.commanded && state.hindrance == "it lands", "{state:?}");
    field.state = 0;
    assert_eq!(field.run(1.0).0.hindrance, "");
}

#[test]
fn an_emergency_of_the_climb_stays() {
    // One from before is ended by the take-off.
    let mut field = Drone::new(EMERGENCY);
    field.run(1.0);
    field.driver.take_off(2.0).expect("accepted");
    assert!(field.run(0.5).1.contains(&(false, true)));
    field.state = FLYING;
    assert!(field.run(1.0).1.contains(&(true, false)));
    field.state = EMERGENCY;
    let (state, sent) = field.run(5.0);
    assert!(sent.iter().all(|sent| *sent == LAND), "{sent:?}");
    assert!(state.hindrance.contains("an emergency stopped"), "{state:?}");
}

#[test]
fn a_take_off_has_its_time() {
    let mut field = Drone::new(0);
    field.run(1.0);
    field.driver.take_off(2.0).expect("accepted");
    field.state = FLYING;
    let (state, sent) = field.run(25.0);
    assert_eq!(sent.last(), Some(&LAND), "never up");
    assert_eq!(state.hindrance, "it lands");
    field.state = 0;
    let (state, _) = field.run(1.0);
    assert!(state.hindrance.contains("not up after"), "{state:?}");
}

#[test]
fn who_flies_by_others_is_left_alone() {
    let mut field = Drone::new(FLYING);
    let (state, sent) = field.run(5.0);
    assert!(sent.is_empty() && state.airborne, "{sent:?}");
    // Until it is ordered to.
    field.driver.land().expect("accepted");
    assert_eq!(field.run(1.0).1.last(), Some(&LAND));
}

#[test]
fn a_pose_has_the_velocity_of_nose_and_height() {
    let mut field = Drone::new(FLYING);
    assert!(field.driver.pose().is_err(), "nothing has come");
    field.forward_mps = 2.0;
    field.tick();
    field.up_m = 0.05;
    field.tick();
    let pose = field.driver.pose().expect("navdata");
    let velocity = pose.velocity.expect("navdata");
    let (sin, cos) = pose.heading.sin_cos();
    assert!((velocity - Vector3::new(2.0 * cos, 2.0 * sin, 0.5)).norm() < 1e-3, "{velocity}");
}
