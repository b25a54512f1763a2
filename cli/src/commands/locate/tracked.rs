//! A transmitter that moves.

use std::cell::{Cell, OnceCell};

use foxhunt::{
    Spread,
    core::{Ellipse, Remark, nalgebra::Vector2},
    filters::consistency::Coverage,
    locate::{Located, Region, Tracked, TrackingConfig},
    overview::SearchOverview,
    recorded::{recorded_way, truth_at},
    recording::Recording,
    report::Place,
};
use serde::Serialize;

use super::found::{Estimated, Found, likeliest, rows_of};
use crate::{
    commands::{
        locating::{Prepared, Residuals, TRUTH_GAP_S, Track},
        recorded::{LatLon, no_degrees},
    },
    error::CliError,
    output::{Output, warn},
    progress::Progress,
    table::{number, table, text as cell},
};

/// Settings of tracking.
#[derive(Debug, clap::Args)]
pub struct Tracking {
    /// With --track: the length of a time window in seconds; receptions in one window are of one
    /// place
    #[arg(long, value_name = "S", default_value_t = 30.0, requires = "track")]
    window_s: f64,
    /// With --track: the time in seconds over which shadowing and reflections stay alike;
    /// receptions within it count as one reading; levels stay alike four times as long
    #[arg(long, value_name = "S", default_value_t = 240.0, requires = "track")]
    correlation_s: f64,
    /// With --track: the speeds that the transmitter may have, in m/s
    #[arg(long, value_name = "V", value_delimiter = ',', requires = "track",
          default_values_t = [0.3, 1.0, 3.0, 10.0])]
    speed_mps: Vec<f64>,
}

/// A track in JSON.
#[derive(Debug, Serialize)]
pub struct Report {
    beacon: Option<String>,
    /// Number of receptions left out by --ignore.
    ignored: usize,
    places: Vec<Passed>,
    /// The speeds that it may have, in m/s, each with its probability.
    speeds_mps: Vec<(f64, f64)>,
    /// The path-loss exponents, each with its probability; empty without levels.
    exponents: Vec<(f64, f64)>,
    border_mass: f64,
    median_error_m: Option<f64>,
    mean_error_m: Option<f64>,
    mean_nees: Option<f64>,
    /// Number of ellipses that hold the truth, and number with a known truth.
    inside_95: Option<[usize; 2]>,
    /// 95 % interval of the share of ellipses that hold the truth (Clopper & Pearson 1934), if
    /// places of different times are independent.
    coverage_interval: Option<[f64; 2]>,
    /// Doubts about the recordings.
    remarks: Vec<Remark>,
    /// Each row's measurements with their residuals from the place at its time.
    rows: Residuals,
    /// Number of rows to be listed; those that do not fit unless given.
    #[serde(skip)]
    listed: Option<usize>,
}

/// A place at a time.
#[derive(Debug, Serialize)]
struct Passed {
    time_s: f64,
    estimate: Estimated,
    ellipse_95: Option<Ellipse>,
    ellipse_is_poor: bool,
    regions_95: Vec<Region>,
    observations: usize,
    truth: Option<Place>,
    error_m: Option<f64>,
    nees: Option<f64>,
    inside_95: Option<bool>,
}

/// Tracks a beacon; the table lists `listed` rows, and pages are given all of them if `is_shown`.
pub fn report(
    tracking: &Tracking,
    truth: Option<LatLon>,
    (listed, is_shown): (Option<usize>, bool),
    prepared: &Prepared,
    beacon: Option<String>,
    output: Output,
) -> Result<(Report, Found), CliError> {
    let recordings = prepared.recordings();
    let config = TrackingConfig {
        window_s: tracking.window_s,
        correlation_s: tracking.correlation_s,
        speeds_mps: tracking.speed_mps.clone(),
    };
    let progress = OnceCell::new();
    let steps = Cell::new(0);
    let watch = |done: usize, most: usize| {
        let count = |count: usize| u64::try_from(count).unwrap_or(u64::MAX);
        let begin = || Progress::new(output, "steps", count(most), true);
        progress.get_or_init(begin).reach(count(done));
        steps.set(most);
    };
    let tracked = prepared.track(beacon.as_deref(), &config, &watch);
    if let Some(progress) = progress.get() {
        progress.finish();
    }
    let Track { tracked, listeners, rows } = tracked?;
    if tracked.border_mass > 0.05 {
        warn("the track is in doubt: it may leave the area that was searched; see --margin-m");
    }
    let frame = recordings.iter().find_map(Recording::frame);
    let stays = truth
        .map(|truth| truth.in_frame(frame).ok_or_else(|| no_degrees("--truth")))
        .transpose()?;
    let way = recorded_way(recordings, beacon.as_deref());
    let up = prepared.config().target_up_m;
    let truth_of = |time_s: f64| -> Option<Vector2<f64>> {
        stays.map(Into::into).or_else(|| truth_at(&way, time_s, TRUTH_GAP_S))
    };
    let passed = |(time_s, located): &(f64, Located)| {
        let estimate = &located.estimate;
        let on_earth = frame.map(|frame| frame.to_geodetic(&estimate.mean.push(up)));
        let truth = truth_of(*time_s);
        Passed {
            time_s: *time_s,
            estimate: Estimated::new(estimate, on_earth),
            ellipse_95: located.ellipse_95(),
            ellipse_is_poor: located.ellipse_is_poor(),
            regions_95: located.regions_95.clone(),
            observations: located.observations,
            truth: truth.map(Place::from),
            error_m: truth.map(|truth| (estimate.mean - truth).norm()),
            nees: truth.and_then(|truth| estimate.nees(&truth)),
            inside_95: truth.and_then(|truth| located.ellipse_95_holds(&truth)),
        }
    };
    let places: Vec<Passed> = tracked.places.iter().map(passed).collect();
    let called = beacon.clone().unwrap_or_else(|| "transmitter".to_owned());
    let shown = rows.chosen(|_| is_shown).collect();
    let search = SearchOverview::tracked(called, &tracked, truth_of).with_rows(shown);
    let tracks = prepared.tracks((config, listeners, steps.get()), &search, beacon.as_deref())?;
    let method = "track".to_owned();
    let found = Found { beacon: beacon.clone(), method, search, tracks: Some(tracks), rows: None };
    let ignored = prepared.ignored(beacon.as_deref());
    let mut report = Report::new(beacon, places, tracked, ignored)?;
    report.remarks = recordings.iter().flat_map(Recording::remarks).cloned().collect();
    report.rows = rows;
    report.listed = listed;
    Ok((report, found))
}

impl Report {
    fn new(
        beacon: Option<String>,
        places: Vec<Passed>,
        tracked: Tracked,
        ignored: usize,
    ) -> Result<Self, CliError> {
        let Tracked { speeds_mps, exponents, border_mass, .. } = tracked;
        let mut coverage = Coverage::new(0.95, 0.95).map_err(CliError::failure)?;
        let held: Vec<bool> = places.iter().filter_map(|place| place.inside_95).collect();
        held.iter().for_each(|held| coverage.add(*held));
        let inside = held.iter().filter(|held| **held).count();
        let spread = |of: fn(&Passed) -> Option<f64>| {
            Spread::of(&places.iter().filter_map(of).collect::<Vec<_>>())
        };
        let errors = spread(|place| place.error_m);
        let mean_nees = spread(|place| place.nees).map(|spread| spread.mean);
        Ok(Self {
            beacon,
            ignored,
            speeds_mps,
            exponents,
            border_mass,
            median_error_m: errors.map(|spread| spread.p50),
            mean_error_m: errors.map(|spread| spread.mean),
            mean_nees,
            inside_95: (!held.is_empty()).then_some([inside, held.len()]),
            coverage_interval: coverage.interval(),
            remarks: Vec::new(),
            rows: Residuals::default(),
            listed: None,
            places,
        })
    }
}

pub fn text(report: &Report) -> String {
    let mut places = table(&[
        "time s",
        "lat °",
        "lon °",
        "east m",
        "north m",
        "95 % ellipse m",
        "along °",
        "error m",
        "NEES",
        "used",
    ]);
    for place in &report.places {
        let axes = place.ellipse_95.map(|e| format!("{:.1} × {:.1}", e.semi_major, e.semi_minor));
        places.add_row([
            number(Some(place.time_s), 1),
            number(place.estimate.lat_deg, 6),
            number(place.estimate.lon_deg, 6),
            number(Some(place.estimate.east_m), 1),
            number(Some(place.estimate.north_m), 1),
            cell(axes),
            number(place.ellipse_95.map(|e| e.orientation.to_degrees()), 0),
            number(place.error_m, 1),
            number(place.nees, 2),
            place.observations.to_string(),
        ]);
    }
    let (speed, of_speed) = likeliest(&report.speeds_mps);
    let mut out =
        format!("{places}\nThe likeliest speed is {speed} m/s ({:.0} %)", 100.0 * of_speed);
    if !report.exponents.is_empty() {
        let (exponent, of_exponent) = likeliest(&report.exponents);
        out += &format!(", the likeliest exponent {exponent} ({:.0} %)", 100.0 * of_exponent);
    }
    out += ".";
    if let (Some([inside, of]), Some([low, high])) = (report.inside_95, report.coverage_interval) {
        out += &format!(
            "\nOver {of} times: error {} m in the median, {} m on average; mean NEES {}; {inside} \
             ellipses hold the truth ({low:.2} to {high:.2} of them, were the times independent).",
            number(report.median_error_m, 1),
            number(report.mean_error_m, 1),
            number(report.mean_nees, 2),
        );
    }
    out + &rows_of(&report.rows, report.listed, "")
}
