use std::{collections::BTreeSet, path::PathBuf};

use foxhunt::{
    core::{Ellipse, Outcome, Remark},
    filters::consistency::Verdict,
    hunt::{LearnedReceiver, PlaceEstimate},
    log::{Log, LogError},
    overview::{Believed, Overview, SearchOverview},
    page::PageLog,
    registry::EstimatorEntry,
    replay::{Replay, ReplayedFix},
    report::{HuntedTransmitter, Place},
    struck::{Struck, StruckError},
};
use serde::Serialize;

use super::{choice, fixes, views::Views};
use crate::{
    error::{CliError, InFile},
    output::{Context, warn},
    table::{Table, number, table, text},
};

/// Run a log through an estimator again
///
/// Runs every reception of a log through the estimator that the log was made with, and checks
/// whether each estimate is the same to the bit; or through another estimator, and compares the two
/// on the same flight.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt replay out/hunt.jsonl\n  \
                        foxhunt replay out/hunt.jsonl --estimator particle --report cloud.html\n  \
                        foxhunt replay out/hunt.jsonl --estimator imm --smooth\n  \
                        foxhunt replay out/hunt.jsonl --ignore struck.jsonl --report without.html\n  \
                        foxhunt replay out/hunt.jsonl --export hunt.kml --origin 50.08,14.44")]
pub struct Args {
    /// A log, such as `foxhunt hunt` writes it
    log: PathBuf,
    /// Another estimator than the log's own
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// Smooth each beacon's track: its place at the time of each reception, from all receptions
    /// before and after
    #[arg(long)]
    smooth: bool,
    /// A list of receptions to leave out: saved by a page, or your own JSON lines (docs/report.md)
    #[arg(long, value_name = "FILE")]
    ignore: Option<PathBuf>,
    #[command(flatten)]
    views: Views,
}

/// A replay in JSON.
#[derive(Debug, Serialize)]
struct Report {
    scenario: String,
    /// The seed of the hunt that was logged.
    seed: u64,
    /// Estimator that the log was made with.
    logged_estimator: String,
    /// Estimator of the replay.
    estimator: String,
    /// True if the two are the same and nothing is left out: every estimate must then be the same.
    own: bool,
    /// Number of receptions left out.
    ignored: usize,
    /// Number of estimates in the log.
    compared: usize,
    /// Number of them that came out the same to the bit.
    identical: usize,
    beacons: Vec<Replayed>,
}

/// One beacon of a replay.
#[derive(Debug, Serialize)]
struct Replayed {
    name: String,
    truth: Option<Place>,
    estimate: PlaceEstimate,
    ellipse_95: Option<Ellipse>,
    error_m: Option<f64>,
    nees: Option<f64>,
    steps: u32,
    rejected: u32,
    anis: Option<f64>,
    /// Interval that holds a consistent estimator's ANIS with 95 %.
    anis_interval: Option<[f64; 2]>,
    /// Verdict on the size of the innovations against the estimator's claim.
    innovations: Verdict,
    /// The probability of innovations as correlated as these if they are white (Ljung & Box 1978).
    whiteness_p: Option<f64>,
    /// Number of times that the innovations became larger than the estimator can explain.
    diverged: u32,
    /// Doubts about the place, each with what to do about it.
    remarks: Vec<Remark>,
    /// Errors that were learned of each receiver; absent for an estimator that takes all for alike.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    receivers: Vec<Learned>,
    /// The transmitters on its frequency, the most probable first; absent for an estimator of one.
    #[serde(skip_serializing_if = "Option::is_none")]
    transmitters: Option<Vec<HuntedTransmitter>>,
    outcome: Option<Outcome>,
    logged_estimate: Option<PlaceEstimate>,
    logged_error_m: Option<f64>,
    /// The smoothed track; absent without `--smooth`.
    #[serde(skip_serializing_if = "Option::is_none")]
    smoothed: Option<SmoothedTrack>,
}

/// Errors that were learned of a receiver: each offset with its σ, that of bearings
/// counter-clockwise.
#[derive(Debug, Serialize)]
struct Learned {
    /// Number of the receiver, from 1.
    drone: usize,
    level_offset_db: [f64; 2],
    level_from_others_db: Option<[f64; 2]>,
    bearing_offset_deg: [f64; 2],
    /// Factors by which its levels and its bearings scatter more than they state.
    scatter: [f64; 2],
    receptions: u32,
}

impl From<&(usize, LearnedReceiver)> for Learned {
    fn from((drone, learned): &(usize, LearnedReceiver)) -> Self {
        Self {
            drone: drone + 1,
            level_offset_db: learned.level_offset_db,
            level_from_others_db: learned.level_from_others_db,
            bearing_offset_deg: learned.bearing_offset.map(f64::to_degrees),
            scatter: learned.scatter,
            receptions: learned.receptions,
        }
    }
}

/// The track of a beacon given all receptions, with its errors and the errors of the estimates that
/// knew the earlier ones alone.
#[derive(Debug, Serialize)]
struct SmoothedTrack {
    places: Vec<SmoothedPlace>,
    /// Root mean square of the errors of `places`; absent where the truth is not known.
    rms_error_m: Option<f64>,
    /// Root mean square of the errors of the estimates at the same times.
    filtered_rms_error_m: Option<f64>,
    /// Average NEES of `places`, 2 for a consistent smoother.
    anees: Option<f64>,
    /// Average NEES of the estimates at the same times.
    filtered_anees: Option<f64>,
}

/// A place of a smoothed track.
#[derive(Debug, Serialize)]
struct SmoothedPlace {
    time_s: f64,
    estimate: PlaceEstimate,
    ellipse_95: Option<Ellipse>,
    error_m: Option<f64>,
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    args.views.check(false)?;
    let log = Log::read(&args.log).map_err(|error: LogError| CliError::input(error))?;
    if log.torn {
        warn(&format!("{}: the last line is cut short and left out", args.log.display()));
    }
    args.views.check_known(log.header.origin.is_some(), log.header.epoch_unix_s.is_some())?;
    let other = match &args.estimator {
        Some(name) => Some(choice::estimator(registry, name, "--estimator")?),
        None => None,
    };
    let struck = match &args.ignore {
        Some(file) => {
            Struck::read(file, &log).map_err(|error: StruckError| CliError::input(error))?
        }
        None => Struck::default(),
    };
    let replayed = match args.smooth {
        true => Overview::of_log_smoothed(&log, registry, other, &struck),
        false => Overview::of_log(&log, registry, other, &struck, Vec::new(), None),
    };
    let (overview, replayed) = replayed.map_err(|error| {
        let file = args.log.display().to_string();
        CliError::input(InFile { file, source: Box::new(error) })
    })?;
    let mut report = Report::new(&log, &replayed, other, struck.len());
    if args.smooth {
        let tracks = report.beacons.iter_mut().zip(&replayed.fixes).zip(&overview.searches);
        for ((beacon, fix), search) in tracks {
            beacon.smoothed = Some(SmoothedTrack::new(&log, fix, search));
        }
    }
    output.result(&report, tables)?;
    let page_log = PageLog::new(&log.header, other, &log.events);
    args.views.write(&overview, Some(&page_log), output)?;
    if report.own && report.identical < report.compared {
        let different = report.compared - report.identical;
        let message = format!("{different} of {} estimates differ from the log's", report.compared);
        return Err(CliError::failure(message));
    }
    Ok(())
}

impl Report {
    fn new(log: &Log, replayed: &Replay, other: Option<&EstimatorEntry>, ignored: usize) -> Self {
        let header = &log.header;
        let own = |entry: &EstimatorEntry| match (entry.settings(), &header.estimator) {
            (Some(settings), Some(logged)) => settings == logged,
            (None, None) => entry.name == header.estimator_name,
            _ => false,
        };
        Self {
            scenario: header.scenario.clone(),
            seed: header.seed,
            logged_estimator: header.estimator_name.clone(),
            estimator: other.map_or(header.estimator_name.clone(), |entry| entry.name.to_string()),
            own: ignored == 0 && other.is_none_or(own),
            ignored,
            compared: replayed.compared,
            identical: replayed.compared.saturating_sub(replayed.different),
            beacons: replayed.fixes.iter().map(|fix| Replayed::new(log, fix)).collect(),
        }
    }
}

impl Replayed {
    fn new(log: &Log, fix: &ReplayedFix) -> Self {
        let beacon = log.header.beacons.get(usize::from(fix.beacon.0));
        let truth = beacon.and_then(|beacon| beacon.nearest_at(fix.time, &fix.estimate.mean));
        let logged = fix.logged.as_ref();
        Self {
            name: fix.name.clone(),
            truth: truth.map(Place::from),
            estimate: (&fix.estimate).into(),
            ellipse_95: fix.estimate.ellipse(0.95),
            error_m: truth.map(|truth| (fix.estimate.mean - truth).norm()),
            nees: truth.and_then(|truth| fix.estimate.nees(&truth)),
            steps: fix.steps,
            rejected: fix.rejected,
            anis: fix.nis.average(),
            anis_interval: fix.nis.interval(),
            innovations: fix.nis.verdict(),
            whiteness_p: fix.whiteness.ljung_box().map(|test| test.p_value),
            diverged: fix.diverged,
            remarks: fix.remarks.clone(),
            receivers: fix.receivers.iter().map(Learned::from).collect(),
            transmitters: (fix.transmitters.as_ref())
                .map(|found| found.iter().map(HuntedTransmitter::from).collect()),
            outcome: logged.map(|logged| logged.outcome),
            logged_estimate: logged.map(|logged| (&logged.estimate).into()),
            smoothed: None,
            logged_error_m: logged.and_then(|logged| Some((logged.estimate.mean - truth?).norm())),
        }
    }
}

impl SmoothedTrack {
    fn new(log: &Log, fix: &ReplayedFix, search: &SearchOverview) -> Self {
        let beacon = log.header.beacons.get(usize::from(fix.beacon.0));
        let truth = |time: f64| beacon.and_then(|beacon| beacon.place_at(time));
        // Errors are compared at times that both have: a reception that changes nothing is
        // smoothed, too, and the first belief is of no reception.
        let filtered = search.beliefs.get(1..).unwrap_or_default();
        let judged = |beliefs: &[Believed], others: &[Believed]| {
            let mut squares = 0.0;
            let mut nees = 0.0;
            let mut count = 0.0;
            let times: BTreeSet<u64> = others.iter().map(|other| other.time.to_bits()).collect();
            for belief in beliefs.iter().filter(|own| times.contains(&own.time.to_bits())) {
                let truth = truth(belief.time)?;
                squares += (belief.estimate.mean - truth).norm_squared();
                nees += belief.estimate.nees(&truth)?;
                count += 1.0;
            }
            (count > 0.0).then(|| ((squares / count).sqrt(), nees / count))
        };
        let smoothed = judged(&search.smoothed, filtered);
        let filtered = judged(filtered, &search.smoothed);
        let place = |believed: &Believed| SmoothedPlace {
            time_s: believed.time,
            estimate: (&believed.estimate).into(),
            ellipse_95: believed.ellipse_95,
            error_m: believed.error_m,
        };
        Self {
            places: search.smoothed.iter().map(place).collect(),
            rms_error_m: smoothed.map(|(rms, _)| rms),
            filtered_rms_error_m: filtered.map(|(rms, _)| rms),
            anees: smoothed.map(|(_, nees)| nees),
            filtered_anees: filtered.map(|(_, nees)| nees),
        }
    }
}

/// Errors of the smoothed tracks and of the estimates; empty without `--smooth`.
fn smoothed_tracks(report: &Report) -> String {
    if report.beacons.iter().all(|beacon| beacon.smoothed.is_none()) {
        return String::new();
    }
    let mut tracks = table(&[
        "beacon",
        "places",
        "filtered rms m",
        "smoothed rms m",
        "filtered ANEES",
        "smoothed ANEES",
    ]);
    for beacon in &report.beacons {
        let Some(smoothed) = &beacon.smoothed else { continue };
        tracks.add_row([
            beacon.name.clone(),
            smoothed.places.len().to_string(),
            number(smoothed.filtered_rms_error_m, 2),
            number(smoothed.rms_error_m, 2),
            number(smoothed.filtered_anees, 2),
            number(smoothed.anees, 2),
        ]);
    }
    format!(
        "\n{tracks}\nThe tracks over the whole flight, by the receptions up to each time and by \
         all of them. A consistent estimator's ANEES is 2; those of one flight are correlated. \
         --json, --report and --export have the places."
    )
}

fn tables(report: &Report) -> String {
    let mut head = format!("{}, seed {}, {}", report.scenario, report.seed, report.estimator);
    match report.ignored {
        0 => {}
        1 => head += ", 1 reception left out",
        many => head += &format!(", {many} receptions left out"),
    }
    let fixes = fixes::fixes(report.beacons.iter().map(row));
    let verdict = if report.own {
        format!("{} of {} estimates are identical", report.identical, report.compared)
    } else {
        comparison(report)
    };
    let doubts: String = (report.beacons.iter())
        .map(|beacon| fixes::doubts(&beacon.remarks, &format!(" of {}", beacon.name)))
        .collect();
    let smoothed = smoothed_tracks(report);
    let transmitters: String = (report.beacons.iter())
        .filter_map(|beacon| {
            let found = beacon.transmitters.as_ref()?;
            Some(format!("\n{}", fixes::transmitters(&beacon.name, found)))
        })
        .collect();
    format!(
        "{head}\n{fixes}{transmitters}\n{}\n{LEGEND}{smoothed}\n{verdict}{doubts}",
        innovations(report)
    )
}

/// Meaning of the columns of [`innovations`].
const LEGEND: &str = "A consistent estimator's ANIS lies in the interval with 95 %, and its \
     innovations are as correlated as these or more with the probability \"white p\". It \
     diverged each time that the innovations of ten receptions became larger than it can \
     explain: by chance, once in 20 000 tests.";

/// The statistics of the innovations.
fn innovations(report: &Report) -> Table {
    let mut innovations =
        table(&["beacon", "rejected", "ANIS", "interval", "verdict", "white p", "diverged"]);
    for beacon in &report.beacons {
        let interval = beacon.anis_interval.map(|[low, high]| format!("{low:.2} to {high:.2}"));
        innovations.add_row([
            beacon.name.clone(),
            beacon.rejected.to_string(),
            number(beacon.anis, 2),
            text(interval),
            beacon.innovations.to_string(),
            number(beacon.whiteness_p, 3),
            beacon.diverged.to_string(),
        ]);
    }
    innovations
}

/// A row of the table of fixes.
fn row(beacon: &Replayed) -> fixes::Row<'_> {
    fixes::Row {
        beacon: &beacon.name,
        estimate: beacon.estimate,
        ellipse_95: beacon.ellipse_95,
        error_m: beacon.error_m,
        nees: beacon.nees,
        steps: beacon.steps,
        outcome: text(beacon.outcome),
    }
}

/// The estimator and the log's own side by side.
fn comparison(report: &Report) -> String {
    let logged = format!("{} error m", report.logged_estimator);
    let mut replayed = format!("{} error m", report.estimator);
    if logged == replayed {
        replayed = "without them".to_owned();
    }
    let mut errors = table(&["beacon", &logged, &replayed]);
    for beacon in &report.beacons {
        errors.add_row([
            beacon.name.clone(),
            number(beacon.logged_error_m, 2),
            number(beacon.error_m, 2),
        ]);
    }
    errors.to_string()
}
