//! Pages and exports that commands write besides tables.

use std::{
    cell::RefCell,
    fs,
    path::{Path, PathBuf},
    rc::Rc,
};

use foxhunt::{
    config::ExtractorConfig,
    core::Sweep,
    export::{ExportError, Format, export},
    geodesy::Geodetic,
    hunt::Tap,
    overview::{KeptTurn, KnownAntenna, Overview},
    page::{NotStrikable, PageLog, page, page_on},
    recording::utc_seconds,
    sensors::SharedAntenna,
};

use super::{
    recorded::LatLon,
    tiles::{NO_PLACE, Tiles},
};
use crate::{
    error::CliError,
    output::{Output, check_writable},
};

/// Files for other programs.
#[derive(Debug, clap::Args)]
pub struct Exports {
    /// Write places, bearings, ellipses, regions and paths to a file, in the format of its ending:
    /// .geojson, .kml, .czml, .gpx, .csv, .cot (Cursor on Target) or .mcap; or the probability of
    /// each cell as .tif (GeoTIFF), .kmz (overlay), .mbtiles or .png; may be given several times
    #[arg(long = "export", value_name = "FILE")]
    exported: Vec<PathBuf>,
    /// The place of the local origin on Earth (WGS84), for --export, --tiles, --cot, --mqtt and
    /// programs that fetch a hunt from --live, if it is not known
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    origin: Option<LatLon>,
    /// The UTC of the time 0, for --export, if it is not known
    #[arg(long, value_name = "YYYY-MM-DDTHH:MM:SS", value_parser = utc, requires = "exported")]
    start_utc: Option<f64>,
}

/// A page and files for other programs.
#[derive(Debug, clap::Args)]
pub struct Views {
    /// Write a page for any browser: one file, without a network
    #[arg(long, value_name = "HTML")]
    report: Option<PathBuf>,
    /// A map below the page, from tiles on this computer: a folder with z/x/y.png, or an .mbtiles
    /// or .pmtiles file of images; the page brings the tiles about the places along
    #[arg(long, value_name = "PATH", requires = "report")]
    tiles: Option<PathBuf>,
    #[command(flatten)]
    exports: Exports,
}

/// Parses a time in UTC.
fn utc(text: &str) -> Result<f64, &'static str> {
    utc_seconds(text).ok_or("it must be YYYY-MM-DDTHH:MM:SS")
}

/// Reason why `--origin` is refused if the places have an origin.
const OWN_ORIGIN: &str =
    "--origin: the places are in degrees already, about an origin of their own";

fn refused(file: &Path, error: &ExportError) -> CliError {
    CliError::input(format!("--export {}: {error}", file.display()))
}

impl Exports {
    /// Refuses files that have an unknown format or cannot be written, before any work is done;
    /// `on_map` is true if something else than exports needs the origin.
    pub fn check(&self, on_map: bool) -> Result<(), CliError> {
        if self.origin.is_some() && self.exported.is_empty() && !on_map {
            return Err(CliError::input("--origin: only for --export, --live, --cot or --mqtt"));
        }
        for file in &self.exported {
            Format::of_file(file).map_err(|error| CliError::input(format!("--export: {error}")))?;
            check_writable(file)?;
        }
        Ok(())
    }

    /// Returns the origin of local metres, if the command line has it.
    pub fn origin(&self) -> Option<Geodetic> {
        self.origin.map(|origin| origin.frame().origin())
    }

    /// Refuses formats that need an origin of local metres or a start in UTC that will be unknown,
    /// before any work is done.
    pub fn check_known(&self, origin: bool, start: bool) -> Result<(), CliError> {
        for file in &self.exported {
            let format = Format::of_file(file).and_then(|format| {
                format.check(origin || self.origin.is_some(), start || self.start_utc.is_some())
            });
            format.map_err(|error| refused(file, &error))?;
        }
        if origin && self.origin.is_some() {
            return Err(CliError::input(OWN_ORIGIN));
        }
        Ok(())
    }

    /// Returns an overview at the origin of the command line, if it has one.
    fn placed(&self, mut overview: Overview) -> Result<Overview, CliError> {
        if let Some(origin) = self.origin {
            if overview.frame.is_some() {
                return Err(CliError::input(OWN_ORIGIN));
            }
            overview.frame = Some(origin.frame());
        }
        Ok(overview)
    }

    /// Writes a page, at the origin of the command line if it has one.
    pub fn write_page(
        &self,
        path: &Path,
        overview: &Overview,
        log: Option<&Result<PageLog, NotStrikable>>,
        tiles: Option<&Tiles>,
    ) -> Result<(), CliError> {
        if self.origin.is_none() {
            return write_page(path, overview, log, tiles);
        }
        write_page(path, &self.placed(overview.clone())?, log, tiles)
    }

    /// Writes the files.
    pub fn write(&self, overview: &Overview, output: Output) -> Result<(), CliError> {
        if self.exported.is_empty() {
            return Ok(());
        }
        let mut overview = self.placed(overview.clone())?;
        overview.epoch_unix_s = overview.epoch_unix_s.or(self.start_utc);
        for file in &self.exported {
            let format = Format::of_file(file).map_err(|error| refused(file, &error))?;
            let bytes = export(&overview, format).map_err(|error| refused(file, &error))?;
            fs::write(file, bytes).map_err(|error| CliError::writing(file, error))?;
            output.note(&format!("export: {}", file.display()))?;
        }
        Ok(())
    }
}

impl Views {
    /// Opens the map below the page.
    fn map(&self) -> Result<Option<Tiles>, CliError> {
        self.tiles.as_deref().map(Tiles::open).transpose()
    }

    /// Returns true if anything is to be written.
    pub fn any(&self) -> bool {
        self.report.is_some() || !self.exports.exported.is_empty()
    }

    /// Returns true if a page is to be written.
    pub fn has_page(&self) -> bool {
        self.report.is_some()
    }

    /// Refuses files that have an unknown format or cannot be written, before any work is done;
    /// `on_map` is true if something else than exports needs the origin.
    pub fn check(&self, on_map: bool) -> Result<(), CliError> {
        self.report.iter().try_for_each(|path| check_writable(path))?;
        let _ = self.map()?;
        self.exports.check(on_map || self.tiles.is_some())
    }

    /// Returns the origin of local metres, if the command line has it.
    pub fn origin(&self) -> Option<Geodetic> {
        self.exports.origin()
    }

    /// Returns an overview at the origin of the command line, if it has one.
    pub fn placed(&self, overview: Overview) -> Result<Overview, CliError> {
        self.exports.placed(overview)
    }

    /// Refuses formats that need an origin of local metres or a start in UTC that is unknown.
    pub fn check_known(&self, origin: bool, start: bool) -> Result<(), CliError> {
        if self.tiles.is_some() && !origin && self.origin().is_none() {
            return Err(CliError::input(NO_PLACE));
        }
        self.exports.check_known(origin, start)
    }

    /// Writes the requested page and files.
    pub fn write(
        &self,
        overview: &Overview,
        log: Option<&Result<PageLog, NotStrikable>>,
        output: Output,
    ) -> Result<(), CliError> {
        if let Some(path) = &self.report {
            let tiles = self.map()?;
            self.exports.write_page(path, overview, log, tiles.as_ref())?;
            output.note(&format!("report: {}", path.display()))?;
        }
        self.exports.write(overview, output)
    }
}

/// A tap that keeps all turns, and the turns.
pub fn keep_turns() -> (Tap, Rc<RefCell<Vec<KeptTurn>>>) {
    let turns = Rc::new(RefCell::new(Vec::new()));
    let kept = Rc::clone(&turns);
    let keep = move |drone: usize, sweep: &Sweep<'_>| {
        kept.borrow_mut().push(KeptTurn { drone, sweep: sweep.into() });
    };
    (Rc::new(RefCell::new(keep)), turns)
}

/// The antenna that an extractor knows, if it does.
pub struct Antennas(Option<(SharedAntenna, f64)>);

impl Antennas {
    pub fn of(extractor: &ExtractorConfig) -> Self {
        let known = extractor.known_antenna();
        // One that cannot be built has stopped the command before.
        Self(known.and_then(|(antenna, elevation)| Some((antenna.build().ok()?, elevation))))
    }

    pub fn known(&self) -> Option<KnownAntenna<'_>> {
        let (antenna, elevation) = self.0.as_ref()?;
        Some(KnownAntenna { antenna: antenna.as_ref(), elevation: *elevation })
    }
}

/// Writes the page that shows a hunt or recordings, above a map if there is one; with the log
/// bearings can be struck out in it.
pub fn write_page(
    path: &Path,
    overview: &Overview,
    log: Option<&Result<PageLog, NotStrikable>>,
    tiles: Option<&Tiles>,
) -> Result<(), CliError> {
    let ground = tiles.and_then(|tiles| tiles.under(overview));
    let text = match &ground {
        Some(ground) => page_on(overview, log, ground),
        None => page(overview, log),
    };
    let text = text.map_err(CliError::failure)?;
    fs::write(path, text).map_err(|error| CliError::writing(path, error))
}
