//! The labelled multi-Bernoulli filter of tracktor over the scans of standard input. Its step
//! drops nothing: tracks below an existence of 10⁻⁴ and components are pruned here by its own
//! functions.

use std::{error::Error, io, time::Instant};

use tracktor::{
    filters::lmb::{extract_lmb_estimates, LabeledBirthModel, LmbFilter},
    prelude::*,
    utils::{prune_and_merge, PruningConfig},
};

struct Births;

impl LabeledBirthModel<f64, 4> for Births {
    fn birth_tracks(&self, labels: &mut LabelGenerator) -> Vec<BernoulliTrack<f64, 4>> {
        let covariance = StateCovariance::from_matrix(nalgebra::SMatrix::identity() * 100.0);
        [(0.0, 0.0), (400.0, -600.0), (-800.0, -200.0), (-200.0, 800.0)]
            .iter()
            .map(|(east, north)| {
                let mean = StateVector::from_array([*east, *north, 0.0, 0.0]);
                let state = GaussianState::new(1.0, mean, covariance);
                BernoulliTrack::new(labels.next_label(), 0.03, state)
            })
            .collect()
    }

    fn expected_birth_count(&self) -> f64 {
        0.12
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let transition = ConstantVelocity2D::new(25.0, 0.99);
    let observation = PositionSensor2D::new(10.0, 0.98);
    let clutter = UniformClutter2D::new(60.0, (-1000.0, 1000.0), (-1000.0, 1000.0));
    let filter: LmbFilter<f64, _, _, _, _, 4, 2> =
        LmbFilter::new(transition, observation, clutter, Births);
    let pruning = PruningConfig::new(1e-4, 4.0, 20);
    let mut state = filter.initial_state();
    let mut run = String::new();
    for line in io::stdin().lines() {
        let line = line?;
        let mut words = line.split(' ');
        let of = words.next().unwrap_or_default();
        if of != run {
            state = filter.initial_state();
            run = of.to_owned();
        }
        let step = words.next().unwrap_or_default();
        let numbers = words.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let scan: Vec<Measurement<f64, 2>> = numbers
            .chunks_exact(2)
            .map(|place| Measurement::from_array([place[0], place[1]]))
            .collect();
        let begin = Instant::now();
        let (mut next, _) = filter.step(state, &scan, 1.0);
        next.tracks.prune_by_existence(1e-4);
        for track in &mut next.tracks.tracks {
            track.components = prune_and_merge(&track.components, &pruning);
            track.normalize_weights();
        }
        let found = extract_lmb_estimates(&next);
        let ns = begin.elapsed().as_nanos();
        print!("{run} {step} {ns}");
        for track in &found {
            print!(" {} {}", track.state.index(0), track.state.index(1));
        }
        println!();
        state = next;
    }
    Ok(())
}
