use approx::abs_diff_eq;
use foxhunt_core::{Belief, Estimate};
use foxhunt_formation::{
    Airspace, AirspaceConfig, MovedReason, Traffic, TrafficConfig, TrafficError, Void,
};
use nalgebra::{Vector2, Vector3};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::{airspace::corner, void::true_mass, world};

/// Lines keep 3 m.
fn traffic(airspace: &AirspaceConfig, positions: &[Vector3<f64>], void: Option<Void>) -> Traffic {
    let airspace = Airspace::new(airspace).expect("an airspace");
    let config = TrafficConfig { void, ..TrafficConfig::default() };
    Traffic::new(&airspace, config, positions).expect("the drones are apart")
}

fn at(east: f64, north: f64) -> Vector3<f64> {
    Vector3::new(east, north, 4.0)
}

#[test]
fn places_are_moved_no_farther_than_needed() {
    let config = AirspaceConfig { altitude_m: Some([3.0, 6.0]), ..corner() };
    let traffic = traffic(&config, &[at(5.0, 5.0), at(15.0, 5.0), at(5.0, 15.0)], None);
    let wanted = [at(5.0, 25.0), at(13.0, 5.0), Vector3::new(1.0, 1.0, 9.0)];
    // The third drone stays where it is and is kept away from.
    let formation = traffic.form(&[1, 0], &wanted[..2]).expect("two drones");
    assert_eq!(formation.drones, [1, 0]);
    let moved = |formation: &foxhunt_formation::Formation, reason| {
        *formation.moved.iter().find(|moved| moved.reason == reason).expect("it was moved so")
    };
    let by_fence = moved(&formation, MovedReason::Airspace);
    assert_eq!(by_fence.wanted, wanted[0]);
    let (east, north) = (by_fence.goal.x - 5.0, by_fence.goal.y - 15.0);
    assert!(abs_diff_eq!(by_fence.goal.y, 19.5, epsilon = 0.01), "by the tolerance inside");
    assert!(east.hypot(north) >= 3.0, "3 m from the drone at (5, 15)");
    assert_eq!(formation.moved.len(), 1);
    assert!(formation.goals.contains(&wanted[1]));

    let alone = traffic.form(&[0], &wanted[2..]).expect("one drone");
    let by_band = moved(&alone, MovedReason::Altitude);
    assert_eq!(by_band.goal, Vector3::new(1.0, 1.0, 6.0));

    let by_drone = traffic.form(&[0], &[at(14.0, 5.0)]).expect("one drone");
    let by_drone = moved(&by_drone, MovedReason::Drone).goal;
    assert!((by_drone - at(12.0, 5.0)).norm() < 0.01, "straight away from it: {by_drone}");

    let together = traffic.form(&[0, 1], &[at(5.0, 5.0), at(5.0, 5.0)]).expect("two drones");
    let apart = (together.goals[0] - together.goals[1]).xy().norm();
    assert!((3.0..3.1).contains(&apart), "{apart}");
    assert_eq!(
        moved(&together, MovedReason::Separation).drone,
        1,
        "the first place is the nearest's"
    );
}

#[test]
fn where_there_is_no_room_a_drone_stays() {
    let narrow = AirspaceConfig {
        fence_m: vec![[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [0.0, 2.0]],
        ..AirspaceConfig::default()
    };
    let traffic = traffic(&narrow, &[at(1.0, 1.0), at(4.5, 1.0)], None);
    let formation = traffic.form(&[0, 1], &[at(3.0, 1.0), at(3.0, 1.0)]).expect("two drones");
    let stays = formation.moved.iter().find(|m| m.reason == MovedReason::NoPlace).expect("one");
    assert_eq!(stays.goal, traffic.place(stays.drone).expect("it is there"));
}

#[test]
fn targets_are_kept_away_from() {
    let belief = Estimate::isotropic(Vector2::new(0.0, 0.0), 4.0);
    let void = Void { radius_m: 10.0, probability: 0.3 };
    let mut traffic = traffic(&AirspaceConfig::default(), &[at(-40.0, 0.0)], Some(void));
    let free = traffic.form(&[0], &[at(-5.0, 0.0)]).expect("one drone");
    assert!(free.moved.is_empty(), "nothing is believed yet");
    traffic.believe([&belief as &dyn Belief]);
    let kept = traffic.form(&[0], &[at(-5.0, 0.0)]).expect("one drone");
    assert_eq!(kept.moved[0].reason, MovedReason::Void);
    let goal = kept.goals[0].xy();
    let near = true_mass(&belief, goal, 10.0);
    assert!(near <= 0.32, "{near}");
    assert!((goal - Vector2::new(-5.0, 0.0)).norm() < 9.0, "no farther than needed: {goal}");
}

/// Seeded: 300 random worlds; what `form` promises holds in each.
#[test]
fn goals_are_permitted_and_apart() {
    for seed in 0..300 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let Some(world) = world::world(&mut rng) else { continue };
        let traffic = &world.traffic;
        let drones: Vec<usize> = (0..traffic.drones()).step_by(2).collect();
        let places: Vec<_> =
            drones.iter().map(|_| world::place(&mut rng, 0.3 * world.extent)).collect();
        let formation = traffic.form(&drones, &places).expect("drones exist");
        let keep = traffic.config().separation_m + 2.0 * traffic.config().tolerance_m;
        let stays = |drone: usize| {
            formation.moved.iter().any(|m| m.drone == drone && m.reason == MovedReason::NoPlace)
        };
        let resting = (0..traffic.drones()).filter(|d| !drones.contains(d));
        let resting: Vec<_> = resting.filter_map(|d| traffic.place(d)).collect();
        let goals: Vec<_> = formation.iter().filter(|(drone, _)| !stays(*drone)).collect();
        for (index, (_, goal)) in goals.iter().enumerate() {
            assert!(traffic.airspace().permits(goal), "seed {seed}");
            let others = goals[..index].iter().map(|(_, other)| other).chain(&resting);
            for other in others {
                assert!((goal - other).xy().norm() >= keep - 1e-6, "seed {seed}");
            }
        }
    }
}

#[test]
fn wrong_questions_are_refused() {
    let traffic = traffic(&AirspaceConfig::default(), &[at(0.0, 0.0), at(9.0, 0.0)], None);
    let refused = |drones: &[usize], places: &[Vector3<f64>]| {
        traffic.form(drones, places).expect_err("a wrong question")
    };
    let here = at(0.0, 0.0);
    assert_eq!(refused(&[0], &[]), TrafficError::Places { places: 0, drones: 1 });
    assert_eq!(refused(&[2], &[here]), TrafficError::Drone { drone: 2, drones: 2 });
    assert_eq!(refused(&[1, 1], &[here, here]), TrafficError::Drone { drone: 1, drones: 2 });
    assert!(matches!(
        refused(&[1], &[at(f64::NAN, 0.0)]),
        TrafficError::NotFinite { drone: 1, .. }
    ));
    assert_eq!(traffic.form(&[], &[]), Ok(foxhunt_formation::Formation::default()));
}
