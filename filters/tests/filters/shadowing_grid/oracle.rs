//! The closed forms against a sum over a and ln σ of the plain Gaussian density.

use approx::assert_abs_diff_eq;
use foxhunt_core::Pose;
use foxhunt_filters::{
    Intercept, Marginal, ShadowingFix, ShadowingGrid, ShadowingGridConfig, Slope,
};
use nalgebra::{DMatrix, DVector};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use super::world::{Truth, correlation, lawn_mower, level, readings, simple};

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

/// Every number of a fix, by brute force on the fix's own cells.
struct Direct {
    mass: Vec<f64>,
    intercept: Marginal,
    slope: Marginal,
    gain: Marginal,
    sigma: Marginal,
    lengths: Vec<f64>,
    nuggets: Vec<f64>,
}

/// Σ over cells, lengths, nuggets, slopes, gains, intercepts and ln σ of
/// w_b w_c |σ² C|^−½ exp(−½ rᵀ (σ² C)⁻¹ r), r = p − a − b x − c g; d ln σ is the prior 1/σ.
fn integrate(
    fix: &ShadowingFix,
    readings: &[(Pose, f64)],
    config: &ShadowingGridConfig,
    slopes: &[(f64, f64)],
    gains: &[(f64, f64)],
) -> Direct {
    let receivers: Vec<Pose> = readings.iter().map(|r| r.0).collect();
    let values = DVector::from_iterator(readings.len(), readings.iter().map(|r| r.1));
    let n = i32::try_from(readings.len()).expect("a few");
    let intercepts: Vec<f64> = match config.intercept {
        Intercept::Known(a) => vec![a],
        Intercept::Flat | Intercept::Calibrated { .. } => {
            (-1000..1000).map(|i| -40.0 + 0.6 * f64::from(i)).collect()
        }
    };
    // The normal density of a calibration, N(a + b x₀, v σ²).
    let calibration = |a: f64, b: f64, s: f64| match config.intercept {
        Intercept::Calibrated { regressor, value, variance } => {
            let off = (value - a - b * regressor) / s;
            (-0.5 * off * off / variance).exp() / s
        }
        Intercept::Known(_) | Intercept::Flat => 1.0,
    };
    let sigmas: Vec<f64> = (0..85).map(|i| 0.3 * (0.1 * f64::from(i)).exp()).collect();
    let mut correlations: Vec<([usize; 2], DMatrix<f64>, f64)> = Vec::new();
    for (i, &length_m) in config.correlation_lengths_m.iter().enumerate() {
        for (j, &nugget) in config.nuggets.iter().enumerate() {
            let c = correlation(&receivers, length_m, nugget);
            let inverse = c.clone().try_inverse().expect("regular");
            correlations.push(([i, j], inverse, c.determinant()));
        }
    }
    let mut mass = Vec::new();
    let (mut intercept, mut slope, mut sigma) = <(Sums, Sums, Sums)>::default();
    let mut gain = Sums::default();
    let mut lengths = vec![0.0; config.correlation_lengths_m.len()];
    let mut nuggets = vec![0.0; config.nuggets.len()];
    for (cell, _) in fix.map.cells() {
        let regressor = |which: usize| {
            let values = receivers.iter().map(|r| level(&cell, r)[which]);
            DVector::from_iterator(readings.len(), values)
        };
        let x = regressor(0);
        let g = regressor(1);
        let mut total = 0.0;
        for ([i, j], inverse, determinant) in &correlations {
            let coefficients = slopes.iter().flat_map(|b| gains.iter().map(move |c| (b, c)));
            for (&(b, b_prior), &(c, c_prior)) in coefficients {
                for &a in &intercepts {
                    let residual = (&values - &x * b - &g * c).add_scalar(-a);
                    let square = residual.dot(&(inverse * &residual));
                    for &s in &sigmas {
                        let weight = b_prior * c_prior * (-0.5 * square / (s * s)).exp()
                            / (s.powi(n) * determinant.sqrt())
                            * calibration(a, b, s);
                        total += weight;
                        lengths[*i] += weight;
                        nuggets[*j] += weight;
                        gain.add(weight, c);
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
    for share in mass.iter_mut().chain(&mut lengths).chain(&mut nuggets) {
        *share /= total;
    }
    let [intercept, slope, gain, sigma] =
        [intercept, slope, gain, sigma].map(|sums| sums.marginal());
    Direct { mass, intercept, slope, gain, sigma, lengths, nuggets }
}

const WORLD: Truth = Truth {
    place: nalgebra::Vector2::new(70.0, 10.0),
    intercept: -35.0,
    slope: 2.5,
    gain: 1.0,
    sigma: 5.0,
    length_m: 25.0,
    nugget: 0.2,
};

/// Eight readings over 25 cells, too few for a finer grid: the fix is the map's.
fn check(intercept: Intercept, slope: Slope, slopes: &[(f64, f64)], config: ShadowingGridConfig) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let readings = readings(&lawn_mower(2, 4, 20.0, 60.0), &WORLD, &mut rng);
    let config = ShadowingGridConfig {
        intercept,
        slope,
        margin_m: 20.0,
        cell_m: 20.0,
        max_cells: 100,
        ..config
    };
    let gains = match &config.gain {
        Slope::Known(gain) => vec![(*gain, 1.0)],
        Slope::Nodes(nodes) => nodes.clone(),
        Slope::Gaussian { .. } => panic!("the sum is over nodes"),
    };
    let fix = ShadowingGrid::new(config.clone()).expect("in range");
    let fix = fix.locate(&readings, level).expect("a posterior");
    assert!(fix.refined.is_none() && fix.map.mass().len() == 25);
    let direct = integrate(&fix, &readings, &config, slopes, &gains);
    // The sum is exact to 1e-7 or so: smooth integrands, and tails cut at ±600 dB and 1200 dB.
    for (mass, expected) in fix.map.mass().iter().zip(&direct.mass) {
        assert_abs_diff_eq!(mass / expected, 1.0, epsilon = 1e-6);
    }
    let shares = fix.correlation_lengths_m.iter().chain(&fix.nuggets);
    for ((_, share), expected) in shares.zip(direct.lengths.iter().chain(&direct.nuggets)) {
        assert_abs_diff_eq!(share, expected, epsilon = 1e-6);
    }
    // Second moments reach farther into the tails: 1e-4.
    for (marginal, expected) in [
        (fix.intercept, direct.intercept),
        (fix.slope, direct.slope),
        (fix.gain, direct.gain),
        (fix.sigma, direct.sigma),
    ] {
        let close = |a: f64, b: f64| (a - b).abs() < 1e-4 * (1.0 + b.abs());
        assert!(close(marginal.mean, expected.mean), "{marginal:?} for {expected:?}");
        assert!(close(marginal.sd, expected.sd), "{marginal:?} for {expected:?}");
    }
}

/// One nugget and the given lengths, without gain.
fn lengths(correlation_lengths_m: &[f64]) -> ShadowingGridConfig {
    let correlation_lengths_m = correlation_lengths_m.to_vec();
    ShadowingGridConfig { correlation_lengths_m, nuggets: vec![0.3], ..simple() }
}

#[test]
fn everything_unknown_is_what_integration_gives() {
    let nodes = [(1.5, 0.2), (2.5, 0.7), (3.5, 0.4)];
    let gain = Slope::Nodes(vec![(0.0, 1.0), (1.5, 0.4)]);
    let config = ShadowingGridConfig { gain, nuggets: vec![0.3, 0.1], ..lengths(&[15.0, 60.0]) };
    check(Intercept::Flat, Slope::Nodes(nodes.to_vec()), &nodes, config);
}

#[test]
fn a_known_intercept_is_what_integration_gives() {
    let nodes = [(2.0, 1.0), (3.0, 0.5)];
    let slope = Slope::Nodes(nodes.to_vec());
    check(Intercept::Known(-33.0), slope, &nodes, lengths(&[15.0, 25.0, 60.0]));
}

#[test]
fn a_calibrated_intercept_is_what_integration_gives() {
    let nodes = [(2.0, 1.0), (3.0, 0.5)];
    let calibrated = Intercept::Calibrated { regressor: -18.0, value: -82.0, variance: 4.0 };
    let gain = Slope::Nodes(vec![(0.0, 1.0), (1.5, 0.4)]);
    let config = ShadowingGridConfig { gain, ..lengths(&[15.0, 60.0]) };
    check(calibrated, Slope::Nodes(nodes.to_vec()), &nodes, config);
}

#[test]
fn a_known_slope_and_gain_are_what_integration_gives() {
    let config = ShadowingGridConfig { gain: Slope::Known(1.0), ..lengths(&[30.0]) };
    check(Intercept::Flat, Slope::Known(2.2), &[(2.2, 1.0)], config);
}

/// Readings that tell slope and gain better than their prior's nodes are apart: steps of 0.25 and
/// 0.5 give the posterior that closer ones give, within the prior's limits and at them.
#[test]
fn the_steps_of_a_gaussian_prior_do_not_decide() {
    let mut farthest: f64 = 0.0;
    let truths = [
        (0.5, 2.63, 0.7),
        (0.2, 2.12, 0.3),
        (0.4, 1.0, 1.2),
        (0.3, 4.4, 2.9),
        (2.0, 2.4, 0.5),
        (0.3, 2.6, 0.8),
    ];
    for (number, (sigma, slope, gain)) in truths.into_iter().enumerate() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(number as u64);
        let place = nalgebra::Vector2::new(190.0, 130.0);
        let truth = Truth { place, sigma, slope, gain, nugget: 1.0, ..WORLD };
        let readings = readings(&lawn_mower(4, 25, 6.0, 30.0), &truth, &mut rng);
        // The last one is of a known slope, with which the gain alone is narrow.
        let of_steps = |slope_step, gain_step| {
            let slope = match number {
                5 => Ok(Slope::Known(2.1)),
                _ => Slope::gaussian(2.3, 0.5, 1.0, 4.0, slope_step),
            };
            let config = ShadowingGridConfig {
                slope: slope.expect("proper"),
                gain: Slope::gaussian(0.5, 1.0, -1.5, 2.5, gain_step).expect("proper"),
                margin_m: 60.0,
                cell_m: 8.0,
                max_cells: 600,
                nuggets: vec![1.0],
                ..lengths(&[30.0])
            };
            let estimator = ShadowingGrid::new(config).expect("in range");
            estimator.locate(&readings, level).expect("a posterior")
        };
        let fix = of_steps(0.25, 0.5);
        let exact = of_steps(0.02, 0.1);
        let apart = fix.position.nees(&exact.position.mean).expect("positive definite").sqrt();
        farthest = farthest.max(apart);
        let spread = fix.position.covariance.trace() / exact.position.covariance.trace();
        println!("{sigma} dB: {apart:.3} σ apart, variance {spread:.3} times");
        assert!(apart < 0.05, "{apart} σ apart at {sigma} dB");
        assert!((spread - 1.0).abs() < 0.05, "{spread} times the variance at {sigma} dB");
        assert_abs_diff_eq!(
            fix.slope.mean,
            exact.slope.mean,
            epsilon = 0.1 * exact.slope.sd + 1e-3
        );
        let spread = (fix.slope.sd - exact.slope.sd).abs();
        assert!(spread <= 0.1 * exact.slope.sd, "{:?} for {:?}", fix.slope, exact.slope);
    }
    assert!(farthest > 0.0, "the two differ");
}
