//! Repeated locating from the receptions of recordings, without the ones that were struck out: the
//! input of a page for that, as lines of JSON.

use foxhunt_core::{Reception, Receptions};
#[cfg(feature = "batch")]
use foxhunt_hunt::locate::{Listener, TrackingConfig, left_out, track};
use foxhunt_hunt::{
    document,
    locate::{LocateConfig, LocateError, Residual},
    registry::{Registry, RegistryError},
};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::overview::SearchOverview;
#[cfg(feature = "batch")]
use foxhunt_archive::recorded::truth_at;
use foxhunt_archive::{
    recorded::{RowResidual, row_name},
    struck::{RowId, StruckRows},
};

/// The version of the lines that this program writes and reads.
const VERSION: u32 = 1;

/// Transmitters that were located, with the receptions and the settings used.
#[derive(Clone, Debug, PartialEq)]
pub struct Relocation {
    header: Header,
    rows: Vec<Row>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    foxhunt_relocation: u32,
    /// The estimator; what suits the receptions where it is absent.
    estimator: Option<String>,
    /// A transmitter that moves is tracked instead.
    #[cfg(feature = "batch")]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    tracking: Option<Tracking>,
    config: LocateConfig,
    searches: Vec<Sought>,
}

/// Settings and listeners for tracking a transmitter that moves.
#[cfg(feature = "batch")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Tracking {
    config: TrackingConfig,
    listeners: Vec<Listener>,
}

/// A transmitter that is located.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sought {
    name: String,
    /// True places of the transmitter with their times, if known.
    truth: Vec<(f64, Vector2<f64>)>,
    /// The time that its place is of.
    time: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    search: usize,
    id: RowId,
    reception: Reception,
}

impl Relocation {
    /// Begins with nothing located, by an estimator of the registry or by the estimator that suits
    /// the receptions.
    #[must_use]
    pub fn new(estimator: Option<&str>, config: LocateConfig) -> Self {
        let estimator = estimator.map(str::to_owned);
        let searches = Vec::new();
        let header = Header {
            foxhunt_relocation: VERSION,
            estimator,
            #[cfg(feature = "batch")]
            tracking: None,
            config,
            searches,
        };
        Self { header, rows: Vec::new() }
    }

    /// No transmitter tracked yet.
    #[cfg(feature = "batch")]
    #[must_use]
    pub fn of_tracks(
        tracking: TrackingConfig,
        listeners: Vec<Listener>,
        config: LocateConfig,
    ) -> Self {
        let mut relocation = Self::new(None, config);
        relocation.header.tracking = Some(Tracking { config: tracking, listeners });
        relocation
    }

    /// Adds a search as it ended, and its receptions in the order of the estimator.
    pub fn add(
        &mut self,
        search: &SearchOverview,
        receptions: impl IntoIterator<Item = (RowId, Reception)>,
    ) {
        let number = self.header.searches.len();
        self.header.searches.push(Sought {
            name: search.name.clone(),
            truth: search.truth.iter().map(|knot| (knot.time, knot.place.xy())).collect(),
            time: search.last().map_or(0.0, |last| last.time),
        });
        let row = |(id, reception)| Row { search: number, id, reception };
        self.rows.extend(receptions.into_iter().map(row));
    }

    /// The estimator's name, where it was given.
    #[must_use]
    pub fn estimator(&self) -> Option<&str> {
        self.header.estimator.as_deref()
    }

    /// Returns the number of receptions.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns true if there are no receptions.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Returns the receptions' row ids.
    #[must_use]
    pub fn ids(&self) -> Vec<RowId> {
        self.rows.iter().map(|row| row.id.clone()).collect()
    }

    /// The lines, the header first.
    ///
    /// # Errors
    ///
    /// The error of the JSON writer.
    pub fn lines(&self) -> Result<Vec<String>, serde_json::Error> {
        let header = std::iter::once(document::to_json(&self.header));
        header.chain(self.rows.iter().map(|row| document::to_json(row))).collect()
    }

    /// Reads the lines; [`None`] where the first is the header of something else.
    ///
    /// # Errors
    ///
    /// [`RelocationError`] names the line.
    pub fn parse(text: &str) -> Result<Option<Self>, RelocationError> {
        let mut lines = text.lines().zip(1..);
        let (first, _) = lines.next().unwrap_or_default();
        if !first.starts_with("{\"foxhunt_relocation\":") {
            return Ok(None);
        }
        let line = |line| move |source| RelocationError::Line { line, source };
        let header: Header = document::from_json(first).map_err(line(1))?;
        if header.foxhunt_relocation != VERSION {
            return Err(RelocationError::Version { version: header.foxhunt_relocation });
        }
        let row = |(text, number)| document::from_json(text).map_err(line(number));
        let rows = lines.map(row).collect::<Result<_, _>>()?;
        Ok(Some(Self { header, rows }))
    }

    /// Locates each transmitter without the receptions that are struck out; one that cannot be
    /// located any more has no beliefs, and its outcome is the reason.
    ///
    /// # Errors
    ///
    /// [`RegistryError`] where the registry does not have the estimator.
    pub fn locate(
        &self,
        registry: &Registry,
        struck: &StruckRows,
    ) -> Result<Vec<SearchOverview>, RegistryError> {
        let Header { estimator, config, searches, .. } = &self.header;
        let mut found = Vec::new();
        for (number, Sought { name, truth, time }) in searches.iter().enumerate() {
            let of_it = || self.rows.iter().filter(|row| row.search == number);
            #[cfg(feature = "batch")]
            if let Some(Tracking { config: tracking, listeners }) = &self.header.tracking {
                let left = of_it().map(|row| match struck.contains(&row.id) {
                    true => left_out(&row.reception),
                    false => row.reception,
                });
                let received: Receptions = left.collect();
                let left: Vec<&Row> = of_it().collect();
                found.push(match track(&received, listeners, config, tracking) {
                    Ok(tracked) => SearchOverview::tracked(name.clone(), &tracked, |time| {
                        truth_at(truth, time, 0.0)
                    })
                    .with_rows(rows_of(&tracked.residuals, &left)),
                    Err(error) => not_located(name, &error),
                });
                continue;
            }
            let truth = truth.first().map(|(_, place)| *place);
            let left: Vec<&Row> = of_it().filter(|row| !struck.contains(&row.id)).collect();
            let received: Receptions = left.iter().map(|row| row.reception).collect();
            let estimator = match estimator {
                Some(name) => registry.estimator(name)?,
                None => registry.suited_to(&received)?,
            };
            let called = |index: usize| left.get(index).map(|row| row_name(&row.id));
            found.push(match estimator.locate_named(&received, config, &called) {
                Ok(located) => {
                    let of_rows = estimator.residuals(&located, &received, config);
                    SearchOverview::located(name.clone(), &located, truth, *time)
                        .with_rows(rows_of(&of_rows, &left))
                }
                Err(error) => not_located(name, &error),
            });
        }
        Ok(found)
    }
}

/// Returns the residuals of rows, each with its row.
fn rows_of(residuals: &[Residual], rows: &[&Row]) -> Vec<RowResidual> {
    let of_row = |residual: &Residual| {
        let row = rows.get(residual.reception)?;
        Some(RowResidual::new(&row.id, None, residual))
    };
    residuals.iter().filter_map(of_row).collect()
}

fn not_located(name: &str, error: &LocateError) -> SearchOverview {
    let outcome = Some(format!("not located: {error}"));
    SearchOverview { name: name.to_owned(), outcome, ..SearchOverview::default() }
}

/// Reason why receptions cannot be located again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RelocationError {
    /// The lines are of another version.
    #[error("line 1: foxhunt_relocation is {version}; this program reads {VERSION}")]
    Version {
        /// Version of the lines.
        version: u32,
    },
    /// A line cannot be read.
    #[error("line {line}: no reception to locate from")]
    Line {
        /// Line number, from 1.
        line: usize,
        /// The JSON error.
        source: serde_json::Error,
    },
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use foxhunt_core::{Bearing, Pose};
    #[cfg(feature = "batch")]
    use nalgebra::Vector3;

    use super::*;
    #[cfg(feature = "batch")]
    use crate::overview::Knot;

    /// Five bearings to a transmitter at (40, 30), and one that is far off.
    fn relocation() -> Relocation {
        let places = [(0.0, 0.0), (60.0, 0.0), (0.0, 60.0), (60.0, 60.0), (40.0, 0.0), (20.0, 0.0)];
        let rows = (2_u64..).zip(places).map(|(line, (east, north))| {
            let angle = f64::atan2(30.0 - north, 40.0 - east) * if line == 7 { -1.0 } else { 1.0 };
            let reception = Reception {
                receiver: Pose::at(east, north, 2.0),
                bearing: Some(Bearing { angle, sigma: 0.1, confidence: 1.0 }),
                ..Reception::default()
            };
            (RowId { file: "a.csv".to_owned(), line, beacon: None }, reception)
        });
        let mut relocation = Relocation::new(None, LocateConfig::default());
        relocation.add(&SearchOverview::default(), rows);
        relocation
    }

    #[test]
    #[cfg(feature = "batch")]
    fn a_track_goes_on_without_what_is_struck() {
        let registry = Registry::builtin();
        let located = |relocation: &Relocation, struck: &[u64]| {
            relocation.locate(&registry, &strike(struck)).expect("built in").remove(0)
        };
        let mut rows = relocation().rows;
        // The last one a window later, when the transmitter has been for 1 m.
        rows.iter_mut()
            .for_each(|row| row.reception.time = if row.id.line == 7 { 60.0 } else { 0.0 });
        let config = LocateConfig::default();
        let mut tracks = Relocation::of_tracks(TrackingConfig::default(), Vec::new(), config);
        let truth = |time| Knot { time, place: Vector3::new(40.0, 30.0, 0.0) };
        let truth = vec![truth(0.0), truth(60.0)];
        let search = SearchOverview { truth, ..SearchOverview::default() };
        tracks.add(&search, rows.into_iter().map(|row| (row.id, row.reception)));
        let text = tracks.lines().expect("plain numbers").join("\n");
        assert_eq!(Relocation::parse(&text).expect("our own"), Some(tracks.clone()));
        let all = located(&tracks, &[]);
        assert_eq!(all.beliefs.iter().map(|b| b.steps).collect::<Vec<_>>(), [5, 1]);
        assert!(all.beliefs[0].error_m.is_some_and(|error| error < 40.0), "{all:?}");
        let without = located(&tracks, &[2, 7]);
        assert_eq!(without.beliefs.iter().map(|b| b.steps).collect::<Vec<_>>(), [4]);
        assert_ne!(without.beliefs[0].estimate, all.beliefs[0].estimate);
    }

    fn strike(lines: &[u64]) -> StruckRows {
        let rows = lines.iter().map(|line| format!("\n{{\"file\":\"a.csv\",\"line\":{line}}}"));
        let text = format!("{{\"foxhunt_struck\":1}}{}", rows.collect::<String>());
        StruckRows::parse(&text, Path::new("list"), &relocation().ids()).expect("they are there")
    }

    #[test]
    fn lines_are_read_to_the_bit() {
        let relocation = relocation();
        let text = relocation.lines().expect("plain numbers").join("\n");
        assert_eq!(Relocation::parse(&text).expect("our own"), Some(relocation));
        assert_eq!(Relocation::parse("{\"foxhunt_log\":6}").expect("a log"), None);
        let error = Relocation::parse(&format!("{text}\n{{}}")).expect_err("no reception");
        assert!(error.to_string().starts_with("line 8"), "{error}");
    }

    #[test]
    fn what_is_struck_is_as_if_it_had_never_been_received() {
        let registry = Registry::builtin();
        let locate = |relocation: &Relocation, struck: &[u64]| {
            relocation.locate(&registry, &strike(struck)).expect("built in").remove(0)
        };
        let all = relocation();
        let mut never = all.clone();
        let _ = never.rows.pop();
        let struck = locate(&all, &[7]);
        assert_eq!(struck, locate(&never, &[]));
        assert!(struck.remarks.is_empty() && struck.rows.len() == 5, "{struck:?}");
        // The bearing that is far off is left out anyway, and named; another one is missed.
        let whole = locate(&all, &[]);
        let [remark] = &whole.remarks[..] else { panic!("{:?}", whole.remarks) };
        assert!(remark.text.starts_with("the bearing of a.csv, line 7 ("), "{remark}");
        assert!(whole.rows.iter().all(|row| row.left_out == (row.line == 7)), "{whole:?}");
        assert_eq!(struck.beliefs, whole.beliefs);
        assert_ne!(struck, locate(&all, &[2]));
        assert_eq!(struck.last().map(|last| last.steps), Some(5));
        let none = locate(&all, &[2, 3, 4, 5, 6, 7]);
        assert!(none.beliefs.is_empty());
        assert!(none.outcome.is_some_and(|why| why.starts_with("not located: ")));
    }
}
