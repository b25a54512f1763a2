//! Comparisons in flown hunts: of antennas, and of the σ of bearings.

use foxhunt::{
    Spread,
    campaign::{
        AntennaSetup, AntennasReport, BeaconCampaign, CampaignError, Repetition, SigmaSetup,
        SigmasReport, antennas_campaign, sigmas_campaign,
    },
    registry::EstimatorEntry,
    scenario::{DEFAULT_SCENARIO, Scenario},
};

use crate::{
    commands::{
        choice,
        settings::{Planning, Runs, Settings},
    },
    error::CliError,
    output::Context,
    table::{number, table, text},
};

/// A scenario that every setup and estimator flies on the same seeds.
#[derive(Debug, clap::Args)]
struct Flown {
    /// A built-in scenario (`foxhunt list scenarios`) or a TOML file
    #[arg(default_value = DEFAULT_SCENARIO)]
    scenario: String,
    #[command(flatten)]
    runs: Runs,
    /// An estimator; may be repeated [default: the scenario's own]
    #[arg(long, value_name = "NAME")]
    estimator: Vec<String>,
    #[command(flatten)]
    planning: Planning,
    #[command(flatten)]
    settings: Settings,
}

impl Flown {
    /// Flies the scenario with each estimator in a number of `setups`, and shows progress.
    fn campaign<R>(
        &self,
        context: Context<'_>,
        setups: usize,
        fly: impl FnOnce(&Scenario, &[EstimatorEntry], &Repetition<'_>) -> Result<R, CampaignError>,
    ) -> Result<R, CliError> {
        let Context { output, registry, .. } = context;
        let mut scenario = choice::scenario(&self.scenario)?;
        self.settings.apply_to(&mut scenario, registry)?;
        self.planning.apply_to(&mut scenario, registry)?;
        let chosen = choice::estimators_of(registry, &self.estimator, &scenario, &self.scenario)?;
        let settled = chosen.into_iter().map(|entry| self.settings.estimator(entry));
        let estimators: Vec<EstimatorEntry> = settled.collect::<Result<_, _>>()?;
        let contenders = estimators.len() * setups;
        let report = self.runs.with_progress(output, "hunts", contenders, |repetition| {
            fly(&scenario, &estimators, repetition)
        });
        report.map_err(|error| choice::campaign_error(error, &self.scenario))
    }
}

/// Compare antennas in flown hunts
///
/// Flies a scenario with an omnidirectional antenna, with a directional one on a body that turns,
/// and with one on a stepper, and compares the errors run by run.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  foxhunt compare antennas --runs 200 --estimator grid")]
pub struct AntennasArgs {
    #[command(flatten)]
    flown: Flown,
}

pub fn run_antennas(args: &AntennasArgs, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    let setups = AntennaSetup::ALL.len();
    let report = args.flown.campaign(context, setups, |scenario, estimators, repetition| {
        antennas_campaign(registry, scenario, estimators, repetition)
    })?;
    output.result(&report, antenna_tables)
}

fn antenna_tables(report: &AntennasReport) -> String {
    let mut lines =
        vec![format!("{}, {} runs, seeds from {}", report.scenario, report.runs, report.seed)];
    let mut errors = table(&[
        "antenna",
        "estimator",
        "beacon",
        "p50",
        "p90",
        "rms",
        "steps",
        "ANEES",
        "in 95 %",
        "failed",
        "hunt s",
    ])
    .named_by(3);
    for campaign in &report.setups {
        for (estimator, duration) in campaign.estimators.iter().zip(&campaign.duration_s) {
            for beacon in &estimator.beacons {
                let error = |pick: fn(&Spread) -> f64| number(beacon.error_m.as_ref().map(pick), 2);
                errors.add_row([
                    campaign.setup.name().to_owned(),
                    estimator.estimator.clone(),
                    beacon.name.clone(),
                    error(|e| e.p50),
                    error(|e| e.p90),
                    error(|e| e.rms),
                    number(beacon.steps.map(|steps| steps.mean), 1),
                    number(beacon.anees, 2),
                    coverage(beacon),
                    beacon.failed.to_string(),
                    number(duration.map(|d| d.mean), 0),
                ]);
            }
        }
    }
    lines.push(errors.to_string());
    let mut ratios = table(&[
        "estimator",
        "beacon",
        "error with",
        "over that with",
        "ratio",
        "95 %",
        "p",
        "pairs",
    ])
    .named_by(4);
    for comparison in &report.comparisons {
        let paired = comparison.paired.as_ref();
        ratios.add_row([
            comparison.estimator.clone(),
            comparison.beacon.clone(),
            comparison.setup.name().to_owned(),
            comparison.against.name().to_owned(),
            number(paired.map(|p| p.ratio), 2),
            text(
                paired.map(|p| format!("{:.2} to {:.2}", p.ratio_interval[0], p.ratio_interval[1])),
            ),
            text(paired.map(|p| format!("{:.1e}", p.p_value))),
            text(paired.map(|p| p.pairs)),
        ]);
    }
    lines.push(ratios.to_string());
    lines.push(ANTENNA_LEGEND.to_owned());
    lines.join("\n")
}

fn coverage(beacon: &BeaconCampaign) -> String {
    text(beacon.coverage_95.map(|share| format!("{:.1} %", 100.0 * share)))
}

/// Meaning of the columns.
const ANTENNA_LEGEND: &str = "Errors in metres. The ratio is the geometric mean of the two \
     errors' ratios run by run, on the same seeds; where its interval leaves out 1, the antennas \
     differ. p is that of Student's paired t-test on the logarithms.";

/// Compare the σ of bearings in flown hunts
///
/// Flies a scenario with the σ that the extractor reads from each pattern, with that σ scaled to
/// the size of the errors, and with a constant σ, and compares the errors run by run. Prints the
/// correlation of σ with the errors of the bearings as well.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  foxhunt compare sigmas pritzl-7.2 --runs 500 --estimator ukf")]
pub struct SigmasArgs {
    #[command(flatten)]
    flown: Flown,
    /// The constant σ in degrees [default: the root mean square error of the bearings]
    #[arg(long, value_name = "DEG")]
    constant_deg: Option<f64>,
}

pub fn run_sigmas(args: &SigmasArgs, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    if let Some(sigma) = args.constant_deg.filter(|s| !(*s > 0.0 && *s <= 103.0)) {
        let message = format!("--constant-deg is {sigma}; it must be above 0, at most 103");
        return Err(CliError::input(message));
    }
    let setups = SigmaSetup::ALL.len();
    let report = args.flown.campaign(context, setups, |scenario, estimators, repetition| {
        sigmas_campaign(registry, scenario, estimators, args.constant_deg, repetition)
    })?;
    output.result(&report, sigma_tables)
}

fn sigma_tables(report: &SigmasReport) -> String {
    let mut lines =
        vec![format!("{}, {} runs, seeds from {}", report.scenario, report.runs, report.seed)];
    let mut bearings = table(&[
        "bearings of",
        "n",
        "without",
        "rms °",
        "σ °",
        "r",
        "p",
        "r of a hunt",
        "p < 0.05",
        "level dB",
        "rms dB",
        "σ ×",
        "floor °",
    ]);
    for campaign in &report.estimators {
        let Some(found) = &campaign.bearings else { continue };
        let hunts = |r: &Spread| format!("{:.2} ({:.2} to {:.2})", r.p50, r.p10, r.p90);
        bearings.add_row([
            campaign.estimator.clone(),
            found.bearings.to_string(),
            found.without.to_string(),
            number(Some(found.rms_deg), 1),
            number(Some(found.sigma_deg), 1),
            number(found.correlation, 2),
            text(found.correlation_p.map(|p| format!("{p:.1e}"))),
            text(found.hunt_correlation.as_ref().map(hunts)),
            format!("{:.0} %", 100.0 * found.significant_hunts),
            number(Some(found.level_mean_db), 2),
            number(Some(found.level_rms_db), 2),
            number(found.fitted.map(|(scale, _)| scale), 2),
            number(found.fitted.map(|(_, floor)| floor), 1),
        ]);
    }
    lines.push(bearings.to_string());
    let mut errors = table(&[
        "estimator",
        "beacon",
        "σ",
        "p50",
        "p90",
        "rms",
        "ANEES",
        "in 95 %",
        "failed",
        "ratio",
        "95 %",
        "p",
    ])
    .named_by(3);
    for campaign in &report.estimators {
        for setup in &campaign.setups {
            for beacon in &setup.campaign.beacons {
                let error = |pick: fn(&Spread) -> f64| number(beacon.error_m.as_ref().map(pick), 2);
                let compared = campaign.comparisons.iter();
                let paired = compared
                    .filter(|c| c.setup == setup.setup && c.beacon == beacon.name)
                    .find_map(|comparison| comparison.paired);
                let interval = paired.map(|p| p.ratio_interval);
                errors.add_row([
                    campaign.estimator.clone(),
                    beacon.name.clone(),
                    setup.setup.name().to_owned(),
                    error(|e| e.p50),
                    error(|e| e.p90),
                    error(|e| e.rms),
                    number(beacon.anees, 2),
                    text(beacon.coverage_95.map(|share| format!("{:.1} %", 100.0 * share))),
                    beacon.failed.to_string(),
                    number(paired.map(|p| p.ratio), 3),
                    text(interval.map(|[low, high]| format!("{low:.2} to {high:.2}"))),
                    text(paired.map(|p| format!("{:.1e}", p.p_value))),
                ]);
            }
        }
    }
    lines.push(errors.to_string());
    lines.push(SIGMA_LEGEND.to_owned());
    lines.join("\n")
}

/// Meaning of the columns.
const SIGMA_LEGEND: &str = "Errors in metres. r is the correlation of σ with |error|, p its \
     Student's test; level and rms dB are those of levels minus the model's law; σ × and floor \
     fit σ to the errors. The ratio is the geometric mean of the error over that with the \
     constant σ, run by run on the same seeds, with p of Student's paired t-test on the \
     logarithms: below 1 the σ gains.";
