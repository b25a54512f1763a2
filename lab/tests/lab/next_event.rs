//! A simulation that goes from event to event is the one that looks at everything at every tick.

use std::{cell::Cell, convert::Infallible, rc::Rc};

use foxhunt_core::{BeaconId, PatternSource, Pose, SteadyMotion, Sweep, Vehicle, Waypoint};
use foxhunt_hunt::{
    hunt::Drone,
    registry::Registry,
    scenario::{Scenario, random_fleet},
};
use foxhunt_lab::simulation::{Setup, fly};
use foxhunt_sim::{DroneConfig, Interval, World};

/// The number of times that devices were polled.
type Polls = Rc<Cell<u32>>;

/// A device that counts how often it is polled, and may keep its next event to itself, as a user's
/// own does.
struct Counted<D> {
    device: D,
    foresees: bool,
    polls: Polls,
}

impl<S: PatternSource> PatternSource for Counted<S> {
    type Error = S::Error;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), S::Error> {
        self.device.begin(beacons)
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, S::Error> {
        self.polls.set(self.polls.get() + 1);
        self.device.poll()
    }

    fn next_event(&self) -> Option<f64> {
        self.device.next_event().filter(|_| self.foresees)
    }
}

impl<V: Vehicle> Vehicle for Counted<V> {
    type Error = V::Error;

    fn pose(&mut self) -> Result<Pose, V::Error> {
        self.polls.set(self.polls.get() + 1);
        self.device.pose()
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), V::Error> {
        self.device.go_to(goal)
    }

    fn land(&mut self) -> Result<(), V::Error> {
        self.device.land()
    }

    fn steady_motion(&self) -> Option<SteadyMotion> {
        self.device.steady_motion().filter(|_| self.foresees)
    }
}

/// The events of a hunt, how long it took, and how often its devices were polled.
fn flown(scenario: &Scenario, seed: u64, foresees: bool) -> (Vec<String>, f64, u32) {
    let registry = Registry::builtin();
    let estimator = registry.estimator("ukf-pritzl2018").expect("it is built in");
    let setup = Setup { scenario, estimator, registry: &registry };
    let world = World::new(&scenario.world, seed).expect("in order");
    let parts = scenario.parts(setup.registry, estimator, seed).expect("in order");
    let mut hunt = parts.build().expect("in order");
    let polls = Polls::default();
    let mut drones = Vec::new();
    for (drone, source) in
        scenario.sources(&registry, &world).expect("in order").into_iter().enumerate()
    {
        let vehicle = world.vehicle(drone).expect("it is there");
        drones.push(Drone {
            source: Counted { device: source, foresees, polls: polls.clone() },
            vehicle: Counted { device: vehicle, foresees, polls: polls.clone() },
        });
    }
    let mut events = Vec::new();
    let flown = fly(&mut hunt, &world, &mut drones, scenario.simulation, |event| {
        events.push(format!("{event:?}"));
        Ok::<_, Infallible>(())
    });
    (events, flown.expect("it ends").duration_s, polls.get())
}

/// Flies both ways; how many polls it took event by event and tick by tick.
fn same_both_ways(scenario: &Scenario, seed: u64) -> [u32; 2] {
    let (events, duration, few) = flown(scenario, seed, true);
    let (expected, expected_duration, many) = flown(scenario, seed, false);
    let name = &scenario.name;
    for (event, expected) in events.iter().zip(&expected) {
        assert_eq!(event, expected, "{name}, seed {seed}");
    }
    assert_eq!(events.len(), expected.len(), "{name}, seed {seed}");
    assert_eq!(duration.to_bits(), expected_duration.to_bits(), "{name}, seed {seed}");
    [few, many]
}

fn scenario(name: &str) -> Scenario {
    Scenario::find(name).expect("it is built in")
}

#[test]
fn hunts_are_the_same_with_fewer_polls() {
    for name in ["pritzl-6.1", "three-beacons", "rough-field"] {
        let [few, many] = same_both_ways(&scenario(name), 1);
        assert!(6 * few < many, "{name}: {few} of {many} polls");
    }
    // A body that turns with its antenna has something to do at every tick.
    same_both_ways(&scenario("pritzl-7.5"), 1);
    // Pulses come each second, and nothing turns: drones that fly are what is polled most.
    same_both_ways(&scenario("avalanche"), 1);
}

#[test]
fn who_watches_sees_every_tick_of_a_flight() {
    let scenario = scenario("pritzl-6.1");
    let registry = Registry::builtin();
    let estimator = registry.estimator("ukf-pritzl2018").expect("it is built in");
    let setup = Setup { scenario: &scenario, estimator, registry: &registry };
    let mut before = None;
    let mut farthest = 0.0_f64;
    let mut moved = 0.0;
    let watch = |world: &World| {
        let here = world.pose(0).expect("it is there").position;
        let step = (here - before.replace(here).unwrap_or(here)).norm();
        farthest = farthest.max(step);
        moved += step;
    };
    let flown = setup.simulate_watched(1, |_| Ok::<_, Infallible>(()), watch);
    let alone = setup.simulate(1, |_| Ok::<_, Infallible>(()));
    let [flown, alone] = [flown, alone].map(|flown| flown.expect("it ends").duration_s.to_bits());
    assert_eq!(flown, alone);
    // 2 m/s over ground and 1 m/s up for 10 ms.
    assert!(moved > 10.0 && farthest < 0.0225, "{farthest} m of {moved} m at once");
}

#[test]
fn fleets_with_failures_are_the_same() {
    for seed in [3, 5, 8, 11] {
        same_both_ways(&random_fleet(seed), seed);
    }
}

#[test]
fn drones_that_fail_while_others_listen_are_found_in_time() {
    let interval = |from_s, to_s| vec![Interval { from_s, to_s: Some(to_s) }];
    let mut broken = scenario("pritzl-6.1");
    let changes: [fn(&mut DroneConfig, Vec<Interval>); 3] = [
        |drone, when| drone.lost = when,
        |drone, when| drone.stuck = when,
        |drone, when| drone.silent = when,
    ];
    for (drone, change) in broken.world.drones.iter_mut().zip(changes) {
        change(drone, interval(3.005, 47.0));
        drone.late_s = 0.7;
    }
    let [few, many] = same_both_ways(&broken, 2);
    assert!(few < many);
    // The time of a turn is up while it goes on, and so is the budget of a search.
    let mut hurried = scenario("three-beacons");
    hurried.hunt.turn_timeout_s = 4.0;
    hurried.hunt.stop.time_s = Some(61.234);
    same_both_ways(&hurried, 3);
}
