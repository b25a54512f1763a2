//! The labelled multi-Bernoulli filter of foxhunt over the scans of standard input.

use std::{error::Error, io, time::Instant};

use foxhunt_core::{
    ConstantVelocity, Estimate, MeasurementModel, Observation, Pose, Quantity, State,
    nalgebra::{Matrix2, SMatrix, Vector2, Vector4},
};
use foxhunt_filters::{
    Ekf, Gate, Reinitialise,
    multi::{Detection, LabelledMultiBernoulli, Reduction},
};

/// East and North of the target, in metres.
#[derive(Clone, Copy)]
struct Place;

impl MeasurementModel<4, 2> for Place {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::linear("east_m"), Quantity::linear("north_m")]
    }
    fn expected(&self, target: &State<4>, _: &Pose) -> Vector2<f64> {
        target.fixed_rows::<2>(0).into_owned()
    }
    fn jacobian(&self, _: &State<4>, _: &Pose) -> SMatrix<f64, 2, 4> {
        SMatrix::identity()
    }
}

type Filter = LabelledMultiBernoulli<Ekf<ConstantVelocity, Place, 4, 2>, 4, 2>;

fn filter() -> Result<Filter, Box<dyn Error>> {
    let motion = ConstantVelocity { spectral_density: 25.0 };
    let mut births = Vec::new();
    for (east, north) in [(0.0, 0.0), (400.0, -600.0), (-800.0, -200.0), (-200.0, 800.0)] {
        let prior = Estimate::isotropic(Vector4::new(east, north, 0.0, 0.0), 10.0);
        // The gate of the scenario's authors, 0.999.
        let kalman = Ekf::new(motion, Place, prior)?.with_gate(Gate::probability(0.999)?);
        births.push((0.03, kalman));
    }
    let detection = Detection::new(0.98, 60.0, [2000.0, 2000.0])?;
    let reduction = Reduction::new(1e-4, 20)?.with_merging(1e-2, Ekf::reinitialise)?;
    Ok(LabelledMultiBernoulli::new(births, 0.99, detection)?.with_reduction(reduction))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut filter = filter()?;
    let mut run = String::new();
    for line in io::stdin().lines() {
        let line = line?;
        let mut words = line.split(' ');
        let of = words.next().unwrap_or_default();
        if of != run {
            filter = self::filter()?;
            run = of.to_owned();
        }
        let step = words.next().unwrap_or_default();
        let numbers = words.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let mut scan = Vec::new();
        for place in numbers.chunks_exact(2) {
            let value = Vector2::new(place[0], place[1]);
            let noise = Matrix2::identity() * 100.0;
            scan.push(Observation::new(0.0, Pose::default(), value, noise)?);
        }
        let begin = Instant::now();
        filter.predict(1.0)?;
        filter.update(&scan)?;
        let found = filter.found();
        let ns = begin.elapsed().as_nanos();
        print!("{run} {step} {ns}");
        for track in found {
            print!(" {} {}", track.estimate().mean.x, track.estimate().mean.y);
        }
        println!();
    }
    Ok(())
}
