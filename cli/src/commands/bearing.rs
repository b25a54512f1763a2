use std::path::PathBuf;

use foxhunt::{
    calibration::{CalibrationFile, StationSection},
    config::{BoxedExtractor, ExtractorConfig},
    core::BearingMode,
    geodesy::radians_to_compass_deg,
    overview::Overview,
    page::NotStrikable,
    recorded::{BearingReading, LOW_CONFIDENCE, bearings, correct_arrays},
    recording::Record,
    registry::Registry,
    struck::file_names,
};
use serde::Serialize;

use super::{
    calibration::{Calibration, Part, Surroundings, calibrated, narrate_corrected, parts},
    choice::Extraction,
    recorded::Reading,
    views::{Antennas, Views},
};
use crate::{
    error::CliError,
    output::Context,
    table::{number, table, text},
};

/// Find the bearing of each recorded turn
///
/// Estimates level and direction of arrival of each turn of a directional antenna in a recording,
/// each with its standard deviation, and a confidence: how far the turn looks like one transmitter.
/// Do not rely on a bearing of low confidence.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt bearing sweep.csv\n  \
                        foxhunt bearing rotation.csv --format uavrt-rotation --beacon 4\n  \
                        foxhunt bearing rotation.csv --all --antenna yagi\n  \
                        foxhunt bearing sweep.csv --calibration calibration.toml")]
pub struct Args {
    /// A recording: CSV with named columns
    file: PathBuf,
    /// Read each turn with every extractor; those with an antenna use that of --antenna, or else
    /// the reference patch
    #[arg(long, conflicts_with = "extractor")]
    all: bool,
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    calibration: Calibration,
    #[command(flatten)]
    surroundings: Surroundings,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    views: Views,
}

/// The bearings of a recording in JSON.
#[derive(Debug, Serialize)]
struct Report {
    file: String,
    format: String,
    /// The receiver's surroundings, in the σ of bearings without a calibration.
    site: &'static str,
    site_sigma_deg: f64,
    /// True if levels are in dBm, and not about an unknown reference.
    calibrated: bool,
    turns: Vec<Turn>,
}

/// One turn.
#[derive(Debug, Serialize)]
struct Turn {
    extractor: String,
    line: u64,
    drone: String,
    beacon: Option<String>,
    turn: Option<u32>,
    time_s: f64,
    samples: usize,
    rss_dbm: Option<f64>,
    rss_sigma_db: Option<f64>,
    bearing_deg_compass: Option<f64>,
    bearing_sigma_deg: Option<f64>,
    confidence: Option<f64>,
    low_confidence: Option<bool>,
    /// Reason why there is no bearing.
    no_bearing: Option<String>,
    /// The competing directions, if there are several.
    modes: Vec<Mode>,
}

/// One of several directions.
#[derive(Debug, Serialize)]
struct Mode {
    weight: f64,
    bearing_deg_compass: f64,
    bearing_sigma_deg: f64,
}

impl Turn {
    fn new(extractor: &str, read: &BearingReading) -> Self {
        let sweep = &read.sweep;
        let reading = &read.reading;
        let bearing = reading.bearing.as_ref().ok();
        Self {
            extractor: extractor.to_owned(),
            line: sweep.line,
            drone: sweep.drone.clone(),
            beacon: sweep.beacon_name.clone(),
            turn: sweep.turn,
            time_s: sweep.sweep.time,
            samples: sweep.sweep.samples.len(),
            rss_dbm: Some(reading.rss_dbm),
            rss_sigma_db: Some(reading.rss_sigma_db),
            bearing_deg_compass: bearing.map(|b| radians_to_compass_deg(b.angle)),
            bearing_sigma_deg: bearing.map(|b| b.sigma.to_degrees()),
            confidence: bearing.map(|b| b.confidence),
            low_confidence: bearing.map(|_| read.is_low()),
            no_bearing: reading.bearing.as_ref().err().map(ToString::to_string),
            modes: reading.modes.as_slice().iter().map(Mode::from).collect(),
        }
    }
}

impl Turn {
    /// Returns a ready-made bearing of an array that the calibration corrected; else `None`.
    fn of_array(record: &Record) -> Option<Self> {
        let bearing = record.bearing.filter(|bearing| bearing.is_calibrated)?;
        Some(Self {
            extractor: "recorded".to_owned(),
            line: record.line,
            drone: record.drone.to_string(),
            beacon: record.beacon.as_deref().map(str::to_owned),
            turn: record.turn,
            time_s: record.time.unwrap_or_default(),
            samples: 1,
            rss_dbm: record.rss_dbm,
            rss_sigma_db: None,
            bearing_deg_compass: Some(radians_to_compass_deg(bearing.angle)),
            bearing_sigma_deg: bearing.sigma.map(f64::to_degrees),
            confidence: None,
            low_confidence: None,
            no_bearing: None,
            modes: Vec::new(),
        })
    }
}

impl From<&BearingMode> for Mode {
    fn from(mode: &BearingMode) -> Self {
        Self {
            weight: mode.weight,
            bearing_deg_compass: radians_to_compass_deg(mode.angle),
            bearing_sigma_deg: mode.sigma.to_degrees(),
        }
    }
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    args.views.check(false)?;
    let own = args.calibration.read()?;
    let antenna = Antennas::of(&args.extraction.config(registry, &ExtractorConfig::default())?);
    let files = std::slice::from_ref(&args.file);
    let mut recordings = args.reading.read(files)?;
    narrate_corrected(correct_arrays(&mut recordings, &own.arrays));
    for recording in &recordings {
        let file = args.calibration.or_shipped(&own, recording);
        let mut read = Vec::new();
        let mut parts = parts(recording, &file);
        // A station without a directional antenna has no turns beside those that have.
        let has_turns =
            |part: &Part<'_, '_>| part.recording.records().iter().any(|r| r.boresight.is_some());
        // Nor has an array whose bearings are corrected.
        let is_array =
            recording.records().iter().any(|r| r.bearing.is_some_and(|b| b.is_calibrated));
        if is_array || parts.iter().any(has_turns) {
            parts.retain(has_turns);
        }
        for (number, part) in parts.into_iter().enumerate() {
            for (name, extractor) in extractors(args, registry, &file, part.station.as_deref())? {
                let extractor = extractor.as_ref();
                let turns = bearings(&part.recording, extractor, args.reading.positions)
                    .map_err(CliError::input)?;
                let turns = turns.into_iter().enumerate();
                read.extend(turns.map(|(turn, read)| ((number, turn), name, read)));
            }
        }
        // Turn by turn; a stable sort leaves the extractors in their order.
        read.sort_by_key(|(turn, ..)| *turn);
        let wanted = args.reading.wanted();
        let of_beacon = |(.., read): &&((usize, usize), &str, BearingReading)| {
            wanted.is_none_or(|name| read.sweep.beacon_name.as_deref() == Some(name))
        };
        // A name that is not in the recording is an error, not an empty table.
        if wanted.is_some() {
            args.reading.beacon(&recordings)?;
        }
        let report = Report {
            file: recording.file().to_owned(),
            format: recording.format().to_owned(),
            site: args.surroundings.site().name(),
            site_sigma_deg: args.surroundings.site().sigma().to_degrees(),
            calibrated: recording.is_calibrated(),
            turns: read
                .iter()
                .filter(of_beacon)
                .map(|(_, name, read)| Turn::new(name, read))
                .chain(
                    (recording.records().iter())
                        .filter(|record| wanted.is_none() || record.beacon.as_deref() == wanted)
                        .filter_map(Turn::of_array),
                )
                .collect(),
        };
        output.result(&report, turns)?;
        if args.views.any() {
            let name = if args.all { "all extractors" } else { args.extraction.name() };
            let mut overview = Overview::of_recordings(std::slice::from_ref(recording), name);
            let files = file_names(std::slice::from_ref(recording));
            let file = files.first().map_or("", String::as_str);
            for (_, name, read) in read.iter().filter(of_beacon) {
                overview.add_reading(file, read, name, antenna.known());
            }
            // The list of what is struck out is for `locate --ignore`.
            args.views.write(&overview, Some(&Err(NotStrikable::NoEstimate)), output)?;
        }
    }
    Ok(())
}

/// The extractors of the command line, calibrated. The antennas of a station have one of their own.
fn extractors<'a>(
    args: &'a Args,
    registry: &'a Registry,
    file: &CalibrationFile,
    station: Option<&StationSection>,
) -> Result<Vec<(&'a str, BoxedExtractor)>, CliError> {
    let chosen = if args.all {
        args.extraction.all(registry)?
    } else {
        vec![(args.extraction.name(), args.extraction.build(registry)?)]
    };
    if station.is_none() {
        let calibrate =
            |(name, built)| Ok((name, calibrated(file, None, name, built, &args.surroundings)?));
        return chosen.into_iter().map(calibrate).collect();
    }
    // A station has an extractor of its own; the others do not know its antennas.
    let around = |(name, built)| (name, args.surroundings.around(built));
    let chosen = chosen.into_iter().map(around);
    if args.extraction.is_given() && !args.all {
        return Ok(chosen.collect());
    }
    let extractor = args.extraction.build(registry)?;
    let extractor = calibrated(file, station, "station", extractor, &args.surroundings)?;
    let mut own = vec![("station", extractor)];
    if args.all {
        own.extend(chosen);
    }
    Ok(own)
}

fn turns(report: &Report) -> String {
    let level = if report.calibrated { "RSS dBm" } else { "RSS dB" };
    let mut turns = table(&[
        "extractor",
        "drone",
        "beacon",
        "turn",
        "samples",
        level,
        "±",
        "bearing ° compass",
        "σ °",
        "confidence",
        "remark",
    ])
    .named_by(4);
    for turn in &report.turns {
        let low = turn.low_confidence.is_some_and(|low| low).then_some("low confidence");
        let remark = turn.no_bearing.as_deref().map(|_| "no bearing").or(low).unwrap_or("");
        turns.add_row([
            turn.extractor.clone(),
            turn.drone.clone(),
            text(turn.beacon.as_ref()),
            text(turn.turn),
            turn.samples.to_string(),
            number(turn.rss_dbm, 1),
            number(turn.rss_sigma_db, 1),
            number(turn.bearing_deg_compass, 1),
            number(turn.bearing_sigma_deg, 1),
            number(turn.confidence, 2),
            remark.to_owned(),
        ]);
    }
    let mut lines = vec![turns.to_string()];
    for turn in &report.turns {
        if let Some(reason) = &turn.no_bearing {
            lines.push(format!("no bearing in line {} by {}: {reason}", turn.line, turn.extractor));
        }
    }
    lines.push(format!(
        "Bearings are clockwise from North. A confidence below {LOW_CONFIDENCE} is low: do not \
         rely on the bearing.\nσ without a calibration holds {:.0}° of what a site does to bearings \
         ({}); see --site.",
        report.site_sigma_deg, report.site
    ));
    lines.join("\n")
}
