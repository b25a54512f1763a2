use super::RecordedError;
use crate::recording::Recording;

/// The choice of a beacon in a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Selection {
    /// The only one there is.
    #[default]
    Only,
    /// The one of this name.
    Named(String),
}

/// The name of the beacon that is meant in these recordings; `None` for a nameless one.
///
/// # Errors
///
/// [`RecordedError`] when there are several and none is named, or the named one is missing.
pub fn only_beacon(
    recordings: &[Recording],
    selection: &Selection,
) -> Result<Option<String>, RecordedError> {
    let mut recorded: Vec<Option<String>> = Vec::new();
    for name in recordings.iter().flat_map(Recording::beacons) {
        let name = name.map(str::to_owned);
        if !recorded.contains(&name) {
            recorded.push(name);
        }
    }
    let beacons = || {
        let names =
            recorded.iter().map(|name| name.clone().unwrap_or_else(|| "(no name)".to_owned()));
        names.collect::<Vec<_>>()
    };
    match selection {
        Selection::Named(wanted) if recorded.contains(&Some(wanted.clone())) => {
            Ok(Some(wanted.clone()))
        }
        Selection::Named(wanted) => {
            Err(RecordedError::NoSuchBeacon { wanted: wanted.clone(), beacons: beacons() })
        }
        Selection::Only if recorded.len() > 1 => {
            Err(RecordedError::SeveralBeacons { beacons: beacons() })
        }
        Selection::Only => Ok(recorded.pop().flatten()),
    }
}
