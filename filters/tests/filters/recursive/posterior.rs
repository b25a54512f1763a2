use foxhunt_core::{
    Correction, Estimate, Estimator, RandomWalk,
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::ParticleFilter;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{
    model::{RssBearing, observations},
    vectors::{cases, matrix, number, vector},
};

#[test]
fn twenty_thousand_particles_reach_the_exact_posterior() {
    let cases = cases("posterior_rss_aoa.json", "sequences");
    for case in cases {
        let name = &case["name"];
        let prior = Estimate {
            mean: vector(&case["prior"]["mean"]),
            covariance: Matrix2::from_diagonal_element(number(&case["prior"]["var"])),
        };
        let drift = case["process_noise_std_per_step"].as_f64().unwrap_or(0.0);
        let rng = Xoshiro256PlusPlus::seed_from_u64(9);
        let model = RssBearing::of(&case);
        let mut filter = ParticleFilter::new(RandomWalk::uniform(drift), model, prior, 20_000, rng)
            .expect("a proper prior");
        let mut log_evidence = 0.0;
        let steps = case["posterior"].as_array().expect("a list");
        for (i, (observation, exact)) in observations(&case).iter().zip(steps).enumerate() {
            filter.predict(1.0).expect("a proper step");
            let Ok(Correction::Fused { log_evidence: reported, .. }) = filter.update(observation)
            else {
                panic!("{name}: step {i} was not fused");
            };
            log_evidence += reported;
            let exact_covariance: Matrix2<f64> = matrix(&exact["cov"]);
            let root = exact_covariance.cholesky().expect("a proper posterior").unpack();
            let whitened: Vector2<f64> = root
                .solve_lower_triangular(&(filter.estimate().mean - vector(&exact["mean"])))
                .expect("a proper posterior");
            // √(n / ESS) is the growth of the cloud's own error √(P / n): 0.02 to 0.05 here. The
            // rest of the bound is the kernel's, which smooths what is not Gaussian.
            assert!(whitened.norm() < 0.2, "{name}, step {i}: mean off by {}", whitened.norm());
            let error = log_evidence - number(&exact["log_evidence"]);
            assert!(error.abs() < 0.2, "{name}, step {i}: log-evidence off by {error}");
        }
    }
}
