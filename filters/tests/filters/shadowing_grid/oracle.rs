//! The closed forms against a sum over a and ln σ of the plain Gaussian density.

use foxhunt_core::Pose;
use foxhunt_filters::{
    Intercept, Marginal, ShadowingFix, ShadowingGrid, ShadowingGridConfig, Slope,
};
use nalgebra::{DMatrix, DVector};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use super::world::{Truth, correlation, lawn_mower, level, readings};

/// Sums of weight, weight × number and weight × number².
#[derive(Clone, Copy, Default)]
struct Sums([f64; 3]);

impl Sums {
    fn add(&mut self, weight: f64, number: f64) {
        for (sum, term) in self.0.iter_mut().zip([1.0, number, number * number]) {
            *sum += weight * term;
        }
    }

    fn marginal(&self) -> Marginal {
        let [weight, first, second] = self.0;
        let mean = first / weight;
        Marginal { mean, sd: (second / weight - mean * mean).max(0.0).sqrt() }
    }
}

/// Everything a fix says, by brute force on the fix's own cells.
struct Direct {
    mass: Vec<f64>,
    intercept: Marginal,
    slope: Marginal,
    sigma: Marginal,
    lengths: Vec<f64>,
}

/// Σ over cells, lengths, slopes, intercepts and ln σ of
/// w_b |σ² C|^−½ exp(−½ (p − a − b x)ᵀ (σ² C)⁻¹ (p − a − b x)); d ln σ is the prior 1/σ.
fn integrate(
    fix: &ShadowingFix,
    readings: &[(Pose, f64)],
    config: &ShadowingGridConfig,
    slopes: &[(f64, f64)],
) -> Direct {
    let receivers: Vec<Pose> = readings.iter().map(|r| r.0).collect();
    let values = DVector::from_iterator(readings.len(), readings.iter().map(|r| r.1));
    let n = i32::try_from(readings.len()).expect("a few");
    let intercepts: Vec<f64> = match config.intercept {
        Intercept::Known(a) => vec![a],
        Intercept::Flat => (-1000..1000).map(|i| -40.0 + 0.6 * f64::from(i)).collect(),
    };
    let sigmas: Vec<f64> = (0..85).map(|i| 0.3 * (0.1 * f64::from(i)).exp()).collect();
    let correlations: Vec<(DMatrix<f64>, f64)> = (config.correlation_lengths_m.iter())
        .map(|&length_m| {
            let c = correlation(&receivers, length_m, config.nugget);
            (c.clone().try_inverse().expect("regular"), c.determinant())
        })
        .collect();
    let mut mass = Vec::new();
    let (mut intercept, mut slope, mut sigma) = <(Sums, Sums, Sums)>::default();
    let mut lengths = vec![0.0; correlations.len()];
    for (cell, _) in fix.map.cells() {
        let x = DVector::from_iterator(readings.len(), receivers.iter().map(|r| level(&cell, r)));
        let mut total = 0.0;
        for ((inverse, determinant), length) in correlations.iter().zip(&mut lengths) {
            for &(b, prior) in slopes {
                for &a in &intercepts {
                    let residual = (&values - &x * b).add_scalar(-a);
                    let square = residual.dot(&(inverse * &residual));
                    for &s in &sigmas {
                        let weight = prior * (-0.5 * square / (s * s)).exp()
                            / (s.powi(n) * determinant.sqrt());
                        total += weight;
                        *length += weight;
                        intercept.add(weight, a);
                        slope.add(weight, b);
                        sigma.add(weight, s);
                    }
                }
            }
        }
        mass.push(total);
    }
    let total: f64 = mass.iter().sum();
    for share in mass.iter_mut().chain(&mut lengths) {
        *share /= total;
    }
    let [intercept, slope, sigma] = [intercept, slope, sigma].map(|sums| sums.marginal());
    Direct { mass, intercept, slope, sigma, lengths }
}

/// Eight readings over 25 cells, too few for a finer grid: the fix is the map's.
fn check(intercept: Intercept, slope: Slope, slopes: &[(f64, f64)], correlation_lengths_m: &[f64]) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let truth = Truth {
        place: nalgebra::Vector2::new(70.0, 10.0),
        intercept: -35.0,
        slope: 2.5,
        sigma: 5.0,
        length_m: 25.0,
        nugget: 0.2,
    };
    let readings = readings(&lawn_mower(2, 4, 20.0, 60.0), &truth, &mut rng);
    let config = ShadowingGridConfig {
        intercept,
        slope,
        correlation_lengths_m: correlation_lengths_m.to_vec(),
        nugget: 0.3,
        margin_m: 20.0,
        cell_m: 20.0,
        max_cells: 100,
        segment_m: 0.0,
        ..ShadowingGridConfig::default()
    };
    let fix = ShadowingGrid::new(config.clone()).expect("in range");
    let fix = fix.locate(&readings, level).expect("a posterior");
    assert!(fix.refined.is_none() && fix.map.mass().len() == 25);
    let direct = integrate(&fix, &readings, &config, slopes);
    // The sum is exact to 1e-7 or so: smooth integrands, and tails cut at ±600 dB and 1200 dB.
    for (mass, expected) in fix.map.mass().iter().zip(&direct.mass) {
        assert!((mass / expected - 1.0).abs() < 1e-6, "{mass} for {expected}");
    }
    for ((_, share), expected) in fix.correlation_lengths_m.iter().zip(&direct.lengths) {
        assert!((share - expected).abs() < 1e-6, "{share} for {expected}");
    }
    // Second moments reach farther into the tails: 1e-4.
    for (marginal, expected) in
        [(fix.intercept, direct.intercept), (fix.slope, direct.slope), (fix.sigma, direct.sigma)]
    {
        let close = |a: f64, b: f64| (a - b).abs() < 1e-4 * (1.0 + b.abs());
        assert!(close(marginal.mean, expected.mean), "{marginal:?} for {expected:?}");
        assert!(close(marginal.sd, expected.sd), "{marginal:?} for {expected:?}");
    }
}

#[test]
fn everything_unknown_is_what_integration_gives() {
    let nodes = [(1.5, 0.2), (2.5, 0.7), (3.5, 0.4)];
    check(Intercept::Flat, Slope::Nodes(nodes.to_vec()), &nodes, &[15.0, 60.0]);
}

#[test]
fn a_known_intercept_is_what_integration_gives() {
    let nodes = [(2.0, 1.0), (3.0, 0.5)];
    check(Intercept::Known(-33.0), Slope::Nodes(nodes.to_vec()), &nodes, &[15.0, 25.0, 60.0]);
}

#[test]
fn a_known_slope_is_what_integration_gives() {
    check(Intercept::Flat, Slope::Known(2.2), &[(2.2, 1.0)], &[30.0]);
}
