//! Clouds on several threads have the bits of clouds on one.

use foxhunt_core::{
    Correction, Estimate, Estimator, Observation, Pose, RandomWalk, State,
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::{ParticleFilter, Resampling};
use rand::rngs::Xoshiro256PlusPlus;

use super::{
    edges::rng,
    model::{FIELD, RssBearing},
};

type Filter = ParticleFilter<RandomWalk<2>, RssBearing, Xoshiro256PlusPlus, 2, 2>;

/// More than a filter leaves to one thread, and no whole number of chunks.
const PARTICLES: usize = 70_001;

fn filter(scheme: Resampling) -> Filter {
    let prior = Estimate::isotropic(Vector2::new(5.0, -3.0), 20.0);
    ParticleFilter::new(RandomWalk::uniform(0.3), FIELD, prior, PARTICLES, rng(3))
        .and_then(|filter| filter.with_resampling_threshold(0.9))
        .expect("proper")
        .with_resampling(scheme)
}

/// All that a filter reports in five steps, the last a sharp one that is applied in stages, and
/// its particles in the end.
fn reports(mut filter: impl Estimator<2, 2>) -> Vec<u64> {
    let mut bits = Vec::new();
    let mut keep = |numbers: &[f64]| bits.extend(numbers.iter().map(|number| number.to_bits()));
    for step in 0..5_i32 {
        filter.predict(1.0).expect("a proper step");
        let receiver = Pose::at(30.0 * f64::from(step - 2), 25.0, 0.0);
        let offset = Vector2::new(5.0, -3.0) - receiver.position.xy();
        let sigma = if step == 4 { [0.2, 0.02] } else { [6.0, 0.5] };
        let z = Vector2::new(-29.06 - 27.65 * offset.norm().log10(), offset.y.atan2(offset.x));
        let noise = Matrix2::from_diagonal(&Vector2::from(sigma.map(|s: f64| s * s)));
        let observation = Observation::new(0.0, receiver, z, noise).expect("proper");
        match filter.update(&observation) {
            Ok(Correction::Fused { nis, log_evidence, effective_sample_size }) => {
                keep(&[log_evidence]);
                keep(nis.as_slice());
                keep(effective_sample_size.as_slice());
            }
            other => panic!("not fused: {other:?}"),
        }
        let Estimate { mean, covariance } = filter.estimate();
        keep(mean.as_slice());
        keep(covariance.as_slice());
    }
    let mut particles = 0;
    let mut total = 0.0;
    filter.visit_samples(&mut |state: &State<2>, weight| {
        keep(state.as_slice());
        keep(&[weight]);
        particles += 1;
        total += weight;
    });
    assert_eq!(particles, PARTICLES);
    assert!((total - 1.0).abs() < 1e-9, "{total}");
    bits
}

#[test]
fn one_two_and_eight_threads_have_the_bits_of_none() {
    for scheme in [
        Resampling::Systematic,
        Resampling::Multinomial,
        Resampling::Stratified,
        Resampling::Residual,
    ] {
        let serial = reports(filter(scheme));
        for threads in [1, 2, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.expect("so many threads");
            let parallel = pool.install(|| reports(filter(scheme).with_threads()));
            assert!(parallel == serial, "{scheme:?} on {threads} threads");
        }
    }
}
