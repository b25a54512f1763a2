//! Plays random fleets through the traffic and checks the truth: nobody comes too near to another,
//! leaves the fence, or enters a keep-out, and everyone is there or blocked in the end.

use foxhunt_formation::Travel;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::world::world;

/// Steps after which chaos ends, and further steps until everyone has arrived or is blocked.
const CHAOS: u32 = 600;
const PATIENCE: u32 = 20_000;

/// Returns the number of drones, and how many ended blocked.
fn episode(seed: u64) -> Option<(usize, usize)> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut world = world(&mut rng)?;
    world.send(&mut rng);
    for _ in 0..CHAOS {
        if rng.random_bool(0.01) {
            world.send(&mut rng);
        }
        world.advance(&mut rng, true);
        world.check(seed);
    }
    for _ in 0..PATIENCE {
        world.advance(&mut rng, false);
        world.check(seed);
        if world.settled() {
            let all = world.drones.len();
            let blocked =
                (0..all).filter(|&drone| world.traffic.status(drone) == Travel::Blocked).count();
            return Some((all, blocked));
        }
    }
    let states: Vec<_> = (0..world.drones.len()).map(|d| world.traffic.status(d)).collect();
    panic!("seed {seed}: not settled: {states:?}");
}

/// Returns the number of episodes played, of their drones, and of the drones that ended blocked.
fn play(seeds: std::ops::Range<u64>) -> [usize; 3] {
    let (mut played, mut drones, mut blocked) = (0, 0, 0);
    for seed in seeds {
        if let Some((all, not_there)) = episode(seed) {
            played += 1;
            drones += all;
            blocked += not_there;
        }
    }
    // Goals that are outside, or walled off by others, are blocked; most are not.
    assert!(blocked * 5 < drones, "{blocked} of {drones} drones ended blocked");
    [played, drones, blocked]
}

#[test]
fn nobody_comes_too_near_and_everyone_ends() {
    let [played, ..] = play(0..500);
    assert!(played > 400, "{played} episodes");
}

#[test]
#[ignore = "campaign: 20 000 fleets, some minutes"]
fn nobody_comes_too_near_in_a_campaign() {
    let [played, drones, blocked] = play(1000..21_000);
    println!("{played} episodes, {drones} drones, {blocked} blocked");
}
