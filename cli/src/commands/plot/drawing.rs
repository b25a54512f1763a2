use std::{
    fs,
    path::{Path, PathBuf},
    str::FromStr,
};

use foxhunt::picture::PictureError;
use serde::Serialize;

use crate::{
    error::CliError,
    output::{Output, check_writable},
};

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

/// File and title of a figure.
#[derive(Debug, clap::Args)]
pub struct Drawing {
    /// The figure: .svg, or with the feature `png` .png
    #[arg(long = "out", value_name = "FILE")]
    target: Target,
    /// The title above the figure [default: made of the inputs]
    #[arg(long, value_name = "TEXT")]
    pub title: Option<String>,
}

/// A drawn figure in JSON.
#[derive(Debug, Serialize)]
struct Drawn<'a> {
    file: &'a Path,
    format: Format,
}

impl Drawing {
    /// Returns the title of the command line, or else this one.
    pub fn title(&self, own: &str) -> String {
        self.title.clone().unwrap_or_else(|| own.to_owned())
    }

    pub fn check(&self) -> Result<(), CliError> {
        check_writable(&self.target.path)
    }

    /// Writes a figure.
    pub fn write(&self, svg: Result<String, PictureError>, output: Output) -> Result<(), CliError> {
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
