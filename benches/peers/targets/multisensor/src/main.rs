//! The labelled multi-Bernoulli filter of multisensor-lmb-filters-rs over the scans of standard
//! input, with its defaults: loopy belief propagation.

use std::{error::Error, io, time::Instant};

use multisensor_lmb_filters_rs::lmb::{
    AssociationConfig, BirthLocation, BirthModel, Filter, LmbFilter, MotionModel, SensorModel,
};
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;

fn main() -> Result<(), Box<dyn Error>> {
    let make = || {
        let motion = MotionModel::constant_velocity_2d(1.0, 5.0, 0.99);
        let sensor = SensorModel::position_sensor_2d(10.0, 0.98, 60.0, 4e6);
        let places = [(0.0, 0.0), (400.0, -600.0), (-800.0, -200.0), (-200.0, 800.0)];
        let births = places.iter().enumerate().map(|(index, (east, north))| {
            let mean = DVector::from_vec(vec![*east, *north, 0.0, 0.0]);
            BirthLocation::new(index, mean, DMatrix::identity(4, 4) * 100.0)
        });
        let birth = BirthModel::new(births.collect(), 0.03, 0.03);
        LmbFilter::new(motion, sensor, birth, AssociationConfig::default())
    };
    let mut filter = make();
    let mut run = String::new();
    let mut rng = rand::rngs::StdRng::seed_from_u64(1);
    for line in io::stdin().lines() {
        let line = line?;
        let mut words = line.split(' ');
        let of = words.next().unwrap_or_default();
        if of != run {
            filter = make();
            run = of.to_owned();
        }
        let step: usize = words.next().unwrap_or_default().parse()?;
        let numbers = words.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let scan: Vec<DVector<f64>> =
            numbers.chunks_exact(2).map(|place| DVector::from_vec(place.to_vec())).collect();
        let begin = Instant::now();
        let found = filter.step(&mut rng, &scan, step).map_err(|error| format!("{error:?}"))?;
        let ns = begin.elapsed().as_nanos();
        print!("{run} {step} {ns}");
        for track in &found.tracks {
            print!(" {} {}", track.mean[0], track.mean[1]);
        }
        println!();
    }
    Ok(())
}
