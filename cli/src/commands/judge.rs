use std::path::PathBuf;

use foxhunt::{
    core::Reception,
    recording::Recording,
    registry::{EstimatorEntry, Registry},
};
use serde::Serialize;

use super::{
    choice,
    locating::{Locating, NAMELESS, Prepared, truth},
    recorded::LatLon,
    scores::{Answer, Summary},
};
use crate::{
    context::Context,
    error::CliError,
    progress::Progress,
    table::{number, table},
};

/// Judge estimators on recordings whose transmitter's place is known
///
/// Locates each beacon of each recording by itself and compares the place with the truth: error,
/// NEES, and how often the 95 % ellipse holds it, for an estimator and for baselines beside it. The
/// truth takes part in no fix.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt judge flight.csv --truth 50.0755,14.4378\n  \
                        foxhunt judge bearings.csv --against lenth1981,pseudolinear")]
pub(crate) struct Args {
    /// Recordings: CSV with named columns; each beacon of each is one fix
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Where the transmitter of all recordings is, in degrees (WGS84); the recordings' own truth
    /// unless given
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    truth: Option<LatLon>,
    /// The estimators beside it, by name; for levels `strongest` and `least-absolute`, for bearings
    /// `lenth1981` and `pseudolinear` unless given
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    against: Vec<String>,
    #[command(flatten)]
    locating: Locating,
}

/// What came out, as JSON has it.
#[derive(Debug, Serialize)]
struct Report {
    fixes: Vec<Fix>,
    estimators: Vec<Summary>,
}

/// One beacon of one recording.
#[derive(Debug, Serialize)]
struct Fix {
    file: String,
    beacon: Option<String>,
    receptions: usize,
    /// The estimator that is judged first, then those beside it.
    answers: Vec<Answer>,
}

pub(crate) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    let beside = args.against.iter().map(|name| choice::estimator(registry, name, "--against"));
    let beside = beside.collect::<Result<Vec<_>, _>>()?;
    let prepared = args.locating.prepare(&args.files, None, registry)?;
    let of_each = |recording: &Recording| {
        let is_wanted = |beacon: &Option<&str>| wanted(args, *beacon);
        recording.beacons().into_iter().filter(is_wanted).count()
    };
    let total: usize = prepared.recordings().iter().map(of_each).sum();
    let total = u64::try_from(total).unwrap_or(u64::MAX);
    let progress = Progress::new(output, "fixes", total, true);
    let mut fixes = Vec::new();
    for (number, recording) in prepared.recordings().iter().enumerate() {
        for beacon in recording.beacons() {
            if !wanted(args, beacon) {
                continue;
            }
            fixes.push(judge(args, &prepared, registry, &beside, (number, recording), beacon)?);
            progress.step();
        }
    }
    progress.finish();
    let answers = || fixes.iter().map(|fix| &fix.answers[..]);
    let report = Report { estimators: Summary::of_each(answers)?, fixes };
    output.result(&report, text)
}

/// Whether a beacon is judged.
fn wanted(args: &Args, beacon: Option<&str>) -> bool {
    args.locating.wanted().is_none_or(|wanted| Some(wanted) == beacon)
}

/// One fix by every estimator.
fn judge(
    args: &Args,
    prepared: &Prepared,
    registry: &Registry,
    beside: &[&EstimatorEntry],
    (number, recording): (usize, &Recording),
    beacon: Option<&str>,
) -> Result<Fix, CliError> {
    let file = recording.file();
    let name = beacon.unwrap_or(NAMELESS);
    let known = truth(args.truth, std::slice::from_ref(recording), beacon)?.ok_or_else(|| {
        CliError::input(format!(
            "{file}: the beacon {name} has no truth, or one that moves; see --truth"
        ))
    })?;
    let received = prepared.receptions_of(number, beacon)?;
    let own = args.locating.estimator(registry, &received)?;
    let usual;
    let beside = if beside.is_empty() {
        usual = baselines(registry, &received);
        usual.as_slice()
    } else {
        beside
    };
    let answer = |estimator: &&EstimatorEntry| match estimator.locate(&received, prepared.config())
    {
        Ok(located) => Answer::new(&estimator.name, &located, Some(&known)),
        Err(error) => Answer::failed(&estimator.name, error.to_string()),
    };
    Ok(Fix {
        file: file.to_owned(),
        beacon: beacon.map(str::to_owned),
        receptions: received.len(),
        answers: std::iter::once(&own).chain(beside).map(answer).collect(),
    })
}

/// The estimators that people use where they have nothing else.
fn baselines<'a>(registry: &'a Registry, received: &[Reception]) -> Vec<&'a EstimatorEntry> {
    let names = if received.iter().any(Reception::has_bearing) {
        ["lenth1981", "pseudolinear"]
    } else {
        ["strongest", "least-absolute"]
    };
    // A registry of one's own need not have them.
    names.iter().filter_map(|name| registry.estimator(name).ok()).collect()
}

fn text(report: &Report) -> String {
    let mut fixes =
        table(&["recording", "beacon", "estimator", "receptions", "error m", "NEES", "in 95 %"])
            .named_by(3);
    for fix in &report.fixes {
        for answer in &fix.answers {
            let inside = match (&answer.failure, answer.inside_95) {
                (Some(_), _) => "no place",
                (None, Some(true)) => "yes",
                (None, Some(false)) => "no",
                (None, None) => "-",
            };
            fixes.add_row([
                fix.file.rsplit('/').next().unwrap_or_default().to_owned(),
                fix.beacon.clone().unwrap_or_else(|| "-".to_owned()),
                answer.estimator.clone(),
                fix.receptions.to_string(),
                number(answer.error_m, 1),
                number(answer.nees, 2),
                inside.to_owned(),
            ]);
        }
    }
    let mut all = table(&[
        "estimator",
        "fixes",
        "no place",
        "median m",
        "mean m",
        "mean NEES",
        "log score",
        "in 95 %",
        "share (95 %)",
        "first nearer",
    ]);
    for of in &report.estimators {
        let share = of.coverage_interval.map(|[low, high]| format!("{low:.2} … {high:.2}"));
        all.add_row([
            of.estimator.clone(),
            of.fixes.to_string(),
            of.failed.to_string(),
            number(of.median_error_m, 1),
            number(of.mean_error_m, 1),
            number(of.mean_nees, 2),
            number(of.mean_log_score, 1),
            of.inside_95.to_string(),
            share.unwrap_or_else(|| "-".to_owned()),
            of.first_is_nearer.map_or_else(|| "-".to_owned(), |count| count.to_string()),
        ]);
    }
    format!(
        "{fixes}\n\n{all}\nA consistent estimator in the plane has a mean NEES of 2; `share` is \
         where the share of its 95 % ellipses that hold the truth lies; `log score` is the mean of \
         -ln of its density at the truth, in 1/m². `first nearer` counts the \
         fixes in which the first estimator has the smaller error."
    )
}
