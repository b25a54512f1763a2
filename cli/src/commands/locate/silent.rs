use foxhunt::{
    core::Remark,
    locate::{NextPlace, RangeSearched, Searched},
    overview::Overview,
    recording::Recording,
};
use serde::Serialize;

use crate::{
    commands::{locating::Prepared, views::Views},
    error::CliError,
    output::Output,
    table::table,
};

/// Stride of the rows in the table of ranges.
const EVERY: usize = 4;

/// A search in which nothing was received, in JSON.
#[derive(Debug, Serialize)]
struct Report {
    beacon: Option<String>,
    /// Number of silences, and of squares of 25 m that they count as.
    silences: usize,
    segments: usize,
    /// The area in which the transmitter is taken to be, in square metres.
    area_m2: f64,
    exponent: f64,
    /// Probability that the search would have found a transmitter in the area.
    pos: f64,
    /// Probability of success by the range at which a level meets the receiver's floor.
    by_range: Vec<RangeSearched>,
    /// Place where a transmitter that was missed would most probably be received.
    next: Next,
    remarks: Vec<Remark>,
}

/// Place to listen at next, in JSON.
#[derive(Debug, Serialize)]
struct Next {
    lat_deg: Option<f64>,
    lon_deg: Option<f64>,
    east_m: f64,
    north_m: f64,
    /// Probability that a transmitter that was missed would be received there.
    pod: f64,
}

impl Next {
    fn new(next: NextPlace, recordings: &[Recording]) -> Self {
        let frame = recordings.iter().find_map(Recording::frame);
        let on_earth = frame.map(|frame| frame.to_geodetic(&next.place.push(0.0)));
        Self {
            lat_deg: on_earth.map(|place| place.lat_deg),
            lon_deg: on_earth.map(|place| place.lon_deg),
            east_m: next.place.x,
            north_m: next.place.y,
            pod: next.pod,
        }
    }
}

/// Reports what a search has looked through in which nothing was received.
pub fn report(
    views: &Views,
    prepared: &Prepared,
    beacon: Option<String>,
    searched: Searched,
    output: Output,
) -> Result<(), CliError> {
    let remarks = prepared.recordings().iter().flat_map(Recording::remarks).cloned();
    let report = Report {
        beacon,
        silences: searched.silences,
        segments: searched.segments,
        area_m2: searched.area_m2(),
        exponent: searched.exponent,
        pos: searched.pos,
        by_range: searched.by_range.clone(),
        next: Next::new(searched.next_place(), prepared.recordings()),
        remarks: remarks.collect(),
    };
    output.result(&report, text)?;
    if views.any() {
        let mut overview = Overview::of_recordings(prepared.recordings(), "searched");
        prepared.add_to(&mut overview, None, report.beacon.as_deref(), None)?;
        overview.searched = Some(searched);
        views.write(&overview, None, output)?;
    }
    Ok(())
}

fn text(report: &Report) -> String {
    let mut ranges = table(&["heard as far as m", "POS %", "area with a POD of 95 %, %"]);
    let is_known = report.by_range.len() == 1;
    for of in report.by_range.iter().step_by(if is_known { 1 } else { EVERY }) {
        ranges.add_row([
            format!("{:.0}", of.range_m),
            format!("{:.0}", 100.0 * of.pos),
            format!("{:.0}", 100.0 * of.searched_95),
        ]);
    }
    let Next { east_m, north_m, pod, .. } = report.next;
    let on_earth = report.next.lat_deg.zip(report.next.lon_deg);
    let on_earth = on_earth.map_or_else(String::new, |(lat, lon)| format!(" ({lat:.6}, {lon:.6})"));
    let next = format!(
        "{:.0} m {}, {:.0} m {}{on_earth}",
        east_m.abs(),
        if east_m < 0.0 { "W" } else { "E" },
        north_m.abs(),
        if north_m < 0.0 { "S" } else { "N" }
    );
    let prior = if is_known { "" } else { ", every range from 10 m to 10 km being as probable" };
    format!(
        "Nothing was received: {} silences over {:.2} km². A transmitter in this area would have \
         been found with {:.0} % (POS){prior}.\n{ranges}\nNext place: {next}. A transmitter that \
         was missed would be received there with {:.0} %.\nPOD is the probability of detection in \
         a place, POS that of success over the area; --report and --export show where.",
        report.silences,
        report.area_m2 / 1e6,
        100.0 * report.pos,
        100.0 * pod,
    )
}
