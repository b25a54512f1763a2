use foxhunt_core::angle;
use foxhunt_hunt::{
    config::{BoxedExtractor, ExtractorConfigError},
    registry::{ExtractorEntry, Registry},
};
use foxhunt_sensors::{AntennaConfig, AntennaError, SharedAntenna};

use super::{BearingCase, BearingReport, ExtractorReport, Turn, report::BearingError};
use crate::{Experiment, Runner, ThreadsError, campaign::Repetition};

/// Draws turns of a case through an antenna, which those extractors are given that take one, and
/// has every extractor read each of them. The result does not depend on the number of threads.
///
/// # Errors
///
/// [`BearingCampaignError`] when the antenna or an extractor cannot be built.
pub fn bearing_campaign(
    registry: &Registry,
    case: &BearingCase,
    antenna: &AntennaConfig,
    extractors: &[ExtractorEntry],
    repetition: &Repetition<'_>,
) -> Result<BearingReport, BearingCampaignError> {
    let runner = Runner::new(repetition.jobs)?;
    let build = |entry: &ExtractorEntry| {
        let config = entry.config();
        registry.build_extractor(&config.clone().with_antenna(antenna).unwrap_or(config))
    };
    let built: Vec<BoxedExtractor> = extractors.iter().map(build).collect::<Result<_, _>>()?;
    let turns = Turns { case, antenna: antenna.build()?, extractors: &built };
    let turns = repetition.of(&runner, &turns).unwrap_or_else(|never| match never {});
    let reports = extractors.iter().enumerate().map(|(index, entry)| {
        let read: Vec<_> =
            turns.iter().map(|(_, read)| read.get(index).copied().flatten()).collect();
        ExtractorReport::of(&entry.name, &read)
    });
    let bounds = turns.iter().map(|(bound, _)| bound).sum::<f64>() / f64::from(repetition.runs);
    Ok(BearingReport {
        campaign: case.name.to_owned(),
        runs: repetition.runs,
        seed: repetition.seed,
        bound_deg: bounds.sqrt().to_degrees(),
        extractors: reports.collect(),
    })
}

/// Turns of a case, each read by every extractor.
struct Turns<'a> {
    case: &'a BearingCase,
    antenna: SharedAntenna,
    extractors: &'a [BoxedExtractor],
}

impl Experiment for Turns<'_> {
    /// The turn's bound, and what each extractor reads.
    type Run = (f64, Vec<Option<BearingError>>);
    type Error = std::convert::Infallible;

    fn run(&self, seed: u64) -> Result<Self::Run, Self::Error> {
        let turn = Turn::draw(self.case, &self.antenna, seed);
        let read = self.extractors.iter().map(|extractor| read(extractor, &turn));
        Ok((turn.bound, read.collect()))
    }
}

/// A turn's bearing against the truth; `None` if it is refused.
fn read(extractor: &BoxedExtractor, turn: &Turn) -> Option<BearingError> {
    let reading = extractor.extract(&turn.as_sweep()).ok()?;
    let bearing = reading.bearing.ok()?;
    Some(BearingError {
        error: angle::wrap(bearing.angle - turn.bearing),
        sigma: bearing.sigma,
        ambiguous: !reading.modes.is_empty(),
        level_error_db: reading.rss_dbm - Turn::LEVEL_DBM,
    })
}

/// The reason why there is no campaign of bearings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BearingCampaignError {
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// The antenna cannot be built.
    #[error("the antenna: {0}")]
    Antenna(#[from] AntennaError),
    /// An extractor cannot be built.
    #[error(transparent)]
    Extractor(#[from] ExtractorConfigError),
}
