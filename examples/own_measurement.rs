//! Your own measurement: round trips give a range in metres, and nothing else. The source
//! measures it, the model names it, and the hunt joins the two by the name of the quantity.
//!
//! `cargo run --example own_measurement`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use std::{convert::Infallible, error::Error};

use foxhunt::{
    core::{OwnedSweep, planner_fn},
    filters::{GridConfig, GridFilter},
    nalgebra::{Vector1, Vector2},
    prelude::*,
    scenario::SimulationConfig,
    sensors::Pritzl2018,
    sim::{SimError, World},
    simulation::fly,
};

// ANCHOR: model
/// The distance over ground, in metres.
#[derive(Clone, Copy)]
struct RoundTrip;

impl MeasurementModel<2, 1> for RoundTrip {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RANGE]
    }

    fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector1<f64> {
        Vector1::new((state.push(0.0) - receiver.position).norm())
    }
}
// ANCHOR_END: model

// ANCHOR: source
/// Answers one second after it is begun; off by 2 m, now too far and now too near. A source with
/// random noise seeds it with `World::source_seed`.
struct Transponder {
    world: World,
    drone: usize,
    pending: Vec<BeaconId>,
    due: f64,
    off: f64,
    lent: OwnedSweep,
}

impl PatternSource for Transponder {
    type Error = SimError;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), SimError> {
        self.pending = beacons.to_vec();
        self.due = self.world.time() + 1.0;
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, SimError> {
        if self.pending.is_empty() || self.world.time() < self.due {
            return Ok(None);
        }
        let beacon = self.pending.remove(0);
        let receiver = self.world.pose(self.drone)?;
        let Some(truth) = self.world.truth(beacon) else { return Ok(None) };
        self.off = -self.off;
        let range = (truth - receiver.position).norm() + self.off;
        let measured = Measured::new(Quantity::RANGE, range, 2.0).into_iter().collect::<Vec<_>>();
        let measured = MeasuredList::new(&measured).unwrap_or_default();
        let time = self.world.time();
        self.lent = OwnedSweep { beacon, time, receiver, measured, ..OwnedSweep::default() };
        Ok(Some(self.lent.as_sweep()))
    }
}
// ANCHOR_END: source

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::find("pritzl-6.1")?;
    let world = World::new(&scenario.world, 1)?;
    // Two of the drones fly a little farther round the estimate with every turn.
    let mut turn = 0.0_f64;
    let planner = planner_fn(move |belief: &dyn Belief, stations: &mut [Station]| {
        turn += 1.0;
        for (share, station) in [0.0, 2.1, 4.2].into_iter().zip(stations) {
            let (sin, cos) = (share + turn).sin_cos();
            let place = belief.position().mean + Vector2::new(cos, sin) * 15.0;
            station.goal.position = place.push(4.0);
        }
        let done = turn % 6.0 < 0.5;
        Ok(if done {
            Decision::Finish(Outcome::PathDone)
        } else {
            Decision::Listen(Stage::Searching)
        })
    });
    let tracks = |search: &Search<'_>| {
        let walk = RandomWalk::uniform(0.02);
        let filter = GridFilter::new(walk, RoundTrip, search.prior, GridConfig::default())?;
        Ok(Track::new::<2, 1>(filter, TrackConfig::default()))
    };
    let parts = Parts::new(Pritzl2018::default(), planner, tracks);
    let parts = parts.with_quantities(&[Quantity::RANGE]);
    let mut hunt = Hunt::new(parts, scenario.beacon_names(), HuntConfig::default())?;
    let mut drones = Vec::new();
    for drone in 0..world.drone_count() {
        let world_of = world.clone();
        let source = Transponder {
            world: world_of,
            drone,
            pending: Vec::new(),
            due: 0.0,
            off: 2.0,
            lent: OwnedSweep::default(),
        };
        drones.push(Drone { source, vehicle: world.vehicle(drone)? });
    }
    let config = SimulationConfig::default();
    let flown = fly(&mut hunt, &world, &mut drones, config, |_event| Ok::<_, Infallible>(()))?;
    for found in &flown.found {
        println!("{}: {:.2} m off from ranges alone", found.fix.name, found.error_m());
    }
    // The same estimator with the sources of the scenario: refused before anything flies.
    let parts = Parts::new(
        Pritzl2018::default(),
        planner_fn(|_: &dyn Belief, _: &mut [Station]| Err(PlanError::NoPlace)),
        tracks,
    );
    let refused = Hunt::new(parts, scenario.beacon_names(), HuntConfig::default());
    println!("without ranges: {}", refused.err().ok_or("it was made")?);
    Ok(())
}
