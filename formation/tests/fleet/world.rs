//! Random fleets in random airspaces, whose drones fly, stray, get stuck, fall silent, and miss
//! orders.

use foxhunt_formation::{Airspace, AirspaceConfig, KeepOut, Order, Traffic, TrafficConfig, Travel};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, rngs::Xoshiro256PlusPlus};

/// Seconds between two looks.
pub(crate) const DT: f64 = 0.05;

/// A drone that flies straight to where it was ordered, gets stuck, and takes a while to turn.
/// Where it truly is it strays from where it reports to be.
pub(crate) struct Drone {
    line: Vector3<f64>,
    stray: Vector2<f64>,
    goal: Vector3<f64>,
    /// Next goal after it has braked, and the way to brake.
    next: Option<(Vector3<f64>, f64)>,
    pub(crate) speed: f64,
    stuck: u32,
    silent: u32,
    deaf: u32,
}

impl Drone {
    pub(crate) fn place(&self) -> Vector3<f64> {
        self.line + Vector3::new(self.stray.x, self.stray.y, 0.0)
    }

    fn order(&mut self, to: Vector3<f64>, braking: f64) {
        let flies = (self.goal - self.line).norm() > 1e-9;
        let braking = self.next.map_or(braking, |(_, left)| left);
        self.next = flies.then_some((to, braking));
        if !flies {
            self.goal = to;
        }
    }

    fn fly(&mut self, dt: f64, tolerance: f64, rng: &mut Xoshiro256PlusPlus) {
        let wander = Vector2::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
        self.stray = (self.stray + wander * 0.05 * tolerance).cap_magnitude(0.3 * tolerance);
        if self.stuck > 0 {
            self.stuck -= 1;
            // One that does not move does not have to brake.
            if let Some((to, _)) = self.next.take() {
                self.goal = to;
            }
            return;
        }
        let step = (self.goal - self.line).cap_magnitude(self.speed * dt);
        self.line += step;
        if let Some((to, braking)) = &mut self.next {
            *braking -= step.norm();
            if *braking <= 0.0 || step.norm() < 1e-12 {
                self.goal = *to;
                self.next = None;
            }
        }
    }
}

pub(crate) struct World {
    pub(crate) truth: Airspace,
    pub(crate) traffic: Traffic,
    pub(crate) drones: Vec<Drone>,
    pub(crate) homes: Vec<Vector3<f64>>,
    pub(crate) extent: f64,
    pub(crate) separation: f64,
}

pub(crate) fn place(rng: &mut Xoshiro256PlusPlus, extent: f64) -> Vector3<f64> {
    let mut coordinate = || rng.random_range(-extent..extent);
    Vector3::new(coordinate(), coordinate(), rng.random_range(0.0..12.0))
}

pub(crate) fn airspace(rng: &mut Xoshiro256PlusPlus, extent: f64) -> AirspaceConfig {
    let corners = rng.random_range(4..10_u32);
    let star = |rng: &mut Xoshiro256PlusPlus| -> Vec<[f64; 2]> {
        let corner = |index: u32| {
            let angle = std::f64::consts::TAU * f64::from(index) / f64::from(corners);
            let radius = extent * rng.random_range(0.35..1.0);
            [radius * angle.cos(), radius * angle.sin()]
        };
        (0..corners).map(corner).collect()
    };
    let fence_m = if rng.random_bool(0.8) { star(rng) } else { vec![] };
    let zones = rng.random_range(0..4);
    let zone = |_| {
        let centre = place(rng, 0.7 * extent);
        if rng.random_bool(0.5) {
            KeepOut::Disc {
                centre_m: [centre.x, centre.y],
                radius_m: rng.random_range(0.03..0.2) * extent,
            }
        } else {
            let size = rng.random_range(0.05..0.2) * extent;
            let corner = |[x, y]: [f64; 2]| [centre.x + size * x, centre.y + size * y];
            let arrow = [[0.0, 1.0], [-1.0, -1.0], [0.0, -0.3], [1.0, -1.0]];
            KeepOut::Polygon { corners_m: arrow.map(corner).to_vec() }
        }
    };
    let keep_out = (0..zones).map(zone).collect();
    let altitude_m = rng.random_bool(0.5).then_some([2.0, 10.0]);
    AirspaceConfig { fence_m, keep_out, altitude_m }
}

/// None where the random airspace has no room for the fleet.
pub(crate) fn world(rng: &mut Xoshiro256PlusPlus) -> Option<World> {
    let extent = rng.random_range(10.0..80.0);
    let config = airspace(rng, extent);
    let truth = Airspace::new(&config).ok()?;
    let config = TrafficConfig {
        separation_m: rng.random_range(0.5..4.0),
        tolerance_m: rng.random_range(0.2..1.0),
        stopping_m: if rng.random_bool(0.3) { 0.0 } else { rng.random_range(0.0..3.0) },
        void: None,
    };
    let count = rng.random_range(1..9);
    let keep = config.separation_m + 2.0 * config.tolerance_m;
    let mut positions: Vec<Vector3<f64>> = vec![];
    for _ in 0..2000 {
        let start = place(rng, extent);
        let start = Vector3::new(start.x, start.y, start.z.min(10.0));
        // Some begin nearer to the fence than they should be.
        let free = truth.clearance(&start.xy()) >= 0.5 * config.tolerance_m;
        if free && positions.iter().all(|p| (p - start).xy().norm() >= keep) {
            positions.push(start);
        }
        if positions.len() == count {
            break;
        }
    }
    let traffic = Traffic::new(&truth, config, &positions).ok()?;
    let drone = |&line: &Vector3<f64>| Drone {
        line,
        stray: Vector2::zeros(),
        goal: line,
        next: None,
        speed: rng.random_range(0.5..5.0),
        stuck: 0,
        silent: 0,
        deaf: 0,
    };
    let drones = positions.iter().map(drone).collect();
    let separation = config.separation_m;
    let homes = traffic.homes(&positions);
    Some(World { truth, traffic, drones, homes, extent, separation })
}

impl World {
    pub(crate) fn send(&mut self, rng: &mut Xoshiro256PlusPlus) {
        let all = self.drones.len();
        match rng.random_range(0..10) {
            0..6 => {
                let taking_part: Vec<usize> = (0..all).filter(|_| rng.random_bool(0.8)).collect();
                let spread = rng.random_range(0.05..1.0) * self.extent;
                let places: Vec<_> = taking_part.iter().map(|_| place(rng, spread)).collect();
                let formation = self.traffic.form(&taking_part, &places).expect("drones exist");
                self.traffic.depart(&formation).expect("drones exist");
            }
            6 => {
                let drone = rng.random_range(0..all);
                if rng.random_bool(0.5) {
                    self.traffic.hold(drone).expect("the drone exists");
                }
                if rng.random_bool(0.5) {
                    self.traffic.give_up(drone).expect("the drone exists");
                }
            }
            7 => {
                let goal = place(rng, self.extent);
                self.traffic.go(rng.random_range(0..all), &goal).expect("the drone exists");
            }
            _ => {
                for drone in 0..all {
                    self.traffic.recall(drone, &self.homes[drone]).expect("the drone exists");
                }
            }
        }
    }

    pub(crate) fn advance(&mut self, rng: &mut Xoshiro256PlusPlus, chaos: bool) {
        let config = *self.traffic.config();
        for (index, drone) in self.drones.iter_mut().enumerate() {
            // As far as it flies between two looks belongs to the tolerance.
            drone.speed = drone.speed.min(0.2 * config.tolerance_m / DT);
            if chaos && rng.random_bool(0.002) {
                drone.stuck = rng.random_range(1..200);
            }
            if chaos && rng.random_bool(0.002) {
                drone.silent = rng.random_range(1..200);
            }
            if chaos && rng.random_bool(0.002) {
                drone.deaf = rng.random_range(1..200);
            }
            drone.deaf = drone.deaf.saturating_sub(1);
            drone.fly(DT, config.tolerance_m, rng);
            if drone.silent > 0 {
                drone.silent -= 1;
            } else {
                self.traffic.locate(index, &drone.line);
            }
        }
        for Order { drone, to, .. } in self.traffic.step() {
            if self.drones[drone].deaf > 0 {
                self.traffic.repeat(drone).expect("the drone exists");
            } else {
                self.drones[drone].order(to, 0.6 * config.stopping_m);
            }
        }
    }

    pub(crate) fn check(&self, seed: u64) {
        for (index, drone) in self.drones.iter().enumerate() {
            let here = drone.place();
            let clearance = self.truth.clearance(&here.xy());
            assert!(clearance >= -1e-6, "seed {seed}: drone {index} is {clearance} m inside");
            for (other, second) in self.drones.iter().enumerate().skip(index + 1) {
                let apart = (here - second.place()).xy().norm();
                assert!(
                    apart >= self.separation - 1e-6,
                    "seed {seed}: {index} and {other} are {apart} m apart, not {}",
                    self.separation
                );
            }
        }
    }

    pub(crate) fn settled(&self) -> bool {
        let states = (0..self.drones.len()).map(|drone| self.traffic.status(drone));
        let mut states = states;
        states.all(|state| matches!(state, Travel::There | Travel::Blocked))
    }
}
