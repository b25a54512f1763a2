//! Input of every peer in Rust, and the measurement of its time.
//!
//! `PEER PROBLEM FILE REPEATS`: with no repeats the answer is printed, else the nanoseconds of a
//! step, the least of ten parts.

use cpu_time::ProcessTime;
use std::{
    env,
    f64::consts::{LN_10, TAU},
    fs,
    hint::black_box,
    process,
};

/// Number of parts of a measurement; the least counts.
const PARTS: usize = 10;

/// Numbers of seeds, particles and steps that a cloud's answer is from.
const SEEDS: u64 = 40;
const PARTICLES: usize = 1000;
const STEPS: usize = 20;

/// Numbers of a line.
fn numbers<const N: usize>(line: &str) -> [f64; N] {
    let numbers: Vec<f64> = line.split(' ').map(|word| word.parse().expect("a number")).collect();
    numbers.try_into().expect("as many numbers as there should be")
}

/// One level and bearing, and from where.
pub struct Measured {
    pub receiver: [f64; 3],
    pub z: [f64; 2],
}

/// A still beacon, measured by level and bearing.
pub struct Beacon {
    pub variance: f64,
    pub drift: f64,
    pub reference_dbm: f64,
    pub exponent: f64,
    pub sigmas: [f64; 2],
    pub alpha: f64,
    pub sweep: Vec<Measured>,
}

impl Beacon {
    fn read(file: &str) -> Self {
        let text = fs::read_to_string(file).expect("the problem can be read");
        let mut lines = text.lines();
        let [variance, drift, reference_dbm, exponent, level, bearing, alpha] =
            numbers(lines.next().expect("a first line"));
        let measured = |line| {
            let [x, y, z, level, bearing] = numbers(line);
            Measured { receiver: [x, y, z], z: [level, bearing] }
        };
        let sweep = lines.map(measured).collect();
        let sigmas = [level, bearing];
        Self { variance, drift, reference_dbm, exponent, sigmas, alpha, sweep }
    }

    /// The variance of the noise of each step.
    pub fn q(&self) -> f64 {
        self.drift * self.drift
    }

    /// The variances of the measurement.
    pub fn r(&self) -> [f64; 2] {
        self.sigmas.map(|sigma| sigma * sigma)
    }

    /// Returns the expected measurement of a beacon here.
    #[inline]
    pub fn expected(&self, x: f64, y: f64, receiver: &[f64; 3]) -> [f64; 2] {
        let x = x - receiver[0];
        let y = y - receiver[1];
        let range = (x * x + y * y + receiver[2] * receiver[2]).sqrt();
        [self.reference_dbm - 10.0 * self.exponent * range.log10(), y.atan2(x)]
    }

    /// Its derivatives, one row for each quantity.
    #[inline]
    pub fn jacobian(&self, x: f64, y: f64, receiver: &[f64; 3]) -> [[f64; 2]; 2] {
        let x = x - receiver[0];
        let y = y - receiver[1];
        let flat = x * x + y * y;
        let slope = -10.0 * self.exponent / LN_10 / (flat + receiver[2] * receiver[2]);
        [[slope * x, slope * y], [-y / flat, x / flat]]
    }
}

/// One bearing, and from where.
pub struct Bearing {
    pub receiver: [f64; 2],
    pub z: f64,
}

/// A target of constant velocity, measured by bearings with outliers.
pub struct Bearings {
    pub prior: [f64; 4],
    pub spread: [f64; 4],
    pub noise: f64,
    pub bias: f64,
    pub sigma: f64,
    pub share: f64,
    pub sequence: Vec<Bearing>,
}

impl Bearings {
    fn read(file: &str) -> Self {
        let text = fs::read_to_string(file).expect("the problem can be read");
        let mut lines = text.lines();
        let [a, b, c, d, e, f, g, h, noise, bias, sigma, share] =
            numbers(lines.next().expect("a first line"));
        let measured = |line| {
            let [x, y, z] = numbers(line);
            Bearing { receiver: [x, y], z }
        };
        let sequence = lines.map(measured).collect();
        let prior = [a, b, c, d];
        let spread = [e, f, g, h];
        Self { prior, spread, noise, bias, sigma, share, sequence }
    }

    /// The density of a bearing of a target here.
    #[inline]
    pub fn likelihood(&self, x: f64, y: f64, bearing: &Bearing) -> f64 {
        let expected = (y - bearing.receiver[1]).atan2(x - bearing.receiver[0]) + self.bias;
        let off = bearing.z - expected;
        let off = (off - TAU * (off / TAU).round()) / self.sigma;
        (1.0 - self.share) * (-0.5 * off * off).exp() / (self.sigma * TAU.sqrt()) + self.share / TAU
    }
}

/// A Kalman filter of the still beacon.
pub trait Kalman {
    /// One prediction and one update.
    fn step(&mut self, beacon: &Beacon, measured: &Measured);
    /// Its mean, and its covariance by rows.
    fn belief(&self) -> ([f64; 2], [f64; 4]);
}

/// A particle filter of the moving target.
pub trait Cloud {
    /// One prediction and one update; returns the mean, and takes the covariance as well.
    fn step(&mut self, bearings: &Bearings, bearing: &Bearing) -> [f64; 4];
}

/// The weighted mean, and the covariance taken besides.
pub fn moments<'a>(particles: impl Iterator<Item = (&'a [f64], f64)> + Clone) -> [f64; 4] {
    let mut mean = [0.0; 4];
    for (state, weight) in particles.clone() {
        for (mean, x) in mean.iter_mut().zip(state) {
            *mean += weight * x;
        }
    }
    let mut covariance = [[0.0; 4]; 4];
    for (state, weight) in particles {
        let off: [f64; 4] = std::array::from_fn(|i| state[i] - mean[i]);
        for (row, a) in covariance.iter_mut().zip(off) {
            for (entry, b) in row.iter_mut().zip(off) {
                *entry += weight * a * b;
            }
        }
    }
    black_box(covariance);
    mean
}

/// Task of this run of a peer.
pub struct Call {
    pub problem: String,
    file: String,
    repeats: usize,
    particles: usize,
}

impl Call {
    /// Reads the arguments.
    pub fn read() -> Self {
        let arguments: Vec<String> = env::args().skip(1).collect();
        let [problem, file, repeats, particles] = arguments.as_slice() else {
            eprintln!("usage: PEER PROBLEM FILE REPEATS PARTICLES");
            process::exit(2);
        };
        Self {
            problem: problem.clone(),
            file: file.clone(),
            repeats: repeats.parse().expect("a number of repeats"),
            particles: particles.parse().expect("a number of particles"),
        }
    }

    /// Answers, or measures, as a Kalman filter.
    pub fn kalman<K: Kalman>(&self, make: impl Fn(&Beacon) -> K) {
        let beacon = Beacon::read(&self.file);
        let mut filter = make(&beacon);
        let mut sweep = || {
            for measured in &beacon.sweep {
                filter.step(&beacon, black_box(measured));
            }
        };
        if self.repeats == 0 {
            sweep();
            let (mean, covariance) = filter.belief();
            println!(r#"{{"mean": {mean:?}, "covariance": {covariance:?}}}"#);
            return;
        }
        self.measure(beacon.sweep.len(), || sweep());
    }

    /// Answers, or measures, with the particle filter that `make` returns for a number of particles
    /// and a seed.
    pub fn cloud<C: Cloud>(&self, make: impl Fn(&Bearings, usize, u64) -> C) {
        let bearings = Bearings::read(&self.file);
        if self.repeats == 0 {
            let means: Vec<[f64; 4]> = (1..=SEEDS)
                .map(|seed| {
                    let mut cloud = make(&bearings, PARTICLES, seed);
                    let steps = bearings.sequence[..STEPS].iter();
                    steps.map(|bearing| cloud.step(&bearings, bearing)).last().expect("some")
                })
                .collect();
            println!(r#"{{"means": {means:?}}}"#);
            return;
        }
        let mut cloud = make(&bearings, self.particles, 1);
        let mut sequence = bearings.sequence.iter().cycle();
        self.measure(self.particles, || {
            let bearing = sequence.next().expect("endless");
            black_box(cloud.step(&bearings, black_box(bearing)));
        });
    }

    fn measure(&self, steps: usize, mut work: impl FnMut()) {
        let mut least = f64::INFINITY;
        for _ in 0..PARTS {
            let start = ProcessTime::now();
            for _ in 0..self.repeats {
                work();
            }
            least = least.min(start.elapsed().as_nanos() as f64);
        }
        println!(r#"{{"ns": {}}}"#, least / (self.repeats * steps) as f64);
    }

    /// Refuses a problem.
    pub fn refuse(&self) {
        eprintln!("no {} here", self.problem);
        process::exit(2);
    }
}
