use std::{
    env,
    path::{Path, PathBuf},
    str::FromStr,
};

use foxhunt::{
    campaign::{CampaignReport, Repetition},
    registry::{EstimatorEntry, Registry},
    scenario::Scenario,
    store::{CampaignToStore, Shard, ShardError, Store, StoreError},
};

use super::choice;
use crate::error::CliError;

/// The program's name in a store; runs of another version are another campaign.
const PROGRAM: &str = concat!("foxhunt ", env!("CARGO_PKG_VERSION"));

/// Store of a campaign's runs, and the part of them flown here.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "A store of runs")]
pub struct Storing {
    /// Keep every run in this file as it ends; runs that it already holds are not flown again
    #[arg(long, value_name = "FILE", conflicts_with = "hunts_to")]
    store: Option<PathBuf>,
    /// Keep the log of every hunt, too; runs already in the store get no log
    #[arg(long, requires = "store")]
    store_logs: bool,
    /// Fly part K of N of the runs, K from 1, or `auto`: K and N from SLURM, Kubernetes or MPI
    #[arg(long, value_name = "K/N", requires = "store")]
    shard: Option<ChosenShard>,
}

/// A part of the runs, as the command line has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ChosenShard {
    /// This one.
    Given(Shard),
    /// The part that the environment names.
    Auto,
}

impl FromStr for ChosenShard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        match text {
            "auto" => Ok(Self::Auto),
            given => given.parse().map(Self::Given),
        }
    }
}

/// A campaign that is flown into a file.
#[derive(Debug)]
pub struct Job<'a> {
    store: Store,
    campaign: CampaignToStore<'a>,
}

impl Storing {
    /// The campaign into the file of the command line, if there is one.
    pub fn job<'a>(
        &self,
        registry: &'a Registry,
        scenario: &'a Scenario,
        estimators: &'a [EstimatorEntry],
        planner: &'a str,
    ) -> Result<Option<Job<'a>>, CliError> {
        let Some(path) = &self.store else { return Ok(None) };
        let shard = match self.shard {
            None => Shard::WHOLE,
            Some(ChosenShard::Given(shard)) => shard,
            Some(ChosenShard::Auto) => of_environment(|name| env::var(name).ok())?,
        };
        let campaign = CampaignToStore {
            registry,
            scenario,
            estimators,
            planner,
            program: PROGRAM,
            logs: self.store_logs,
            shard,
        };
        Ok(Some(Job { store: create(path)?, campaign }))
    }
}

impl Job<'_> {
    /// Returns the number of runs flown here, of all `runs`.
    pub fn part_of(&self, runs: u32) -> u32 {
        let part = self.campaign.shard.of(runs);
        part.end - part.start
    }

    pub fn fly(&self, repetition: &Repetition<'_>) -> Result<CampaignReport, StoreError> {
        self.campaign.fly(&self.store, repetition)
    }
}

fn create(path: &Path) -> Result<Store, CliError> {
    Store::create(path).map_err(reading)
}

/// Returns the error of a store that went wrong; `scenario` was flown.
pub fn error(error: StoreError, scenario: &str) -> CliError {
    match error {
        StoreError::Simulation(error) => choice::simulation_error(error, scenario),
        StoreError::Threads(_) | StoreError::Io { .. } | StoreError::Sql { .. } => {
            CliError::failure(error)
        }
        _ => CliError::input(error),
    }
}

/// Error of a store that cannot be read.
pub fn reading(error: StoreError) -> CliError {
    self::error(error, "")
}

/// Variables by which launchers of many processes number them: a process's number, the number of
/// processes, and the number of the first one. An array of SLURM may begin anywhere.
const LAUNCHERS: [(&str, &str, Option<&str>); 4] = [
    ("SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", Some("SLURM_ARRAY_TASK_MIN")),
    ("JOB_COMPLETION_INDEX", "JOB_COMPLETIONS", None),
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", None),
    ("PMI_RANK", "PMI_SIZE", None),
];

/// The shard that the first launcher whose variables are set gives this process.
fn of_environment(variable: impl Fn(&str) -> Option<String>) -> Result<Shard, CliError> {
    for (number, count, first) in LAUNCHERS {
        let Some(given) = variable(number) else { continue };
        let whole = |name: &str, text: &str| {
            text.trim().parse::<u32>().map_err(|_| {
                CliError::input(format!("--shard auto: {name} is {text:?}, not a whole number"))
            })
        };
        let missing = || {
            CliError::input(format!(
                "--shard auto: {number} is set and {count} is not; set it to the number of shards"
            ))
        };
        let text = variable(count).ok_or_else(missing)?;
        let index = whole(number, &given)?;
        let count = whole(count, &text)?;
        let first = match first.and_then(|name| Some((name, variable(name)?))) {
            Some((name, text)) => whole(name, &text)?,
            None => 0,
        };
        let place = index.checked_sub(first).and_then(|place| place.checked_add(1));
        let shard = Shard::new(place.unwrap_or(0), count);
        return shard.map_err(|error| CliError::input(format!("--shard auto: {number}: {error}")));
    }
    let names = LAUNCHERS.map(|(number, ..)| number).join(", ");
    Err(CliError::input(format!("--shard auto: none of {names} is set")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(variables: &[(&str, &str)]) -> Result<String, String> {
        let variable = |name: &str| {
            variables.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned())
        };
        of_environment(variable).map(|shard| shard.to_string()).map_err(|error| error.to_string())
    }

    #[test]
    fn launchers_give_their_shard() {
        let slurm = |id: &'static str, min: &'static str| {
            let mut all = vec![("SLURM_ARRAY_TASK_ID", id), ("SLURM_ARRAY_TASK_COUNT", "4")];
            all.extend(Some(("SLURM_ARRAY_TASK_MIN", min)).filter(|(_, min)| !min.is_empty()));
            with(&all)
        };
        assert_eq!(slurm("3", "1").as_deref(), Ok("3/4"));
        assert_eq!(slurm("0", "0").as_deref(), Ok("1/4"));
        assert_eq!(slurm("13", "10").as_deref(), Ok("4/4"));
        assert_eq!(slurm("0", "").as_deref(), Ok("1/4"));
        for (number, count) in [
            ("JOB_COMPLETION_INDEX", "JOB_COMPLETIONS"),
            ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
            ("PMI_RANK", "PMI_SIZE"),
        ] {
            assert_eq!(with(&[(number, "2"), (count, "3")]).as_deref(), Ok("3/3"));
            let error = with(&[(number, "2")]).expect_err("of how many?");
            assert!(error.contains(count), "{error}");
            assert!(with(&[(number, "3"), (count, "3")]).is_err());
            let error = with(&[(number, "two"), (count, "3")]).expect_err("no number");
            assert!(error.contains("\"two\""), "{error}");
        }
        assert!(slurm("1", "2").is_err());
        let error = with(&[]).expect_err("no launcher");
        assert!(error.contains("SLURM_ARRAY_TASK_ID") && error.contains("PMI_RANK"), "{error}");
    }
}
