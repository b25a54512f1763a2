//! Drawn recordings, located through files as a user's are, and scored.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use clap::Parser;
use foxhunt::{
    Experiment,
    core::{Receptions, Remark, nalgebra::Vector2},
    drawn::{Bound, Class, DrawnRecording},
    recording::Recording,
    registry::{EstimatorEntry, Need, Registry},
};
#[cfg(feature = "batch")]
use foxhunt::{
    core::Reception, locate::TrackingConfig, recorded::recorded_way, recorded::truth_at,
};

#[cfg(feature = "batch")]
use super::super::locating::{TRUTH_GAP_S, Track};
use super::{
    super::{
        locating::{Locating, Prepared, truth},
        recorded::LatLon,
        scores::Answer,
    },
    usage::{held_mib, spent_s},
};
use crate::{error::CliError, output::overheard};

/// Command line of a drawn recording: flags of `judge` and `locate`.
#[derive(Debug, Parser)]
struct Flags {
    #[arg(long, allow_hyphen_values = true)]
    truth: Option<LatLon>,
    #[arg(long)]
    track: bool,
    #[command(flatten)]
    locating: Locating,
}

/// Estimators of a draw besides the estimator that suits it.
#[derive(Clone, Debug)]
pub enum Beside<'a> {
    /// No other estimator: the draw is made shorter.
    Nothing,
    /// These, if they use what was received.
    Named(Vec<&'a EstimatorEntry>),
}

/// An answer and its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Timed {
    pub answer: Answer,
    /// Time on the processor.
    pub seconds: f64,
}

/// A draw, located by all estimators.
#[derive(Clone, Debug)]
pub struct Judged {
    /// The answers to each fix: the estimator that suits it first.
    pub fixes: Vec<Vec<Timed>>,
    pub bound: Option<Bound>,
    /// True if the recording leaves the place open: an answer without a remark is wrong, a refusal
    /// right.
    pub is_open: bool,
    /// Memory that the program held after it, in mebibytes.
    pub held_mib: Option<f64>,
}

/// The NEES beyond which an answer without a remark is a failure: a consistent one is there once
/// in three million fixes.
const SILENT_NEES: f64 = 30.0;

/// Way in which a draw failed.
#[derive(Clone, Debug, PartialEq)]
pub enum Failing {
    /// A place without a remark, so far from the truth for its ellipse.
    Silent {
        /// NEES; infinite where the place is open.
        nees: f64,
    },
    /// A refusal, by its text without numbers.
    Refused(String),
}

/// Name of the answers to a file that cannot be read.
const UNREAD: &str = "(unread)";

/// Most windows of a track that count: neighbours are alike.
#[cfg(feature = "batch")]
const WINDOWS: usize = 8;

impl Judged {
    /// Returns the worst that the estimator which suits the draw did.
    pub fn failing(&self) -> Option<Failing> {
        let mut worst: Option<Failing> = None;
        for answer in self.fixes.iter().filter_map(|fix| fix.first()).map(|timed| &timed.answer) {
            let next = match &answer.failure {
                Some(_) if self.is_open => continue,
                Some(reason) => Failing::Refused(without_numbers(reason)),
                None if !is_silent_and_wrong(answer, self.is_open) => continue,
                None if self.is_open => Failing::Silent { nees: f64::INFINITY },
                None => Failing::Silent { nees: answer.nees.unwrap_or(f64::INFINITY) },
            };
            worst = match (worst, next) {
                (Some(Failing::Silent { nees }), Failing::Silent { nees: more }) if more > nees => {
                    Some(Failing::Silent { nees: more })
                }
                (Some(known @ Failing::Silent { .. }), _) => Some(known),
                (_, next) => Some(next),
            };
        }
        worst
    }
}

impl Failing {
    /// Returns true if another draw fails in the same way.
    fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Silent { .. }, Self::Silent { .. }) => true,
            (one, other) => one == other,
        }
    }

    /// Rank among the worst: places beyond all doubt first, refusals last.
    pub fn rank(&self) -> f64 {
        match self {
            Self::Silent { nees } => *nees,
            Self::Refused(_) => 0.0,
        }
    }
}

/// Returns true if an answer stands as it is and is wrong.
pub fn is_silent_and_wrong(answer: &Answer, is_open: bool) -> bool {
    let is_wrong = is_open || answer.nees.is_some_and(|nees| nees > SILENT_NEES);
    answer.failure.is_none() && answer.remarks.is_empty() && is_wrong
}

/// Replaces the numbers of a text, so that like reasons are alike.
pub fn without_numbers(text: &str) -> String {
    let mut out = String::new();
    for word in text.split(' ') {
        let is_number = word.contains(|letter: char| letter.is_ascii_digit());
        out.push_str(if is_number { "#" } else { word });
        out.push(' ');
    }
    out.trim_end().to_owned()
}

/// The draws of a class.
pub struct Draws<'a> {
    pub class: Class,
    pub data: Option<&'a Path>,
    pub registry: &'a Registry,
    pub beside: Beside<'a>,
    /// Folder for the files of draws.
    pub folder: &'a Path,
}

impl Experiment for Draws<'_> {
    type Run = Judged;
    type Error = String;

    fn run(&self, seed: u64) -> Result<Judged, String> {
        let drawn = self.class.draw(seed, self.data).map_err(|error| error.to_string())?;
        let folder = self.folder.join(format!("{}-{seed}", self.class.name));
        let judged = self.judge(&drawn, &folder);
        judged.map_err(|error| format!("{}: {error}", folder.display()))
    }
}

impl Draws<'_> {
    /// Locates with the files of a draw, in a folder that is removed again.
    fn judge(&self, drawn: &DrawnRecording, folder: &Path) -> io::Result<Judged> {
        let paths = write(drawn, folder)?;
        let words = [String::from("foxhunt")].into_iter().chain(flags(drawn, folder));
        // What is printed about each of thousands of recordings is of no use to anybody.
        let (fixes, _) = overheard(|| {
            let began = spent_s();
            let fixes = Flags::try_parse_from(words)
                .map_err(CliError::input)
                .and_then(|flags| fixes(&flags, &paths[..1], &self.beside, self.registry));
            fixes.unwrap_or_else(|error| {
                let answer = Answer::failed(UNREAD, error.to_string());
                vec![vec![Timed { answer, seconds: spent_s() - began }]]
            })
        });
        fs::remove_dir_all(folder)?;
        let is_open = self.class.is_open();
        Ok(Judged { fixes, bound: drawn.bound, is_open, held_mib: held_mib() })
    }

    /// Returns true if the estimator that suits a draw fails with it in the same way.
    pub fn fails_like(&self, drawn: &DrawnRecording, failing: &Failing) -> bool {
        let beside = Beside::Nothing;
        let alone = Draws { beside, ..*self };
        let judged = alone.judge(drawn, &self.folder.join("shorter"));
        judged.is_ok_and(|run| run.failing().is_some_and(|other| other.is_like(failing)))
    }
}

/// Writes the files of a draw to a new folder, and returns their paths.
pub fn write(drawn: &DrawnRecording, folder: &Path) -> io::Result<Vec<PathBuf>> {
    fs::create_dir_all(folder)?;
    let write = |file: &foxhunt::drawn::DrawnFile| {
        let path = folder.join(&file.name);
        fs::write(&path, &file.text).map(|()| path)
    };
    drawn.files.iter().map(write).collect()
}

/// Returns the flags of a draw, with the paths of its files in place of their names.
pub fn flags(drawn: &DrawnRecording, folder: &Path) -> Vec<String> {
    let flag = |flag: &String| match flag.split_once('=') {
        Some((name, value)) if drawn.files.iter().any(|file| file.name == value) => {
            format!("{name}={}", folder.join(value).display())
        }
        _ => flag.clone(),
    };
    drawn.flags.iter().map(flag).collect()
}

/// Locates each beacon of a recording.
fn fixes(
    flags: &Flags,
    files: &[PathBuf],
    beside: &Beside<'_>,
    registry: &Registry,
) -> Result<Vec<Vec<Timed>>, CliError> {
    let began = spent_s();
    let prepared = flags.locating.prepare(files, None, flags.track, registry)?;
    let reading_s = spent_s() - began;
    let Some(recording) = prepared.recordings().first() else { return Ok(Vec::new()) };
    let mut all = Vec::new();
    for beacon in recording.beacons() {
        if flags.track {
            #[cfg(feature = "batch")]
            all.extend(windows(&prepared, recording, beacon)?);
            continue;
        }
        let known = truth(flags.truth, std::slice::from_ref(recording), beacon)?;
        let received = prepared.receptions_of(0, beacon)?;
        let own = flags.locating.estimator(registry, &received)?;
        let mut fix = vec![timed(own, &received, &prepared, known.as_ref(), recording)];
        fix.iter_mut().for_each(|timed| timed.seconds += reading_s);
        let beside = match beside {
            Beside::Nothing => &[],
            Beside::Named(entries) => &entries[..],
        };
        let others = beside.iter().filter(|entry| entry.name != own.name);
        let others = others.filter(|entry| uses(entry, &received));
        fix.extend(others.map(|e| timed(e, &received, &prepared, known.as_ref(), recording)));
        all.push(fix);
    }
    Ok(all)
}

/// Returns true if an estimator can use what was received.
fn uses(entry: &EstimatorEntry, received: &Receptions) -> bool {
    let needs = entry.needs();
    let has_levels = received.iter().any(|reception| reception.level.is_some());
    let has_bearings = received.iter().any(|r| r.has_bearing());
    let has = |need: Need, is_there: bool| (need != Need::Required || is_there, need, is_there);
    let parts = [has(needs.level, has_levels), has(needs.bearing, has_bearings)];
    let uses_some = parts.iter().any(|(_, need, is_there)| *need != Need::Unused && *is_there);
    let is_there = |quantity| received.iter().any(|r| r.measured.get(quantity).is_some());
    let others = needs.others.iter().all(|quantity| is_there(*quantity));
    parts.iter().all(|(met, _, _)| *met) && others && (uses_some || !needs.others.is_empty())
}

fn timed(
    entry: &EstimatorEntry,
    received: &Receptions,
    prepared: &Prepared,
    known: Option<&Vector2<f64>>,
    recording: &Recording,
) -> Timed {
    let began = spent_s();
    let located = entry.locate(received, prepared.config());
    let seconds = spent_s() - began;
    let mut answer = match located {
        Ok(located) => Answer::new(&entry.name, &located, known),
        Err(error) => Answer::failed(&entry.name, error.to_string()),
    };
    if recording.backwards().is_some() {
        answer.remarks.push(Remark::new("clock-back", "the clock runs backwards"));
    }
    Timed { answer, seconds }
}

/// Tracks a beacon, and scores some of the windows. Beside each is the place of the receiver with
/// the strongest level about its time.
#[cfg(feature = "batch")]
fn windows(
    prepared: &Prepared,
    recording: &Recording,
    beacon: Option<&str>,
) -> Result<Vec<Vec<Timed>>, CliError> {
    let tracking = TrackingConfig::default();
    let began = spent_s();
    let Track { tracked, .. } = prepared.track(beacon, &tracking, &|_, _| {})?;
    let seconds = spent_s() - began;
    let way = recorded_way(std::slice::from_ref(recording), beacon);
    let received = prepared.receptions_of(0, beacon)?;
    let every = tracked.places.len().div_ceil(WINDOWS).max(1);
    let mut fixes = Vec::new();
    for (time_s, located) in tracked.places.iter().skip(every / 2).step_by(every) {
        let known = truth_at(&way, *time_s, TRUTH_GAP_S);
        let answer = Answer::new("track", located, known.as_ref());
        let about = |r: &Reception| (r.time - time_s).abs() <= 0.5 * tracking.window_s;
        let level = |r: &Reception| r.level.map_or(f64::NEG_INFINITY, |level| level.rss_dbm);
        let levels = received.iter().filter(about).filter(|r| r.level.is_some());
        let strongest = levels.max_by(|a, b| level(a).total_cmp(&level(b)));
        let mut fix = vec![Timed { answer, seconds }];
        fix.extend(strongest.zip(known).map(|(strongest, known)| {
            let error_m = (strongest.receiver.position.xy() - known).norm();
            let answer = Answer::failed("strongest", String::new());
            let answer = Answer { error_m: Some(error_m), failure: None, ..answer };
            Timed { answer, seconds: 0.0 }
        }));
        fixes.push(fix);
    }
    Ok(fixes)
}
