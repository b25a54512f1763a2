//! The runs of a store as they are read: rows, summaries, logs, and contenders seed by seed.

use std::{io::Read, ops::Range};

use flate2::read::GzDecoder;
use foxhunt_core::Outcome;
use foxhunt_filters::consistency::ChiSquaredSums;
use rusqlite::{OptionalExtension, params, types::FromSql};
use serde::{
    Deserialize, Serialize,
    de::{IntoDeserializer, value::Error},
};

use super::{Contender, Store, StoreError, StoredCampaign, first};
use crate::{
    Paired, PairedDifference,
    campaign::{BeaconRun, CampaignReport, EstimatorCampaign, FlightsSummary},
};

/// The requirement on numbers.
const NUMBER: &str = "must be a number";

const FIGURES: [Figure; 4] = [
    ("error_m", |run| Some(run.sample()?.error_m)),
    ("steps_to_3m", |run| run.steps_to_3m.map(f64::from)),
    ("time_to_3m_s", |run| run.time_to_3m_s),
    ("path_m", |run| run.path_m),
];

/// A choice of a store's runs; all of them if nothing is given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Filter {
    /// Names of estimators, each with or without the beginning of its digest.
    pub estimators: Vec<String>,
    /// The planner's name.
    pub planner: Option<String>,
    /// The scenario's name.
    pub scenario: Option<String>,
    /// The beacon's name.
    pub beacon: Option<String>,
    /// The seeds.
    pub seeds: Option<Range<u64>>,
}

impl Filter {
    pub(super) fn campaign(&self, campaign: &StoredCampaign) -> bool {
        self.planner.as_ref().is_none_or(|planner| *planner == campaign.planner)
            && self.scenario.as_ref().is_none_or(|scenario| *scenario == campaign.scenario)
    }

    pub(super) fn contender(&self, contender: &Contender) -> bool {
        self.estimators.is_empty() || self.estimators.iter().any(|name| contender.is(name))
    }

    fn beacon(&self, name: &str) -> bool {
        self.beacon.as_ref().is_none_or(|beacon| beacon == name)
    }

    pub(super) fn seeds(&self) -> Range<u64> {
        self.seeds.clone().unwrap_or(0..i64::MAX.unsigned_abs())
    }
}

/// A summary of one campaign in a store.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The campaign that was flown.
    pub campaign: StoredCampaign,
    /// The runs of each contender.
    pub held: Vec<Held>,
    /// Statistics of the runs, as [`campaign`](crate::campaign::campaign) gives them for the same
    /// runs.
    pub report: CampaignReport,
}

/// The runs of one contender.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Held {
    /// The contender.
    pub contender: Contender,
    /// The number of runs.
    pub runs: u32,
    /// The least seed; absent where there is no run.
    pub first_seed: Option<u64>,
    /// The greatest one.
    pub last_seed: Option<u64>,
    /// The number of seeds without a run between the least and the greatest of the whole campaign.
    pub missing: u64,
}

/// One row of a store: one run for one beacon.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The seed of the run.
    pub seed: u64,
    /// The beacon's index.
    pub beacon: usize,
    /// The reason why the hunt could not go on, if so.
    pub failure: Option<String>,
    /// Duration of the hunt, in simulated seconds.
    pub duration_s: Option<f64>,
    /// The figures.
    pub run: BeaconRun,
}

impl Store {
    /// The statistics of what the store holds, campaign by campaign.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the file cannot be read.
    pub fn summaries(&self, filter: &Filter) -> Result<Vec<Summary>, StoreError> {
        let contenders = self.contenders()?;
        let campaigns = self.campaigns()?.into_iter().filter(|c| filter.campaign(c));
        let summary = |campaign: StoredCampaign| {
            let of = |contender: &&Contender| {
                contender.campaign == campaign.id && filter.contender(contender)
            };
            let contenders: Vec<&Contender> = contenders.iter().filter(of).collect();
            self.summary(campaign, &contenders, filter)
        };
        let mut summaries = campaigns.map(summary).collect::<Result<Vec<_>, _>>()?;
        summaries.retain(|summary| !summary.held.is_empty());
        Ok(summaries)
    }

    fn summary(
        &self,
        campaign: StoredCampaign,
        contenders: &[&Contender],
        filter: &Filter,
    ) -> Result<Summary, StoreError> {
        let mut held = Vec::new();
        let mut estimators = Vec::new();
        for contender in contenders {
            let (mut of, bounds, runs) = self.scan(&campaign, contender, &filter.seeds())?;
            of.beacons.retain(|beacon| filter.beacon(&beacon.name));
            if contenders.iter().filter(|other| other.estimator == contender.estimator).count() > 1
            {
                of.estimator = contender.full_name();
            }
            estimators.push(of);
            let first_seed = bounds.map(|b| b[0]);
            let last_seed = bounds.map(|b| b[1]);
            let contender = (*contender).clone();
            held.push(Held { contender, runs, first_seed, last_seed, missing: 0 });
        }
        let seed = held.iter().filter_map(|held| held.first_seed).min().unwrap_or(0);
        let last = held.iter().filter_map(|held| held.last_seed).max();
        let all = last.map_or(0, |last| last - seed + 1);
        for held in &mut held {
            held.missing = all - u64::from(held.runs);
        }
        let report = CampaignReport {
            scenario: campaign.scenario.clone(),
            planner: Some(campaign.planner.clone()),
            runs: held.iter().map(|held| held.runs).max().unwrap_or(0),
            seed,
            estimators,
        };
        Ok(Summary { campaign, held, report })
    }

    /// The statistics of one contender's runs with these seeds.
    pub(super) fn summary_of(
        &self,
        campaign: &StoredCampaign,
        contender: &Contender,
        seeds: &Range<u64>,
    ) -> Result<EstimatorCampaign, StoreError> {
        Ok(self.scan(campaign, contender, seeds)?.0)
    }

    /// The statistics, the least and the greatest seed, and how many runs there are.
    fn scan(
        &self,
        campaign: &StoredCampaign,
        contender: &Contender,
        seeds: &Range<u64>,
    ) -> Result<(EstimatorCampaign, Option<[u64; 2]>, u32), StoreError> {
        let mut summary = FlightsSummary::new(&campaign.beacons);
        let mut run = vec![BeaconRun::default(); campaign.beacons.len()];
        let mut bounds = None::<[u64; 2]>;
        let mut runs = 0;
        self.for_each_run(contender, seeds, |seed, beacon, figures| {
            // The rows of a run are one after the other.
            if bounds.is_some_and(|[_, last]| last != seed) {
                summary.add(|beacon| run[beacon]);
                run.fill(BeaconRun::default());
                runs += 1;
            }
            bounds = Some([bounds.map_or(seed, |[least, _]| least), seed]);
            match run.get_mut(beacon) {
                Some(place) => *place = figures,
                None => return Err("must be that of a beacon of the campaign"),
            }
            Ok(())
        })?;
        if bounds.is_some() {
            summary.add(|beacon| run[beacon]);
            runs += 1;
        }
        Ok((summary.report(&contender.estimator), bounds, runs))
    }

    /// Calls `take` with seed, beacon and figures of each row, in the order of the seeds.
    fn for_each_run(
        &self,
        contender: &Contender,
        seeds: &Range<u64>,
        mut take: impl FnMut(u64, usize, BeaconRun) -> Result<(), &'static str>,
    ) -> Result<(), StoreError> {
        self.for_each_row(contender, seeds, |row| {
            take(row.seed()?, row.beacon()?, row.figures()?)
                .map_err(|requirement| row.wrong("beacon", requirement))
        })
    }

    /// Calls `take` with each row of a contender, by seed and beacon.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the file cannot be read or holds what it must not; the errors of
    /// `take`.
    pub fn rows<E: From<StoreError>>(
        &self,
        contender: &Contender,
        seeds: &Range<u64>,
        mut take: impl FnMut(Row) -> Result<(), E>,
    ) -> Result<(), E> {
        self.for_each_row(contender, seeds, |row| {
            take(Row {
                seed: row.seed()?,
                beacon: row.beacon()?,
                failure: row.get(4, "failure", "must be a text")?,
                duration_s: row.get(5, "duration_s", NUMBER)?,
                run: row.figures()?,
            })
        })
    }

    fn for_each_row<E: From<StoreError>>(
        &self,
        contender: &Contender,
        seeds: &Range<u64>,
        mut take: impl FnMut(&StoredRow<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        const READING: &str = "reading runs";
        let sql = "SELECT * FROM run WHERE contender = ?1 AND seed >= ?2 AND seed < ?3 \
                   ORDER BY seed, beacon";
        let mut select = self.doing(READING, self.connection.prepare_cached(sql))?;
        let bound = |seed: u64| i64::try_from(seed).unwrap_or(i64::MAX);
        let bounds = params![contender.id, bound(seeds.start), bound(seeds.end)];
        let mut rows = self.doing(READING, select.query(bounds))?;
        while let Some(row) = self.doing(READING, rows.next())? {
            take(&StoredRow { store: self, row })?;
        }
        Ok(())
    }

    /// Errors in metres and NEES of the good runs of a contender for the beacon of an index, each
    /// rising; 16 bytes for each run are in memory.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the file cannot be read.
    pub fn samples(
        &self,
        contender: &Contender,
        beacon: usize,
        filter: &Filter,
    ) -> Result<[Vec<f64>; 2], StoreError> {
        let mut errors_m = Vec::new();
        let mut nees = Vec::new();
        self.for_each_run(contender, &filter.seeds(), |_, of, run| {
            if let Some(sample) = run.sample().filter(|_| of == beacon) {
                errors_m.push(sample.error_m);
                nees.push(sample.nees);
            }
            Ok(())
        })?;
        errors_m.sort_by(f64::total_cmp);
        nees.sort_by(f64::total_cmp);
        Ok([errors_m, nees])
    }

    /// The one contender that a filter lets through.
    ///
    /// # Errors
    ///
    /// [`StoreError`] unless exactly one contender passes, or when the file cannot be read.
    pub fn only_contender(&self, filter: &Filter) -> Result<Contender, StoreError> {
        let campaigns = self.campaigns()?;
        let mut contenders = self.contenders()?;
        let fits = |id| campaigns.iter().any(|c| c.id == id && filter.campaign(c));
        contenders.retain(|one| fits(one.campaign) && filter.contender(one));
        match &contenders[..] {
            [one] => Ok(one.clone()),
            several => Err(StoreError::Contender {
                file: self.file(),
                name: filter.estimators.join(", "),
                count: several.len(),
                known: self.contenders()?.iter().map(Contender::full_name).collect(),
            }),
        }
    }

    /// The log of a run, as it was written.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when there is no such log, or it cannot be read.
    pub fn log(&self, contender: &Contender, seed: u64) -> Result<Vec<u8>, StoreError> {
        let sql = "SELECT jsonl_gz FROM log WHERE contender = ?1 AND seed = ?2";
        let key = params![contender.id, i64::try_from(seed).unwrap_or(i64::MAX)];
        let found = self.connection.query_row(sql, key, first::<Vec<u8>>).optional();
        let missing =
            || StoreError::NoLog { file: self.file(), contender: contender.full_name(), seed };
        let compressed = self.doing("reading a log", found)?.ok_or_else(missing)?;
        let mut text = Vec::new();
        GzDecoder::new(&compressed[..]).read_to_end(&mut text).map_err(|source| {
            StoreError::Io { file: self.file(), doing: "inflating a log", source }
        })?;
        Ok(text)
    }
}

/// A row of the table `run`.
struct StoredRow<'a> {
    store: &'a Store,
    row: &'a rusqlite::Row<'a>,
}

impl StoredRow<'_> {
    fn get<T: FromSql>(
        &self,
        column: usize,
        field: &'static str,
        requirement: &'static str,
    ) -> Result<T, StoreError> {
        self.row.get(column).map_err(|_| self.wrong(field, requirement))
    }

    fn seed(&self) -> Result<u64, StoreError> {
        self.get(1, "seed", "must be a whole number that is not negative")
    }

    fn beacon(&self) -> Result<usize, StoreError> {
        self.get(2, "beacon", "must be an index")
    }

    fn figures(&self) -> Result<BeaconRun, StoreError> {
        const COUNT: &str = "must be a count";
        Ok(BeaconRun {
            outcome: self.outcome()?,
            error_m: self.get(6, "error_m", NUMBER)?,
            nees: self.get(7, "nees", NUMBER)?,
            steps: self.get(8, "steps", COUNT)?,
            steps_to_3m: self.get(9, "steps_to_3m", COUNT)?,
            time_to_3m_s: self.get(10, "time_to_3m_s", NUMBER)?,
            path_m: self.get(11, "path_m", NUMBER)?,
            nis: ChiSquaredSums {
                sum: self.get(12, "nis_sum", NUMBER)?,
                sum_of_squares: self.get(13, "nis_sum_of_squares", NUMBER)?,
                degrees_of_freedom: self.get(14, "nis_degrees_of_freedom", COUNT)?,
                count: self.get(15, "nis_count", COUNT)?,
            },
            transmitters: None,
        })
    }

    fn outcome(&self) -> Result<Option<Outcome>, StoreError> {
        let wrong = || self.wrong("ended", "must be how a search ends");
        let ended = self.row.get_ref(3).map_err(|_| wrong())?;
        match ended.as_str_or_null() {
            Ok(None) => Ok(None),
            Ok(Some(name)) => outcome_of(name).map(Some).ok_or_else(wrong),
            Err(_) => Err(wrong()),
        }
    }

    fn wrong(&self, field: &'static str, requirement: &'static str) -> StoreError {
        let number = |column| self.row.get(column).unwrap_or(-1);
        StoreError::Row {
            file: self.store.file(),
            contender: number(0),
            seed: number(1),
            beacon: number(2),
            field,
            requirement,
        }
    }
}

/// The comparison of two contenders of a store on one beacon over the seeds that both have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeedBySeed {
    /// The contender whose figures come first.
    pub first: String,
    /// The contender that the first is compared with.
    pub second: String,
    /// The beacon's name.
    pub beacon: String,
    /// The figure that is compared, as the column of the store is called.
    pub figure: &'static str,
    /// The first one's figure minus the second one's; absent for less than two runs.
    pub difference: Option<PairedDifference>,
    /// The first one's figure over the second one's; absent where there are no ratios.
    pub ratio: Option<Paired>,
}

/// A figure that is compared: a column and its value, where a run has one.
type Figure = (&'static str, fn(&BeaconRun) -> Option<f64>);

/// The name of the end of a search in a store and a log.
pub(super) fn name_of(outcome: Outcome) -> String {
    match serde_json::to_value(outcome) {
        Ok(serde_json::Value::String(name)) => name,
        // An end of a search is a word, which a test of all of them holds.
        _ => String::new(),
    }
}

fn outcome_of(name: &str) -> Option<Outcome> {
    let name: serde::de::value::StrDeserializer<'_, Error> = name.into_deserializer();
    Outcome::deserialize(name).ok()
}

/// Compares two contenders, seed by seed; runs that lack a figure with either are left out of its
/// comparison. Contenders are named by their estimators, with or without the beginning of the
/// digest; they may be of different campaigns. The figures are kept in memory, 136 bytes for each
/// run.
///
/// # Errors
///
/// [`StoreError`] when a name is not that of exactly one contender that the filter lets through, or
/// the file cannot be read.
pub fn compare(
    store: &Store,
    filter: &Filter,
    first: &str,
    second: &str,
) -> Result<Vec<SeedBySeed>, StoreError> {
    let campaigns = store.campaigns()?;
    let let_through =
        |id| campaigns.iter().any(|campaign| campaign.id == id && filter.campaign(campaign));
    let mut contenders = store.contenders()?;
    contenders.retain(|contender| let_through(contender.campaign));
    let first = named(store, &contenders, first)?;
    let second = named(store, &contenders, second)?;
    let names = |contender: &Contender| {
        campaigns.iter().find(|c| c.id == contender.campaign).map_or(&[][..], |c| &c.beacons)
    };
    let mut comparisons = Vec::new();
    for (index, beacon) in names(first).iter().enumerate() {
        let wanted = filter.beacon.as_ref().is_none_or(|wanted| wanted == beacon);
        let other = names(second).iter().position(|name| name == beacon);
        let (true, Some(other)) = (wanted, other) else { continue };
        let figures = |run: &BeaconRun| FIGURES.map(|(_, figure)| figure(run));
        let mut own = Vec::new();
        store.for_each_run(first, &filter.seeds(), |seed, beacon, run| {
            if beacon == index {
                own.push((seed, figures(&run)));
            }
            Ok(())
        })?;
        let mut pairs = FIGURES.map(|_| Vec::new());
        store.for_each_run(second, &filter.seeds(), |seed, beacon, run| {
            if beacon == other
                && let Ok(at) = own.binary_search_by_key(&seed, |(seed, _)| *seed)
            {
                for ((pairs, a), b) in pairs.iter_mut().zip(own[at].1).zip(figures(&run)) {
                    pairs.extend(a.zip(b));
                }
            }
            Ok(())
        })?;
        for ((figure, _), pairs) in FIGURES.iter().zip(pairs) {
            comparisons.push(SeedBySeed {
                first: first.full_name(),
                second: second.full_name(),
                beacon: beacon.clone(),
                figure,
                difference: PairedDifference::of(pairs.iter().copied()),
                ratio: Paired::of(pairs),
            });
        }
    }
    Ok(comparisons)
}

/// The one contender of a name.
fn named<'a>(
    store: &Store,
    contenders: &'a [Contender],
    name: &str,
) -> Result<&'a Contender, StoreError> {
    let found: Vec<&Contender> = contenders.iter().filter(|one| one.is(name)).collect();
    match found[..] {
        [one] => Ok(one),
        _ => Err(StoreError::Contender {
            file: store.file(),
            name: name.to_owned(),
            count: found.len(),
            known: contenders.iter().map(Contender::full_name).collect(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_of_searches_have_the_names_of_the_log() {
        for (outcome, name) in
            [(Outcome::Converged, "converged"), (Outcome::BudgetSpent, "budget_spent")]
        {
            assert_eq!(name_of(outcome), name);
            assert_eq!(outcome_of(name), Some(outcome));
        }
        assert_eq!(outcome_of("lost"), None);
    }
}
