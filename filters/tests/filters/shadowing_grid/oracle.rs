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

/// A Gaussian prior on nodes that are so close that none of them decides.
fn exactly(mean: f64, sd: f64, lower: f64, upper: f64, last: u16) -> Slope {
    let step = (upper - lower) / f64::from(last);
    let node = |i| {
        let value = lower + step * f64::from(i);
        let share = if i == 0 || i == last { 0.5 } else { 1.0 };
        (value, share * (-0.5 * ((value - mean) / sd).powi(2)).exp())
    };
    Slope::Nodes((0..=last).map(node).collect())
}

/// The nodes over which slope and gain are summed give the posterior that very close ones give:
/// where the readings tell more than the prior or less, within its limits and at them, and where
/// few readings tell something else than the prior does.
#[test]
fn the_nodes_of_a_gaussian_prior_do_not_decide() {
    // Readings on each of four legs, σ in dB, slope and gain.
    let truths = [
        (25, 0.5, 2.63, 0.7),
        (25, 0.2, 2.12, 0.3),
        (25, 0.4, 1.0, 1.2),
        (25, 0.3, 4.4, 2.9),
        (25, 2.0, 2.4, 0.5),
        (25, 0.3, 2.6, 0.8),
        (25, 8.0, 2.4, 0.5),
        (4, 0.5, 2.6, 0.7),
        (4, 3.0, 2.2, -0.4),
        (2, 1.0, 2.6, 0.7),
        (2, 0.3, 3.9, 2.4),
        (2, 6.0, 2.0, 0.0),
    ];
    let mut farthest: f64 = 0.0;
    for (number, (count, sigma, slope, gain)) in truths.into_iter().enumerate() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(number as u64);
        let place = nalgebra::Vector2::new(190.0, 130.0);
        let truth = Truth { place, sigma, slope, gain, nugget: 1.0, ..WORLD };
        let legs = lawn_mower(4, count, 150.0 / f64::from(count), 30.0);
        let readings = readings(&legs, &truth, &mut rng);
        let with = |slope: Slope, gain: Slope| {
            let config = ShadowingGridConfig {
                // One is of a known slope, with which the gain alone is narrow.
                slope: if number == 5 { Slope::Known(2.1) } else { slope },
                gain,
                margin_m: 60.0,
                cell_m: 8.0,
                max_cells: 600,
                nuggets: vec![1.0],
                ..lengths(&[30.0])
            };
            let estimator = ShadowingGrid::new(config).expect("in range");
            estimator.locate(&readings, level).expect("a posterior")
        };
        let proper = "in order";
        let fix = with(
            Slope::gaussian(2.3, 0.5, 1.0, 4.0, 0.25).expect(proper),
            Slope::gaussian(0.5, 1.0, -1.5, 2.5, 0.5).expect(proper),
        );
        let exact = with(exactly(2.3, 0.5, 1.0, 4.0, 150), exactly(0.5, 1.0, -1.5, 2.5, 100));
        let apart = fix.position.nees(&exact.position.mean).expect("positive definite").sqrt();
        farthest = farthest.max(apart);
        let spread = fix.position.covariance.trace() / exact.position.covariance.trace();
        println!("{count} of {sigma} dB: {apart:.3} σ apart, variance {spread:.3} times");
        assert!(apart < 0.05, "{apart} σ apart at {sigma} dB");
        assert!((spread - 1.0).abs() < 0.05, "{spread} times the variance at {sigma} dB");
        for (found, exact) in [(fix.slope, exact.slope), (fix.gain, exact.gain)] {
            assert_abs_diff_eq!(found.mean, exact.mean, epsilon = 0.1 * exact.sd + 1e-3);
            assert!((found.sd - exact.sd).abs() <= 0.1 * exact.sd, "{found:?} for {exact:?}");
        }
    }
    assert!(farthest > 0.0, "the two differ");
}
