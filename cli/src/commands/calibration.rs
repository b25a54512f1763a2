//! The calibration that the commands take.

use std::{borrow::Cow, path::PathBuf};

use foxhunt::{calibration::CalibrationFile, config::BoxedExtractor};

use crate::{
    error::{CliError, InFile},
    output::warn,
};

/// A calibration from recordings with a known transmitter.
#[derive(Debug, clap::Args)]
pub(super) struct Calibration {
    /// What `foxhunt calibrate --out` wrote: path loss, errors of bearings, a station's antennas
    #[arg(long = "calibration", value_name = "FILE")]
    calibration: Option<PathBuf>,
}

impl Calibration {
    /// The file; an empty one where none is given.
    pub(super) fn read(&self) -> Result<CalibrationFile, CliError> {
        match &self.calibration {
            Some(path) => CalibrationFile::read(path).map_err(CliError::input),
            None => Ok(CalibrationFile::default()),
        }
    }

    /// The file that was [`read`](Self::read); where none is given, the calibration that comes with
    /// the program for recordings of this format.
    pub(super) fn or_shipped<'a>(
        &self,
        read: &'a CalibrationFile,
        format: &str,
    ) -> Cow<'a, CalibrationFile> {
        match CalibrationFile::shipped(format) {
            Some(shipped) if self.calibration.is_none() => {
                warn(&format!("  calibration: {format}, as it comes with the program"));
                Cow::Owned(shipped)
            }
            _ => Cow::Borrowed(read),
        }
    }
}

/// The extractor of this name, calibrated. The σ of another extractor is not its own.
pub(super) fn calibrated(
    file: &CalibrationFile,
    name: &str,
    extractor: BoxedExtractor,
) -> Result<BoxedExtractor, CliError> {
    let mut file = Cow::Borrowed(file);
    let whose = file.bearings.as_ref().and_then(|bearings| bearings.extractor.clone());
    let other = |whose: &String| whose != name && whose != "recorded" && file.station.is_none();
    if let Some(whose) = whose.filter(other) {
        warn(&format!("  the bearings of {whose} were calibrated: the σ of {name} stays as it is"));
        if let Some(bearings) = &mut file.to_mut().bearings {
            bearings.correction.sigma_scale = 1.0;
            bearings.correction.sigma_floor_deg = 0.0;
        }
    }
    file.extractor(extractor).map_err(|error| {
        CliError::input(InFile { file: "--calibration".to_owned(), source: Box::new(error) })
    })
}
