use std::{
    borrow::Cow,
    collections::BTreeMap,
    fs,
    io::Read,
    path::{Path, PathBuf},
};

use foxhunt::{
    calibration::{
        ArraySection, CalibrationFile, PathLossSection, StationModelSection, StationSection,
    },
    config::BoxedExtractor,
    core::BearingExtractor,
    log::{LOG_BEGIN, Log},
    recorded::{
        CalibrateConfig, StationConfig, calibrate, calibrate_array, calibrate_bearings,
        fit_boresights, has_several_beacons, is_fixed_array, station_boresights,
    },
    recording::{Record, Recording},
    registry::Registry,
    sensors::PathLossFit,
};

use super::{
    calibration::{Part, parts, station_place},
    calibration_report::{Array, Report, Skipped, text},
    choice::Extraction,
    recorded::{LatLon, Reading, no_degrees},
};
use crate::{
    error::CliError,
    output::{Context, check_writable},
};

/// Calibrate path loss, bearings and a station's antennas
///
/// Fits to recordings of a transmitter at a known place (from --truth, or from the recording's own
/// columns) all that they allow: the path loss P = P₀ − 10 γ log₁₀ d with the joint
/// confidence region of P₀ and γ; the offset of bearings, and whether it depends on the heading,
/// as a disturbed compass has it; the deviation of arrays that do not turn over the direction of
/// arrival, from one beacon or from all whose place is known; the scale of their σ; and the
/// boresights of stations with fixed antennas, all stations together. Prints what cannot be fitted,
/// and why.
///
/// Logs of hunts (.jsonl) with a truth are recordings, too; their bearings and σ are those of the
/// hunt's extractor.
///
/// --out writes the file that `foxhunt locate`, `bearing`, `hunt` and `campaign` take as
/// --calibration.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
                        foxhunt calibrate flight.csv --truth 50.0755,14.4378 --max-exponent 3\n  \
                        foxhunt calibrate monday.csv tuesday.csv --out calibration.toml\n  \
                        foxhunt calibrate out/hunt.jsonl")]
pub struct Args {
    /// Recordings: CSV with named columns, or logs of hunts
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The place of the transmitter in degrees (WGS84) [default: the recordings' own truth]
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    truth: Option<LatLon>,
    /// The height of the transmitter above the ground, in metres
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_hyphen_values = true)]
    target_up_m: f64,
    /// The largest path-loss exponent [default: no bound]
    #[arg(long, value_name = "V", allow_hyphen_values = true)]
    max_exponent: Option<f64>,
    /// Leave out bursts that a station received from nearer than this, in metres
    #[arg(long, value_name = "M", default_value_t = 30.0)]
    least_range_m: f64,
    /// The file to write the calibration to
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    reading: Reading,
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    if !args.target_up_m.is_finite() {
        return Err(CliError::input(format!(
            "--target-up-m is {}; it must be finite",
            args.target_up_m
        )));
    }
    if !(args.least_range_m >= 0.0 && args.least_range_m.is_finite()) {
        let message =
            format!("--least-range-m is {}; it must be finite, zero or more", args.least_range_m);
        return Err(CliError::input(message));
    }
    if let Some(most) = args.max_exponent.filter(|most| !(*most > 0.0 && most.is_finite())) {
        return Err(CliError::input(format!("--max-exponent is {most}; it must be positive")));
    }
    args.out.iter().try_for_each(|path| check_writable(path))?;
    let recordings = read(args)?;
    // An array's error is that of any beacon's bearings.
    let all_beacons = args.reading.wanted().is_none()
        && args.truth.is_none()
        && has_several_beacons(&recordings)
        && by_station(&recordings).values().any(|own| is_fixed_array(own));
    let beacon = if all_beacons { None } else { args.reading.beacon(&recordings)? };
    let truth = match args.truth {
        Some(truth) => {
            let frame = recordings.iter().find_map(Recording::frame);
            Some(truth.in_frame(frame).ok_or_else(|| no_degrees("--truth"))?.into())
        }
        None => None,
    };
    let config = CalibrateConfig {
        truth,
        target_up_m: args.target_up_m,
        max_exponent: args.max_exponent,
        positions: args.reading.positions,
    };
    let report = if all_beacons {
        fit_all_beacons(&recordings, &config)?
    } else {
        fit(args, &recordings, beacon, registry, &config)?
    };
    output.result(&report, text)?;
    if let Some(out) = &args.out {
        fs::write(out, report.file.to_toml()).map_err(|error| CliError::writing(out, error))?;
        output.note(&format!("calibration: {}", out.display()))?;
    }
    Ok(())
}

/// Reads logs of hunts, or else recordings.
fn read(args: &Args) -> Result<Vec<Recording>, CliError> {
    let is_log = |path: &&PathBuf| path.extension().is_some_and(|ending| ending == "jsonl");
    let logs: Vec<&PathBuf> = args.files.iter().filter(is_log).collect();
    if logs.is_empty() || !logs.iter().all(|path| is_hunt(path)) {
        return args.reading.read(&args.files);
    }
    if logs.len() < args.files.len() {
        return Err(CliError::input("give logs or recordings, not both"));
    }
    if args.extraction.is_given() {
        let text = "--extractor and --antenna are for recordings: a log has bearings that were \
                    made already";
        return Err(CliError::input(text));
    }
    logs.into_iter()
        .map(|path| {
            let log = Log::read(path).map_err(CliError::input)?;
            let name = path.display().to_string();
            let nothing = || CliError::input(format!("{name}: the log has no reception"));
            Recording::of_log(&log, &name).ok_or_else(nothing)
        })
        .collect()
}

/// Returns true if a file begins as the log of a hunt does; recordings of others end with .jsonl as
/// well.
fn is_hunt(path: &Path) -> bool {
    let Ok(file) = fs::File::open(path) else { return false };
    let mut begin = Vec::new();
    let read = file.take(64).read_to_end(&mut begin);
    read.is_ok() && begin.starts_with(LOG_BEGIN)
}

/// Fits the deviations of arrays to the bearings of all beacons; an error if no array is found.
fn fit_all_beacons(recordings: &[Recording], config: &CalibrateConfig) -> Result<Report, CliError> {
    let mut report = Report::new(recordings, None);
    let taken = fit_arrays(recordings, None, &mut report, config);
    let why = "there are several beacons; choose one with --beacon";
    report.skip("path loss", why.to_owned());
    let others = by_station(recordings).into_iter().filter(|(name, _)| !taken.contains(name));
    for (name, _) in others {
        let name = name.map_or_else(String::new, |name| format!("{name}: "));
        report.skip("bearings", format!("{name}{why}"));
    }
    if report.file.arrays.is_empty() {
        let skipped = report.skipped.iter().map(|own| format!("{}: {}", own.what, own.why));
        return Err(CliError::input(skipped.collect::<Vec<_>>().join("; ")));
    }
    Ok(report)
}

/// Fits the deviation of each array that does not turn, and returns the names of those whose
/// bearings have one that depends on the direction.
fn fit_arrays(
    recordings: &[Recording],
    beacon: Option<Option<&str>>,
    report: &mut Report,
    config: &CalibrateConfig,
) -> Vec<Option<String>> {
    let mut taken = Vec::new();
    for (name, own) in by_station(recordings).into_iter().filter(|(_, own)| is_fixed_array(own)) {
        let called = name.as_ref().map_or_else(String::new, |name| format!("{name}: "));
        let fitted = match calibrate_array(&own, beacon, config) {
            Ok(Ok(fitted)) => fitted,
            Ok(Err(error)) => {
                report.skip("array", format!("{called}{error}"));
                continue;
            }
            Err(error) => {
                report.skip("array", error.to_string());
                continue;
            }
        };
        // With one beacon a constant is fitted as for any other receiver.
        if fitted.fit.deviation.harmonics().len() > 0 || beacon.is_none() {
            let sigma = fitted.sigma.as_ref();
            report.file.arrays.push(ArraySection::new(name.as_deref(), &fitted.fit, sigma));
            report.arrays.push(Array::from(&fitted));
            taken.push(name);
        }
    }
    taken
}

/// Fits what the recordings allow; an error if that is nothing.
fn fit(
    args: &Args,
    recordings: &[Recording],
    beacon: Option<String>,
    registry: &Registry,
    config: &CalibrateConfig,
) -> Result<Report, CliError> {
    let mut report = Report::new(recordings, beacon.clone());
    let fixed = fit_fixed(args, recordings, &mut report, config);
    let arrays = fit_arrays(recordings, Some(beacon.as_deref()), &mut report, config);
    let is_array = |own: &Recording| {
        let name = own.drones().first().filter(|_| own.names_drones()).map(|n| (*n).to_owned());
        arrays.contains(&name)
    };
    // Stations' antennas do not turn.
    let turns: Vec<Recording> = recordings
        .iter()
        .flat_map(Recording::by_drone)
        .filter(|own| !(fixed && station_boresights([own]).is_some() || is_array(own)))
        .collect();
    let fixed = fixed || !arrays.is_empty();
    let has = |wanted: fn(&Record) -> bool| turns.iter().flat_map(Recording::records).any(wanted);
    if has(|record| record.boresight.is_some() || record.bearing.is_some()) {
        let extractor = args.extraction.build(registry)?;
        let turns = if fixed { &turns[..] } else { recordings };
        match calibrate_bearings(turns, beacon.as_deref(), extractor.as_ref(), config) {
            Ok(fitted) => {
                let turns = has(|record| record.boresight.is_some());
                let name = if turns { args.extraction.name() } else { "recorded" };
                report.file.bearings = fitted.section(name);
                report.bearings(&fitted);
            }
            Err(error) => report.skip("bearings", error.to_string()),
        }
    } else if !arrays.is_empty() {
        // The table of arrays has their bearings.
    } else if fixed {
        let why = "the antennas do not turn: their boresights are the station's";
        report.skip("bearings", why.to_owned());
    } else {
        report.skip("bearings", "there is neither a turn of an antenna nor a bearing".to_owned());
    }

    // Last, for the levels of a station's turns need its pattern.
    let mut read: Vec<(Cow<'_, Recording>, BoxedExtractor)> = Vec::new();
    for recording in recordings {
        for Part { recording, station } in parts(recording, &report.file) {
            let extractor: BoxedExtractor = match station {
                Some(station) => Box::new(station.build().map_err(CliError::input)?),
                None => args.extraction.build(registry)?,
            };
            read.push((recording, extractor));
        }
    }
    let each: Vec<(&Recording, &dyn BearingExtractor)> =
        read.iter().map(|(own, extractor)| (&**own, &**extractor as _)).collect();
    let why = match calibrate(&each, beacon.as_deref(), config) {
        Ok(calibration) if falls(&calibration.fit) => {
            report.file.path_loss = Some(PathLossSection::from(&calibration.fit));
            report.path_loss(&calibration);
            return Ok(report);
        }
        // A law that may as well rise with range would send a hunt astray.
        Ok(calibration) => CliError::input(format!("{NO_FALL} (γ {})", calibration.fit.exponent)),
        Err(error) => CliError::input(error),
    };
    let CalibrationFile { bearings, stations, arrays, .. } = &report.file;
    if bearings.is_none() && stations.is_empty() && arrays.is_empty() {
        return Err(why);
    }
    report.skipped.insert(0, Skipped { what: "path loss", why: why.to_string() });
    Ok(report)
}

/// Fits all stations of fixed antennas together; returns false if there is none. Stations with one
/// antenna belong to them where another one has several.
fn fit_fixed(
    args: &Args,
    recordings: &[Recording],
    report: &mut Report,
    config: &CalibrateConfig,
) -> bool {
    let station = StationConfig {
        positions: config.positions,
        least_range_m: args.least_range_m,
        truth: config.truth,
    };
    let mut several = false;
    let mut fixed = Vec::new();
    let mut others = Vec::new();
    for (name, own) in by_station(recordings) {
        match station_boresights(&own) {
            Some(boresights) => {
                several |= boresights.len() > 1;
                fixed.push((name, own));
            }
            None => others.push((name, own)),
        }
    }
    if !several {
        return false;
    }
    let called = |name: Option<&str>, why: String| match name {
        Some(name) => format!("{name}: {why}"),
        None => why,
    };
    for (name, own) in others {
        let turns = own.iter().flat_map(Recording::records).any(|r| r.boresight.is_some());
        let why = if turns {
            "its antenna turns"
        } else {
            "no antenna of a known boresight; its levels are used as they are"
        };
        report.skip("station", called(name.as_deref(), why.to_owned()));
    }
    let own: Vec<&[Recording]> = fixed.iter().map(|(_, own)| &own[..]).collect();
    let fitted = match fit_boresights(&own, report.beacon(), &station) {
        Ok(fitted) => fitted,
        Err(error) => {
            report.skip("stations", error.to_string());
            return true;
        }
    };
    let mut count = 0;
    for ((name, own), fitted) in fixed.iter().zip(&fitted.stations) {
        match fitted {
            Ok(fitted) => {
                let place = own.first().and_then(station_place);
                let section = StationSection::from(&fitted.fit);
                report.file.stations.push(StationSection { name: name.clone(), place, ..section });
                report.stations.push(fitted.into());
                count += 1;
            }
            Err(error) => report.skip("station", called(name.as_deref(), error.to_string())),
        }
    }
    let model = StationModelSection::from(&fitted.model);
    report.file.station_model = Some(StationModelSection { stations: Some(count), ..model });
    true
}

/// Groups recordings by their receiver's name, as each has its own antennas. Recordings without a
/// name count as one receiver.
fn by_station(recordings: &[Recording]) -> BTreeMap<Option<String>, Vec<Recording>> {
    let mut stations: BTreeMap<Option<String>, Vec<Recording>> = BTreeMap::new();
    for own in recordings.iter().flat_map(Recording::by_drone) {
        let name = own.drones().first().filter(|_| own.names_drones()).map(|n| (*n).to_owned());
        stations.entry(name).or_default().push(own);
    }
    stations
}

/// Reason why a path loss that was fitted is not used.
const NO_FALL: &str = "the levels do not show that power falls with range: the exponent's 95 % \
     interval reaches 0; points over a wider span of ranges are needed";

/// Returns true if power falls with range for certain.
fn falls(fit: &PathLossFit) -> bool {
    let certain = fit.exponent_interval(0.95).is_none_or(|[low, _]| low > 0.0);
    fit.exponent > 0.0 && (fit.at_bound || certain)
}
