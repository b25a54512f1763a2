use std::{fs, path::Path};

use foxhunt_hunt::document;
use serde::{Deserialize, de::DeserializeOwned};

use super::{STRUCK_VERSION, StruckError};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    foxhunt_struck: u32,
}

/// The text of a list.
pub(super) fn read(path: &Path) -> Result<String, StruckError> {
    fs::read_to_string(path).map_err(|source| StruckError::Read { path: path.to_owned(), source })
}

/// Reads the lines of a list after its header, each with its number from 1; `what` is the name of
/// such a line in errors.
pub(super) fn entries<T: DeserializeOwned>(
    text: &str,
    path: &Path,
    what: &'static str,
) -> Result<Vec<(usize, T)>, StruckError> {
    let path = || path.to_owned();
    let mut lines = text.lines().zip(1..);
    let (first, _) = lines.next().unwrap_or_default();
    let Header { foxhunt_struck: version } = document::from_json(first)
        .map_err(|source| StruckError::Header { path: path(), source })?;
    if version != STRUCK_VERSION {
        return Err(StruckError::Version { path: path(), version });
    }
    let entry = |(text, line): (&str, usize)| {
        let wrong = |source| StruckError::Line { path: path(), line, what, source };
        Ok((line, document::from_json(text).map_err(wrong)?))
    };
    lines.filter(|(text, _)| !text.trim().is_empty()).map(entry).collect()
}
