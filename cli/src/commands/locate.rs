mod found;
mod silent;
#[cfg(feature = "batch")]
mod tracked;
#[cfg(feature = "batch")]
mod unknown_number;

use std::{fs, path::PathBuf};

use foxhunt::{
    calibration::{ConformalFile, ConformalRegions},
    core::{Ellipse, Remark, nalgebra::Vector2},
    geodesy::Geodetic,
    locate::{CommonErrors, Explanation, FoundOffset, Located, Region, Rival, Searched},
    movebank::{MovebankFix, write_movebank},
    overview::{Overview, SearchOverview},
    recording::Recording,
    registry::Registry,
    report::Place,
};
use serde::Serialize;

use self::found::{Estimated, Found, Others, likeliest, rows_of};
use super::{
    cot::{CotArgs, Teams},
    fixes::doubts,
    locating::{
        Locating, NAMELESS, Prepared, Received, Residuals, not_located, shared_truth, truth,
    },
    mqtt::MqttArgs,
    recorded::LatLon,
    views::Views,
};
use crate::{
    error::CliError,
    output::{Context, Output, check_writable},
    progress::Progress,
    table::{number, table, text},
};

/// Locate a transmitter from recorded flights
///
/// Estimates the place of one transmitter from one or several recordings: turns of a directional
/// antenna, levels of an omnidirectional one, ready-made bearings, ranges or differences. Without
/// --p0-dbm and --exponent, or a --calibration that has them, the transmitter's power is estimated
/// along with its place, and the exponent if the estimator can; with --exponent alone, only the
/// power. If nothing but silence was recorded, it reports where the transmitter is not: the
/// probability that the search would have found it (POS).
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt locate flight.csv\n  \
                        foxhunt locate uav1.csv uav2.csv --truth 50.0755,14.4378 \
                        --p0-dbm -29.06 --exponent 2.765\n  \
                        foxhunt locate bearings.csv --every-beacon\n  \
                        foxhunt locate flight.csv --ignore struck.jsonl --report without.html\n  \
                        foxhunt locate hills.csv --terrain tiles --p0-dbm -29.06 \
                        --exponent 2.765\n  \
                        foxhunt locate stations.csv --track")]
pub struct Args {
    /// Recordings: CSV with named columns
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The true place of the transmitter in degrees (WGS84), for the error [default: the
    /// recordings' own truth]
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    truth: Option<LatLon>,
    /// Locate every beacon of the recordings, one after the other
    #[arg(long, conflicts_with = "beacon")]
    every_beacon: bool,
    /// Track a moving transmitter: its place at each time, from all receptions before and after, by
    /// one or several receivers
    #[cfg(feature = "batch")]
    #[arg(long, conflicts_with_all = ["estimator", "every_beacon", "movebank_to", "terrain"])]
    track: bool,
    #[cfg(feature = "batch")]
    #[command(flatten)]
    tracking: tracked::Tracking,
    /// Find how many transmitters send on one frequency, and locate each: every bearing belongs to
    /// one of them or is wrong; after a search that received nothing, state how strong a
    /// transmitter is absent
    #[cfg(feature = "batch")]
    #[arg(long, conflicts_with_all = ["truth", "every_beacon", "track", "movebank_to",
          "conformal"])]
    unknown_number: bool,
    /// A list of receptions to leave out: saved by a page, or your own JSON lines (docs/report.md)
    #[arg(long, value_name = "FILE")]
    ignore: Option<PathBuf>,
    /// List the N rows that fit worst, 20 without N, with file, line and residual
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "20",
          require_equals = true)]
    rows: Option<usize>,
    /// Write the places to a table with Movebank's names; needs recordings with times in UTC
    #[arg(long, value_name = "CSV")]
    movebank_to: Option<PathBuf>,
    #[command(flatten)]
    locating: Locating,
    #[command(flatten)]
    views: Views,
    #[command(flatten)]
    cot: CotArgs,
    #[command(flatten)]
    mqtt: MqttArgs,
}

/// A located place in JSON.
#[derive(Debug, Serialize)]
struct Report {
    estimator: String,
    beacon: Option<String>,
    estimate: Estimated,
    ellipse_95: Option<Ellipse>,
    truth: Option<Place>,
    error_m: Option<f64>,
    nees: Option<f64>,
    observations: usize,
    rejected: usize,
    /// Number of receptions left out by --ignore.
    ignored: usize,
    /// The probability on the border of the area that was searched, for estimators with one.
    border_mass: Option<f64>,
    /// Explanation of the receptions, for estimators that weigh explanations.
    explanation: Option<Explanation>,
    /// Errors common to the bearings of each place, if some place has several.
    common_errors: Option<CommonErrors>,
    /// Regions that hold the transmitter with 95 % by the user's recordings, for --conformal.
    #[serde(skip_serializing_if = "Option::is_none")]
    conformal_95: Option<ConformalRegions>,
    /// True if the ellipse is a poor picture of the regions.
    ellipse_is_poor: bool,
    /// The smallest region that holds the transmitter with 95 %, for estimators with a posterior
    /// density; places are East and North in metres.
    regions_95: Vec<Region>,
    /// Other places that are nearly as probable, for estimators that look for them.
    rivals: Vec<RivalPlace>,
    /// Offset between the clocks of levels and path, where it was found and taken off.
    #[serde(skip_serializing_if = "Option::is_none")]
    clock_offset: Option<FoundOffset>,
    /// Doubts about the recordings and the place, each with what to do about it.
    remarks: Vec<Remark>,
    /// Residual of each measurement that took part, by file and line.
    rows: Residuals,
    /// Number of rows that the table lists; unless given, it lists the rows that do not fit.
    #[serde(skip)]
    listed: Option<usize>,
    /// Number of the first remarks, of the recordings, that were warned of on reading.
    #[serde(skip)]
    warned: usize,
}

/// Another place that is nearly as probable.
#[derive(Debug, Serialize)]
struct RivalPlace {
    lat_deg: Option<f64>,
    lon_deg: Option<f64>,
    east_m: f64,
    north_m: f64,
    /// The density there over that at the estimate.
    relative_density: f64,
    error_m: Option<f64>,
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    args.views.check(args.cot.is_given() || args.mqtt.is_given())?;
    let teams = args.cot.teams(&args.mqtt)?;
    args.movebank_to.iter().try_for_each(|path| check_writable(path))?;
    let conformal = args.locating.conformal()?;
    #[cfg(feature = "batch")]
    if args.track && conformal.is_some() {
        return Err(CliError::input("--conformal: a track has no region of its own recordings"));
    }
    #[cfg(feature = "batch")]
    let is_track = args.track;
    #[cfg(not(feature = "batch"))]
    let is_track = false;
    let ignore = args.ignore.as_deref();
    let prepared = args.locating.prepare(&args.files, ignore, is_track, registry)?;
    let recordings = prepared.recordings();
    let on_earth = recordings.iter().any(|recording| recording.frame().is_some());
    let in_utc = recordings.iter().all(Recording::is_in_utc);
    args.views.check_known(on_earth, in_utc)?;
    teams.check_known(on_earth || args.views.origin().is_some())?;
    if args.movebank_to.is_some() && !(on_earth && in_utc) {
        return Err(CliError::input(NOT_FOR_MOVEBANK));
    }
    if args.every_beacon {
        let (mut reports, found): (Vec<_>, Vec<_>) =
            every(args, registry, &prepared, conformal.as_ref(), output)?.into_iter().unzip();
        if let Some(remark) = shared_truth(args.truth, reports.len()) {
            for report in &mut reports {
                report.remarks.insert(report.warned, remark.clone());
                report.warned += 1;
            }
        }
        to_movebank(args, &prepared, &reports)?;
        output.result(&reports, |reports| places(reports))?;
        return show(args, registry, &prepared, (found, None), teams, output);
    }
    let beacon = args.locating.beacon(prepared.recordings())?;
    #[cfg(feature = "batch")]
    if args.track {
        let shown = (args.rows, args.views.any());
        let (report, found) =
            tracked::report(&args.tracking, args.truth, shown, &prepared, beacon, output)?;
        output.result(&report, tracked::text)?;
        return show(args, registry, &prepared, (vec![found], None), teams, output);
    }
    #[cfg(feature = "batch")]
    if args.unknown_number {
        let locate = |own| {
            let (mut report, found) =
                located(args, registry, &prepared, None, (beacon.clone(), own))?;
            // A truth of the recording is the place of one transmitter.
            report.truth = None;
            report.error_m = None;
            report.nees = None;
            Ok((report, found))
        };
        let (several, found) = unknown_number::several(&prepared, beacon.clone(), locate)?;
        output.result(&several, |several| unknown_number::answer(several, cells, details))?;
        return show(args, registry, &prepared, (found, Some(several.others())), teams, output);
    }
    let received = prepared.received(beacon.as_deref())?;
    if let Some(searched) = Searched::in_silence(received.receptions(), prepared.config()) {
        return silent::report(&args.views, &prepared, beacon, searched, output);
    }
    let (report, found) =
        located(args, registry, &prepared, conformal.as_ref(), (beacon, received))?;
    to_movebank(args, &prepared, std::slice::from_ref(&report))?;
    output.result(&report, |report| places(std::slice::from_ref(report)))?;
    show(args, registry, &prepared, (vec![found], None), teams, output)
}

/// Reason why there is no table for Movebank.
const NOT_FOR_MOVEBANK: &str =
    "--movebank-to: Movebank takes only places in degrees and times in UTC";

/// Writes the requested page and exports, and sends the places to teams. `others` are rows of no
/// transmitter.
fn show(
    args: &Args,
    registry: &Registry,
    prepared: &Prepared,
    (found, others): (Vec<Found>, Option<Others<'_>>),
    teams: Teams,
    output: Output,
) -> Result<(), CliError> {
    if !args.views.any() && !teams.any() {
        return Ok(());
    }
    let method = found.first().map_or_else(String::new, |found| found.method.clone());
    let mut overview = Overview::of_recordings(prepared.recordings(), &method);
    let entry = registry.estimator(&method).ok();
    let mut beacons = Vec::new();
    let mut tracks = None;
    let mut is_sorted = false;
    for (number, found) in found.into_iter().enumerate() {
        let Found { beacon, search, tracks: again, rows, .. } = found;
        is_sorted |= rows.is_some();
        prepared.add_to(&mut overview, Some(number), beacon.as_deref(), rows.as_deref())?;
        overview.searches.push(search);
        beacons.push(beacon);
        tracks = tracks.or(again);
    }
    if let Some(Others { beacon, rows }) = others {
        prepared.add_to(&mut overview, None, beacon, rows)?;
    }
    overview.mark_left_out();
    // A place from all receptions is known when the last of them has come.
    let [_, end] = overview.span();
    for search in &mut overview.searches {
        if let [only] = search.beliefs.as_mut_slice() {
            only.time = end;
        }
    }
    if !args.views.has_page() {
        args.views.write(&overview, None, output)?;
        return teams.send(&args.views.placed(overview)?);
    }
    // A page locates again from all rows of a beacon, not from those of one of its transmitters.
    if let Some(estimator) = entry.filter(|_| !is_sorted) {
        let searches = overview.searches.iter().zip(beacons.iter().map(Option::as_deref));
        let again = prepared.relocation(estimator, searches, args.locating.names_estimator())?;
        tracks = Some(again);
    }
    args.views.write(&overview, tracks.as_ref(), output)?;
    teams.send(&args.views.placed(overview)?)
}

/// Writes the places for Movebank, if requested.
fn to_movebank(args: &Args, prepared: &Prepared, reports: &[Report]) -> Result<(), CliError> {
    let Some(path) = &args.movebank_to else { return Ok(()) };
    let recordings = prepared.recordings();
    let frame = recordings.iter().find_map(Recording::frame);
    let frame = frame.ok_or_else(|| CliError::input(NOT_FOR_MOVEBANK))?;
    let mut fixes = Vec::new();
    for report in reports {
        let received = prepared.received(report.beacon.as_deref())?;
        let times = received.receptions().iter().map(|reception| reception.time);
        let (first, last) = times
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(first, last), time| {
                (time.min(first), time.max(last))
            });
        fixes.push(MovebankFix {
            tag: report.beacon.clone().unwrap_or_default(),
            received: [first, last],
            place: Vector2::new(report.estimate.east_m, report.estimate.north_m),
            ellipse_95: report.ellipse_95,
        });
    }
    let file = fs::File::create(path).map_err(|error| CliError::writing(path, error))?;
    write_movebank(file, &frame, &fixes).map_err(CliError::failure)
}

/// Locates one beacon.
fn one(
    args: &Args,
    registry: &Registry,
    prepared: &Prepared,
    conformal: Option<&ConformalFile>,
    beacon: Option<String>,
) -> Result<(Report, Found), CliError> {
    let received = prepared.received(beacon.as_deref())?;
    located(args, registry, prepared, conformal, (beacon, received))
}

/// Locates a transmitter from these receptions of a beacon.
fn located(
    args: &Args,
    registry: &Registry,
    prepared: &Prepared,
    conformal: Option<&ConformalFile>,
    (beacon, received): (Option<String>, Received),
) -> Result<(Report, Found), CliError> {
    let estimator = args.locating.estimator(registry, received.receptions())?;
    let truth = truth(args.truth, prepared.recordings(), beacon.as_deref())?;
    let located = prepared.locate(estimator, &received).map_err(not_located)?;
    let factors = conformal.map(|file| file.of(&estimator.name)).transpose();
    let factors = factors.map_err(CliError::input)?;
    let own = factors.and_then(|factors| factors.regions(&located));
    let rows = prepared.residuals(estimator, &located, received);
    let name = estimator.name.to_string();
    let up = located.up_m(prepared.config());
    let called = beacon.clone().unwrap_or_else(|| "transmitter".to_owned());
    // Millions of rows are copied for pages and exports alone.
    let shown = rows.chosen(|_| args.views.any()).collect();
    let search = SearchOverview {
        conformal: factors.cloned(),
        ..SearchOverview::located(called, &located, truth, 0.0).with_rows(shown)
    };
    let method = name.clone();
    let found = Found { beacon: beacon.clone(), method, search, tracks: None, rows: None };
    let mut report = Report::new(name, beacon, prepared.recordings(), up, truth, &located);
    report.clock_offset = prepared.found_clock().or(report.clock_offset);
    report.ignored = prepared.ignored(report.beacon.as_deref());
    report.rows = rows;
    report.conformal_95 = own;
    report.listed = args.rows;
    Ok((report, found))
}

/// Locates each beacon; one that cannot be located is reported on standard error.
fn every(
    args: &Args,
    registry: &Registry,
    prepared: &Prepared,
    conformal: Option<&ConformalFile>,
    output: Output,
) -> Result<Vec<(Report, Found)>, CliError> {
    let mut beacons: Vec<Option<&str>> = Vec::new();
    for beacon in prepared.recordings().iter().flat_map(Recording::beacons) {
        if !beacons.contains(&beacon) {
            beacons.push(beacon);
        }
    }
    let total = u64::try_from(beacons.len()).unwrap_or(u64::MAX);
    let progress = Progress::new(output, "beacons", total, true);
    let mut reports = Vec::new();
    let mut failed = None;
    for beacon in beacons {
        match one(args, registry, prepared, conformal, beacon.map(str::to_owned)) {
            Ok(report) => reports.push(report),
            Err(error) => {
                let name = beacon.unwrap_or(NAMELESS);
                progress.warn(&format!("{name} is not located: {error}"));
                failed = Some(error);
            }
        }
        progress.step();
    }
    progress.finish();
    failed.filter(|_| reports.is_empty()).map_or(Ok(reports), Err)
}

impl Report {
    fn new(
        estimator: String,
        beacon: Option<String>,
        recordings: &[Recording],
        target_up_m: f64,
        truth: Option<Vector2<f64>>,
        located: &Located,
    ) -> Self {
        let estimate = &located.estimate;
        let frame = recordings.iter().find_map(Recording::frame);
        let on_earth = |place: &Vector2<f64>| -> Option<Geodetic> {
            frame.map(|frame| frame.to_geodetic(&place.push(target_up_m)))
        };
        let rival = |rival: &Rival| {
            let on_earth = on_earth(&rival.place);
            RivalPlace {
                lat_deg: on_earth.map(|place| place.lat_deg),
                lon_deg: on_earth.map(|place| place.lon_deg),
                east_m: rival.place.x,
                north_m: rival.place.y,
                relative_density: rival.relative_density,
                error_m: truth.map(|truth| (rival.place - truth).norm()),
            }
        };
        let rivals = located.rivals.iter().map(rival).collect();
        let of_recordings: Vec<_> = recordings.iter().flat_map(Recording::remarks).collect();
        Self {
            estimator,
            beacon,
            estimate: Estimated::new(estimate, on_earth(&estimate.mean)),
            ellipse_95: located.ellipse_95(),
            truth: truth.map(Place::from),
            error_m: truth.map(|truth| (estimate.mean - truth).norm()),
            nees: truth.and_then(|truth| estimate.nees(&truth)),
            observations: located.observations,
            rejected: located.rejected,
            ignored: 0,
            border_mass: located.border_mass,
            explanation: located.explanation.clone(),
            common_errors: located.common_errors.clone(),
            conformal_95: None,
            ellipse_is_poor: located.ellipse_is_poor(),
            regions_95: located.regions_95.clone(),
            rivals,
            clock_offset: located.clock_offset,
            rows: Residuals::default(),
            listed: None,
            warned: of_recordings.len(),
            remarks: of_recordings.into_iter().chain(&located.remarks).cloned().collect(),
        }
    }
}

fn places(reports: &[Report]) -> String {
    let named = reports.len() > 1;
    let mut columns = vec![
        "estimator",
        "lat °",
        "lon °",
        "east m",
        "north m",
        "95 % ellipse m",
        "along °",
        "error m",
        "NEES",
        "used",
        "rejected",
    ];
    if named {
        columns.insert(0, "beacon");
    }
    let mut places = table(&columns).named_by(if named { 2 } else { 1 });
    for report in reports {
        let mut row = cells(report);
        row.extend([
            number(report.error_m, 1),
            number(report.nees, 2),
            report.observations.to_string(),
            report.rejected.to_string(),
        ]);
        if named {
            row.insert(0, report.beacon.clone().unwrap_or_else(|| NAMELESS.to_owned()));
        }
        places.add_row(row);
    }
    let from = match reports.first() {
        Some(Report { estimate: Estimated { lat_deg: None, .. }, .. }) => "as in the recordings",
        _ => "from the first usable position",
    };
    let legend = format!(
        "East and north {from}; the ellipse's semi-axes, and the direction of the longer one \
         counter-clockwise from East."
    );
    let ignored: usize = reports.iter().map(|report| report.ignored).sum();
    let ignored = match ignored {
        0 => String::new(),
        count => format!(" Left out by --ignore: {count}."),
    };
    let of_beacon = |report: &Report| {
        let whose = report.beacon.as_ref().map_or_else(String::new, |name| format!(" of {name}"));
        details(report, &whose)
    };
    let details: String = reports.iter().map(of_beacon).collect();
    format!("{places}\n{legend}{ignored}{details}")
}

/// Returns the cells of a report in a table: estimator, place and ellipse.
fn cells(report: &Report) -> Vec<String> {
    let axes = report.ellipse_95.map(|e| format!("{:.1} × {:.1}", e.semi_major, e.semi_minor));
    vec![
        report.estimator.clone(),
        number(report.estimate.lat_deg, 6),
        number(report.estimate.lon_deg, 6),
        number(report.estimate.east_m, 1),
        number(report.estimate.north_m, 1),
        text(axes),
        number(report.ellipse_95.map(|e| e.orientation.to_degrees()), 0),
    ]
}

/// Returns the details below the table: explanation of the levels, regions, rivals and so on.
fn details(report: &Report, whose: &str) -> String {
    let explanation = report.explanation.as_ref().map(|explanation| explained(explanation, whose));
    let common = report.common_errors.as_ref().map(|common| in_common(common, whose));
    let regions = Some(&report.regions_95).filter(|_| report.ellipse_is_poor);
    let regions = regions.map(|parts| regions_of(parts, whose));
    let rivals = Some(&report.rivals).filter(|rivals| !rivals.is_empty());
    let rivals = rivals.map(|rivals| rivals_of(rivals, whose));
    let remarks = remarks_of(report.remarks.get(report.warned..).unwrap_or_default(), whose);
    let rows = rows_of(&report.rows, report.listed, whose);
    let conformal = report.conformal_95.as_ref().map(|own| conformal(own, whose));
    [conformal, Some(remarks), Some(rows), explanation, common, regions, rivals]
        .into_iter()
        .flatten()
        .collect()
}

/// Lists the remarks that have no table of their own.
fn remarks_of(remarks: &[Remark], whose: &str) -> String {
    let untold = |remark: &&Remark| !["ellipse-is-poor", "rivals"].contains(&&*remark.code);
    doubts(remarks.iter().filter(untold), whose)
}

/// Returns the regions by the user's recordings in a sentence.
fn conformal(regions: &ConformalRegions, whose: &str) -> String {
    let ConformalRegions { fixes, ellipse, circle_m } = regions;
    format!(
        "\n95 % by your own recordings (n = {fixes}): an ellipse of {:.1} × {:.1} m along {:.0}° \
         about the place{whose}, or a circle of {circle_m:.1} m.",
        ellipse.semi_major,
        ellipse.semi_minor,
        ellipse.orientation.to_degrees(),
    )
}

/// Returns the best explanation of the levels, in a sentence.
fn explained(explanation: &Explanation, whose: &str) -> String {
    let Explanation { exponent, dipoles, target_up_m, sigma_db, .. } = explanation;
    let (length_m, of_length) = likeliest(&explanation.correlation_lengths_m);
    let (share, of_share) = likeliest(&explanation.own_shares);
    let antennas = match dipoles {
        Some(dipoles) => {
            format!("{:.1} ± {:.1} vertical dipoles on the way", dipoles.mean, dipoles.sd)
        }
        None => "the antennas that were named".into(),
    };
    let height = target_up_m.map_or_else(String::new, |height| {
        format!(", a transmitter {:.0} ± {:.0} m above the ground", height.mean, height.sd)
    });
    format!(
        "\nThe levels{whose} are best explained by an exponent of {:.1} ± {:.1}, \
         {antennas}{height}, and shadowing of {:.0} ± {:.0} dB over {length_m:.0} m \
         ({:.0} %), {:.0} % of its variance each reading's own ({:.0} %).",
        exponent.mean,
        exponent.sd,
        sigma_db.mean,
        sigma_db.sd,
        100.0 * of_length,
        100.0 * share,
        100.0 * of_share,
    )
}

/// Returns the errors common to the bearings of each place.
fn in_common(common: &CommonErrors, whose: &str) -> String {
    let mut stations = table(&["station", "east m", "north m", "bearings", "error ° ccw", "±"]);
    for (number_of, station) in (1..).zip(&common.stations) {
        stations.add_row([
            i32::to_string(&number_of),
            number(Some(station.place.x), 1),
            number(Some(station.place.y), 1),
            station.bearings.to_string(),
            number(Some(station.error_deg_ccw.mean), 1),
            number(Some(station.error_deg_ccw.sd), 1),
        ]);
    }
    let shares: Vec<String> = (common.sigmas_deg.iter())
        .map(|(deg, probability)| format!("{deg:.0}° ({:.0} %)", 100.0 * probability))
        .collect();
    format!(
        "\n\nBearings{whose} from one place share an error, with a σ of {}:\n{stations}",
        shares.join(", ")
    )
}

/// Returns the parts of the region, which an ellipse does not show.
fn regions_of(regions: &[Region], whose: &str) -> String {
    if regions.is_empty() {
        return String::new();
    }
    let mut parts = table(&["part", "probability", "area m²", "east m", "north m"]);
    for (number_of, region) in (1..).zip(regions) {
        let range = |along: fn(&Vector2<f64>) -> f64| {
            let values = region.outline.iter().map(along);
            let (low, high) = values
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                    (low.min(value), high.max(value))
                });
            format!("{low:.0} … {high:.0}")
        };
        parts.add_row([
            i32::to_string(&number_of),
            number(Some(region.probability), 2),
            number(Some(region.area_m2), 0),
            range(|place| place.x),
            range(|place| place.y),
        ]);
    }
    format!(
        "\n\nThe ellipse{whose} is a poor picture; the smallest region that holds the transmitter \
         with 95 % (outlines in the output of --json):\n{parts}"
    )
}

fn rivals_of(rivals: &[RivalPlace], whose: &str) -> String {
    let mut places =
        table(&["rival", "lat °", "lon °", "east m", "north m", "relative density", "error m"]);
    for (number_of, rival) in (1..).zip(rivals) {
        places.add_row([
            i32::to_string(&number_of),
            number(rival.lat_deg, 6),
            number(rival.lon_deg, 6),
            number(rival.east_m, 1),
            number(rival.north_m, 1),
            number(rival.relative_density, 2),
            number(rival.error_m, 1),
        ]);
    }
    format!(
        "\n\nOther places{whose} fit nearly as well:\n{places}\nThe density is that of \
         the posterior, over that at the place above."
    )
}
