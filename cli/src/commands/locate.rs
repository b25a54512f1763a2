use std::path::PathBuf;

use foxhunt::{
    calibration::CalibrationFile,
    core::{Ellipse, EstimatorError, nalgebra::Vector2},
    geodesy::Geodetic,
    hunt::PlaceEstimate,
    locate::{LocateConfig, LocateError, Located, Power, Rival},
    recorded::{ReceptionConfig, receptions, recorded_truth},
    recording::Recording,
    report::Place,
};
use serde::Serialize;

use super::{
    calibration::{Calibration, calibrated},
    choice,
    extraction::Extraction,
    parameter::{EastNorthUp, Parameter},
    recorded::{LatLon, Reading, no_degrees},
};
use crate::{
    context::Context,
    error::CliError,
    output::warn,
    table::{number, table, text},
};

/// Locate a transmitter from recorded flights
///
/// Estimates the place of one transmitter from one or several recordings: turns of a directional
/// antenna, levels of an omnidirectional one, ready-made bearings, ranges or differences. Without
/// --p0-dbm and --exponent, or a --calibration that has them, the transmitter's power is estimated
/// along with its place.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt locate flight.csv\n  \
                        foxhunt locate uav1.csv uav2.csv --truth 50.0755,14.4378 \
                        --p0-dbm -29.06 --exponent 2.765")]
pub(crate) struct Args {
    /// Recordings: CSV with named columns
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Where the transmitter is, in degrees (WGS84), for the error; the recordings' own truth
    /// unless given
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    truth: Option<LatLon>,
    /// The estimator (`foxhunt list estimators` describes them); chosen by what was recorded unless
    /// given
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// The power at one metre in dBm, or `free` where it is not known
    #[arg(long, value_name = "V|free", default_value = "free", allow_hyphen_values = true)]
    p0_dbm: Parameter,
    /// The path-loss exponent, or `free` where it is not known
    #[arg(long, value_name = "V|free", default_value = "free", allow_hyphen_values = true)]
    exponent: Parameter,
    /// How high the transmitter is above the ground, in metres
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_hyphen_values = true)]
    target_up_m: f64,
    /// How far the transmitter may lie beyond the area that was flown over, in metres
    #[arg(long, value_name = "M", default_value_t = 200.0)]
    margin_m: f64,
    /// How uncertain the receiver's own place is, in metres on each axis, as its GNSS has it; known
    /// unless given
    #[arg(long, value_name = "M")]
    receiver_sigma_m: Option<f64>,
    /// Where the reference receiver of range and level differences is, in metres of the local frame
    #[arg(long, value_name = "E,N,U", allow_hyphen_values = true)]
    reference_m: Option<EastNorthUp>,
    /// The seed of estimators that draw random numbers
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    #[command(flatten)]
    calibration: Calibration,
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    reading: Reading,
}

/// A place that was found, as JSON has it.
#[derive(Debug, Serialize)]
struct Report {
    estimator: String,
    beacon: Option<String>,
    estimate: Estimated,
    ellipse_95: Option<Ellipse>,
    truth: Option<Place>,
    error_m: Option<f64>,
    nees: Option<f64>,
    observations: usize,
    rejected: usize,
    /// The probability on the border of the area that was searched, for estimators with one.
    border_mass: Option<f64>,
    /// Other places that are nearly as probable, for estimators that look for them.
    rivals: Vec<RivalPlace>,
}

/// Another place that is nearly as probable.
#[derive(Debug, Serialize)]
struct RivalPlace {
    lat_deg: Option<f64>,
    lon_deg: Option<f64>,
    east_m: f64,
    north_m: f64,
    /// The density there over that at the estimate.
    relative_density: f64,
    error_m: Option<f64>,
}

/// An estimate on Earth and in the local frame.
#[derive(Debug, Serialize)]
struct Estimated {
    /// Absent where the recordings are in local metres.
    lat_deg: Option<f64>,
    lon_deg: Option<f64>,
    east_m: f64,
    north_m: f64,
    covariance_m2: [[f64; 2]; 2],
}

/// With more probability than this on the border of the area the place is in doubt.
const MUCH_BORDER: f64 = 0.05;

pub(crate) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry } = context;
    check(args)?;
    let own = args.calibration.read()?;
    // Mistakes of the command line are reported before those of files.
    power(args, &own)?;
    let recordings = args.reading.read(&args.files)?;
    let beacon = args.reading.beacon(&recordings)?;
    let format = recordings.first().map_or("", Recording::format);
    let calibration = args.calibration.or_shipped(&own, format);
    let power = power(args, &calibration)?;
    let mut extractor = args.extraction.build(registry)?;
    // A station has an extractor of its own, unless another one is given.
    if calibration.station.is_none() || !args.extraction.is_given() {
        extractor = calibrated(&calibration, args.extraction.name(), extractor)?;
    }
    let reading = ReceptionConfig {
        positions: args.reading.positions,
        bearings: calibration.bearing_calibration(),
        receiver_sigma_m: args.receiver_sigma_m,
        ..ReceptionConfig::default()
    };
    let received = receptions(&recordings, beacon.as_deref(), extractor.as_ref(), &reading)
        .map_err(CliError::input)?;

    let estimator = match &args.estimator {
        Some(name) => choice::estimator(registry, name, "--estimator")?,
        None => registry.suited_to(&received).map_err(CliError::input)?,
    };
    let config = LocateConfig {
        power,
        target_up_m: args.target_up_m,
        margin_m: args.margin_m,
        reference_m: args.reference_m.map(Into::into),
        seed: args.seed,
    };
    let truth = truth(args, &recordings)?;
    let located = estimator.locate(&received, &config).map_err(|error| match error {
        LocateError::Start(EstimatorError::Unsupported { .. }) => CliError::input(error),
        LocateError::Start(_) => CliError::failure(error),
        error => CliError::input(error),
    })?;
    if located.border_mass.is_some_and(|mass| mass > MUCH_BORDER) {
        warn(
            "the place is in doubt: it may lie outside the area that was searched; \
             see --margin-m",
        );
    }
    let name = estimator.name.to_string();
    let report = Report::new(name, beacon, &recordings, args.target_up_m, truth, &located);
    output.result(&report, place)
}

/// Refuses numbers that are out of range.
fn check(args: &Args) -> Result<(), CliError> {
    if !args.target_up_m.is_finite() {
        return Err(CliError::input(format!("--target-up-m is {}, no height", args.target_up_m)));
    }
    if !(args.margin_m > 0.0 && args.margin_m.is_finite()) {
        let message = format!("--margin-m is {}; it must be positive", args.margin_m);
        return Err(CliError::input(message));
    }
    Ok(())
}

/// What is known of the transmitter's power, by the flags or else by the calibration.
fn power(args: &Args, calibration: &CalibrationFile) -> Result<Power, CliError> {
    match (args.p0_dbm, args.exponent) {
        (Parameter::Free, Parameter::Free) => {
            Ok(calibration.path_loss.as_ref().map_or(Power::Free, |law| Power::Known {
                reference_dbm: law.p0_dbm,
                exponent: law.exponent,
            }))
        }
        (Parameter::Value(reference_dbm), Parameter::Value(exponent)) => {
            Ok(Power::Known { reference_dbm, exponent })
        }
        _ => Err(CliError::input("--p0-dbm and --exponent go together: both numbers or both free")),
    }
}

/// Where the transmitter truly is, if that is known.
fn truth(args: &Args, recordings: &[Recording]) -> Result<Option<Vector2<f64>>, CliError> {
    match args.truth {
        None => Ok(recorded_truth(recordings)),
        Some(truth) => {
            let frame = recordings.iter().find_map(Recording::frame);
            let place = truth.in_frame(frame).ok_or_else(|| no_degrees("--truth"))?;
            Ok(Some(place.into()))
        }
    }
}

impl Report {
    fn new(
        estimator: String,
        beacon: Option<String>,
        recordings: &[Recording],
        target_up_m: f64,
        truth: Option<Vector2<f64>>,
        located: &Located,
    ) -> Self {
        let estimate = &located.estimate;
        let frame = recordings.iter().find_map(Recording::frame);
        let on_earth = |place: &Vector2<f64>| -> Option<Geodetic> {
            frame.map(|frame| frame.to_geodetic(&place.push(target_up_m)))
        };
        let rival = |rival: &Rival| {
            let on_earth = on_earth(&rival.place);
            RivalPlace {
                lat_deg: on_earth.map(|place| place.lat_deg),
                lon_deg: on_earth.map(|place| place.lon_deg),
                east_m: rival.place.x,
                north_m: rival.place.y,
                relative_density: rival.relative_density,
                error_m: truth.map(|truth| (rival.place - truth).norm()),
            }
        };
        let rivals = located.rivals.iter().map(rival).collect();
        let on_earth = on_earth(&estimate.mean);
        Self {
            estimator,
            beacon,
            estimate: Estimated {
                lat_deg: on_earth.map(|place| place.lat_deg),
                lon_deg: on_earth.map(|place| place.lon_deg),
                east_m: estimate.mean.x,
                north_m: estimate.mean.y,
                covariance_m2: PlaceEstimate::from(estimate).covariance_m2,
            },
            ellipse_95: located.ellipse_95(),
            truth: truth.map(Place::from),
            error_m: truth.map(|truth| (estimate.mean - truth).norm()),
            nees: truth.and_then(|truth| estimate.nees(&truth)),
            observations: located.observations,
            rejected: located.rejected,
            border_mass: located.border_mass,
            rivals,
        }
    }
}

fn place(report: &Report) -> String {
    let mut place = table(&[
        "estimator",
        "lat °",
        "lon °",
        "east m",
        "north m",
        "95 % ellipse m",
        "along °",
        "error m",
        "NEES",
        "used",
        "rejected",
    ]);
    let axes = report.ellipse_95.map(|e| format!("{:.1} × {:.1}", e.semi_major, e.semi_minor));
    place.add_row([
        report.estimator.clone(),
        number(report.estimate.lat_deg, 6),
        number(report.estimate.lon_deg, 6),
        number(report.estimate.east_m, 1),
        number(report.estimate.north_m, 1),
        text(axes),
        number(report.ellipse_95.map(|e| e.orientation.to_degrees()), 0),
        number(report.error_m, 1),
        number(report.nees, 2),
        report.observations.to_string(),
        report.rejected.to_string(),
    ]);
    let legend = "East and north from the first usable position; the ellipse's semi-axes, and the \
                  direction of the\nlonger one counter-clockwise from East.";
    let rivals = if report.rivals.is_empty() { String::new() } else { rivals(&report.rivals) };
    format!("{place}\n{legend}{rivals}")
}

fn rivals(rivals: &[RivalPlace]) -> String {
    let mut places =
        table(&["rival", "lat °", "lon °", "east m", "north m", "relative density", "error m"]);
    for (number_of, rival) in (1..).zip(rivals) {
        places.add_row([
            i32::to_string(&number_of),
            number(rival.lat_deg, 6),
            number(rival.lon_deg, 6),
            number(rival.east_m, 1),
            number(rival.north_m, 1),
            number(rival.relative_density, 2),
            number(rival.error_m, 1),
        ]);
    }
    format!(
        "\n\nOther places fit nearly as well, and the ellipse does not include \
         them:\n{places}\nThe density is that of the posterior, over that at the place above."
    )
}
