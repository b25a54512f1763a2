use foxhunt_core::angle;
use foxhunt_sensors::{AntennaConfig, AntennaError};
use rayon::prelude::*;

use super::{BearingCase, BearingReport, ExtractorReport, Turn, report::Found};
use crate::config::{BoxedExtractor, ExtractorConfigError, NamedExtractor};

/// Draws `runs` turns of a case through an antenna, which the extractors that can are told, and has
/// every extractor read each of them, on `jobs` threads. Turn i has the seed `seed` + i; the result
/// does not depend on `jobs`. `progress` is called after each turn, from any thread.
///
/// # Errors
///
/// [`BearingCampaignError`] when the antenna or an extractor cannot be built.
pub fn bearing_campaign(
    case: &BearingCase,
    antenna: &AntennaConfig,
    extractors: &[NamedExtractor],
    runs: u32,
    seed: u64,
    jobs: usize,
    progress: &(dyn Fn() + Sync),
) -> Result<BearingReport, BearingCampaignError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|error| BearingCampaignError::Threads { jobs, reason: error.to_string() })?;
    let through = antenna.build()?;
    let build = |named: &NamedExtractor| {
        let config = named.config.clone();
        config.clone().with_antenna(antenna).unwrap_or(config).build()
    };
    let built: Vec<BoxedExtractor> = extractors.iter().map(build).collect::<Result<_, _>>()?;
    let one = |run: u32| {
        let turn = Turn::draw(case, &through, seed.wrapping_add(u64::from(run)));
        let read: Vec<Option<Found>> =
            built.iter().map(|extractor| find(extractor, &turn)).collect();
        progress();
        (turn.bound, read)
    };
    let turns: Vec<_> = pool.install(|| (0..runs).into_par_iter().map(one).collect());
    let reports = extractors.iter().enumerate().map(|(index, named)| {
        let found: Vec<_> =
            turns.iter().map(|(_, read)| read.get(index).copied().flatten()).collect();
        ExtractorReport::of(named.name, &found)
    });
    let bounds = turns.iter().map(|(bound, _)| bound).sum::<f64>() / f64::from(runs);
    Ok(BearingReport {
        campaign: case.name.to_owned(),
        runs,
        seed,
        bound_deg: bounds.sqrt().to_degrees(),
        extractors: reports.collect(),
    })
}

/// A turn's bearing against the truth; none where it is refused.
fn find(extractor: &BoxedExtractor, turn: &Turn) -> Option<Found> {
    let reading = extractor.extract(&turn.lend()).ok()?;
    let bearing = reading.bearing.ok()?;
    Some(Found {
        error: angle::wrap(bearing.angle - turn.bearing),
        sigma: bearing.sigma,
        ambiguous: !reading.modes.is_empty(),
        level_error_db: reading.rss_dbm - Turn::LEVEL_DBM,
    })
}

/// Why there is no campaign of bearings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BearingCampaignError {
    /// The threads could not be started.
    #[error("{jobs} threads cannot be started: {reason}")]
    Threads {
        /// How many.
        jobs: usize,
        /// Why not.
        reason: String,
    },
    /// The antenna cannot be built.
    #[error("the antenna: {0}")]
    Antenna(#[from] AntennaError),
    /// An extractor cannot be built.
    #[error(transparent)]
    Extractor(#[from] ExtractorConfigError),
}
