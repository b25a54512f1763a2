//! The figures that papers print.

mod contenders;
mod hunts;
mod recordings;

use std::{
    fs,
    path::{Path, PathBuf},
    str::FromStr,
};

use foxhunt::picture::PictureError;
use serde::Serialize;

use crate::{context::Context, error::CliError, output::Output, writable};

/// Draw the figures of a paper
///
/// Draws what hunts, recordings and comparisons have left: each kind of figure is a command of its
/// own. `docs/figures.md` lists the figures of the two reference documents with the command that
/// draws each.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt plot error out/hunt.jsonl --out error.svg\n  \
                        foxhunt plot pattern turns.csv --turn 3 --out pattern.svg\n  \
                        foxhunt plot rssi flight.csv --truth 50.0755,14.4378 --out rssi.svg\n  \
                        foxhunt plot planners planners.json --out planners.svg")]
pub(crate) struct Args {
    #[command(subcommand)]
    kind: Kind,
}

/// The kinds of figures.
#[derive(Debug, clap::Subcommand)]
enum Kind {
    /// The drones, their bearings, and how the estimates of a hunt went
    Trajectory(hunts::OneLog),
    /// The error of the estimate after each reception
    Error(hunts::Logs),
    /// The semi-axes of the 95 % ellipse after each reception
    Axes(hunts::Logs),
    /// The NEES after each reception, averaged over logs of one scenario, with its χ² band
    Nees(hunts::Logs),
    /// The cloud of a particle filter at six moments of a hunt
    Cloud(hunts::OneLog),
    /// The radiation pattern of a recorded turn, as received and preprocessed
    Pattern(recordings::OneTurn),
    /// The level over the distance to a known transmitter, with the fitted path loss
    Rssi(recordings::Measured),
    /// The errors of bearings, with the fitted mixture of a normal and outliers
    BearingErrors(recordings::Measured),
    /// How planners compare, of what `compare planners --json` has printed
    Planners(contenders::Planners),
    /// How errors and NEES of the contenders of a store are distributed
    #[cfg(feature = "store")]
    Distributions(contenders::Distributions),
}

/// The file of a figure, by its ending.
#[derive(Clone, Debug)]
struct Target {
    path: PathBuf,
    format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Format {
    Svg,
    #[cfg(feature = "png")]
    Png,
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let path = PathBuf::from(text);
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        let format = match ending.as_deref() {
            Some("svg") => Format::Svg,
            #[cfg(feature = "png")]
            Some("png") => Format::Png,
            #[cfg(not(feature = "png"))]
            Some("png") => {
                return Err(format!(
                    "PNG needs a build with the feature png: {}",
                    crate::hints::build("png")
                ));
            }
            _ => return Err("it must end with .svg or .png".to_owned()),
        };
        Ok(Self { path, format })
    }
}

/// Where a figure goes.
#[derive(Debug, clap::Args)]
struct Drawing {
    /// The figure: .svg, or with the feature `png` .png
    #[arg(long = "out", value_name = "FILE")]
    target: Target,
    /// What is written above it; what it is made of unless given
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
}

/// A figure that was drawn, as JSON has it.
#[derive(Debug, Serialize)]
struct Drawn<'a> {
    file: &'a Path,
    format: Format,
}

impl Drawing {
    /// The title of the command line, or this one.
    fn title(&self, own: &str) -> String {
        self.title.clone().unwrap_or_else(|| own.to_owned())
    }

    fn check(&self) -> Result<(), CliError> {
        writable::file(&self.target.path)
    }

    /// Writes a figure.
    fn write(&self, svg: Result<String, PictureError>, output: Output) -> Result<(), CliError> {
        let svg = svg.map_err(CliError::failure)?;
        let Target { path, format } = &self.target;
        let bytes = match format {
            Format::Svg => svg.into_bytes(),
            #[cfg(feature = "png")]
            Format::Png => foxhunt::picture::png(&svg).map_err(CliError::failure)?,
        };
        fs::write(path, bytes).map_err(|error| CliError::writing(path, error))?;
        let drawn = Drawn { file: path, format: *format };
        output.result(&drawn, |drawn| format!("figure: {}", drawn.file.display()))
    }
}

pub(crate) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    match &args.kind {
        Kind::Trajectory(args) => hunts::trajectory(args, context),
        Kind::Error(args) => hunts::error(args, context),
        Kind::Axes(args) => hunts::axes(args, context),
        Kind::Nees(args) => hunts::nees(args, context),
        Kind::Cloud(args) => hunts::cloud(args, context),
        Kind::Pattern(args) => recordings::pattern(args, context),
        Kind::Rssi(args) => recordings::rssi(args, context),
        Kind::BearingErrors(args) => recordings::bearing_errors(args, context),
        Kind::Planners(args) => contenders::planners(args, context.output),
        #[cfg(feature = "store")]
        Kind::Distributions(args) => contenders::distributions(args, context.output),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_is_the_format() {
        let format = |text: &str| text.parse::<Target>().map(|target| target.format);
        assert_eq!(format("a/b.SVG"), Ok(Format::Svg));
        assert_eq!(format("a.png").is_ok(), cfg!(feature = "png"));
        for text in ["a", "a.pdf", ".svg"] {
            assert!(format(text).is_err(), "{text}");
        }
    }
}
