//! The calibration that the commands take.

use std::{borrow::Cow, path::PathBuf};

use foxhunt::{
    calibration::{CalibrationFile, StationPlace, StationSection},
    config::BoxedExtractor,
    recorded::station_boresights,
    recording::Recording,
    sensors::{AtSite, Site},
};

use crate::{
    error::{CliError, InFile},
    output::warn_once,
};

/// A calibration from recordings with a known transmitter.
#[derive(Debug, clap::Args)]
pub struct Calibration {
    /// The file that `foxhunt calibrate --out` wrote: path loss, errors of bearings, a station's
    /// antennas
    #[arg(long = "calibration", value_name = "FILE")]
    calibration: Option<PathBuf>,
}

/// Surroundings of the receivers.
#[derive(Debug, clap::Args)]
pub struct Surroundings {
    /// The receiver's surroundings: open, forest, street, indoors or unknown; part of the σ of
    /// bearings from uncalibrated turns [default: unknown, which is wide]
    #[arg(long, value_name = "SITE", hide_possible_values = true)]
    site: Option<Site>,
}

impl Surroundings {
    /// The site; unknown unless given.
    pub fn site(&self) -> Site {
        self.site.unwrap_or_default()
    }

    /// Prints the σ of turns at an unknown site, unless a site is given.
    pub fn narrate(&self) {
        if self.site.is_none() {
            let deg = Site::default().sigma().to_degrees();
            warn_once(&format!(
                "  σ of bearings of turns: {deg:.0}°, of an unknown site; see --site"
            ));
        }
    }

    /// Returns an extractor whose σ includes the site's.
    pub fn around(&self, extractor: BoxedExtractor) -> BoxedExtractor {
        Box::new(AtSite::new(extractor, self.site()))
    }

    /// An extractor whose σ is calibrated, which needs no site.
    fn needless(&self, name: &str, extractor: BoxedExtractor) -> BoxedExtractor {
        if let Some(site) = self.site {
            warn_once(&format!("  --site {site}: not used, the σ of {name} is calibrated"));
        }
        extractor
    }
}

impl Calibration {
    /// Reads the file, or returns an empty one if no file is given.
    pub fn read(&self) -> Result<CalibrationFile, CliError> {
        match &self.calibration {
            Some(path) => CalibrationFile::read(path).map_err(CliError::input),
            None => Ok(CalibrationFile::default()),
        }
    }

    /// Returns the file that was [`read`](Self::read). Without a file, returns the calibration that
    /// comes with the program for a station of this recording.
    pub fn or_shipped<'a>(
        &self,
        read: &'a CalibrationFile,
        recording: &Recording,
    ) -> Cow<'a, CalibrationFile> {
        let format = recording.format();
        match CalibrationFile::shipped(format) {
            Some(shipped) if self.calibration.is_none() => {
                if parts(recording, &shipped).iter().any(|part| part.station.is_some()) {
                    warn_once(&format!("  calibration: {format}, as it comes with the program"));
                    return Cow::Owned(shipped);
                }
                warn_once(&format!(
                    "  calibration: none; {format}, which comes with the program, is that of a \
                     station at another place"
                ));
                Cow::Borrowed(read)
            }
            _ => Cow::Borrowed(read),
        }
    }
}

/// Prints the number of bearings that the calibration of their array corrected, if there are any.
pub fn narrate_corrected(bearings: usize) {
    if bearings > 0 {
        warn_once(&format!("  bearings corrected by the calibration of their array: {bearings}"));
    }
}

/// A recording, or one drone's part of it, and the station whose turns it holds.
pub struct Part<'r, 'f> {
    pub recording: Cow<'r, Recording>,
    pub station: Option<Cow<'f, StationSection>>,
}

/// The parts of a recording that are read in different ways: where stations are calibrated, each
/// drone's own. A station of fixed antennas that has no section of its own is one of the model.
pub fn parts<'r, 'f>(recording: &'r Recording, file: &'f CalibrationFile) -> Vec<Part<'r, 'f>> {
    if file.stations.is_empty() && file.station_model.is_none() {
        return vec![Part { recording: Cow::Borrowed(recording), station: None }];
    }
    let part = |own: Recording| {
        let place = station_place(&own);
        let known = own.drones().first().and_then(|name| file.station(name, place));
        let of_model = || {
            let boresights = station_boresights([&own])?;
            file.station_model.as_ref()?.station(&boresights).ok()
        };
        let station = known.map(Cow::Borrowed).or_else(|| of_model().map(Cow::Owned));
        Part { station, recording: Cow::Owned(own) }
    };
    recording.by_drone().into_iter().map(part).collect()
}

/// Place of a recording's receiver, as calibrations have it.
pub fn station_place(recording: &Recording) -> Option<StationPlace> {
    let place = recording.first_place()?;
    Some(StationPlace { lat_deg: place.lat_deg, lon_deg: place.lon_deg })
}

/// Returns the extractor of this name, calibrated; a station's turns have the station's own. The σ
/// of an uncalibrated extractor includes the site's.
pub fn calibrated(
    file: &CalibrationFile,
    station: Option<&StationSection>,
    name: &str,
    extractor: BoxedExtractor,
    surroundings: &Surroundings,
) -> Result<BoxedExtractor, CliError> {
    let mut file = Cow::Borrowed(file);
    let mut is_calibrated = station.is_some() || file.bearings.is_some();
    let whose = file.bearings.as_ref().and_then(|bearings| bearings.extractor.clone());
    let other = |whose: &String| whose != name && whose != "recorded" && station.is_none();
    if let Some(whose) = whose.filter(other) {
        warn_once(&format!(
            "  the bearings of {whose} were calibrated: the σ of {name} stays as it is"
        ));
        is_calibrated = false;
        if let Some(bearings) = &mut file.to_mut().bearings {
            bearings.correction.sigma_scale = 1.0;
            bearings.correction.sigma_floor_deg = 0.0;
            // Without the number that was fitted nothing is widened but by the offset's σ.
            bearings.bearings = None;
        }
    }
    let extractor = file.extractor(station, extractor).map_err(|error| {
        CliError::input(InFile { file: "--calibration".to_owned(), source: Box::new(error) })
    })?;
    Ok(if is_calibrated {
        surroundings.needless(name, extractor)
    } else {
        surroundings.around(extractor)
    })
}
