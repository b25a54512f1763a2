use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use foxhunt::{
    geodesy::compass_deg_to_radians,
    picture::antenna_svg,
    recorded::{KnownDirection, learn_antenna},
    recording::Recording,
    sensors::{Antenna, AntennaConfig, LearnedPattern, MsiFile, PatternTable, SharedAntenna},
};
use serde::Serialize;

use super::recorded::{LatLon, Reading, no_degrees};
use crate::{
    error::{CliError, InFile},
    output::{Output, check_writable},
    table::{number, table},
};

/// Print the figures of an antenna, and convert its file
///
/// Reads an antenna from a file (MSI Planet .msi or .pln, or .csv with one angle or with both), or
/// takes one by its name, and prints its gain, beamwidths, front-to-back ratio and directivity.
///
/// With --learn, learns the pattern from recorded turns with a transmitter in a known direction: at
/// --truth, at --bearing-deg, or at the recordings' own truth. Its gain is about the mean over the
/// turn.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt antenna panel.msi --out panel.svg\n  \
                        foxhunt antenna yagi --write yagi.msi\n  \
                        foxhunt antenna reference-patch --json\n  \
                        foxhunt antenna --learn turn.csv --bearing-deg 137 --write mine.csv")]
pub struct Args {
    /// An antenna file, or one of isotropic, dipole, cardioid, patch, yagi, reference-patch
    #[arg(value_name = "FILE|NAME", required_unless_present = "learn", conflicts_with = "learn")]
    antenna: Option<String>,
    /// Learn the pattern from the turns of these recordings
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    learn: Vec<PathBuf>,
    /// With --learn, the place of the transmitter in degrees (WGS84)
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true, conflicts_with = "antenna")]
    truth: Option<LatLon>,
    /// With --learn, the transmitter's direction in compass degrees, the same for all turns
    #[arg(
        long,
        value_name = "DEG",
        allow_hyphen_values = true,
        conflicts_with_all = ["antenna", "truth"]
    )]
    bearing_deg: Option<f64>,
    #[command(flatten)]
    reading: Reading,
    /// Draw both cuts through the main lobe
    #[arg(long, value_name = "SVG")]
    out: Option<PathBuf>,
    /// Write the antenna to a file: its two cuts (.msi, .pln) or its horizontal one (.csv)
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
}

/// The figures of an antenna in JSON.
#[derive(Debug, Serialize)]
struct Report {
    antenna: String,
    gain_dbi: f64,
    /// Azimuth of the main lobe, counter-clockwise from the boresight.
    main_lobe_azimuth_deg: f64,
    main_lobe_elevation_deg: f64,
    /// Half-power beamwidth in azimuth; absent if the gain never falls by half.
    azimuth_beamwidth_deg: Option<f64>,
    elevation_beamwidth_deg: Option<f64>,
    front_to_back_db: f64,
    directivity_dbi: f64,
    /// Electrical tilt in a vendor's file, if it has one in numbers; positive downwards.
    electrical_tilt_deg: Option<f64>,
    /// The header of a vendor's file.
    header: BTreeMap<String, String>,
    /// Fit of a learned pattern.
    #[serde(skip_serializing_if = "Option::is_none")]
    learned: Option<Fit>,
}

/// The fit of a learned pattern.
#[derive(Debug, Serialize)]
struct Fit {
    /// Number of positions of turns that it was fitted to.
    directions: usize,
    harmonics: u16,
    /// Standard deviation of the positions' levels about it.
    sigma_db: f64,
}

pub fn run(args: &Args, output: Output) -> Result<(), CliError> {
    args.write.iter().chain(&args.out).try_for_each(|path| check_writable(path))?;
    let (name, antenna, vendor, learned) = match &args.antenna {
        Some(name) => {
            let (antenna, vendor) = known(name)?;
            (name.as_str(), antenna, vendor, None)
        }
        None => {
            let LearnedPattern { table, harmonics, sigma_db, directions } = learn(args)?;
            let antenna: SharedAntenna = Arc::new(table);
            ("learned", antenna, None, Some(Fit { directions, harmonics, sigma_db }))
        }
    };
    if let Some(path) = &args.write {
        write(path, name, &antenna, vendor.as_ref())?;
    }
    if let Some(path) = &args.out {
        let svg = antenna_svg(name, &antenna).map_err(CliError::failure)?;
        fs::write(path, svg).map_err(|error| CliError::writing(path, error))?;
    }
    let report = Report { learned, ..Report::new(name, &antenna, vendor.as_ref()) };
    output.result(&report, figures)
}

/// The antenna of a name or a file, and a vendor's file as such.
fn known(name: &str) -> Result<(SharedAntenna, Option<MsiFile>), CliError> {
    let config = AntennaConfig::named(name);
    let config = config.unwrap_or_else(|| AntennaConfig::File(PathBuf::from(name)));
    let antenna = config.build().map_err(|error| {
        let names = AntennaConfig::NAMES.join(", ");
        let unknown = Path::new(name).extension().is_none();
        let more = if unknown { format!("; the names are {names}") } else { String::new() };
        CliError::input(format!("{error}{more}"))
    })?;
    Ok((antenna, vendor_file(&config)?))
}

/// The pattern of recorded turns.
fn learn(args: &Args) -> Result<LearnedPattern, CliError> {
    let recordings = args.reading.read(&args.learn)?;
    let beacon = args.reading.beacon(&recordings)?;
    let known = match (args.truth, args.bearing_deg) {
        (Some(truth), _) => {
            let frame = recordings.iter().find_map(Recording::frame);
            let place = truth.in_frame(frame).ok_or_else(|| no_degrees("--truth"))?;
            KnownDirection::Place(place.into())
        }
        (None, Some(degrees)) => KnownDirection::Bearing(compass_deg_to_radians(degrees)),
        (None, None) => KnownDirection::Recorded,
    };
    learn_antenna(&recordings, beacon.as_deref(), known, args.reading.positions)
        .map_err(CliError::input)
}

/// The vendor's file behind an antenna, if there is one: for its header.
fn vendor_file(config: &AntennaConfig) -> Result<Option<MsiFile>, CliError> {
    let AntennaConfig::File(path) = config else { return Ok(None) };
    if !is_msi(path) {
        return Ok(None);
    }
    let in_file = |source| CliError::input(InFile { file: path.display().to_string(), source });
    let bytes = fs::read(path).map_err(|error| in_file(error.into()))?;
    let file = MsiFile::parse(&String::from_utf8_lossy(&bytes));
    file.map(Some).map_err(|error| in_file(error.into()))
}

fn is(path: &Path, extensions: &[&str]) -> bool {
    let own = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    extensions.iter().any(|e| e.eq_ignore_ascii_case(own))
}

fn is_msi(path: &Path) -> bool {
    is(path, &["msi", "pln"])
}

/// Writes the antenna in the form that the file's extension asks for.
fn write(
    path: &Path,
    name: &str,
    antenna: &SharedAntenna,
    vendor: Option<&MsiFile>,
) -> Result<(), CliError> {
    let text = if is_msi(path) {
        // What came with a header keeps it.
        let file = vendor.cloned().unwrap_or_else(|| MsiFile::sampled(name, antenna));
        file.to_string()
    } else if is(path, &["csv"]) {
        let lobe = antenna.main_lobe();
        let gain = |degree: u16| antenna.gain_dbi(f64::from(degree).to_radians(), lobe.elevation);
        let gains: Vec<f64> = (0..360).map(gain).collect();
        PatternTable::equally_spaced(&gains).map_err(CliError::failure)?.to_csv()
    } else {
        let path = path.display();
        return Err(CliError::input(format!("--write {path}: it must be .msi, .pln or .csv")));
    };
    fs::write(path, text).map_err(|error| CliError::writing(path, error))
}

impl Report {
    fn new(name: &str, antenna: &dyn Antenna, vendor: Option<&MsiFile>) -> Self {
        let lobe = antenna.main_lobe();
        let field = |(name, value): (&str, &str)| (name.to_owned(), value.to_owned());
        Self {
            antenna: name.to_owned(),
            gain_dbi: lobe.gain_dbi,
            main_lobe_azimuth_deg: lobe.azimuth.to_degrees(),
            main_lobe_elevation_deg: lobe.elevation.to_degrees(),
            azimuth_beamwidth_deg: antenna.half_power_beamwidth().map(f64::to_degrees),
            elevation_beamwidth_deg: antenna.elevation_half_power_beamwidth().map(f64::to_degrees),
            front_to_back_db: antenna.front_to_back_db(),
            directivity_dbi: antenna.directivity_dbi(),
            electrical_tilt_deg: vendor.and_then(MsiFile::electrical_tilt_deg),
            learned: None,
            header: vendor.map(|file| file.fields().map(field).collect()).unwrap_or_default(),
        }
    }
}

fn figures(report: &Report) -> String {
    let mut figures = table(&["figure", "value"]);
    for (figure, value, decimals) in [
        ("gain dBi", Some(report.gain_dbi), 2),
        ("directivity dBi", Some(report.directivity_dbi), 2),
        ("half-power beamwidth, azimuth °", report.azimuth_beamwidth_deg, 1),
        ("half-power beamwidth, elevation °", report.elevation_beamwidth_deg, 1),
        ("front-to-back dB", Some(report.front_to_back_db), 1),
        ("main lobe, azimuth ° (left positive)", Some(report.main_lobe_azimuth_deg), 1),
        ("main lobe, elevation °", Some(report.main_lobe_elevation_deg), 1),
    ] {
        figures.add_row([figure.to_owned(), number(value, decimals)]);
    }
    let mut lines = vec![figures.to_string()];
    if let Some(tilt) = report.electrical_tilt_deg {
        lines.push(format!("electrical tilt {tilt}° down, in the vertical cut already"));
    }
    if let Some(Fit { directions, harmonics, sigma_db }) = &report.learned {
        lines.push(format!(
            "learned from {directions} positions: {harmonics} harmonics, σ {sigma_db:.2} dB; the \
             gain is about the mean over the turn"
        ));
    }
    lines.extend(report.header.iter().map(|(name, value)| format!("{name}: {value}")));
    lines.join("\n")
}
