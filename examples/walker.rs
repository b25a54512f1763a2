//! A person who walks with a turning antenna, a radio and a GNSS receiver, and finds a beacon: no
//! drone. The drivers are the ones for real devices; the devices are emulated, in memory.
//!
//! `cargo run --example walker --features hardware`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use std::error::Error;

use foxhunt::{
    filters::{GridConfig, GridFilter},
    geodesy::LocalFrame,
    hardware::{
        CarriedConfig, CarriedVehicle, GnssConfig, GnssReceiver, Shared, XbeeConfig, XbeeRadio,
    },
    prelude::*,
    sensors::{LogDistance, Pritzl2018, RssBearing, StepperConfig, StepperSource},
    sim::{
        BeaconConfig, DroneConfig, EmulatedGnss, EmulatedGnssConfig, EmulatedXbee,
        EmulatedXbeeConfig, Emulator, World, WorldConfig, xbee_address,
    },
    wire::{memory_pair, xbee::Address},
};

fn main() -> Result<(), Box<dyn Error>> {
    // To the world the person is a drone that keeps to the ground.
    let fox =
        BeaconConfig { name: "fox".into(), east_m: 28.0, north_m: -17.0, ..Default::default() };
    let person = DroneConfig { up_m: 1.5, ..DroneConfig::default() };
    let beacons = vec![fox];
    let drones = vec![person];
    let world = World::new(&WorldConfig { beacons, drones, ..WorldConfig::default() }, 1)?;
    let (radio_port, radio_end) = memory_pair();
    let (gnss_port, gnss_end) = memory_pair();
    // The bearings of the turning antenna need a compass.
    let emulated = EmulatedGnssConfig { compass: true, ..EmulatedGnssConfig::default() };
    let frame = LocalFrame::new(emulated.origin)?;
    let mut devices: [Box<dyn Emulator>; 2] = [
        Box::new(EmulatedXbee::new(&world, 0, EmulatedXbeeConfig::default(), radio_end)?),
        Box::new(EmulatedGnss::new(&world, 0, emulated, 1, gnss_end)?),
    ];
    let mut pass = move |world: &World| -> Result<(), Box<dyn Error>> {
        world.advance(0.01)?;
        devices.iter_mut().try_for_each(|device| Ok(device.serve()?))
    };

    let beacon = BeaconId(0);
    let beacons = vec![Address::Long(xbee_address(beacon).0)];
    let config = XbeeConfig { beacons, ..XbeeConfig::default() };
    let radio = XbeeRadio::new(config, radio_port, world.clock())?;
    let gnss = GnssReceiver::new(GnssConfig::default(), gnss_port, world.clock())?;
    let walker = Shared::new(CarriedVehicle::new(CarriedConfig::default(), gnss, frame));
    let stepper = StepperConfig::pritzl2018();
    let rotator = world.rotator(0)?;
    let mut source = StepperSource::new(stepper, radio, rotator, walker.clone(), world.clock());

    let model = RssBearing::new(LogDistance::pritzl2018_field());
    let prior = Estimate::isotropic(foxhunt::nalgebra::Vector2::zeros(), 20.0);
    let mut belief =
        GridFilter::new(RandomWalk::uniform(0.0), model, prior, GridConfig::default())?;
    let extractor = Pritzl2018::default();
    let truth = world.truth(beacon).ok_or("the world has this beacon")?.xy();
    for leg in 1..=8 {
        source.begin(&[beacon])?;
        let reception = loop {
            pass(&world)?;
            // Before the first fix and the radio's first answer there are errors, and no sweep.
            let Ok(Some(sweep)) = source.poll() else { continue };
            break extractor.extract(&sweep).map(|reading| Reception::new(&sweep, &reading))?;
        };
        let intake = ByQuantity([Quantity::RSS, Quantity::BEARING]);
        let observation = intake.observation(&reception)?.ok_or("neither level nor bearing")?;
        let _ = belief.update(&observation)?;
        let found = belief.estimate();
        let error = (found.mean - truth).norm();
        let sigma = reception.receiver_sigma_m.ok_or("the receiver reports it")?.x;
        println!("leg {leg}: place ±{sigma:.1} m, the beacon is {error:.1} m from its estimate");
        // Two thirds of the way there, shown to the person, whose feet the world moves.
        let here = reception.receiver.position.xy();
        let goal = here + (found.mean - here) * 0.66;
        walker.clone().go_to(&Waypoint { position: goal.push(1.5) })?;
        let shown = walker.with(|walker| walker.goal()).ok_or("it was just sent")?;
        world.vehicle(0)?.go_to(&shown)?;
        for _ in 0..1000 {
            pass(&world)?;
            let _ = walker.clone().pose();
        }
    }
    Ok(())
}
