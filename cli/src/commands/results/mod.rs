mod page;

pub use page::titled_distributions;

use std::{
    fs::{self, File},
    io::BufWriter,
    ops::Range,
    path::{Path, PathBuf},
    str::FromStr,
};

use foxhunt::{
    picture::distributions_svg,
    store::{self, Filter, SeedBySeed, Store, StoreError, Summary, compare, write_csv},
};
use serde::Serialize;

use self::page::{COMPARED, compared_row};
use super::{campaign::tables, storing::reading};
use crate::{
    error::CliError,
    output::{Output, warn},
    table::table,
};

/// Summarise, compare and export the runs of a store
///
/// Prints the tables of the campaigns that `campaign --store` has kept in a file. Compares two
/// contenders seed by seed, and writes runs as tables for other programs. `results merge` puts the
/// shards of a campaign together.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  foxhunt results runs.sqlite\n  \
                  foxhunt results runs.sqlite --compare ekf ukf --beacon \"beacon 1\"\n  \
                  foxhunt results runs.sqlite --estimator ekf --seeds 1..1000 --csv runs.csv\n  \
                  foxhunt results runs.sqlite --beacon \"beacon 1\" --svg runs.svg\n  \
                  foxhunt results runs.sqlite --report runs.html\n  \
                  foxhunt results merge a.sqlite b.sqlite --to runs.sqlite"
)]
pub struct Args {
    #[command(subcommand)]
    part: Option<Part>,
    /// A file that `campaign --store` wrote
    #[arg(required = true)]
    file: Option<PathBuf>,
    #[command(flatten)]
    selection: Selection,
    /// Only these seeds, the last one included
    #[arg(long, value_name = "A..B")]
    seeds: Option<Seeds>,
    /// Compare two estimators seed by seed instead
    #[arg(long, num_args = 2, value_names = ["NAME", "NAME"])]
    compare: Option<Vec<String>>,
    /// Write the runs as CSV, a row for each run and beacon
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the runs as Parquet
    #[cfg(feature = "parquet")]
    #[arg(long, value_name = "FILE")]
    parquet: Option<PathBuf>,
    /// Draw the distributions of the errors and the NEES of one beacon, as SVG
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Write a page: tables, distributions, and the first estimator compared with the others
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Write the log of the run with this seed; it must be kept (`campaign --store-logs`)
    #[arg(long, value_name = "SEED", requires = "log")]
    log_of: Option<u64>,
    /// The file of the log
    #[arg(long, value_name = "FILE", requires = "log_of")]
    log: Option<PathBuf>,
}

/// Selection of runs of a store.
#[derive(Debug, clap::Args)]
pub struct Selection {
    /// Only this estimator; may be repeated; `NAME@DIGEST` if several have the name
    #[arg(long, value_name = "NAME")]
    estimator: Vec<String>,
    /// Only campaigns with this planner
    #[arg(long, value_name = "NAME")]
    planner: Option<String>,
    /// Only campaigns of this scenario
    #[arg(long, value_name = "NAME")]
    scenario: Option<String>,
    /// Only this beacon
    #[arg(long, value_name = "NAME")]
    beacon: Option<String>,
}

impl Selection {
    /// The runs with these seeds; with any unless given.
    pub fn filter(&self, seeds: Option<Range<u64>>) -> Filter {
        Filter {
            estimators: self.estimator.clone(),
            planner: self.planner.clone(),
            scenario: self.scenario.clone(),
            beacon: self.beacon.clone(),
            seeds,
        }
    }
}

/// Other commands on stores.
#[derive(Debug, clap::Subcommand)]
enum Part {
    Merge(MergeArgs),
}

/// Put the shards of a campaign together
///
/// The new file holds what one process would have written, row by row. Shards of another version,
/// scenario, planner or estimator are refused.
#[derive(Debug, clap::Args)]
struct MergeArgs {
    /// The files of the shards
    #[arg(required = true)]
    shards: Vec<PathBuf>,
    /// The file to make
    #[arg(long, value_name = "FILE")]
    to: PathBuf,
}

/// Seeds from one to another, both included.
#[derive(Clone, Debug)]
struct Seeds(Range<u64>);

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let seeds = || {
            let (first, last) = text.split_once("..")?;
            let (first, last): (u64, u64) = (first.parse().ok()?, last.parse().ok()?);
            Some(first..last.checked_add(1)?).filter(|seeds| !seeds.is_empty())
        };
        let seeds = seeds().ok_or("it must be A..B, two whole numbers with A ≤ B")?;
        Ok(Self(seeds))
    }
}

pub fn run(args: &Args, output: Output) -> Result<(), CliError> {
    let path = match (&args.part, &args.file) {
        (Some(Part::Merge(MergeArgs { shards, to })), _) => {
            store::merge(shards, to).map_err(reading)?;
            let merged = Store::open(to).map_err(reading)?;
            return show(&merged, &Filter::default(), output);
        }
        (None, Some(path)) => path,
        (None, None) => return Err(CliError::input("a file is missing")),
    };
    let store = Store::open(path).map_err(reading)?;
    let filter = args.selection.filter(args.seeds.clone().map(|Seeds(seeds)| seeds));
    let mut written = false;
    if let Some(path) = &args.csv {
        let rows = write_csv(&store, &filter, created(path)?).map_err(reading)?;
        warn(&format!("{rows} rows: {}", path.display()));
        written = true;
    }
    #[cfg(feature = "parquet")]
    if let Some(path) = &args.parquet {
        let rows = store::write_parquet(&store, &filter, created(path)?).map_err(reading)?;
        warn(&format!("{rows} rows: {}", path.display()));
        written = true;
    }
    if let Some(path) = &args.svg {
        let (title, distributions) = titled_distributions(&store, &filter)?;
        let svg = distributions_svg(&title, &distributions).map_err(CliError::failure)?;
        fs::write(path, svg).map_err(|error| CliError::writing(path, error))?;
        warn(&format!("picture: {}", path.display()));
        written = true;
    }
    if let Some(path) = &args.report {
        let page = page::page(&store, &filter, &fitting(&store, &filter)?)?;
        fs::write(path, page).map_err(|error| CliError::writing(path, error))?;
        warn(&format!("page: {}", path.display()));
        written = true;
    }
    if let (Some(seed), Some(path)) = (args.log_of, &args.log) {
        let log = log_of(&store, &filter, seed).map_err(reading)?;
        fs::write(path, log).map_err(|error| CliError::writing(path, error))?;
        warn(&format!("log: {}", path.display()));
        written = true;
    }
    match args.compare.as_deref() {
        Some([first, second]) => {
            let compared = compare(&store, &filter, first, second).map_err(reading)?;
            output.result(&compared, |compared| comparisons(compared))
        }
        _ if written => Ok(()),
        _ => show(&store, &filter, output),
    }
}

fn created(path: &Path) -> Result<BufWriter<File>, CliError> {
    File::create(path).map(BufWriter::new).map_err(|error| CliError::writing(path, error))
}

/// Returns the log of the only contender that the filter lets through.
fn log_of(store: &Store, filter: &Filter, seed: u64) -> Result<Vec<u8>, StoreError> {
    let contender = store.only_contender(filter)?;
    store.log(&contender, seed)
}

/// The result in JSON.
#[derive(Serialize)]
struct Results<'a> {
    campaigns: &'a [Summary],
}

/// Returns the runs that fit a filter; an error if there are no such runs.
fn fitting(store: &Store, filter: &Filter) -> Result<Vec<Summary>, CliError> {
    let summaries = store.summaries(filter).map_err(reading)?;
    if summaries.is_empty() {
        let file = store.path().display();
        return Err(CliError::input(format!("{file}: no runs fit")));
    }
    Ok(summaries)
}

fn show(store: &Store, filter: &Filter, output: Output) -> Result<(), CliError> {
    let summaries = fitting(store, filter)?;
    output.result(&Results { campaigns: &summaries }, |results| {
        let texts: Vec<String> = results.campaigns.iter().map(campaign).collect();
        texts.join("\n\n")
    })
}

/// Returns the tables of a campaign, and its missing runs.
fn campaign(summary: &Summary) -> String {
    let campaign = &summary.campaign;
    let digest = campaign.digest.get(..8).unwrap_or_default();
    let mut lines = vec![
        tables(&summary.report),
        format!(
            "Campaign {digest}: {}, scenario {}, planner {}.",
            campaign.program, campaign.scenario, campaign.planner
        ),
    ];
    for held in summary.held.iter().filter(|held| held.missing > 0) {
        lines.push(format!(
            "{}: {} runs; {} seeds up to the last one have none.",
            held.contender.full_name(),
            held.runs,
            held.missing
        ));
    }
    lines.join("\n")
}

fn comparisons(compared: &[SeedBySeed]) -> String {
    let Some(first) = compared.first() else { return "They have no beacon in common.".to_owned() };
    let mut rows = table(&COMPARED).named_by(2);
    for one in compared {
        rows.add_row(compared_row(one));
    }
    format!(
        "{} minus {}, seed by seed\n{rows}\nMean: of the differences, with Student's t. Ranks: \
         Wilcoxon's test of signed ranks. Ratio: the geometric mean of the first one's figure \
         over the second one's.",
        first.first, first.second
    )
}
