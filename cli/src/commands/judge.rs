use std::{fs, path::PathBuf};

use foxhunt::{
    calibration::{ConformalFactors, ConformalFile, Deviation, LEAST_CONFORMAL_FIXES},
    core::{Receptions, Remark},
    locate::FoundOffset,
    recording::Recording,
    registry::{EstimatorEntry, Registry},
};
use serde::Serialize;

use super::{
    choice,
    locating::{Locating, NAMELESS, Prepared, shared_truth, truth},
    recorded::LatLon,
    scores::{Answer, Summary},
};
use crate::{
    error::CliError,
    output::{Context, check_writable, warn},
    progress::Progress,
    table::{number, table},
};

/// Judge estimators on recordings whose transmitter's place is known
///
/// Locates each beacon of each recording by itself and compares the place with the truth: error,
/// NEES, and the share of 95 % ellipses that hold it, for an estimator and for baselines. The truth
/// takes part in no fix.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt judge flight.csv --truth 50.0755,14.4378\n  \
                        foxhunt judge bearings.csv --against lenth1981,pseudolinear")]
pub struct Args {
    /// Recordings: CSV with named columns; each beacon of each recording is one fix
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The place of the transmitter of all recordings in degrees (WGS84) [default: the recordings'
    /// own truth]
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    truth: Option<LatLon>,
    /// The baselines, by name [default: for levels `strongest` and `least-absolute`, for bearings
    /// `lenth1981` and `pseudolinear`]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    against: Vec<String>,
    /// Write the distances of the truths from the places, in units of the ellipses, for --conformal
    /// of `locate` and `judge`; needs 19 fixes
    #[arg(long, value_name = "FILE", conflicts_with = "conformal")]
    calibrate: Option<PathBuf>,
    #[command(flatten)]
    locating: Locating,
}

/// Result in JSON.
#[derive(Debug, Serialize)]
struct Report {
    files: Vec<Read>,
    fixes: Vec<Fix>,
    estimators: Vec<Summary>,
}

/// A recording.
#[derive(Debug, Serialize)]
struct Read {
    file: String,
    /// Offset between the clocks of levels and path, where it was found and taken off.
    #[serde(skip_serializing_if = "Option::is_none")]
    clock_offset: Option<FoundOffset>,
    /// Doubts about its rows.
    remarks: Vec<Remark>,
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

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    let beside = args.against.iter().map(|name| choice::estimator(registry, name, "--against"));
    let beside = beside.collect::<Result<Vec<_>, _>>()?;
    let conformal = args.locating.conformal()?;
    args.calibrate.iter().try_for_each(|path| check_writable(path))?;
    let prepared = args.locating.prepare(&args.files, None, false, registry)?;
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
            let mut fix = judge(args, &prepared, registry, &beside, (number, recording), beacon)?;
            if let Some(file) = &conformal {
                fix.answers = with_conformal(fix.answers, file)?;
            }
            fixes.push(fix);
            progress.step();
        }
    }
    progress.finish();
    let answers = || fixes.iter().map(|fix| &fix.answers[..]);
    let estimators = Summary::of_each(answers)?;
    if let Some(path) = &args.calibrate {
        let text = calibrated(&fixes)?.to_toml().map_err(CliError::failure)?;
        fs::write(path, text).map_err(|error| CliError::writing(path, error))?;
    }
    let read = |recording: &Recording| {
        let shared = shared_truth(args.truth, of_each(recording));
        let remarks = recording.remarks().iter().cloned().chain(shared).collect();
        let clock_offset = prepared.found_clock();
        Read { file: recording.file().to_owned(), clock_offset, remarks }
    };
    let files = prepared.recordings().iter().map(read).collect();
    let report = Report { files, fixes, estimators };
    output.result(&report, text)
}

/// Judges the regions by the user's recordings; the file must have the first estimator.
fn with_conformal(answers: Vec<Answer>, file: &ConformalFile) -> Result<Vec<Answer>, CliError> {
    if let Some(first) = answers.first() {
        file.of(&first.estimator).map_err(CliError::input)?;
    }
    let judged = |answer: Answer| {
        let factors = file.of(&answer.estimator).ok();
        answer.with_conformal(factors)
    };
    Ok(answers.into_iter().map(judged).collect())
}

/// Returns the factors of each estimator with enough fixes.
fn calibrated(fixes: &[Fix]) -> Result<ConformalFile, CliError> {
    let mut of_each: Vec<(&str, Vec<Deviation>)> = Vec::new();
    for answer in fixes.iter().flat_map(|fix| &fix.answers) {
        let Some(deviation) = answer.deviation else { continue };
        match of_each.iter_mut().find(|(name, _)| *name == answer.estimator) {
            Some((_, deviations)) => deviations.push(deviation),
            None => of_each.push((&answer.estimator, vec![deviation])),
        }
    }
    let mut factors = Vec::new();
    let mut refused = None;
    for (name, deviations) in &of_each {
        match ConformalFactors::new(name, deviations) {
            Ok(own) => factors.push(own),
            Err(error) => {
                warn(&format!("  --calibrate leaves out {name}: {error}"));
                refused = refused.or(Some(error));
            }
        }
    }
    if factors.is_empty() {
        return Err(refused.map_or_else(
            || {
                CliError::input(format!(
                    "--calibrate: no answer has an ellipse; it needs at least \
                     {LEAST_CONFORMAL_FIXES} fixes"
                ))
            },
            CliError::input,
        ));
    }
    Ok(ConformalFile::new(factors))
}

/// Returns true if a beacon is judged.
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
    let received = prepared.received_of(number, beacon)?;
    let own = args.locating.estimator(registry, received.receptions())?;
    let usual;
    let beside = if beside.is_empty() {
        usual = baselines(registry, received.receptions());
        usual.as_slice()
    } else {
        beside
    };
    // Fixes that count twice would make the regions of --calibrate too small.
    let mut each = vec![own];
    for estimator in beside {
        if each.iter().all(|other| other.name != estimator.name) {
            each.push(estimator);
        }
    }
    let answer = |estimator: &&EstimatorEntry| match prepared.locate(estimator, &received) {
        Ok(located) => Answer::new(&estimator.name, &located, Some(&known)),
        Err(error) => Answer::failed(&estimator.name, error.to_string()),
    };
    Ok(Fix {
        file: file.to_owned(),
        beacon: beacon.map(str::to_owned),
        receptions: received.receptions().len(),
        answers: each.iter().map(answer).collect(),
    })
}

/// Returns the default baselines for these receptions.
fn baselines<'a>(registry: &'a Registry, received: &Receptions) -> Vec<&'a EstimatorEntry> {
    let names = if received.iter().any(|r| r.has_bearing()) {
        ["lenth1981", "pseudolinear"]
    } else {
        ["strongest", "least-absolute"]
    };
    // A registry of one's own need not have them.
    names.iter().filter_map(|name| registry.estimator(name).ok()).collect()
}

fn text(report: &Report) -> String {
    let mut fixes = table(&[
        "recording",
        "beacon",
        "estimator",
        "receptions",
        "error m",
        "NEES",
        "in 95 %",
        "remarks",
    ])
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
                codes(&answer.remarks),
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
        "without remarks",
        "their share (95 %)",
        "first nearer",
    ]);
    for of in &report.estimators {
        let [unremarked, of_unremarked] = of.unremarked_95;
        all.add_row([
            of.estimator.clone(),
            of.fixes.to_string(),
            of.failed.to_string(),
            number(of.median_error_m, 1),
            number(of.mean_error_m, 1),
            number(of.mean_nees, 2),
            number(of.mean_log_score, 1),
            of.inside_95.to_string(),
            interval(of.coverage_interval),
            format!("{unremarked} of {of_unremarked}"),
            interval(of.unremarked_interval),
            of.first_is_nearer.map_or_else(|| "-".to_owned(), |count| count.to_string()),
        ]);
    }
    format!(
        "{fixes}\n\n{all}\nA consistent estimator in the plane has a mean NEES of 2; `share` is \
         where the share of its 95 % ellipses that hold the truth lies; `log score` is the mean of \
         -ln of its density at the truth, in 1/m². `without remarks` counts the 95 % regions that \
         hold the truth among the answers without a remark. `first nearer` counts the \
         fixes in which the first estimator has the smaller error.{}",
        conformal(&report.estimators)
    )
}

/// Returns the codes of remarks, each once.
fn codes(remarks: &[Remark]) -> String {
    let mut codes: Vec<&str> = Vec::new();
    for remark in remarks {
        if !codes.contains(&&*remark.code) {
            codes.push(&remark.code);
        }
    }
    if codes.is_empty() { "-".to_owned() } else { codes.join(", ") }
}

fn interval(of: Option<[f64; 2]>) -> String {
    of.map_or_else(|| "-".to_owned(), |[low, high]| format!("{low:.2} … {high:.2}"))
}

/// Returns the table of the regions by the user's recordings; empty without any.
fn conformal(estimators: &[Summary]) -> String {
    let mut regions =
        table(&["estimator", "in ellipse", "share (95 %)", "in circle", "their share (95 %)"]);
    let mut is_empty = true;
    for of in estimators {
        let (Some([ellipses, fixes]), Some([circles, _])) =
            (of.in_conformal_ellipses_95, of.in_conformal_circles_95)
        else {
            continue;
        };
        is_empty = false;
        regions.add_row([
            of.estimator.clone(),
            format!("{ellipses} of {fixes}"),
            interval(of.conformal_ellipse_interval),
            format!("{circles} of {fixes}"),
            interval(of.conformal_circle_interval),
        ]);
    }
    if is_empty {
        return String::new();
    }
    format!("\n\nThe regions of --conformal, for 95 % by your own recordings:\n{regions}")
}
