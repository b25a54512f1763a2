//! A flight from the ground to the ground, with aircraft that follow their orders, or do not.

use std::{cell::RefCell, rc::Rc};

use foxhunt::{
    core::{Pose, Spinner, Vehicle, Waypoint},
    fly::{Ending, FlightRules, FlownDrone, Mission, MissionError},
    hardware::{Aircraft, AircraftState, Hands, Shared},
    hunt::{BoxedSource, Event, FlightStage},
    registry::Registry,
    scenario::Scenario,
    sim::{SimError, SimVehicle, World},
};

/// A simulated drone that stands until it takes off, with a pilot who may take it.
#[derive(Debug)]
struct Lifted {
    vehicle: SimVehicle,
    doings: Rc<RefCell<Doings>>,
}

#[derive(Debug, Default)]
struct Doings {
    hindrance: String,
    airborne: bool,
    pilot: bool,
    /// It takes no orders since its link was lost, in the mode in which it was.
    dropped: bool,
    /// It does not leave the ground.
    refuses: bool,
    /// Nothing is received of it.
    broken: bool,
    /// It is ours once it is taken over.
    yields: bool,
    orders: Vec<&'static str>,
    pictures: u32,
    camera_fails: Option<SimError>,
    corrections_fail: Option<SimError>,
}

impl Vehicle for Lifted {
    type Error = SimError;

    fn pose(&mut self) -> Result<Pose, SimError> {
        self.vehicle.pose()
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), SimError> {
        self.doings.borrow_mut().orders.push("go to");
        self.vehicle.go_to(goal)
    }

    fn land(&mut self) -> Result<(), SimError> {
        let mut doings = self.doings.borrow_mut();
        doings.orders.push("land");
        doings.airborne = false;
        Ok(())
    }
}

impl Spinner for Lifted {
    fn spin(&mut self, rate: Option<f64>) -> Result<(), SimError> {
        self.vehicle.spin(rate)
    }
}

impl Aircraft for Lifted {
    fn state(&mut self) -> Result<AircraftState, SimError> {
        let doings = self.doings.borrow();
        if doings.broken {
            return Err(SimError::Drone { drone: 0, drones: 0 });
        }
        Ok(AircraftState {
            mode: if doings.pilot { "LOITER" } else { "GUIDED" }.into(),
            armed: doings.airborne,
            airborne: doings.airborne,
            commanded: doings.airborne && !doings.pilot && !doings.dropped,
            offered: doings.airborne && doings.dropped,
            hands: match (doings.airborne, doings.pilot, doings.dropped) {
                (false, ..) if doings.orders.last() == Some(&"take off") => Hands::Ours,
                (false, ..) => Hands::Nobody,
                (_, true, _) => Hands::Pilot,
                (_, _, true) => Hands::GivenBack,
                _ => Hands::Ours,
            },
            hindrance: doings.hindrance.clone(),
            ..AircraftState::default()
        })
    }

    fn take_off(&mut self, _up_m: f64) -> Result<(), SimError> {
        let mut doings = self.doings.borrow_mut();
        doings.orders.push("take off");
        doings.airborne = !doings.refuses;
        Ok(())
    }

    fn take_over(&mut self) -> Result<(), SimError> {
        let mut doings = self.doings.borrow_mut();
        doings.orders.push("take over");
        doings.dropped &= !doings.yields;
        Ok(())
    }

    fn return_to_launch(&mut self) -> Result<(), SimError> {
        let mut doings = self.doings.borrow_mut();
        doings.orders.push("return");
        doings.airborne = false;
        Ok(())
    }

    fn photograph(&mut self) -> Result<(), SimError> {
        self.doings.borrow_mut().pictures += 1;
        Ok(())
    }

    fn device_failure(&mut self) -> Option<SimError> {
        self.doings.borrow_mut().corrections_fail.take()
    }

    fn picture_failure(&mut self) -> Option<SimError> {
        self.doings.borrow_mut().camera_fails.take()
    }
}

struct Field {
    world: World,
    mission: Mission<Shared<Lifted>, BoxedSource>,
    doings: Vec<Rc<RefCell<Doings>>>,
    events: Vec<Event>,
}

impl Field {
    fn new(rules: FlightRules) -> Self {
        let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
        let registry = Registry::builtin();
        let estimator = registry.estimator("ekf").expect("it is known");
        let world = World::new(&scenario.world, 1).expect("a world");
        let sources = scenario.sources(&registry, &world).expect("sources");
        let doings: Vec<Rc<RefCell<Doings>>> = sources.iter().map(|_| Rc::default()).collect();
        let drones = sources.into_iter().enumerate().map(|(drone, source)| {
            let vehicle = world.vehicle(drone).expect("there is one");
            let aircraft = Shared::new(Lifted { vehicle, doings: doings[drone].clone() });
            FlownDrone::new(format!("drone {drone}"), aircraft, source)
        });
        let parts = scenario.parts(&registry, estimator, 1).expect("parts");
        let hunt = parts.build().expect("a hunt");
        let mission = Mission::new(rules, hunt, drones.collect(), 0.0).expect("a flight");
        Self { world, mission, doings, events: Vec::new() }
    }

    /// Lets time pass, at most `seconds`, until `done`.
    fn run(&mut self, seconds: f64, mut done: impl FnMut(&Self) -> bool) {
        let until = self.world.time() + seconds;
        while self.world.time() < until && !done(self) {
            self.world.advance(0.02).expect("time passes");
            self.mission.step(self.world.time());
            while let Some(event) = self.mission.poll_event() {
                self.events.push(event);
            }
        }
    }

    fn stages(&self) -> Vec<FlightStage> {
        let stage = |event: &Event| match event {
            Event::FlightStage { stage, .. } => Some(*stage),
            _ => None,
        };
        self.events.iter().filter_map(stage).collect()
    }
}

#[test]
fn a_flight_goes_from_the_ground_to_the_ground() {
    let mut field = Field::new(FlightRules { at_end: Ending::Land, ..FlightRules::default() });
    field.run(2000.0, |field| field.mission.is_over());
    use FlightStage::{Climbing, Hunting, Leaving, Over, Preparing};
    assert_eq!(field.stages(), [Preparing, Climbing, Hunting, Leaving, Over]);
    assert_eq!(field.mission.failure(), None);
    assert_eq!(field.mission.hunt().fixes().len(), 2);
    for doings in &field.doings {
        let orders = &doings.borrow().orders;
        assert_eq!((orders[0], orders[orders.len() - 1]), ("take off", "land"), "{orders:?}");
        assert_eq!(doings.borrow().pictures, 2, "one of each beacon");
    }
}

#[test]
fn only_those_in_our_hands_photograph_and_what_fails_is_logged() {
    let mut field = Field::new(FlightRules::default());
    field.run(30.0, |_| false);
    field.doings[0].borrow_mut().pilot = true;
    field.doings[1].borrow_mut().camera_fails = Some(SimError::Drone { drone: 7, drones: 3 });
    let lost = SimError::Drone { drone: 8, drones: 3 };
    let reason = lost.to_string();
    field.doings[2].borrow_mut().corrections_fail = Some(lost);
    field.run(2000.0, |field| field.mission.hunt().fixes().len() == 2);
    let pictures: Vec<u32> = field.doings.iter().map(|doings| doings.borrow().pictures).collect();
    assert_eq!(pictures, [0, 2, 2]);
    let failure = |event: &&Event| matches!(event, Event::DeviceFailed { drone: Some(1), .. });
    assert_eq!(field.events.iter().filter(failure).count(), 1);
    let loss = |event: &&Event| match event {
        Event::DeviceFailed { drone: Some(2), reason: own, .. } => *own == reason,
        _ => false,
    };
    assert_eq!(field.events.iter().filter(loss).count(), 1, "and it flies on");
}

#[test]
fn nobody_leaves_the_ground_before_all_are_ready() {
    let rules = FlightRules { ready_timeout_s: 20.0, ..FlightRules::default() };
    let mut field = Field::new(rules);
    field.doings[1].borrow_mut().hindrance = "no position yet".into();
    field.run(19.0, |_| false);
    assert_eq!(field.stages(), [FlightStage::Preparing]);
    assert!(field.doings.iter().all(|doings| doings.borrow().orders.is_empty()));
    field.run(5.0, |_| false);
    assert!(field.mission.is_over());
    assert_eq!(field.mission.failure(), Some("drone 1 is not ready: no position yet"));
    assert!(field.doings.iter().all(|doings| doings.borrow().orders.is_empty()));
}

#[test]
fn they_wait_for_go() {
    let mut field = Field::new(FlightRules::default());
    field.mission.wait_for_go(true);
    field.run(400.0, |_| false);
    assert!(field.mission.is_ready(), "a drone that waits for go is not given up");
    field.mission.go();
    field.run(1.0, |_| false);
    assert_eq!(field.mission.stage(), FlightStage::Hunting);
}

#[test]
fn breaking_off_brings_down_all_but_the_pilots_own() {
    let rules = FlightRules { at_end: Ending::Land, ..FlightRules::default() };
    let mut field = Field::new(rules);
    field.run(30.0, |_| false);
    assert_eq!(field.mission.stage(), FlightStage::Hunting);
    field.doings[2].borrow_mut().pilot = true;
    field.mission.abort(field.world.time(), "enough");
    field.run(1.0, |_| false);
    for (doings, last) in field.doings.iter().zip(["return", "return", "take off"]) {
        let doings = doings.borrow();
        let orders: Vec<_> = doings.orders.iter().filter(|order| **order != "go to").collect();
        assert_eq!(*orders[orders.len() - 1], last);
    }
    assert!(field.mission.is_over());
    let words = "enough; drone 2 is left to its pilot, who has it in LOITER; he keeps it";
    assert_eq!(field.mission.failure(), Some(words));
}

#[test]
fn an_aircraft_is_taken_again_in_the_mode_in_which_it_was_ours() {
    let mut field = Field::new(FlightRules::default());
    field.run(30.0, |_| false);
    field.doings[0].borrow_mut().pilot = true;
    field.doings[1].borrow_mut().dropped = true;
    field.run(5.0, |_| false);
    let requested = |drone: usize| {
        field.doings[drone].borrow().orders.iter().filter(|order| **order == "take over").count()
    };
    assert_eq!([requested(0), requested(2)], [0, 0], "the pilot has chosen another mode");
    assert!((2..=3).contains(&requested(1)), "its link is back: {}", requested(1));
}

#[test]
fn a_take_off_that_is_broken_off_ends_for_all() {
    let mut field = Field::new(FlightRules { on_abort: Ending::Land, ..FlightRules::default() });
    field.doings[1].borrow_mut().refuses = true;
    field.run(3.0, |_| false);
    assert_eq!(field.mission.stage(), FlightStage::Climbing, "one does not leave the ground");
    field.mission.abort(field.world.time(), "not today");
    field.run(1.0, |_| false);
    for doings in &field.doings {
        let orders = &doings.borrow().orders;
        assert_eq!(orders.last(), Some(&"land"), "on the ground or not: {orders:?}");
    }
    assert!(field.mission.is_over());
}

#[test]
fn a_drone_whose_link_was_lost_is_brought_down_with_the_others() {
    let mut field = Field::new(FlightRules::default());
    field.run(30.0, |_| false);
    field.doings[1].borrow_mut().dropped = true;
    field.mission.abort(field.world.time(), "enough");
    field.run(1.0, |_| false);
    assert_eq!(field.doings[1].borrow().orders.last(), Some(&"return"));
    assert!(field.mission.is_over());
}

#[test]
fn holding_is_an_order_and_lasts_until_the_pilot_has_them() {
    let mut field = Field::new(FlightRules { on_abort: Ending::Hold, ..FlightRules::default() });
    field.run(30.0, |_| false);
    field.mission.abort(field.world.time(), "hold it");
    field.run(20.0, |_| false);
    assert_eq!(field.mission.stage(), FlightStage::Leaving, "they are served until then");
    for doings in &field.doings {
        assert_eq!(doings.borrow().orders.last(), Some(&"go to"), "to where they are");
        doings.borrow_mut().pilot = true;
    }
    field.run(1.0, |_| false);
    assert!(field.mission.is_over());
}

#[test]
fn what_somebody_else_flies_ends_a_flight_before_it_begins() {
    for (pilot, words) in [(true, "LOITER"), (false, "GUIDED")] {
        let mut field = Field::new(FlightRules::default());
        {
            let mut doings = field.doings[2].borrow_mut();
            (doings.airborne, doings.pilot, doings.dropped) = (true, pilot, true);
        }
        field.run(10.0, |_| false);
        assert!(field.mission.is_over());
        let why = field.mission.failure().expect("it did not fly");
        assert!(why.starts_with("drone 2 is in the air in ") && why.contains(words), "{why}");
        assert!(field.doings.iter().all(|doings| doings.borrow().orders.is_empty()));
    }
    // A take-over is allowed.
    let mut field = Field::new(FlightRules::default());
    {
        let mut doings = field.doings[2].borrow_mut();
        (doings.airborne, doings.dropped, doings.yields) = (true, true, true);
    }
    field.mission.allow_take_over();
    field.run(5.0, |_| false);
    assert_eq!(field.mission.stage(), FlightStage::Hunting);
    assert_eq!(field.doings[2].borrow().orders[0], "take over");
}

#[test]
fn a_drone_that_is_down_takes_no_part_and_the_last_one_ends_the_flight() {
    let mut field = Field::new(FlightRules::default());
    field.run(30.0, |_| false);
    field.doings[0].borrow_mut().airborne = false;
    field.run(0.1, |_| false);
    let orders = field.doings[0].borrow().orders.len();
    let from = field.events.len();
    field.run(200.0, |field| field.mission.is_over());
    assert_eq!(field.doings[0].borrow().orders.len(), orders, "it is sent nowhere");
    let received = |event: &Event| matches!(event, Event::Received { drone: 0, .. });
    assert!(!field.events[from..].iter().any(received), "it does not listen on the ground");
    assert!(field.events[from..].iter().any(|event| matches!(event, Event::Received { .. })));
    assert_eq!(field.mission.stage(), FlightStage::Hunting);
    for drone in [1, 2] {
        field.doings[drone].borrow_mut().airborne = false;
    }
    field.run(1.0, |_| false);
    assert!(field.mission.is_over());
    assert_eq!(field.mission.failure(), Some("all drones are on the ground"));
}

#[test]
fn a_flight_without_any_drone_ends() {
    let mut field = Field::new(FlightRules::default());
    field.run(30.0, |_| false);
    for doings in &field.doings {
        doings.borrow_mut().broken = true;
    }
    let begun = field.world.time();
    field.run(300.0, |field| field.mission.stage() != FlightStage::Hunting);
    let took = field.world.time() - begun;
    assert!((29.0..31.0).contains(&took), "{took} s");
    // What the pilot flies may be given back.
    let mut field = Field::new(FlightRules::default());
    field.run(30.0, |_| false);
    for doings in &field.doings {
        doings.borrow_mut().pilot = true;
    }
    field.run(500.0, |_| false);
    assert_eq!(field.mission.stage(), FlightStage::Hunting);
    assert!(field.mission.hunt().fixes().is_empty(), "nothing is given up meanwhile");
    for doings in &field.doings {
        doings.borrow_mut().pilot = false;
    }
    field.run(2000.0, |field| field.mission.is_over());
    assert_eq!((field.mission.failure(), field.mission.hunt().fixes().len()), (None, 2));
}

#[test]
fn a_rule_that_cannot_be_is_named() {
    let rules = FlightRules { takeoff_up_m: f64::NAN, ..FlightRules::default() };
    let error = rules.check().expect_err("not a number");
    assert!(error.name == "takeoff_up_m" && error.value.is_nan(), "{error}");
    let hunt = || {
        let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
        let registry = Registry::builtin();
        let estimator = registry.estimator("ekf").expect("it is known");
        scenario.parts(&registry, estimator, 1).expect("parts").build().expect("a hunt")
    };
    let refused = Mission::<Shared<Lifted>, BoxedSource>::new(rules, hunt(), Vec::new(), 0.0);
    let error = refused.expect_err("not a number").to_string();
    assert_eq!(error, "flight.takeoff_up_m is NaN; it must be a positive number");
    let rules = FlightRules::default();
    let nobody = Mission::<Shared<Lifted>, BoxedSource>::new(rules, hunt(), Vec::new(), 0.0);
    assert_eq!(nobody.err(), Some(MissionError::NoDrone));
}
