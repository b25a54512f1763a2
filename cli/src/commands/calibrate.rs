use std::path::PathBuf;

use foxhunt::{
    config::ExtractorConfig,
    recorded::{CalibrateConfig, Calibration, calibrate},
    recording::Recording,
};
use serde::Serialize;

use super::recorded::{LatLon, Reading, no_degrees};
use crate::{
    error::CliError,
    output::Output,
    table::{number, table},
};

/// Fit the path loss to a recording with a known transmitter
///
/// Fits the log-distance law, P = P₀ − 10 γ log₁₀ d, to what was heard of a transmitter whose
/// place is known: from --truth, or from the recording's own columns (its place, or the ranges).
/// What comes out is what `foxhunt locate` takes as --p0-dbm and --exponent.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  \
                        foxhunt calibrate flight.csv --truth 50.0755,14.4378 --max-exponent 3")]
pub(crate) struct Args {
    /// A recording: CSV with named columns
    file: PathBuf,
    /// Where the transmitter is, in degrees (WGS84); the recording's own truth unless given
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    truth: Option<LatLon>,
    /// How high the transmitter is above the ground, in metres
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_hyphen_values = true)]
    target_up_m: f64,
    /// The largest exponent that is let through; without it there is no bound
    #[arg(long, value_name = "V")]
    max_exponent: Option<f64>,
    #[command(flatten)]
    reading: Reading,
}

/// A fitted path loss, as JSON has it.
#[derive(Debug, Serialize)]
struct Report {
    file: String,
    beacon: Option<String>,
    /// Whether levels are in dBm, and not about an unknown reference.
    calibrated: bool,
    p0_dbm: f64,
    p0_standard_error_db: f64,
    exponent: f64,
    /// Absent where the bound holds the exponent.
    exponent_standard_error: Option<f64>,
    at_bound: bool,
    rmse_db: f64,
    sigma_db: f64,
    points: usize,
    nearest_m: f64,
    farthest_m: f64,
}

pub(crate) fn run(args: &Args, output: Output) -> Result<(), CliError> {
    if !args.target_up_m.is_finite() {
        return Err(CliError::input(format!("--target-up-m is {}, no height", args.target_up_m)));
    }
    let recordings = args.reading.read(std::slice::from_ref(&args.file))?;
    let beacon = args.reading.beacon(&recordings)?;
    let extractor = ExtractorConfig::default().build().map_err(CliError::input)?;
    for recording in &recordings {
        let truth = match args.truth {
            Some(truth) => {
                let place = truth.in_frame(recording.frame());
                Some(place.ok_or_else(|| no_degrees("--truth"))?.into())
            }
            None => None,
        };
        let config = CalibrateConfig {
            truth,
            target_up_m: args.target_up_m,
            max_exponent: args.max_exponent,
            positions: args.reading.positions,
        };
        let calibration = calibrate(recording, beacon.as_deref(), extractor.as_ref(), &config)
            .map_err(CliError::input)?;
        output.result(&Report::new(recording, beacon.clone(), &calibration), fitted)?;
    }
    Ok(())
}

impl Report {
    fn new(recording: &Recording, beacon: Option<String>, calibration: &Calibration) -> Self {
        let fit = &calibration.fit;
        let error = |index: usize| fit.covariance[(index, index)].sqrt();
        Self {
            file: recording.file().to_owned(),
            beacon,
            calibrated: recording.is_calibrated(),
            p0_dbm: fit.reference_dbm,
            p0_standard_error_db: error(0),
            exponent: fit.exponent,
            exponent_standard_error: (!fit.at_bound).then(|| error(1)),
            at_bound: fit.at_bound,
            rmse_db: fit.rmse_db,
            sigma_db: fit.sigma_db,
            points: fit.points,
            nearest_m: calibration.nearest_m,
            farthest_m: calibration.farthest_m,
        }
    }
}

fn fitted(report: &Report) -> String {
    let unit = if report.calibrated { "dBm" } else { "dB" };
    let mut fitted = table(&["parameter", "value", "standard error"]);
    fitted.add_row([
        format!("P₀ {unit}"),
        number(report.p0_dbm, 2),
        number(report.p0_standard_error_db, 2),
    ]);
    fitted.add_row([
        "exponent γ".to_owned(),
        number(report.exponent, 3),
        number(report.exponent_standard_error, 3),
    ]);
    let mut lines = vec![fitted.to_string()];
    lines.push(format!(
        "{} points from {:.1} m to {:.1} m; RMSE {:.2} dB, σ {:.2} dB",
        report.points, report.nearest_m, report.farthest_m, report.rmse_db, report.sigma_db
    ));
    if report.at_bound {
        lines.push("The exponent is held by --max-exponent.".to_owned());
    }
    if !report.calibrated {
        lines.push("The levels are about an unknown reference, and so is P₀.".to_owned());
    }
    lines.join("\n")
}
