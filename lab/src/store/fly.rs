//! Campaigns that are flown into a store, whole or in shards.

use std::{convert::Infallible, fmt, io::Write, ops::Range, str::FromStr};

use flate2::{Compression, write::GzEncoder};
use foxhunt_hunt::{
    hunt::Event,
    log::LogWriter,
    registry::{EstimatorEntry, Registry},
    scenario::Scenario,
};
use rusqlite::params;

use super::{Contender, Store, StoreError, StoredCampaign, first};
use crate::{
    Experiment, Runner,
    campaign::{BeaconRun, CampaignReport, Flown, Repetition, beacon_names},
    simulation::{Setup, SimulationError},
};

/// One of several parts of a campaign, each of which another process flies.
///
/// Runs are divided into parts that lie one after the other and differ by one run at most.
///
/// ```
/// use foxhunt_lab::store::Shard;
///
/// let second: Shard = "2/3".parse()?;
/// assert_eq!(second.of(10), 3..6);
/// # Ok::<(), foxhunt_lab::store::ShardError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: u32,
    count: u32,
}

impl Shard {
    /// All of it: the first part of one.
    pub const WHOLE: Self = Self { number: 1, count: 1 };

    /// Part `number`, counted from 1, of `count`.
    ///
    /// # Errors
    ///
    /// [`ShardError`] when there is no such part.
    pub fn new(number: u32, count: u32) -> Result<Self, ShardError> {
        if (1..=count).contains(&number) {
            Ok(Self { number, count })
        } else {
            Err(ShardError { given: format!("{number}/{count}") })
        }
    }

    /// Returns the range of runs, out of `runs`, that the part flies.
    #[must_use]
    pub fn of(self, runs: u32) -> Range<u32> {
        let before = |parts: u32| {
            let runs = u64::from(runs) * u64::from(parts) / u64::from(self.count);
            u32::try_from(runs).unwrap_or(u32::MAX)
        };
        before(self.number - 1)..before(self.number)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let error = || ShardError { given: text.to_owned() };
        let (number, count) = text.split_once('/').ok_or_else(error)?;
        let whole = |digits: &str| digits.parse().map_err(|_| error());
        Self::new(whole(number)?, whole(count)?)
    }
}

/// There is no such part of a campaign.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("shard {given:?} must be K/N, with whole numbers and 1 ≤ K ≤ N")]
pub struct ShardError {
    given: String,
}

/// A campaign that is flown into a store.
#[derive(Clone, Copy, Debug)]
pub struct CampaignToStore<'a> {
    /// The registry with the names in the scenario.
    pub registry: &'a Registry,
    /// The scenario, with the planner that it is flown with.
    pub scenario: &'a Scenario,
    /// The estimators.
    pub estimators: &'a [EstimatorEntry],
    /// The planner's name, or [`OWN`](crate::campaign::OWN).
    pub planner: &'a str,
    /// The program and its version: what was flown by another one is another campaign.
    pub program: &'a str,
    /// True if the log of each hunt is kept.
    pub logs: bool,
    /// The part of the runs that is flown here.
    pub shard: Shard,
}

impl CampaignToStore<'_> {
    /// Flies the runs that the store does not hold yet, each of which is in the store soon after
    /// its end, and gives the statistics of all runs of the shard, as
    /// [`campaign`](crate::campaign::campaign) does. The memory that it takes does not hang on the
    /// number of runs.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the scenario or an estimator cannot be built, or the store not be
    /// written. A single run that goes wrong is one of its rows.
    pub fn fly(
        &self,
        store: &Store,
        repetition: &Repetition<'_>,
    ) -> Result<CampaignReport, StoreError> {
        let Repetition { runs, seed, jobs, progress } = *repetition;
        let runner = Runner::new(jobs)?;
        let beacons = beacon_names(self.scenario);
        if beacons.is_empty() {
            return Err(StoreError::NoBeacon { scenario: self.scenario.name.clone() });
        }
        let seeds = seeds(seed, runs, self.shard)?;
        store.write_ahead()?;
        let (campaign, contenders) = self.register(store, beacons)?;
        for (estimator, contender) in self.estimators.iter().zip(&contenders) {
            let missing = store.missing(contender.id, &seeds)?;
            let open: u64 = missing.iter().map(|range| range.end - range.start).sum();
            (open..seeds.end - seeds.start).for_each(|_| progress());
            let setup = Setup { scenario: self.scenario, estimator, registry: self.registry };
            let flights = StoredFlights { setup, beacons: campaign.beacons.len(), logs: self.logs };
            let missing = missing.into_iter().flatten();
            runner.run_seeds::<_, StoreError>(&flights, missing, progress, |runs| {
                store.write(contender.id, &runs)
            })?;
        }
        store.settle();
        let estimators = contenders
            .iter()
            .map(|contender| store.summary_of(&campaign, contender, &seeds))
            .collect::<Result<_, _>>()?;
        Ok(CampaignReport {
            scenario: campaign.scenario,
            planner: Some(campaign.planner),
            runs: u32::try_from(seeds.end - seeds.start).unwrap_or(u32::MAX),
            seed: seeds.start,
            estimators,
        })
    }

    /// Enters campaign and contenders, all before the first run, so that every shard has the same.
    fn register(
        &self,
        store: &Store,
        beacons: Vec<String>,
    ) -> Result<(StoredCampaign, Vec<Contender>), StoreError> {
        let mut campaign = StoredCampaign::new(self.program, self.planner, self.scenario, beacons)?;
        store.at_once(|| {
            campaign.id = store.doing("entering the campaign", store.campaign_id(&campaign))?;
            let enter = |estimator| {
                let mut contender = Contender::new(&campaign, estimator)?;
                let entered = store.contender_id(&contender);
                contender.id = store.doing("entering a contender", entered)?;
                Ok(contender)
            };
            let contenders = self.estimators.iter().map(enter).collect::<Result<_, StoreError>>();
            Ok((campaign.clone(), contenders?))
        })
    }
}

/// Hunts of which only figures and the log are kept.
struct StoredFlights<'a> {
    setup: Setup<'a>,
    beacons: usize,
    logs: bool,
}

/// The results of one hunt that a store keeps.
struct StoredRun {
    failure: Option<String>,
    duration_s: Option<f64>,
    beacons: Vec<BeaconRun>,
    log: Option<Vec<u8>>,
}

impl Experiment for StoredFlights<'_> {
    type Run = StoredRun;
    type Error = SimulationError;

    fn run(&self, seed: u64) -> Result<StoredRun, SimulationError> {
        let (flown, log) = if self.logs {
            let unwritten = |error| SimulationError::Log(Box::new(error));
            let mut text = Vec::new();
            let mut writer =
                LogWriter::new(&mut text, &self.setup.log_header(seed)).map_err(unwritten)?;
            let flown = self.setup.simulate(seed, |event| writer.event(event));
            (flown, Some(compressed(&text).map_err(unwritten)?))
        } else {
            (self.setup.simulate(seed, |_: &Event| Ok::<_, Infallible>(())), None)
        };
        let flown = Flown::of(flown)?;
        Ok(StoredRun {
            beacons: (0..self.beacons).map(|beacon| flown.beacon_run(beacon)).collect(),
            duration_s: flown.0.as_ref().ok().map(|hunt| hunt.duration_s),
            failure: flown.0.err(),
            log,
        })
    }
}

impl Store {
    /// Writes runs of a contender: all of them, or none.
    fn write(&self, contender: i64, runs: &[(u64, StoredRun)]) -> Result<(), StoreError> {
        self.at_once(|| {
            let written = runs.iter().try_for_each(|(seed, run)| {
                // Checked before the first run.
                self.write_run(contender, i64::try_from(*seed).unwrap_or(i64::MAX), run)
            });
            self.doing("writing runs", written)
        })
    }

    fn write_run(&self, contender: i64, seed: i64, run: &StoredRun) -> Result<(), rusqlite::Error> {
        let mut insert = self.connection.prepare_cached(
            "INSERT INTO run VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, \
             ?15, ?16)",
        )?;
        for (index, beacon) in (0_i64..).zip(&run.beacons) {
            let count = |count: usize| i64::try_from(count).unwrap_or(i64::MAX);
            insert.execute(params![
                contender,
                seed,
                index,
                beacon.outcome.map(super::read::name_of),
                run.failure,
                run.duration_s,
                beacon.error_m,
                beacon.nees,
                beacon.steps,
                beacon.steps_to_3m,
                beacon.time_to_3m_s,
                beacon.path_m,
                beacon.nis.sum,
                beacon.nis.sum_of_squares,
                count(beacon.nis.degrees_of_freedom),
                count(beacon.nis.count),
            ])?;
        }
        if let Some(log) = &run.log {
            let sql = "INSERT INTO log (contender, seed, jsonl_gz) VALUES (?1, ?2, ?3)";
            self.connection.prepare_cached(sql)?.execute(params![contender, seed, log])?;
        }
        Ok(())
    }

    /// The seeds of a range that a contender has no run with.
    fn missing(&self, contender: i64, seeds: &Range<u64>) -> Result<Vec<Range<u64>>, StoreError> {
        let read = || {
            let mut held = self.connection.prepare(
                "SELECT seed FROM run WHERE contender = ?1 AND beacon = 0 \
                 AND seed >= ?2 AND seed < ?3 ORDER BY seed",
            )?;
            let bound = |seed: u64| i64::try_from(seed).unwrap_or(i64::MAX);
            let mut rows = held.query(params![contender, bound(seeds.start), bound(seeds.end)])?;
            let mut missing = Vec::new();
            let mut next = seeds.start;
            while let Some(row) = rows.next()? {
                let seed = first::<i64>(row)?.unsigned_abs();
                if seed > next {
                    missing.push(next..seed);
                }
                next = seed + 1;
            }
            if next < seeds.end {
                missing.push(next..seeds.end);
            }
            Ok(missing)
        };
        self.doing("looking for what is missing", read())
    }
}

/// The seeds of a shard.
fn seeds(seed: u64, runs: u32, shard: Shard) -> Result<Range<u64>, StoreError> {
    let most = i64::MAX.unsigned_abs();
    if seed.checked_add(u64::from(runs)).is_none_or(|end| end > most) {
        return Err(StoreError::Seeds { seed, runs });
    }
    let part = shard.of(runs);
    Ok(seed + u64::from(part.start)..seed + u64::from(part.end))
}

fn compressed(text: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(text)?;
    encoder.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_cover_all_runs_once() {
        for (runs, count) in [(10, 3), (2, 5), (1, 1), (0, 2), (u32::MAX, 7)] {
            let mut next = 0;
            for number in 1..=count {
                let part = Shard::new(number, count).expect("it is one of them").of(runs);
                assert_eq!(part.start, next);
                assert!(part.len() <= (runs as usize).div_ceil(count as usize));
                next = part.end;
            }
            assert_eq!(next, runs);
        }
    }

    #[test]
    fn what_is_no_shard_is_refused() {
        for text in ["0/3", "4/3", "1", "1/0", "a/2", "-1/2", "1/2/3", ""] {
            let error = text.parse::<Shard>().expect_err("it is none").to_string();
            assert!(error.contains(&format!("{text:?}")), "{error}");
        }
        assert_eq!("2/3".parse::<Shard>().expect("one").to_string(), "2/3");
    }
}
