//! Figures of comparisons.

use std::{fs, path::PathBuf};

use foxhunt::picture::{Ratios, ratios_svg};
use serde::Deserialize;

use super::drawing::Drawing;
#[cfg(feature = "store")]
use crate::commands::{results, storing};
use crate::{
    error::{CliError, InFile},
    output::Output,
};

/// A comparison of planners.
#[derive(Debug, clap::Args)]
pub struct Planners {
    /// The output of `foxhunt --json compare planners`
    #[arg(value_name = "JSON")]
    file: PathBuf,
    /// Only this scenario
    #[arg(long, value_name = "NAME")]
    scenario: Option<String>,
    /// Only this beacon
    #[arg(long, value_name = "NAME")]
    beacon: Option<String>,
    #[command(flatten)]
    drawing: Drawing,
}

/// A scenario of the comparison, as far as it is drawn.
#[derive(Debug, Deserialize)]
struct Compared {
    scenario: String,
    comparisons: Vec<Comparison>,
}

#[derive(Debug, Deserialize)]
struct Comparison {
    beacon: String,
    planner: String,
    against: String,
    steps_to_3m: Option<Ratio>,
    time_to_3m_s: Option<Ratio>,
    path_m: Option<Ratio>,
    error_m: Option<Ratio>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
struct Ratio {
    ratio: f64,
    ratio_interval: [f64; 2],
}

/// The figures that planners are compared in.
const FIGURES: [&str; 4] = ["steps to 3 m", "seconds to 3 m", "path", "error"];

pub fn planners(args: &Planners, output: Output) -> Result<(), CliError> {
    args.drawing.check()?;
    let in_file = |source: Box<dyn std::error::Error>| {
        CliError::input(InFile { file: args.file.display().to_string(), source })
    };
    let text = fs::read_to_string(&args.file).map_err(|error| in_file(Box::new(error)))?;
    let compared: Vec<Compared> =
        serde_json::from_str(&text).map_err(|error| in_file(Box::new(error)))?;
    let is = |wanted: &Option<String>, name: &str| wanted.as_ref().is_none_or(|w| w == name);
    let mut rows: Vec<(&str, &Comparison)> = Vec::new();
    for of in compared.iter().filter(|of| is(&args.scenario, &of.scenario)) {
        let comparisons = of.comparisons.iter().filter(|one| is(&args.beacon, &one.beacon));
        rows.extend(comparisons.map(|one| (of.scenario.as_str(), one)));
    }
    let Some((scenario, first)) = rows.first() else {
        return Err(in_file("it holds no such comparison".into()));
    };
    let one_scenario = rows.iter().all(|(name, _)| name == scenario);
    let one_beacon = rows.iter().all(|(_, one)| one.beacon == first.beacon);
    let mut own = format!("over {}", first.against);
    if one_scenario {
        own = format!("{scenario}, {own}");
    }
    let ratios: Vec<Ratios> = rows
        .iter()
        .map(|(scenario, one)| {
            let mut name = one.planner.clone();
            if !one_beacon {
                name = format!("{name}, {}", one.beacon);
            }
            if !one_scenario {
                name = format!("{scenario}: {name}");
            }
            let figures = [one.steps_to_3m, one.time_to_3m_s, one.path_m, one.error_m];
            let ratios = figures.map(|ratio| ratio.map(|r| (r.ratio, r.ratio_interval)));
            Ratios { name, ratios: ratios.to_vec() }
        })
        .collect();
    args.drawing.write(ratios_svg(&args.drawing.title(&own), &FIGURES, &ratios), output)
}

/// The runs of a store.
#[cfg(feature = "store")]
#[derive(Debug, clap::Args)]
pub struct Distributions {
    /// A file that `campaign --store` wrote
    file: PathBuf,
    #[command(flatten)]
    selection: results::Selection,
    #[command(flatten)]
    drawing: Drawing,
}

#[cfg(feature = "store")]
pub fn distributions(args: &Distributions, output: Output) -> Result<(), CliError> {
    use foxhunt::store::Store;

    args.drawing.check()?;
    let store = Store::open(&args.file).map_err(storing::reading)?;
    let filter = args.selection.filter(None);
    let (own, distributions) = results::titled_distributions(&store, &filter)?;
    let title = args.drawing.title(&own);
    args.drawing.write(foxhunt::picture::distributions_svg(&title, &distributions), output)
}
