use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use foxhunt::{
    picture::antenna_svg,
    sensors::{Antenna, AntennaConfig, MsiFile, PatternTable, SharedAntenna},
};
use serde::Serialize;

use crate::{
    error::{CliError, InFile},
    output::Output,
    table::{number, table},
};

/// Show what an antenna is like, and convert its file
///
/// Reads an antenna from a file (MSI Planet .msi or .pln, or .csv with one angle or with both), or
/// takes one by its name, and tells its gain, beamwidths, front-to-back ratio and directivity.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt antenna panel.msi --out panel.svg\n  \
                        foxhunt antenna yagi --write yagi.msi\n  \
                        foxhunt antenna reference-patch --json")]
pub(crate) struct Args {
    /// A file, or one of isotropic, dipole, cardioid, patch, yagi, reference-patch
    #[arg(value_name = "FILE|NAME")]
    antenna: String,
    /// Draw both cuts through the main lobe
    #[arg(long, value_name = "SVG")]
    out: Option<PathBuf>,
    /// Write the antenna to a file: its two cuts (.msi, .pln) or its horizontal one (.csv)
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
}

/// An antenna's figures, as JSON has them.
#[derive(Debug, Serialize)]
struct Report {
    antenna: String,
    gain_dbi: f64,
    /// Counter-clockwise of the boresight.
    main_lobe_azimuth_deg: f64,
    main_lobe_elevation_deg: f64,
    /// Absent where the gain never falls by half.
    azimuth_beamwidth_deg: Option<f64>,
    elevation_beamwidth_deg: Option<f64>,
    front_to_back_db: f64,
    directivity_dbi: f64,
    /// Of a vendor's file, if it tells it in numbers; down where positive.
    electrical_tilt_deg: Option<f64>,
    /// The header of a vendor's file.
    header: BTreeMap<String, String>,
}

pub(crate) fn run(args: &Args, output: Output) -> Result<(), CliError> {
    let config = AntennaConfig::named(&args.antenna)
        .unwrap_or_else(|| AntennaConfig::File(PathBuf::from(&args.antenna)));
    let antenna = config.build().map_err(|error| {
        let names = AntennaConfig::NAMES.join(", ");
        let unknown = Path::new(&args.antenna).extension().is_none();
        let more = if unknown { format!("; the names are {names}") } else { String::new() };
        CliError::input(format!("{error}{more}"))
    })?;
    let vendor = vendor_file(&config)?;
    if let Some(path) = &args.write {
        write(path, &args.antenna, &antenna, vendor.as_ref())?;
    }
    if let Some(path) = &args.out {
        let svg = antenna_svg(&args.antenna, &antenna).map_err(CliError::failure)?;
        fs::write(path, svg).map_err(|error| CliError::writing(path, error))?;
    }
    output.result(&Report::new(&args.antenna, &antenna, vendor.as_ref()), figures)
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
    lines.extend(report.header.iter().map(|(name, value)| format!("{name}: {value}")));
    lines.join("\n")
}
