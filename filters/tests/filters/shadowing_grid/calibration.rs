//! Truth drawn from the prior, readings from the model: the posterior must know its own error.
//!
//! No χ² here, as the posterior is not Gaussian: what each run's own posterior expects (of the
//! error squared, of its 95 % ellipse) is summed over the runs, with its own variance.

use approx::assert_abs_diff_eq;
use foxhunt_core::Pose;
use foxhunt_filters::{
    BearingGrid, BearingLine, Marginal, ShadowingFix, ShadowingGrid, ShadowingGridConfig, Slope,
};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{ChiSquared, Distribution, Normal, StandardNormal};

use super::world::{Truth, lawn_mower, level, readings, simple};

/// A sum of independent numbers, the mean and the variance it should have.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    sum: f64,
    expected: f64,
    variance: f64,
}

impl Tally {
    fn add(&mut self, number: f64, expected: f64, variance: f64) {
        self.sum += number;
        self.expected += expected;
        self.variance += variance;
    }

    /// Distance from the expected value, in standard deviations.
    fn score(&self, what: &'static str) -> Score {
        let z = (self.sum - self.expected) / self.variance.sqrt();
        Score { what, sum: self.sum, expected: self.expected, z }
    }
}

/// A tally's verdict.
#[derive(Clone, Copy, Debug)]
#[expect(dead_code, reason = "printed, for a person to read")]
struct Score {
    what: &'static str,
    sum: f64,
    expected: f64,
    z: f64,
}

/// Numbers whose mean should be 1, their variance estimated from themselves.
#[derive(Clone, Debug, Default)]
struct Squares(Vec<f64>);

impl Squares {
    fn add(&mut self, marginal: &Marginal, truth: f64) {
        self.0.push(((truth - marginal.mean) / marginal.sd).powi(2));
    }

    fn score(&self, what: &'static str) -> Score {
        let count = f64::from(u32::try_from(self.0.len()).expect("a few"));
        let mean = self.0.iter().sum::<f64>() / count;
        let variance = self.0.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / count / count;
        Tally { sum: mean, expected: 1.0, variance }.score(what)
    }
}

/// Calibration of the posterior against the truth, over many runs.
#[derive(Clone, Debug, Default)]
struct Calibration {
    nees: Tally,
    inside: Tally,
    /// The mass of cells less likely than the truth's: uniform on [0, 1].
    rank: Tally,
    rank_square: Tally,
    border: Tally,
    lengths: [Tally; 3],
    nuggets: [Tally; 2],
    gain: Squares,
    intercept: Squares,
    slope: Squares,
    sigma: Squares,
    refined: u32,
}

impl Calibration {
    fn add(
        &mut self,
        fix: &ShadowingFix,
        truth: &Truth,
        is_on_border: bool,
        rng: &mut Xoshiro256PlusPlus,
    ) {
        let nees = |place: &Vector2<f64>| fix.position.nees(place).expect("positive definite");
        let limit = 5.991_464_547_107_979;
        let mut expected = 0.0;
        let mut square = 0.0;
        let mut inside = 0.0;
        let map = fix.refined.as_ref().unwrap_or(&fix.map);
        self.refined += u32::from(fix.refined.is_some());
        for (place, mass) in map.cells() {
            let q = nees(&place);
            expected += mass * q;
            square += mass * q * q;
            inside += if q < limit { mass } else { 0.0 };
        }
        let q = nees(&truth.place);
        self.nees.add(q, 2.0, square - expected * expected);
        self.inside.add(f64::from(u8::from(q < limit)), inside, inside * (1.0 - inside));

        let half = 0.5 * map.cell_m();
        let own = map.cells().find(|(place, _)| (place - truth.place).amax() <= half);
        let own = own.map_or(0.0, |(_, mass)| mass);
        let less: f64 = map.mass().iter().filter(|mass| **mass < own).sum();
        let rank = less + own * rng.random::<f64>();
        self.rank.add(rank, 0.5, 1.0 / 12.0);
        self.rank_square.add(rank * rank, 1.0 / 3.0, 4.0 / 45.0);
        self.border.add(
            f64::from(u8::from(is_on_border)),
            fix.border_mass,
            fix.border_mass * (1.0 - fix.border_mass),
        );

        let count = |tally: &mut Tally, is: bool, p: f64| {
            tally.add(f64::from(u8::from(is)), p, p * (1.0 - p));
        };
        for (tally, (length_m, p)) in self.lengths.iter_mut().zip(&fix.correlation_lengths_m) {
            count(tally, (length_m - truth.length_m).abs() < 0.1, *p);
        }
        for (tally, (nugget, p)) in self.nuggets.iter_mut().zip(&fix.nuggets) {
            count(tally, (nugget - truth.nugget).abs() < 1e-3, *p);
        }
        self.gain.add(&fix.gain, truth.gain);
        self.intercept.add(&fix.intercept, truth.intercept);
        self.slope.add(&fix.slope, truth.slope);
        self.sigma.add(&fix.sigma, truth.sigma);
    }

    fn scores(&self) -> Vec<Score> {
        vec![
            self.nees.score("NEES"),
            self.inside.score("in the 95 % ellipse"),
            self.rank.score("rank"),
            self.rank_square.score("rank²"),
            self.border.score("on the border"),
            self.lengths[0].score("the first correlation length"),
            self.lengths[1].score("the second"),
            self.lengths[2].score("the third"),
            self.nuggets[0].score("the first nugget"),
            self.gain.score("gain"),
            self.intercept.score("intercept"),
            self.slope.score("slope"),
            self.sigma.score("sigma"),
        ]
    }
}

/// Nothing farther off than 3.29 standard deviations: a false-alarm rate of 0.1 % per score.
const LIMIT: f64 = 3.29;

/// A coefficient from its prior.
fn draw(slope: &Slope, rng: &mut Xoshiro256PlusPlus) -> f64 {
    let Slope::Gaussian { mean, sd, lower, upper, .. } = *slope else {
        panic!("the default is Gaussian")
    };
    let prior = Normal::new(mean, sd).expect("proper");
    loop {
        let value = prior.sample(rng);
        if (lower..=upper).contains(&value) {
            return value;
        }
    }
}

/// Returns true if a place lies in the outermost ring of cells.
fn is_on_border(fix: &ShadowingFix, place: &Vector2<f64>) -> bool {
    let first = fix.map.south_west();
    let (last, _) = fix.map.cells().last().expect("a map has cells");
    let from_middle = (place - 0.5 * (first + last)).abs() - 0.5 * (last - first);
    from_middle.max() > -0.5 * fix.map.cell_m()
}

/// Bearings of a place from `count` of the receivers, whose σ of 8° is right up to a factor with
/// the grid's prior.
fn bearings(
    grid: &BearingGrid,
    count: usize,
    receivers: &[Pose],
    place: &Vector2<f64>,
    rng: &mut Xoshiro256PlusPlus,
) -> Vec<(BearingLine, f64)> {
    if count == 0 {
        return Vec::new();
    }
    let sigma = 8.0_f64.to_radians();
    let chi = ChiSquared::new(grid.freedom).expect("degrees of freedom").sample(rng);
    let scale = (grid.freedom / chi).sqrt();
    let taken = receivers.iter().step_by(receivers.len() / count).take(count);
    taken
        .map(|receiver| {
            let receiver = receiver.position.xy();
            let way = place - receiver;
            let error = sigma * scale * rng.sample::<f64, _>(StandardNormal);
            (BearingLine { receiver, bearing: way.y.atan2(way.x) + error }, sigma)
        })
        .collect()
}

/// Scores of `runs` flights along `receivers`, whose first is the south-western one, with bearings
/// from `count` of them.
fn calibrate(
    seed: u64,
    runs: u32,
    receivers: &[Pose],
    count: usize,
    config: &ShadowingGridConfig,
) -> Vec<Score> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let estimator = ShadowingGrid::new(config.clone()).expect("in range");
    let last =
        receivers.iter().fold(Vector2::zeros(), |m: Vector2<f64>, r| m.sup(&r.position.xy()));
    // Many degrees of freedom: with few a bearing may be off by more than a half turn.
    let grid = BearingGrid { freedom: 8.0, ..BearingGrid::default() };
    let mut calibration = Calibration::default();
    for _ in 0..runs {
        let side = |extent: f64, u: f64| u * (extent + 2.0 * config.margin_m) - config.margin_m;
        let truth = Truth {
            place: Vector2::new(side(last.x, rng.random()), side(last.y, rng.random())),
            // a is flat and σ scales: the result may not depend on what they are.
            intercept: -50.0 + 100.0 * rng.random::<f64>(),
            slope: draw(&config.slope, &mut rng),
            gain: draw(&config.gain, &mut rng),
            sigma: 2.0 * (2.3 * rng.random::<f64>()).exp(),
            length_m: config.correlation_lengths_m[rng.random_range(0..3)],
            nugget: config.nuggets[rng.random_range(0..2)],
        };
        let readings = readings(receivers, &truth, &mut rng);
        let lines = bearings(&grid, count, receivers, &truth.place, &mut rng);
        let of_bearings = grid.log_likelihood(&lines).expect("they are finite");
        let fix = estimator
            .locate_with(
                &readings,
                |cell: &Vector2<f64>, pose: &Pose, _| level(cell, pose),
                &[],
                of_bearings,
            )
            .expect("a posterior");
        calibration.add(&fix, &truth, is_on_border(&fix, &truth.place), &mut rng);
    }
    assert!(calibration.refined > runs / 4, "finer grids are to be tested too");
    calibration.scores()
}

/// Gain and nugget are unknown, too. The tests choose cells that fill the prior's area: the border
/// of any others reaches beyond it.
fn with_all_unknown() -> ShadowingGridConfig {
    let gain = Slope::gaussian(0.5, 1.0, -1.0, 2.0, 0.5).expect("in order");
    ShadowingGridConfig { gain, nuggets: vec![0.1, 0.3], ..simple() }
}

#[test]
fn the_posterior_is_calibrated() {
    let config =
        ShadowingGridConfig { margin_m: 60.0, cell_m: 20.0, max_cells: 4000, ..with_all_unknown() };
    for score in calibrate(11, 300, &lawn_mower(3, 9, 25.0, 80.0), 0, &config) {
        println!("{score:.2?}");
        assert_abs_diff_eq!(score.z, 0.0, epsilon = LIMIT);
    }
}

#[test]
fn with_bearings_the_posterior_is_calibrated() {
    let config =
        ShadowingGridConfig { margin_m: 60.0, cell_m: 20.0, max_cells: 4000, ..with_all_unknown() };
    for score in calibrate(13, 300, &lawn_mower(3, 9, 25.0, 80.0), 6, &config) {
        println!("{score:.2?}");
        assert_abs_diff_eq!(score.z, 0.0, epsilon = LIMIT);
    }
}

#[test]
#[ignore = "long"]
fn the_posterior_is_calibrated_over_many_runs() {
    let config = ShadowingGridConfig { margin_m: 100.0, ..with_all_unknown() };
    for score in calibrate(12, 2000, &lawn_mower(4, 25, 15.0, 80.0), 0, &config) {
        println!("{score:.2?}");
        assert_abs_diff_eq!(score.z, 0.0, epsilon = LIMIT);
    }
}
