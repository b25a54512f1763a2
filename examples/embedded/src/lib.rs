//! The sequences of `vectors/filter_runs.json` through the extended and the unscented Kalman
//! filter, without an allocator: the same code on a microcontroller and on its host.

#![no_std]

use core::fmt::{self, Write};

use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, Observation, ObservationError, Pose,
    RandomWalk,
    nalgebra::{Matrix2, Vector2},
    parameter::ParameterError,
};
use foxhunt_filters::{Gate, Kalman, Taylor, Transform, Unscented};
use foxhunt_sensors::{LogDistance, RssBearing};

include!(concat!(env!("OUT_DIR"), "/sequences.rs"));

/// Maximum distance of a mean from the vectors, in metres: the scaled unscented transform with α =
/// 10⁻³ costs eight digits.
const TOLERANCE: f64 = 1e-6;

/// A sequence of the vectors.
struct Sequence {
    name: &'static str,
    prior_mean: [f64; 2],
    /// In m².
    prior_variance: f64,
    /// The root of the process noise per step, in metres.
    drift: f64,
    /// The level at one metre.
    reference_dbm: f64,
    /// Exponent of the path loss.
    exponent: f64,
    steps: &'static [Step],
}

/// An observation of RSS and bearing, in dBm and radians, and the exact means after it.
struct Step {
    /// East, North, Up in metres.
    receiver: [f64; 3],
    value: [f64; 2],
    sigmas: [f64; 2],
    ekf: [f64; 2],
    ukf: [f64; 2],
}

/// Cost of a filter's steps.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    /// Number of steps.
    pub steps: u32,
    /// Cost of all of them, in units of the stopwatch.
    pub total: u32,
    /// Cost of the dearest step.
    pub most: u32,
}

/// Reason why a run ended early; without numbers, as to print decimals costs a quarter of the
/// flash.
#[derive(Clone, Copy, Debug)]
pub enum Failure {
    /// A filter could not be made or could not go on.
    Estimator,
    /// A vector is no observation.
    Observation,
    /// The calibration is out of range.
    Parameter,
    /// The mean after this step, from 0, is not the vectors'.
    Mean {
        /// Name of the sequence.
        sequence: &'static str,
        /// Index of the step.
        step: usize,
    },
    /// The results could not be written.
    Output,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Estimator => f.write_str("a filter refuses the vectors"),
            Self::Observation => f.write_str("a vector is not an observation"),
            Self::Parameter => f.write_str("the calibration is out of range"),
            Self::Mean { sequence, step } => write!(f, "{sequence}, step {step}: another mean"),
            Self::Output => f.write_str("the results cannot be written"),
        }
    }
}

impl From<EstimatorError> for Failure {
    fn from(_: EstimatorError) -> Self {
        Self::Estimator
    }
}

impl From<ObservationError> for Failure {
    fn from(_: ObservationError) -> Self {
        Self::Observation
    }
}

impl From<ParameterError> for Failure {
    fn from(_: ParameterError) -> Self {
        Self::Parameter
    }
}

impl From<fmt::Error> for Failure {
    fn from(_: fmt::Error) -> Self {
        Self::Output
    }
}

/// Runs all sequences through the extended filter and writes the bits of mean, covariance and NIS
/// after each step. `lap` gives what has been spent since it was called before.
///
/// # Errors
///
/// An error when a filter refuses a step, or a mean is off the vectors' by more than 1 µm.
pub fn run_ekf(out: &mut impl Write, lap: impl FnMut() -> u32) -> Result<Cost, Failure> {
    run("ekf", Taylor, |step| step.ekf, out, lap)
}

/// Runs all sequences as [`run_ekf`] does, through the unscented filter: α = 10⁻³, β = 2, κ = 3 −
/// n.
///
/// # Errors
///
/// As [`run_ekf`].
pub fn run_ukf(out: &mut impl Write, lap: impl FnMut() -> u32) -> Result<Cost, Failure> {
    run("ukf", Unscented::pritzl2018(), |step| step.ukf, out, lap)
}

fn run<T: Transform + Copy>(
    filter: &str,
    transform: T,
    exact: impl Fn(&Step) -> [f64; 2],
    out: &mut impl Write,
    mut lap: impl FnMut() -> u32,
) -> Result<Cost, Failure> {
    let mut cost = Cost::default();
    for sequence in SEQUENCES {
        let law = LogDistance::new(sequence.reference_dbm, sequence.exponent)?;
        let motion = RandomWalk::uniform(sequence.drift);
        let prior = Estimate {
            mean: Vector2::from(sequence.prior_mean),
            covariance: Matrix2::from_diagonal_element(sequence.prior_variance),
        };
        let mut kalman = Kalman::<Taylor, _, _, 2, 2>::new(motion, RssBearing::new(law), prior)?
            .with_transform(transform)?
            .with_gate(Gate::pritzl2018());
        for (i, step) in sequence.steps.iter().enumerate() {
            let observation = step.observation()?;
            lap();
            kalman.predict(1.0)?;
            let correction = kalman.update(&observation)?;
            let spent = lap();
            cost.steps += 1;
            cost.total += spent;
            cost.most = cost.most.max(spent);

            let estimate = kalman.estimate();
            write!(out, "{filter} {} {i}", sequence.name)?;
            write_bits(out, &estimate, &correction)?;
            let near = (estimate.mean - Vector2::from(exact(step))).norm() < TOLERANCE;
            if !near {
                return Err(Failure::Mean { sequence: sequence.name, step: i });
            }
        }
    }
    Ok(cost)
}

impl Step {
    fn observation(&self) -> Result<Observation<2>, ObservationError> {
        let [east, north, up] = self.receiver;
        let noise = Matrix2::from_diagonal(&Vector2::from(self.sigmas.map(|sigma| sigma * sigma)));
        Observation::new(0.0, Pose::at(east, north, up), Vector2::from(self.value), noise)
    }
}

fn write_bits(
    out: &mut impl Write,
    estimate: &Estimate<2>,
    correction: &Correction,
) -> fmt::Result {
    let nis = correction.nis().unwrap_or(f64::NAN);
    for number in estimate.mean.iter().chain(estimate.covariance.iter()).chain([&nis]) {
        write!(out, " {:016x}", number.to_bits())?;
    }
    writeln!(out, "{}", if correction.is_rejected() { " rejected" } else { "" })
}
