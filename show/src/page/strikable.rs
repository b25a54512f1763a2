use foxhunt_hunt::{
    config::{EstimatorConfig, FilterConfig, ParticleConfig},
    document,
    hunt::Event,
    log::LogHeader,
    registry::{EstimatorEntry, Registry},
};

use crate::relocation::Relocation;

/// Seconds of a browser's time that a replay may take.
const MOST_S: f64 = 60.0;

/// Estimators of the library that would make a page much larger.
const NOT_BROUGHT: [&str; 1] = ["field-map"];

/// Seconds that a browser takes for a model at one time, on the most cells; measured as
/// [`seconds`].
#[cfg(feature = "batch")]
const OF_A_TRACKING_STEP_S: f64 = 6e-3;

/// Assumed number of receptions of a hunt that goes on, whose length is unknown.
const OF_A_LIVE_HUNT: usize = 500;

/// Receptions of recordings that a page brings along at most, of about 200 bytes each.
const MOST_ROWS: usize = 10_000;

/// Lines of a log, or of recordings, with which a page runs the receptions through the estimator
/// again.
#[derive(Clone, Debug, PartialEq)]
pub struct PageLog {
    header: String,
    lines: Vec<String>,
}

impl PageLog {
    /// The log of a hunt that is over, with the estimator that it shall be replayed with: its own
    /// where none is given.
    ///
    /// # Errors
    ///
    /// [`NotStrikable`] says why a page cannot run the estimator.
    pub fn new(
        header: &LogHeader,
        other: Option<&EstimatorEntry>,
        events: &[Event],
    ) -> Result<Self, NotStrikable> {
        let received = events.iter().filter(|e| matches!(e, Event::Received { .. })).count();
        let header = header_line(header, other, received)?;
        Ok(Self { header, lines: events.iter().filter_map(page_line).collect() })
    }

    /// The log of a hunt that goes on: a header alone; events come one by one ([`page_line`]).
    ///
    /// # Errors
    ///
    /// [`NotStrikable`] says why a page cannot run the estimator.
    pub fn live(header: &LogHeader, other: Option<&EstimatorEntry>) -> Result<Self, NotStrikable> {
        Ok(Self { header: header_line(header, other, OF_A_LIVE_HUNT)?, lines: Vec::new() })
    }

    /// Builds the log of recordings' receptions; `estimator` is the registry's entry for the
    /// estimator that located with them.
    ///
    /// # Errors
    ///
    /// [`NotStrikable`] says why a page cannot run the estimator.
    pub fn of_recordings(
        relocation: &Relocation,
        estimator: &EstimatorEntry,
    ) -> Result<Self, NotStrikable> {
        let registry = Registry::builtin();
        let name = estimator.name.to_string();
        let brought = registry.estimator(&name).ok();
        let is_brought = brought.is_some_and(|brought| brought.settings() == estimator.settings());
        if !is_brought || NOT_BROUGHT.contains(&name.as_str()) {
            return Err(NotStrikable::OwnCode { estimator: name });
        }
        if let Some(settings) = estimator.settings() {
            check_weight(&name, seconds(settings, relocation.len()))?;
        }
        Self::of_lines(relocation)
    }

    /// The receptions of recordings, for transmitters that are tracked; `steps` is how many the
    /// tracking took ([`track_watched`](foxhunt_hunt::locate::track_watched)).
    ///
    /// # Errors
    ///
    /// [`NotStrikable`] says why a page cannot track.
    #[cfg(feature = "batch")]
    pub fn of_tracks(relocation: &Relocation, steps: usize) -> Result<Self, NotStrikable> {
        check_weight("tracking", OF_A_TRACKING_STEP_S * count(steps))?;
        Self::of_lines(relocation)
    }

    fn of_lines(relocation: &Relocation) -> Result<Self, NotStrikable> {
        if relocation.len() > MOST_ROWS {
            return Err(NotStrikable::TooMany { receptions: relocation.len() });
        }
        let mut lines = relocation.lines().map_err(|_| NotStrikable::NoText)?.into_iter();
        let header = lines.next().unwrap_or_default();
        Ok(Self { header, lines: lines.collect() })
    }

    /// The lines, the header first.
    pub(super) fn lines(&self) -> impl Iterator<Item = &str> {
        std::iter::once(&self.header).chain(&self.lines).map(String::as_str)
    }
}

/// The line of a log that an event is, where a replay in a page needs it.
#[must_use]
pub fn page_line(event: &Event) -> Option<String> {
    let needed = matches!(
        event,
        Event::BeaconStarted { .. } | Event::Received { .. } | Event::BeaconFinished { .. }
    );
    // What cannot be written stands in no log either.
    needed.then(|| document::to_json(event).ok()).flatten()
}

fn header_line(
    header: &LogHeader,
    other: Option<&EstimatorEntry>,
    received: usize,
) -> Result<String, NotStrikable> {
    let (name, settings) = match other {
        Some(other) => (other.name.to_string(), other.settings().copied()),
        None => (header.estimator_name.clone(), header.estimator),
    };
    let Some(settings) = settings else {
        return Err(NotStrikable::OwnCode { estimator: name });
    };
    check_weight(&name, seconds(&settings, received))?;
    let header = LogHeader {
        estimator_name: name,
        estimator: Some(settings),
        planner: None,
        homes: Vec::new(),
        ..header.clone()
    };
    document::to_json(&header).map_err(|_| NotStrikable::NoText)
}

/// Refuses what would take a browser too long.
fn check_weight(name: &str, seconds: f64) -> Result<(), NotStrikable> {
    if seconds > MOST_S {
        return Err(NotStrikable::TooHeavy { estimator: name.to_owned(), seconds });
    }
    Ok(())
}

/// Estimates the time in which a browser replays, in seconds: measured in Chromium on a laptop's
/// core.
fn seconds(settings: &EstimatorConfig, received: usize) -> f64 {
    let received = count(received);
    let each = match settings.filter {
        FilterConfig::Grid { side, .. } => 4e-6 * count(side).powi(2),
        FilterConfig::Particle(ParticleConfig { count: particles, .. })
        | FilterConfig::RaoBlackwellised { count: particles } => 4e-6 * count(particles),
        FilterConfig::GaussianSum { parts, .. } => 1e-4 * count(parts).powi(2),
        // Those that solve over all receptions after each.
        _ => 1e-3 + 1e-4 * received,
    };
    received * each
}

fn count(of: usize) -> f64 {
    u32::try_from(of).map_or(f64::INFINITY, f64::from)
}

/// Reason why no bearing can be struck out in a page.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NotStrikable {
    /// The page has the estimators of the library alone.
    #[error("{estimator} is not one of the estimators that a page brings along")]
    OwnCode {
        /// The estimator.
        estimator: String,
    },
    /// It would take too long.
    #[error("{estimator} would take a browser about {seconds:.0} s for each change")]
    TooHeavy {
        /// The estimator.
        estimator: String,
        /// Estimated time in seconds.
        seconds: f64,
    },
    /// They would make the page too large.
    #[error("the page holds {MOST_ROWS} receptions at most, and there are {receptions}")]
    TooMany {
        /// Number of receptions.
        receptions: usize,
    },
    /// The page does not have the tiles of the terrain.
    #[error("the tiles of the terrain are not in the page")]
    Terrain,
    /// The σ of bearings was learned from the bearings of all beacons.
    #[error("the σ of bearings is learned from all beacons together")]
    LearnedSigma,
    /// Bearings alone, from which nothing is estimated.
    #[error("nothing is located here")]
    NoEstimate,
    /// The header holds a number that JSON has not.
    #[error("the log's header cannot be written")]
    NoText,
}

#[cfg(test)]
mod tests {
    #[cfg(feature = "batch")]
    use foxhunt_hunt::locate::{LocateConfig, TrackingConfig};
    use foxhunt_hunt::registry::Registry;

    use super::*;

    #[test]
    fn the_heavy_are_refused() {
        let text = concat!(
            r#"{"foxhunt_log":6,"scenario":"field","seed":1,"estimator_name":"mine","#,
            r#""model":{"reference_dbm":-29.06,"exponent":2.765},"beacons":[]}"#,
        );
        let header: LogHeader = serde_json::from_str(text).expect("a header");
        let own = PageLog::live(&header, None).expect_err("the log has no settings");
        assert_eq!(own, NotStrikable::OwnCode { estimator: "mine".to_owned() });
        let registry = Registry::builtin();
        let particle = registry.estimator("particle").expect("it is built in");
        let log = PageLog::live(&header, Some(particle)).expect("2000 particles are few");
        let header_line = log.lines().next().expect("a header");
        let put: LogHeader = serde_json::from_str(header_line).expect("a header");
        assert_eq!(put.estimator.as_ref(), particle.settings());
        let many = particle.with_settings("count", |settings| {
            settings.filter = FilterConfig::Particle(ParticleConfig::of(1_000_000));
        });
        let heavy = PageLog::live(&header, many.ok().as_ref()).expect_err("it takes half an hour");
        assert!(matches!(heavy, NotStrikable::TooHeavy { .. }), "{heavy}");
        #[cfg(feature = "batch")]
        {
            let relocation = Relocation::of_tracks(
                TrackingConfig::default(),
                Vec::new(),
                LocateConfig::default(),
            );
            assert!(PageLog::of_tracks(&relocation, 1000).is_ok(), "seconds");
            let heavy = PageLog::of_tracks(&relocation, 1_000_000).expect_err("many minutes");
            assert!(matches!(heavy, NotStrikable::TooHeavy { .. }), "{heavy}");
        }
    }
}
