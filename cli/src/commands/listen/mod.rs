//! Pulses and tags as they come in.

mod args;
mod input;
mod screen;
mod tracker;

pub use args::Args;

use std::{
    io::{IsTerminal, stdout},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use foxhunt::signal::{
    Waterfall,
    detector::{Detection, Detector},
    tags::TagTable,
};
use serde::Serialize;

use self::{
    input::{Came, Input, Losses},
    screen::Screen,
    tracker::{TagRow, Tracker, rows},
};
use super::pulses::{HEADER, line};
use crate::{
    error::{CliError, InFile},
    output::{Context, Output, warn},
};

/// Output of `--json` at the end.
#[derive(Debug, Serialize)]
struct Report {
    source: String,
    rate_hz: f64,
    /// Centre frequency; without it frequencies are about the middle of the band.
    center_hz: Option<f64>,
    /// Searched time without gaps, in seconds.
    searched_s: f64,
    /// True if levels are in dBm, and not in dB of full scale.
    calibrated: bool,
    /// The energy over the noise's power density that a pulse must have, at the end.
    threshold_db: f64,
    /// Allowed rate of false alarms, per hour.
    false_alarms_per_hour: f64,
    lost: Losses,
    tags: Vec<TagRow>,
    /// Number of pulses of no tag.
    others: usize,
    pulses: Vec<Detection>,
}

/// View of pulses.
enum View {
    Screen(Box<Screen>),
    Csv,
    Lines,
    Json(Vec<Detection>),
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let output = context.output;
    let table = match &args.tags {
        Some(file) => TagTable::read(file).map_err(CliError::input)?,
        None => TagTable::default(),
    };
    let mut input = input::open(args)?;
    let wrong = |error: foxhunt::signal::detector::DetectorError| {
        CliError::input(InFile { file: args.source.clone(), source: error.into() })
    };
    let rate = input.rate_hz();
    let center = input.center_hz();
    let mut config = args.search.config(rate, center, input.rounding_noise());
    config.search_every_s = input.is_live().then_some(SEARCH_EVERY_S);
    let mut detector = Detector::new(config).map_err(wrong)?;
    let mut tracker = Tracker::new(table, args.intervals_s);
    let mut view = view(args, input.as_ref(), output)?;
    let stop = stop_on_interrupt(output)?;
    let mut samples = Vec::new();
    let mut found = Vec::new();
    let mut time_s = 0.0;
    while !stop.load(Ordering::Relaxed) && args.for_s.is_none_or(|limit| time_s < limit) {
        match input.read(&mut samples)? {
            Came::Samples(first) => {
                detector.push(first, &samples, &mut found).map_err(wrong)?;
                let next = first.saturating_add(samples.len() as u64);
                #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
                let end_s = next as f64 / rate;
                time_s = end_s;
                if let View::Screen(screen) = &mut view {
                    screen.take(first, &samples);
                }
            }
            Came::Nothing => time_s = time_s.max(input.elapsed_s().unwrap_or(0.0)),
            Came::End => break,
        }
        show(&mut view, &mut tracker, &mut found, time_s, input.as_mut(), args, output)?;
    }
    detector.finish(&mut found);
    show(&mut view, &mut tracker, &mut found, time_s, input.as_mut(), args, output)?;
    tracker.associate();
    let is_csv = matches!(view, View::Csv);
    // The screen goes, so that the table stays below what was there.
    let pulses = match view {
        View::Json(pulses) => pulses,
        other => {
            drop(other);
            Vec::new()
        }
    };
    let report = Report {
        source: args.source.clone(),
        rate_hz: rate,
        center_hz: center,
        searched_s: detector.searched_s(),
        calibrated: args.search.full_scale_dbm.is_some(),
        threshold_db: detector.threshold_db(),
        false_alarms_per_hour: args.search.false_alarms_per_hour,
        lost: input.losses(),
        others: tracker.others(),
        tags: tracker.into_rows(),
        pulses,
    };
    if is_csv { Ok(()) } else { output.result(&report, text) }
}

/// Time between two searches of a receiver's samples, in seconds.
const SEARCH_EVERY_S: f64 = 0.1;

/// Number of columns of the waterfall, if the terminal does not limit it.
const MOST_COLUMNS: u16 = 160;

fn view(args: &Args, input: &dyn Input, output: Output<'_>) -> Result<View, CliError> {
    if output.is_json() {
        return Ok(View::Json(Vec::new()));
    }
    if args.csv {
        output.note(HEADER)?;
        return Ok(View::Csv);
    }
    if !stdout().is_terminal() {
        return Ok(View::Lines);
    }
    let (_, width) = console::Term::stdout().size();
    let columns = usize::from(width.clamp(20, MOST_COLUMNS) - 1);
    let waterfall = Waterfall::new(input.rate_hz(), columns, screen::ROW_S);
    let waterfall = waterfall.ok_or_else(|| CliError::input("--rate-hz: no waterfall fits"))?;
    let is_calibrated = args.search.full_scale_dbm.is_some();
    let screen = Screen::open(&args.source, input, waterfall)?;
    Ok(View::Screen(Box::new(screen.calibrated(is_calibrated))))
}

/// Handles Ctrl-C, so that the table is printed and the terminal restored; does nothing inside
/// another program.
fn stop_on_interrupt(output: Output<'_>) -> Result<Arc<AtomicBool>, CliError> {
    let stop = Arc::new(AtomicBool::new(false));
    if output.is_kept() {
        return Ok(stop);
    }
    let stopped = Arc::clone(&stop);
    let quit = move || {
        if stopped.swap(true, Ordering::Relaxed) {
            // The second time: whatever is waited for is not worth it.
            console::Term::stdout().show_cursor().ok();
            std::process::exit(130);
        }
    };
    // In a page the worker is ended from outside.
    #[cfg(target_family = "wasm")]
    drop(quit);
    #[cfg(not(target_family = "wasm"))]
    ctrlc::set_handler(quit).map_err(CliError::failure)?;
    Ok(stop)
}

fn show(
    view: &mut View,
    tracker: &mut Tracker,
    found: &mut Vec<Detection>,
    time_s: f64,
    input: &mut dyn Input,
    args: &Args,
    output: Output<'_>,
) -> Result<(), CliError> {
    for detection in found.drain(..) {
        tracker.take(detection.pulse);
        match view {
            View::Csv => {
                let rate = detection.false_alarms_per_hour;
                output.note(&line(&detection.pulse, rate, input.name(), None))?;
            }
            View::Lines => {
                let pulse = detection.pulse;
                output.note(&format!(
                    "{:10.3} s {:14.1} Hz {:6.1} ms {:7.1} {} {:5.1} dB",
                    pulse.time_s,
                    pulse.frequency_hz,
                    1e3 * pulse.width_s,
                    pulse.power_dbm,
                    level_unit(args.search.full_scale_dbm.is_some()),
                    pulse.snr_db
                ))?;
            }
            View::Json(pulses) => pulses.push(detection),
            View::Screen(_) => {}
        }
    }
    tracker.refresh(time_s);
    let news = input.news();
    match view {
        View::Screen(screen) => screen.draw(tracker, time_s, news.as_deref(), input.losses())?,
        _ => news.iter().for_each(|news| warn(news)),
    }
    Ok(())
}

fn level_unit(is_calibrated: bool) -> &'static str {
    if is_calibrated { "dBm" } else { "dBFS" }
}

/// The tags as a table.
fn text(report: &Report) -> String {
    let tags = rows(&report.tags, report.searched_s, report.calibrated);
    let pulses: usize = report.tags.iter().map(|tag| tag.pulses).sum();
    format!(
        "{tags}\n{} pulses in {:.1} s searched, {} of them of no tag; {} samples lost in {} gaps.",
        pulses + report.others,
        report.searched_s,
        report.others,
        report.lost.samples,
        report.lost.gaps
    )
}
