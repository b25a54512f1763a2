//! Cost of the traffic: a look at 8 drones, and new ways for all of them.

use std::f64::consts::TAU;

use criterion::{Criterion, criterion_group, criterion_main};
use foxhunt_formation::{Airspace, AirspaceConfig, KeepOut, Traffic, TrafficConfig};
use nalgebra::Vector3;

fn ring(radius: f64, turn: f64) -> Vec<Vector3<f64>> {
    let place = |index: u32| {
        let angle = TAU / 8.0 * f64::from(index) + turn;
        Vector3::new(radius * angle.cos(), radius * angle.sin(), 4.0)
    };
    (0..8).map(place).collect()
}

/// 8 drones in a field with a notch, 3 trees and a house.
fn traffic() -> Traffic {
    let tree = |east: f64, north: f64| KeepOut::Disc { centre_m: [east, north], radius_m: 3.0 };
    let house = vec![[15.0, 15.0], [25.0, 15.0], [25.0, 22.0], [15.0, 22.0]];
    let config = AirspaceConfig {
        fence_m: vec![[-60.0, -60.0], [60.0, -60.0], [60.0, 60.0], [0.0, 35.0], [-60.0, 60.0]],
        keep_out: vec![
            tree(0.0, 0.0),
            tree(-15.0, 20.0),
            tree(20.0, -15.0),
            KeepOut::Polygon { corners_m: house },
        ],
        altitude_m: Some([2.0, 30.0]),
    };
    let airspace = Airspace::new(&config).expect("a field");
    Traffic::new(&airspace, TrafficConfig::default(), &ring(10.0, 0.0)).expect("8 drones apart")
}

fn look(c: &mut Criterion) {
    let mut traffic = traffic();
    let drones: Vec<usize> = (0..8).collect();
    let formation = traffic.form(&drones, &ring(30.0, 2.0)).expect("8 drones");
    traffic.depart(&formation).expect("8 drones");
    traffic.step();
    let places: Vec<_> = drones.iter().filter_map(|&drone| traffic.place(drone)).collect();
    c.bench_function("traffic/look at 8", |b| {
        b.iter(|| {
            for (drone, place) in places.iter().enumerate() {
                traffic.locate(drone, place);
            }
            traffic.step()
        });
    });
}

fn set_off(c: &mut Criterion) {
    let traffic = traffic();
    let drones: Vec<usize> = (0..8).collect();
    c.bench_function("traffic/form 8", |b| b.iter(|| traffic.form(&drones, &ring(30.0, 2.0))));
    let formation = traffic.form(&drones, &ring(30.0, 2.0)).expect("8 drones");
    c.bench_function("traffic/8 set off", |b| {
        b.iter_batched(
            || traffic.clone(),
            |mut traffic| {
                traffic.depart(&formation).expect("8 drones");
                traffic.step()
            },
            criterion::BatchSize::SmallInput,
        );
    });
}

criterion_group!(benches, look, set_off);
criterion_main!(benches);
