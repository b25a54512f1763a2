use std::borrow::Cow;

use foxhunt::{
    bearing_trial::bearing_cases,
    config::SourceConfig,
    core::Quantity,
    registry::{EstimatorEntry, Need, RECOMMENDED_EXTRACTOR, Registry},
    scenario::{DEFAULT_SCENARIO, Key, KeyTable, builtin_scenarios, scenario_keys},
    trial::builtin_trials,
};
use serde::Serialize;

use crate::{
    error::CliError,
    output::{Context, Output},
    table::list,
};

/// List estimators, extractors, planners, sources, scenarios, trials, cases or keys
///
/// Lists each entry with its name, a description and its source. `foxhunt list estimators` has the
/// estimators to choose from, each with when to use it; with `--all` every estimator, with the
/// quantities that it uses.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt list scenarios\n  foxhunt list estimators\n  \
                        foxhunt list estimators --all\n  foxhunt list estimators --json")]
pub struct Args {
    /// The kind of entries
    #[arg(value_enum)]
    what: What,
    /// List every estimator, variants and baselines too; --json always does
    #[arg(long)]
    all: bool,
}

/// Kind of listed entries.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum What {
    /// Simulated hunts that need no file: for `hunt` and `campaign`
    Scenarios,
    /// Drawn bearings on a target of known course: for `compare estimators`
    Trials,
    /// Estimators, for `--estimator`
    Estimators,
    /// Extractors of level and bearing from a turn, for `--extractor`
    Extractors,
    /// Planners of the next places to listen at, for `--planner`
    Planners,
    /// Sources that the drones listen with, for `--source`
    Sources,
    /// Simulated turns of an antenna: for `compare extractors`
    Cases,
    /// Keys of a scenario's file, with unit, default and meaning
    Keys,
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    if args.all && !matches!(args.what, What::Estimators) {
        return Err(CliError::input(
            "--all is for `foxhunt list estimators`; other lists are whole",
        ));
    }
    match args.what {
        What::Scenarios => scenarios(output),
        What::Trials => trials(output),
        What::Estimators => estimators(registry, args.all, output),
        What::Extractors => extractors(registry, output),
        What::Planners => planners(registry, output),
        What::Sources => sources(registry, output),
        What::Cases => cases(output),
        What::Keys => keys(output),
    }
}

/// A scenario in JSON.
#[derive(Debug, Serialize)]
struct ListedScenario {
    name: String,
    description: String,
    estimator: String,
    drones: usize,
    beacons: usize,
    default: bool,
}

fn scenarios(output: Output) -> Result<(), CliError> {
    let listed = builtin_scenarios().into_iter().map(|scenario| ListedScenario {
        default: scenario.name == DEFAULT_SCENARIO,
        drones: scenario.world.drones.len(),
        beacons: scenario.world.beacons.len(),
        name: scenario.name,
        description: scenario.description,
        estimator: scenario.estimator,
    });
    output.result(&listed.collect::<Vec<_>>(), |listed| {
        let columns = ["scenario", "drones", "beacons", "estimator", "what it is"];
        let mut rows = list(&columns);
        for scenario in listed {
            let mark = if scenario.default { " (default)" } else { "" };
            rows.add_row([
                format!("{}{mark}", scenario.name),
                scenario.drones.to_string(),
                scenario.beacons.to_string(),
                scenario.estimator.clone(),
                scenario.description.clone(),
            ]);
        }
        format!("{rows}\nfleet-1, fleet-2 and so on are scenarios with random fleets.")
    })
}

/// A trial in JSON.
#[derive(Debug, Serialize)]
struct ListedTrial {
    name: String,
    description: String,
    estimator: String,
}

fn trials(output: Output) -> Result<(), CliError> {
    let listed = builtin_trials().into_iter().map(|trial| ListedTrial {
        name: trial.name,
        description: trial.description,
        estimator: trial.estimator,
    });
    output.result(&listed.collect::<Vec<_>>(), |listed| {
        let mut rows = list(&["trial", "estimator", "what it is"]);
        for trial in listed {
            rows.add_row([&trial.name, &trial.estimator, &trial.description]);
        }
        rows.to_string()
    })
}

/// An estimator in JSON.
#[derive(Debug, Serialize)]
struct ListedEstimator {
    name: String,
    about: String,
    source: String,
    /// True if it is listed without `--all`.
    in_menu: bool,
    /// Cases to use it for; absent outside of the menu.
    when: Option<String>,
    /// Use of levels: required, used or unused.
    level: String,
    bearing: String,
    /// Quantities besides level and bearing, all of them required.
    others: Vec<String>,
    /// True if it follows a beacon that moves.
    moving: bool,
    /// True if it takes all receptions at once, in `locate` alone.
    all_at_once: bool,
}

impl From<&EstimatorEntry> for ListedEstimator {
    fn from(entry: &EstimatorEntry) -> Self {
        let needs = entry.needs();
        Self {
            name: entry.name.to_string(),
            about: entry.about.to_string(),
            source: entry.source.to_string(),
            in_menu: entry.when().is_some(),
            when: entry.when().map(str::to_owned),
            level: needs.level.to_string(),
            bearing: needs.bearing.to_string(),
            others: needs.others.iter().map(Quantity::to_string).collect(),
            moving: needs.moving,
            all_at_once: needs.all_at_once,
        }
    }
}

fn estimators(registry: &Registry, all: bool, output: Output) -> Result<(), CliError> {
    let listed: Vec<_> = registry.estimators().iter().map(ListedEstimator::from).collect();
    output.result(&listed, |listed| {
        if !all {
            return menu(registry);
        }
        let columns =
            ["estimator", "what it is", "level", "bearing", "others", "moving", "takes", "source"];
        let mut rows = list(&columns);
        let unused = Need::Unused.to_string();
        let need = |need: &str| if need == unused { "-".to_owned() } else { need.to_owned() };
        for entry in listed {
            let others = entry.others.join(", ");
            rows.add_row([
                entry.name.clone(),
                entry.about.clone(),
                need(&entry.level),
                need(&entry.bearing),
                if others.is_empty() { "-".to_owned() } else { others },
                if entry.moving { "yes" } else { "-" }.to_owned(),
                if entry.all_at_once { "all at once" } else { "a stream" }.to_owned(),
                entry.source.clone(),
            ]);
        }
        format!("{rows}\n{ESTIMATORS_LEGEND}")
    })
}

/// The estimators to choose from.
fn menu(registry: &Registry) -> String {
    let mut rows = list(&["estimator", "when to use it"]);
    for entry in registry.menu() {
        rows.add_row([&*entry.name, entry.when().unwrap_or_default()]);
    }
    format!("{rows}\n{MENU_LEGEND}")
}

/// Way to the estimators that are not in the menu.
const MENU_LEGEND: &str = "`foxhunt list estimators --all` has every estimator, with the \
                           quantities that it uses and its source.";

/// Meaning of the estimators' columns.
const ESTIMATORS_LEGEND: &str = "Level, bearing and others: what an estimator requires of a \
     reception, or uses where there is one. Moving: whether it follows a beacon that moves. One \
     that takes all receptions at once is for `foxhunt locate`.";

/// A named entry in JSON.
#[derive(Debug, Serialize)]
struct Listed {
    name: String,
    about: String,
    source: String,
}

/// An extractor in JSON.
#[derive(Debug, Serialize)]
struct ListedExtractor {
    #[serde(flatten)]
    listed: Listed,
    /// True if it takes the antenna's pattern.
    needs_antenna: bool,
    recommended: bool,
}

fn extractors(registry: &Registry, output: Output) -> Result<(), CliError> {
    let listed = registry.extractors().iter().map(|entry| ListedExtractor {
        needs_antenna: entry.config().with_antenna(&Default::default()).is_some(),
        recommended: entry.name == RECOMMENDED_EXTRACTOR,
        listed: Listed {
            name: entry.name.to_string(),
            about: entry.about.to_string(),
            source: entry.source.to_string(),
        },
    });
    output.result(&listed.collect::<Vec<_>>(), |listed| {
        let rows = table("extractor", listed.iter().map(|extractor| &extractor.listed));
        format!("{rows}\nWhere the antenna is known, {RECOMMENDED_EXTRACTOR} is the best.")
    })
}

fn planners(registry: &Registry, output: Output) -> Result<(), CliError> {
    let listed = registry.planners().iter().map(|entry| Listed {
        name: entry.name.to_string(),
        about: entry.about.to_string(),
        source: entry.source.to_string(),
    });
    output.result(&listed.collect::<Vec<_>>(), |listed| table("planner", listed))
}

/// A table of names, descriptions and sources.
fn table<'a>(what: &str, listed: impl IntoIterator<Item = &'a Listed>) -> String {
    let mut rows = list(&[what, "what it is", "source"]);
    for Listed { name, about, source } in listed {
        rows.add_row([name, about, source]);
    }
    rows.to_string()
}

/// A source in JSON.
#[derive(Debug, Serialize)]
struct ListedSource {
    name: Cow<'static, str>,
    about: Cow<'static, str>,
    /// Quantities that it measures besides level and bearing.
    quantities: Vec<String>,
    /// True if files name it with `kind = "registered"`, not with a kind of its own.
    registered: bool,
}

fn sources(registry: &Registry, output: Output) -> Result<(), CliError> {
    let kinds = SourceConfig::KINDS.into_iter().map(|(name, about)| ListedSource {
        name: name.into(),
        about: about.into(),
        quantities: Vec::new(),
        registered: false,
    });
    let registered = registry.sources().iter().map(|entry| ListedSource {
        name: entry.name.clone(),
        about: entry.about.clone(),
        quantities: entry.quantities.iter().map(Quantity::to_string).collect(),
        registered: true,
    });
    output.result(&kinds.chain(registered).collect::<Vec<_>>(), |listed| {
        let mut rows = list(&["source", "what it is", "measures besides"]);
        for source in listed {
            let quantities = source.quantities.join(", ");
            let quantities = if quantities.is_empty() { "-" } else { quantities.as_str() };
            rows.add_row([source.name.as_ref(), source.about.as_ref(), quantities]);
        }
        format!("{rows}\nA scenario's file has one as `source = {{ kind = \"stepper\" }}`.")
    })
}

/// A case in JSON.
#[derive(Debug, Serialize)]
struct ListedCase {
    name: &'static str,
    about: &'static str,
}

fn cases(output: Output) -> Result<(), CliError> {
    let listed = bearing_cases().map(|case| ListedCase { name: case.name, about: case.about });
    output.result(&listed, |listed| {
        let mut rows = list(&["case", "what it is"]);
        for case in listed {
            rows.add_row([case.name, case.about]);
        }
        rows.to_string()
    })
}

/// A table of a scenario's file in JSON.
#[derive(Debug, Serialize)]
struct ListedTable {
    /// Path of the table in the file; behind a space the kind that has the keys.
    name: &'static str,
    about: &'static str,
    keys: Vec<ListedKey>,
}

/// A key in JSON.
#[derive(Debug, Serialize)]
struct ListedKey {
    name: &'static str,
    unit: &'static str,
    default: &'static str,
    meaning: &'static str,
}

fn keys(output: Output) -> Result<(), CliError> {
    let key =
        |&Key { name, unit, default, meaning }: &Key| ListedKey { name, unit, default, meaning };
    let listed = scenario_keys().iter().map(|&KeyTable { table, about, keys }| ListedTable {
        name: table,
        about,
        keys: keys.iter().map(key).collect(),
    });
    output.result(&listed.collect::<Vec<_>>(), |listed| {
        let tables = listed.iter().map(|table| {
            let mut rows = list(&["key", "unit", "default", "meaning"]);
            for key in &table.keys {
                let unit = if key.unit.is_empty() { "-" } else { key.unit };
                rows.add_row([key.name, unit, key.default, key.meaning]);
            }
            format!("[{}] {}\n{rows}", table.name, table.about)
        });
        tables.collect::<Vec<_>>().join("\n\n")
    })
}
