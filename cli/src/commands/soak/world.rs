//! `soak --recordings`: the classes of drawn recordings, one row each.

use std::{
    cell::Cell,
    collections::BTreeMap,
    env, fs,
    path::{Path, PathBuf},
};

use foxhunt::{
    Runner, Spread,
    drawn::{Bound, Class, DrawnRecording, classes, median_error},
    registry::{EstimatorEntry, Registry},
};
use serde::Serialize;

use super::{
    drawn::{
        Beside, Draws, Failing, Judged, Timed, flags, is_silent_and_wrong, without_numbers, write,
    },
    runs::least,
};
use crate::{
    commands::{
        choice,
        scores::{Answer, Summary},
    },
    error::CliError,
    output::{Output, event},
    progress::Progress,
    table::{number, table},
};

/// Flags of `soak --recordings`.
#[derive(Debug, clap::Args)]
pub struct World {
    /// Draw recordings as people make them, by class, locate with each through a file, and judge
    /// the estimators by the truth: --runs counts the draws of each class
    #[arg(long, conflicts_with = "out")]
    pub recordings: bool,
    /// The classes to draw [default: all but the one of the largest recordings]
    #[arg(long = "class", value_name = "NAME", value_delimiter = ',', requires = "recordings")]
    classes: Vec<String>,
    /// The estimators beside the one that suits a recording: names, or `all` [default: simple
    /// methods and `batch-multistart`]
    #[arg(long, value_name = "NAME|all", value_delimiter = ',', requires = "recordings")]
    against: Vec<String>,
    /// Write the worst draw of each class to this folder, whole and cut down to the rows that still
    /// fail, with the commands that show it
    #[arg(long, value_name = "DIR", requires = "recordings")]
    write: Option<PathBuf>,
    /// The folder of real recordings, some of which are cut and thinned [default: $FOXHUNT_DATA]
    #[arg(long, value_name = "DIR", requires = "recordings")]
    data: Option<PathBuf>,
}

/// Simple methods, for comparison.
const SIMPLE: [&str; 6] = [
    "strongest",
    "weighted-centroid",
    "least-absolute",
    "lenth1981",
    "lenth1981-andrews",
    "pseudolinear",
];

/// Estimator beside these by default.
const USUAL: &str = "batch-multistart";

/// Name that stands for every estimator.
const ALL: &str = "all";

/// All classes in JSON.
#[derive(Debug, Serialize)]
struct Report {
    /// Seed of the first draw of each class.
    seed: u64,
    /// Draws of each class.
    runs: u32,
    classes: Vec<ClassReport>,
    /// Classes not drawn, as the real recordings are missing.
    skipped: Vec<&'static str>,
    worst: Vec<Worst>,
}

/// A class of recordings.
#[derive(Debug, Serialize)]
struct ClassReport {
    class: &'static str,
    about: &'static str,
    /// True if the recordings leave the place open, so that a refusal is right.
    is_open: bool,
    /// The median error that an estimate at the bound of each draw has, where draws have one.
    bound_m: Option<f64>,
    most_memory_mib: Option<f64>,
    /// Criteria that the estimator which suits each draw falls short of.
    lost: Vec<&'static str>,
    /// The estimator that suits each draw, whichever it is.
    default: Row,
    /// Every estimator by name.
    estimators: Vec<Row>,
}

/// An estimator over the draws of a class.
#[derive(Debug, Serialize)]
struct Row {
    is_simple: bool,
    scores: Summary,
    /// Answers without a remark whose NEES is above 30, or where the place is open.
    silent_and_wrong: usize,
    /// Answers with each remark.
    remarks: BTreeMap<String, usize>,
    /// Refusals by their reason, without numbers.
    refusals: BTreeMap<String, usize>,
    /// Time on the processor, that of reading the file included for the default.
    mean_s: Option<f64>,
    most_s: Option<f64>,
}

/// The worst draw of a class.
#[derive(Debug, Serialize)]
struct Worst {
    class: &'static str,
    seed: u64,
    what: String,
    /// The command that draws it again.
    again: String,
    /// The command over the files that were written.
    command: Option<String>,
    /// The command over its remaining rows, their number and the number of all.
    least: Option<(String, [usize; 2])>,
}

pub fn run(
    world: &World,
    (runs, seed, runner): (u64, u64, &Runner),
    registry: &Registry,
    output: Output,
    shows: bool,
) -> Result<(), CliError> {
    let runs = u32::try_from(runs)
        .map_err(|_| CliError::input(format!("--runs: {runs} draws of each class are too many")))?;
    let chosen = chosen(&world.classes)?;
    let beside = world.beside(registry)?;
    let data = world.data.clone().or_else(|| env::var_os("FOXHUNT_DATA").map(PathBuf::from));
    let data = data.as_deref();
    if let Some(missing) = data.filter(|folder| !folder.is_dir()) {
        return Err(CliError::input(format!("--data: {} is not a folder", missing.display())));
    }
    let scratch = Scratch::new()?;
    let (drawn, skipped): (Vec<Class>, Vec<Class>) =
        chosen.into_iter().partition(|class| data.is_some() || !class.is_cut());
    let total = u64::from(runs) * u64::try_from(drawn.len()).unwrap_or(u64::MAX);
    let progress = Progress::new(output, "draws", total, shows);
    let skipped: Vec<&'static str> = skipped.iter().map(|class| class.name).collect();
    if !skipped.is_empty() {
        progress.warn(&format!(
            "{} classes of real recordings are left out, as neither --data nor FOXHUNT_DATA names \
             their folder: {}",
            skipped.len(),
            skipped.join(", ")
        ));
    }
    let mut report = Report { seed, runs, classes: Vec::new(), skipped, worst: Vec::new() };
    for class in drawn {
        progress.note(format!("draws, {}", class.name));
        let beside = beside.clone();
        let draws = Draws { class, data, registry, beside, folder: &scratch.0 };
        let judged = runner.run(&draws, runs, seed, &|| progress.step());
        let judged = judged.map_err(CliError::failure)?;
        let of_class = ClassReport::new(class, &judged)?;
        if output.streams() {
            event("class", &of_class).map_err(CliError::printing)?;
        }
        report.classes.push(of_class);
        let seeds = (0..u64::from(runs)).map(|run| seed.wrapping_add(run));
        let failing = seeds.zip(&judged).filter_map(|(seed, run)| Some((seed, run.failing()?)));
        let worst = failing.max_by(|(_, a), (_, b)| a.rank().total_cmp(&b.rank()));
        if let Some((seed, failing)) = worst {
            report.worst.push(Worst::new(&draws, seed, &failing, world.write.as_deref())?);
        }
    }
    progress.finish();
    output.result(&report, text)
}

impl World {
    /// Returns the estimators besides the estimator that suits a recording.
    fn beside<'a>(&self, registry: &'a Registry) -> Result<Beside<'a>, CliError> {
        // Estimators of single samples need an antenna that no drawn recording states.
        let every = registry.estimators().iter().filter(|entry| !entry.takes_samples());
        if self.against.iter().any(|name| name == ALL) {
            return Ok(Beside::Named(every.collect()));
        }
        if self.against.is_empty() {
            // A registry of one's own need not have them.
            let usual = SIMPLE.iter().chain([&USUAL]);
            return Ok(Beside::Named(
                usual.filter_map(|name| registry.estimator(name).ok()).collect(),
            ));
        }
        let named = self.against.iter().map(|name| choice::estimator(registry, name, "--against"));
        let named: Vec<&EstimatorEntry> = named.collect::<Result<_, _>>()?;
        Ok(Beside::Named(named))
    }
}

/// Returns the named classes; without names all that do not take minutes.
fn chosen(names: &[String]) -> Result<Vec<Class>, CliError> {
    let all = classes();
    if names.is_empty() {
        return Ok(all.into_iter().filter(|class| !class.is_large()).collect());
    }
    let of = |name: &String| {
        all.iter().find(|class| class.name == *name).copied().ok_or_else(|| {
            let known: Vec<&str> = all.iter().map(|class| class.name).collect();
            CliError::input(format!("--class: {name:?} is not one of {}", known.join(", ")))
        })
    };
    names.iter().map(of).collect()
}

/// A folder for files that are read once. It is removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Result<Self, CliError> {
        let folder = env::temp_dir().join(format!("foxhunt-soak-{}", std::process::id()));
        fs::create_dir_all(&folder).map_err(|error| CliError::writing(&folder, error))?;
        Ok(Self(folder))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed from the folder of temporary files is removed by the system.
        let _ = fs::remove_dir_all(&self.0);
    }
}

impl ClassReport {
    fn new(class: Class, judged: &[Judged]) -> Result<Self, CliError> {
        let fixes = || judged.iter().flat_map(|run| run.fixes.iter().map(move |fix| (run, fix)));
        let mut names: Vec<&str> = Vec::new();
        for (_, fix) in fixes() {
            for timed in fix {
                if !names.contains(&timed.answer.estimator.as_str()) {
                    names.push(&timed.answer.estimator);
                }
            }
        }
        let row = |name: &str, is_own: &dyn Fn(usize, &Answer) -> bool| {
            let own = |(run, fix): (&'_ Judged, &'_ Vec<Timed>)| {
                let own = fix.iter().enumerate().find(|(at, timed)| is_own(*at, &timed.answer));
                own.map(|(_, timed)| (timed.clone(), fix.first().cloned(), run.is_open))
            };
            Row::of(name, &fixes().filter_map(own).collect::<Vec<_>>())
        };
        let bounds: Vec<Bound> = judged.iter().filter_map(|run| run.bound).collect();
        let held = judged.iter().filter_map(|run| run.held_mib);
        let estimators = names.iter().map(|name| row(name, &|_, a| a.estimator == *name));
        let mut report = Self {
            class: class.name,
            about: class.about,
            is_open: class.is_open(),
            bound_m: median_error(&bounds),
            most_memory_mib: held.fold(None, |most, held| Some(most.unwrap_or(0.0).max(held))),
            default: row("default", &|at, _| at == 0)?,
            lost: Vec::new(),
            estimators: estimators.collect::<Result<_, _>>()?,
        };
        report.lost = report.lost();
        Ok(report)
    }

    /// Lists the criteria that the estimator which suits each draw misses: `silent`, an answer
    /// without a remark whose NEES is above 30, or where the place is open; `coverage`, a share of
    /// 95 % regions that is below 0.9 or above 0.99 beyond chance; `error` and `bound`, a median
    /// error above 1.1 times that of the best simple method, or 1.3 times the bound; `refused`,
    /// half of the recordings or more where the place is not open.
    fn lost(&self) -> Vec<&'static str> {
        let scores = &self.default.scores;
        let median_m = scores.median_error_m.unwrap_or(0.0);
        let simple_m = self.best(true).and_then(|best| best.scores.median_error_m);
        let [low, high] = scores.region_interval.unwrap_or([0.0, 1.0]);
        let answered = scores.fixes > 0;
        let all = [
            ("silent", self.default.silent_and_wrong > 0),
            ("coverage", high < 0.9 || low > 0.99),
            ("error", simple_m.is_some_and(|simple_m| median_m > 1.1 * simple_m)),
            ("bound", self.bound_m.is_some_and(|bound_m| median_m > 1.3 * bound_m)),
            ("refused", answered && !self.is_open && 2 * scores.failed >= scores.fixes),
        ];
        all.into_iter().filter(|(_, applies)| *applies).map(|(what, _)| what).collect()
    }

    /// Returns the row with the least median error among the simple methods, or among the others;
    /// rows that answer less than nine times in ten do not count.
    fn best(&self, is_simple: bool) -> Option<&Row> {
        let answers = |row: &Row| row.scores.fixes - row.scores.failed;
        let most = self.estimators.iter().map(answers).max().unwrap_or(0);
        let often = |row: &&Row| row.is_simple == is_simple && 10 * answers(row) >= 9 * most;
        let median = |row: &Row| row.scores.median_error_m.unwrap_or(f64::INFINITY);
        let own = |row: &&Row| row.scores.first_is_nearer.is_some();
        let rows = self.estimators.iter().filter(often).filter(own);
        rows.min_by(|a, b| median(a).total_cmp(&median(b)))
    }
}

impl Row {
    /// Summarises answers, each with the first one of its fix, and whether the place is open.
    fn of(name: &str, answers: &[(Timed, Option<Timed>, bool)]) -> Result<Self, CliError> {
        let mut silent_and_wrong = 0;
        let mut remarks: BTreeMap<String, usize> = BTreeMap::new();
        let mut refusals: BTreeMap<String, usize> = BTreeMap::new();
        for (Timed { answer, .. }, _, is_open) in answers {
            silent_and_wrong += usize::from(is_silent_and_wrong(answer, *is_open));
            for remark in &answer.remarks {
                *remarks.entry(remark.code.to_string()).or_default() += 1;
            }
            if let Some(reason) = &answer.failure {
                *refusals.entry(without_numbers(reason)).or_default() += 1;
            }
        }
        let seconds: Vec<f64> = answers.iter().map(|(timed, ..)| timed.seconds).collect();
        let spread = Spread::of(&seconds);
        let pairs = answers
            .iter()
            .map(|(own, first, _)| (&own.answer, first.as_ref().map(|first| &first.answer)));
        Ok(Self {
            is_simple: SIMPLE.contains(&name),
            scores: Summary::of(name, pairs)?,
            silent_and_wrong,
            remarks,
            refusals,
            mean_s: spread.map(|spread| spread.mean),
            most_s: spread.map(|spread| spread.max),
        })
    }
}

/// Maximum number of times that a draw is located while it is made shorter.
const TRIES: u32 = 200;

impl Worst {
    fn new(
        draws: &Draws<'_>,
        seed: u64,
        failing: &Failing,
        folder: Option<&Path>,
    ) -> Result<Self, CliError> {
        let class = draws.class.name;
        let what = match failing {
            Failing::Silent { nees } if nees.is_finite() => {
                format!("a place without a remark, NEES {nees:.0}")
            }
            Failing::Silent { .. } => {
                "a place without a remark, where the rows leave it open".to_owned()
            }
            Failing::Refused(reason) => format!("refused: {reason}"),
        };
        let again = format!("foxhunt soak --recordings --class {class} --runs 1 --seed {seed}");
        let mut worst = Self { class, seed, what, again, command: None, least: None };
        let Some(folder) = folder else { return Ok(worst) };
        let drawn = draws.class.draw(seed, draws.data).map_err(CliError::failure)?;
        let whole = folder.join(format!("{class}-{seed}"));
        worst.command = Some(written(&drawn, &whole)?);
        let (shorter, rows) = shorter(&drawn, draws, failing);
        worst.least = Some((written(&shorter, &whole.join("least"))?, rows));
        Ok(worst)
    }
}

/// Writes the files of a draw, and returns the command over them.
fn written(drawn: &DrawnRecording, folder: &Path) -> Result<String, CliError> {
    let paths = write(drawn, folder).map_err(|error| CliError::writing(folder, error))?;
    let judges = !drawn.is_track() && !drawn.is_empty;
    let command = if judges { "judge" } else { "locate" };
    let file = paths.first().map(|path| path.display().to_string()).unwrap_or_default();
    let words = flags(drawn, folder).join(" ");
    let command = format!("foxhunt {command} {file} {words}").trim_end().to_owned();
    let note = folder.join("command.txt");
    fs::write(&note, format!("{command}\n")).map_err(|error| CliError::writing(&note, error))?;
    Ok(command)
}

/// Leaves out rows of a draw as long as it fails in the same way, and returns the numbers of
/// remaining rows and of all.
fn shorter(
    drawn: &DrawnRecording,
    draws: &Draws<'_>,
    failing: &Failing,
) -> (DrawnRecording, [usize; 2]) {
    let text = drawn.text().as_bytes();
    let mut lines: Vec<&[u8]> = text.split_inclusive(|byte| *byte == b'\n').collect();
    let rows = lines.split_off(drawn.header.min(lines.len()));
    let before = rows.len();
    let with = |rows: &[&[u8]]| {
        let bytes = [&lines[..], rows].concat().concat();
        drawn.clone().with_text(String::from_utf8_lossy(&bytes).into_owned())
    };
    let tries = Cell::new(0);
    let fails = |rows: &[&[u8]]| {
        tries.set(tries.get() + 1);
        tries.get() <= TRIES && draws.fails_like(&with(rows), failing)
    };
    let rows = least(rows, fails);
    (with(&rows), [rows.len(), before])
}

fn text(report: &Report) -> String {
    let mut all = table(&[
        "class",
        "fixes",
        "answered",
        "median m",
        "(95 %)",
        "NEES",
        "in 95 %",
        "(95 %) ",
        "log score",
        "silent, wrong",
        "best simple m",
        "best other m",
        "bound m",
        "s",
        "lost",
    ])
    .named_by(1);
    for of in &report.classes {
        let scores = &of.default.scores;
        let best = |row: Option<&Row>| {
            row.map_or_else(
                || "-".to_owned(),
                |row| format!("{} {}", number(row.scores.median_error_m, 1), row.scores.estimator),
            )
        };
        let interval = |interval: Option<[f64; 2]>, decimals| {
            interval.map_or_else(
                || "-".to_owned(),
                |[low, high]| format!("{} … {}", number(low, decimals), number(high, decimals)),
            )
        };
        let [held, of_regions] = scores.in_regions_95;
        all.add_row([
            of.class.to_owned(),
            scores.fixes.max(of.default.refusals.values().sum()).to_string(),
            (scores.fixes - scores.failed).to_string(),
            number(scores.median_error_m, 1),
            interval(scores.median_interval_m, 1),
            number(scores.median_nees, 1),
            format!("{held} of {of_regions}"),
            interval(scores.region_interval, 2),
            number(scores.mean_log_score, 1),
            of.default.silent_and_wrong.to_string(),
            best(of.best(true)),
            best(of.best(false)),
            number(of.bound_m, 1),
            number(of.default.mean_s, 3),
            of.lost.join(", "),
        ]);
    }
    let mut lines = vec![
        format!("{} draws of each class, seeds from {}", report.runs, report.seed),
        all.to_string(),
        "The estimator that suits each draw; NEES in the median, 2 ln 2 = 1.4 where it is \
         consistent; `in 95 %` counts the regions that hold the truth; `log score` is the mean of \
         -ln of the density at the truth in 1/m²; `silent, wrong` counts answers without a remark \
         whose NEES is above 30, or where the rows leave the place open; `bound` is the median \
         error that the law of the draws allows; `lost` names what falls short: `silent`; `coverage` \
         below 0.9 or above 0.99 beyond chance; `error` above 1.1 times the best simple way's, \
         `bound` above 1.3 times it; `refused`."
            .to_owned(),
    ];
    for worst in &report.worst {
        lines.push(format!("{}, seed {}: {}", worst.class, worst.seed, worst.what));
        lines.push(format!("  {}", worst.command.as_ref().unwrap_or(&worst.again)));
        lines.extend(
            worst
                .least
                .as_ref()
                .map(|(command, [left, of])| format!("  {left} of {of} rows: {command}")),
        );
    }
    lines.join("\n")
}
