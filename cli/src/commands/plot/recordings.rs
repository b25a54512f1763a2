//! Figures of recordings and of the receptions in logs.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use foxhunt::{
    config::ExtractorConfig,
    core::{Reception, angle},
    hunt::Event,
    log::Log,
    overview::{Overview, Turn},
    picture::{Axis, Curve, Graph, Mark, Scale, Tint, graph_svg, turn_svg},
    recorded::{CalibrateConfig, KnownRange, RecordedError, bearings, known_ranges, true_bearing},
    recording::Recording,
    sensors::{BearingMixture, fit_log_distance},
};

use super::drawing::Drawing;
use crate::{
    commands::{
        choice::Extraction,
        recorded::{LatLon, Reading, no_degrees},
        views::Antennas,
    },
    error::CliError,
    output::{Context, Output},
};

/// One turn of a recording.
#[derive(Debug, clap::Args)]
pub struct OneTurn {
    /// A recording of turns: CSV with named columns
    file: PathBuf,
    /// The number of the turn, from 1 in the order of the recording
    #[arg(long, value_name = "N", default_value_t = 1)]
    turn: usize,
    /// Draw the level over the angle, with the mean of each position, the moving mean, the border
    /// 2 dB below its top, and the detected and the true direction
    #[arg(long)]
    over_angle: bool,
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    drawing: Drawing,
}

/// Levels of a recording.
#[derive(Debug, clap::Args)]
pub struct Received {
    /// A recording: CSV with named columns
    file: PathBuf,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    drawing: Drawing,
}

/// Receptions of a transmitter whose place is known.
#[derive(Debug, clap::Args)]
pub struct Measured {
    /// Recordings (CSV with named columns), or logs of simulated hunts (.jsonl)
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The place of the transmitter in degrees (WGS84) [default: the recordings' own truth]
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    truth: Option<LatLon>,
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    drawing: Drawing,
}

pub fn pattern(args: &OneTurn, context: Context<'_>) -> Result<(), CliError> {
    let registry = context.registry;
    args.drawing.check()?;
    let config = args.extraction.config(registry, &ExtractorConfig::default())?;
    let antenna = Antennas::of(&config);
    let extractor = args.extraction.build(registry)?;
    let recordings = args.reading.read(std::slice::from_ref(&args.file))?;
    let [recording] = recordings.as_slice() else {
        return Err(CliError::input("a turn is drawn from one recording"));
    };
    let wanted = args.reading.wanted();
    if wanted.is_some() {
        args.reading.beacon(&recordings)?;
    }
    let mut turns =
        bearings(recording, extractor.as_ref(), args.reading.positions).map_err(CliError::input)?;
    turns.retain(|read| wanted.is_none_or(|name| read.sweep.beacon_name.as_deref() == Some(name)));
    let count = turns.len();
    let chosen = args.turn.checked_sub(1).and_then(|index| turns.get(index));
    let read = chosen.ok_or_else(|| {
        CliError::input(format!("--turn {}: the recording has turns 1 to {count}", args.turn))
    })?;
    let mut overview = Overview::default();
    overview.add_reading(recording.file(), read, args.extraction.name(), antenna.known());
    let turn = overview.received.pop().and_then(|received| received.turn).unwrap_or_default();
    let beacon = read.sweep.beacon_name.as_ref().map_or_else(String::new, |b| format!(", {b}"));
    let own = format!("{}{beacon}, turn {} of {count}", read.sweep.drone, args.turn);
    let detected = read.reading.bearing.ok().map(|bearing| bearing.angle);
    let title = args.drawing.title(&own);
    if !args.over_angle {
        return args.drawing.write(turn_svg(&title, &turn, detected), context.output);
    }
    let truth = recording.records().iter().find(|record| record.line == read.sweep.line);
    let truth = true_bearing(read, truth.and_then(|record| record.truth));
    let graph = over_angle(title, &turn, detected, truth);
    args.drawing.write(graph_svg(&graph), context.output)
}

/// A curve of a graph.
fn curve(name: impl Into<String>, points: Points, mark: Mark, tint: Tint) -> Curve {
    Curve { name: name.into(), points, mark, tint }
}

/// Distance of the border below the top of the moving mean, in dB (Pritzl 2018, §4.2).
const BORDER_DB: f64 = 2.0;

/// The level of a turn over the direction of the antenna (Pritzl 2018, §4.1 and §4.2).
fn over_angle(title: String, turn: &Turn, detected: Option<f64>, truth: Option<f64>) -> Graph {
    let degrees = |radians: f64| angle::wrap(radians).to_degrees();
    let over_degrees = |points: &[[f64; 2]]| -> Points {
        let mut over: Points = points.iter().map(|[at, level]| [degrees(*at), *level]).collect();
        over.sort_by(|a, b| a[0].total_cmp(&b[0]));
        over
    };
    let samples = over_degrees(&turn.samples);
    let smoothed = over_degrees(&turn.smoothed);
    let levels = samples.iter().map(|[_, level]| *level).filter(|level| level.is_finite());
    let (lowest, highest) = levels
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), db| (low.min(db), high.max(db)));
    let top = smoothed.iter().map(|[_, level]| *level).fold(f64::NEG_INFINITY, f64::max);
    let upright = |at: f64| vec![[degrees(at), lowest], [degrees(at), highest]];
    let border = vec![[-180.0, top - BORDER_DB], [180.0, top - BORDER_DB]];
    let mut curves = vec![
        curve("samples", samples.clone(), Mark::Dots, Tint::Number(0)),
        curve("mean of a position", means(turn), Mark::Dots, Tint::Number(1)),
        curve("moving mean", smoothed, Mark::Line, Tint::Belief),
        curve("2 dB below its top", border, Mark::Dashes, Tint::Belief),
    ];
    if let Some(at) = detected {
        let name = format!("detected, {:.1}°", degrees(at));
        curves.push(curve(name, upright(at), Mark::Line, Tint::Number(2)));
    }
    if let Some(at) = truth {
        let name = format!("true, {:.1}°", degrees(at));
        curves.push(curve(name, upright(at), Mark::Dashes, Tint::Truth));
    }
    Graph {
        title,
        across: Axis {
            label: "direction of the antenna in degrees, counter-clockwise from East".to_owned(),
            scale: Scale::Linear,
        },
        up: level_axis(),
        bands: Vec::new(),
        curves,
    }
}

/// The mean level of the samples nearest to each position.
fn means(turn: &Turn) -> Points {
    let mean = |&[at, _]: &[f64; 2]| {
        let width = std::f64::consts::PI / as_number(turn.smoothed.len());
        let near = turn.samples.iter().filter(|[boresight, level]| {
            level.is_finite() && angle::wrap(boresight - at).abs() <= width
        });
        let (sum, count) = near.fold((0.0, 0.0), |(sum, n), [_, level]| (sum + level, n + 1.0));
        (count > 0.0).then(|| [angle::wrap(at).to_degrees(), sum / count])
    };
    turn.smoothed.iter().filter_map(mean).collect()
}

fn as_number(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}

fn level_axis() -> Axis {
    Axis { label: "level in dBm, or dB".to_owned(), scale: Scale::Linear }
}

pub fn levels(args: &Received, output: Output) -> Result<(), CliError> {
    args.drawing.check()?;
    let recordings = args.reading.read(std::slice::from_ref(&args.file))?;
    let wanted = args.reading.wanted();
    if wanted.is_some() {
        args.reading.beacon(&recordings)?;
    }
    let mut of_receivers: BTreeMap<&str, Points> = BTreeMap::new();
    for record in recordings.iter().flat_map(Recording::records) {
        let (Some(time), Some(level)) = (record.time, record.rss_dbm) else { continue };
        if wanted.is_none_or(|name| record.beacon.as_deref() == Some(name)) {
            of_receivers.entry(&*record.drone).or_default().push([time, level]);
        }
    }
    let times = of_receivers.values().flatten().map(|[time, _]| *time);
    let start = times.fold(f64::INFINITY, f64::min);
    if !start.is_finite() {
        let name = args.file.display();
        return Err(CliError::input(format!("{name}: no row has a time and a level")));
    }
    let curves = of_receivers.into_iter().enumerate().map(|(index, (name, points))| {
        let name = if name.is_empty() { "levels" } else { name };
        let points = points.into_iter().map(|[time, level]| [time - start, level]).collect();
        curve(name, points, Mark::Dots, Tint::Number(index))
    });
    let graph = Graph {
        title: args.drawing.title(&file_name(&args.file).unwrap_or_default()),
        across: Axis { label: "time in seconds".to_owned(), scale: Scale::Linear },
        up: level_axis(),
        bands: Vec::new(),
        curves: curves.collect(),
    };
    args.drawing.write(graph_svg(&graph), output)
}

fn file_name(path: &Path) -> Option<String> {
    path.file_name().map(|name| name.to_string_lossy().into_owned())
}

/// Pairs of a known and a measured value.
type Points = Vec<[f64; 2]>;

impl Measured {
    /// Applies `of_log` to the receptions of logs, with the truth, or else `of_recordings` to
    /// recordings: if `pooled`, to all beacons, unless one is chosen.
    fn measured<T>(
        &self,
        context: Context<'_>,
        pooled: bool,
        of_log: fn(&Reception, [f64; 2]) -> Option<T>,
        of_recordings: impl Fn(&Recorded<'_>) -> Result<Vec<T>, RecordedError>,
    ) -> Result<Vec<T>, CliError> {
        self.drawing.check()?;
        let is_log = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "jsonl");
        match self.files.iter().filter(|path| is_log(path)).count() {
            0 => {}
            logs if logs == self.files.len() => return self.of_logs(of_log),
            _ => return Err(CliError::input("give logs or recordings, not both")),
        }
        let recordings = self.reading.read(&self.files)?;
        let beacons = match self.reading.wanted() {
            None if pooled => {
                let mut all: Vec<Option<&str>> =
                    recordings.iter().flat_map(Recording::beacons).collect();
                all.sort_unstable();
                all.dedup();
                all.into_iter().map(|name| name.map(str::to_owned)).collect()
            }
            _ => vec![self.reading.beacon(&recordings)?],
        };
        let frame = recordings.iter().find_map(Recording::frame);
        let in_frame = |truth: LatLon| truth.in_frame(frame).ok_or_else(|| no_degrees("--truth"));
        let truth = self.truth.map(in_frame).transpose()?.map(Into::into);
        let positions = self.reading.positions;
        let config = CalibrateConfig { truth, positions, ..CalibrateConfig::default() };
        let extractor = self.extraction.build(context.registry)?;
        let mut measured = Vec::new();
        for beacon in &beacons {
            let recorded = Recorded {
                recordings: &recordings,
                beacon: beacon.as_deref(),
                extractor: extractor.as_ref(),
                config: &config,
            };
            measured.append(&mut of_recordings(&recorded).map_err(CliError::input)?);
        }
        Ok(measured)
    }

    fn of_logs<T>(
        &self,
        of_log: fn(&Reception, [f64; 2]) -> Option<T>,
    ) -> Result<Vec<T>, CliError> {
        if self.truth.is_some() || self.extraction.is_given() {
            let text = "--truth, --extractor and --antenna are for recordings: a log has a truth \
                        of its own, and bearings that were made already";
            return Err(CliError::input(text));
        }
        let mut found = Vec::new();
        for path in &self.files {
            let Log { header, events, .. } = Log::read(path).map_err(CliError::input)?;
            for event in &events {
                let Event::Received { reception, .. } = event else { continue };
                let beacon = header.beacons.get(usize::from(reception.beacon.0));
                let wanted = |name: &str| self.reading.wanted().is_none_or(|wanted| wanted == name);
                let beacon = beacon.filter(|beacon| wanted(&beacon.name));
                let truth = beacon.and_then(|beacon| beacon.place_at(reception.time));
                found.extend(truth.and_then(|truth| of_log(reception, truth.into())));
            }
        }
        Ok(found)
    }

    /// The names of the files, as a title.
    fn named(&self) -> String {
        let names: Vec<String> = self.files.iter().filter_map(|path| file_name(path)).collect();
        match names.as_slice() {
            [first, _, _, ..] => format!("{first} and {} more", names.len() - 1),
            few => few.join(", "),
        }
    }
}

/// Recordings whose transmitter's place is known.
struct Recorded<'a> {
    recordings: &'a [Recording],
    beacon: Option<&'a str>,
    extractor: &'a dyn foxhunt::core::BearingExtractor,
    config: &'a CalibrateConfig,
}

pub fn rssi(args: &Measured, context: Context<'_>) -> Result<(), CliError> {
    let of_log = |reception: &Reception, [east, north]: [f64; 2]| {
        let from = reception.receiver.position;
        Some(KnownRange {
            range_m: (from.x - east).hypot(from.y - north).hypot(from.z),
            up_m: Some(from.z),
            rss_dbm: reception.level?.rss_dbm,
        })
    };
    let levels = args.measured(context, false, of_log, |of| {
        known_ranges(of.recordings, of.beacon, of.extractor, of.config)
    })?;
    let fit = fit_log_distance(levels.iter().map(|level| (level.range_m, level.rss_dbm)), None);
    let fit = fit.map_err(CliError::input)?;
    let ranges = levels.iter().map(|level| level.range_m);
    let (nearest, farthest) = ranges
        .fold((f64::INFINITY, 0.0_f64), |(low, high), range| (low.min(range), high.max(range)));
    let line = |shift_db: f64| -> Points {
        let ends = [nearest, farthest];
        let level = |range: f64| fit.reference_dbm - 10.0 * fit.exponent * range.log10();
        ends.map(|range| [range, level(range) + shift_db]).to_vec()
    };
    let law = format!("P₀ {:.1}, γ {:.2}", fit.reference_dbm, fit.exponent);
    let mut curves = by_height(&levels);
    curves.extend([
        curve(law, line(0.0), Mark::Line, Tint::Belief),
        curve(
            format!("± σ, {:.1} dB", fit.sigma_db),
            line(fit.sigma_db),
            Mark::Dashes,
            Tint::Belief,
        ),
        curve("", line(-fit.sigma_db), Mark::Dashes, Tint::Belief),
    ]);
    let graph = Graph {
        title: args.drawing.title(&args.named()),
        across: Axis { label: "distance in metres".to_owned(), scale: Scale::Logarithmic },
        up: level_axis(),
        bands: Vec::new(),
        curves,
    };
    args.drawing.write(graph_svg(&graph), context.output)
}

/// Most heights that have a colour of their own.
const MOST_HEIGHTS: usize = 6;

/// The levels as dots, in a colour for each height. Heights are rounded to the least width that
/// leaves at most [`MOST_HEIGHTS`] colours.
fn by_height(levels: &[KnownRange]) -> Vec<Curve> {
    let up = |level: &KnownRange| level.up_m.unwrap_or(f64::INFINITY);
    let mut sorted = levels.to_vec();
    sorted.sort_by(|a, b| up(a).total_cmp(&up(b)));
    let groups = |width: f64| -> Vec<&[KnownRange]> {
        let rounded = |level: &KnownRange| (up(level) / width).round();
        sorted.chunk_by(|a, b| rounded(a).total_cmp(&rounded(b)).is_eq()).collect()
    };
    let widths = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0];
    let few = widths.into_iter().map(groups).find(|groups| groups.len() <= MOST_HEIGHTS);
    let groups = few.unwrap_or_else(|| vec![&sorted]);
    let only = groups.len() == 1;
    let dots = groups.iter().enumerate().map(|(index, group)| {
        let count = group.len();
        let ends = (group.first().and_then(|l| l.up_m), group.last().and_then(|l| l.up_m));
        let name = match ends {
            (Some(low), Some(high)) if !only && high - low < 0.1 => {
                format!("{count} levels {low:.1} m up")
            }
            (Some(low), Some(high)) if !only => {
                format!("{count} levels {low:.0} to {high:.0} m up")
            }
            _ => format!("{count} levels"),
        };
        let points = group.iter().map(|level| [level.range_m, level.rss_dbm]).collect();
        curve(name, points, Mark::Dots, Tint::Number(index))
    });
    dots.collect()
}

pub fn bearing_errors(args: &Measured, context: Context<'_>) -> Result<(), CliError> {
    let of_log = |reception: &Reception, [east, north]: [f64; 2]| {
        let from = reception.receiver.position;
        let true_angle = (north - from.y).atan2(east - from.x);
        Some(angle::wrap(reception.bearing?.angle - true_angle))
    };
    let errors: Vec<f64> = args.measured(context, true, of_log, |of| {
        foxhunt::recorded::bearing_errors(of.recordings, of.beacon, of.extractor, of.config)
    })?;
    let fit = BearingMixture::fit(&errors).ok_or_else(|| {
        CliError::input(format!("{} bearings of a known direction are too few", errors.len()))
    })?;
    let reach = reach_deg(&errors);
    let graph = Graph {
        title: args.drawing.title(&args.named()),
        across: Axis {
            label: format!(
                "error of the bearing in degrees, counter-clockwise; the fitted bias is {:.1}°",
                fit.bias().to_degrees()
            ),
            scale: Scale::Linear,
        },
        up: Axis { label: "density per degree".to_owned(), scale: Scale::FromZero },
        bands: Vec::new(),
        curves: vec![
            histogram(&errors, reach),
            curve(
                format!(
                    "{:.0} % outliers, σ {:.1}°",
                    100.0 * fit.outlier_share(),
                    fit.sigma().to_degrees()
                ),
                density(&fit, reach),
                Mark::Line,
                Tint::Belief,
            ),
            curve(
                "Isaacs et al. 2014",
                density(&BearingMixture::isaacs2014(), reach),
                Mark::Dashes,
                Tint::Truth,
            ),
        ],
    };
    args.drawing.write(graph_svg(&graph), context.output)
}

/// Range of the shown errors to either side, in degrees: the largest error, and half a turn at
/// most.
fn reach_deg(errors: &[f64]) -> f64 {
    let largest = errors.iter().map(|error| error.abs().to_degrees()).fold(0.0, f64::max);
    (15.0 * (largest / 15.0).ceil()).clamp(30.0, 180.0)
}

/// The share of errors for each degree, in bars of some degrees.
fn histogram(errors: &[f64], reach_deg: f64) -> Curve {
    let bars: u16 = if errors.len() < 200 { 36 } else { 72 };
    let width = 2.0 * reach_deg / f64::from(bars);
    let all = f64::from(u32::try_from(errors.len()).unwrap_or(u32::MAX));
    let bar = |bar: u16| {
        let low = -reach_deg + width * f64::from(bar);
        let within = |error: &&f64| (low..low + width).contains(&error.to_degrees());
        let count = errors.iter().filter(within).count();
        let count = f64::from(u32::try_from(count).unwrap_or(u32::MAX));
        [low + 0.5 * width, count / (all * width)]
    };
    Curve {
        name: format!("{} bearings", errors.len()),
        points: (0..bars).map(bar).collect(),
        mark: Mark::Bars(width),
        tint: Tint::Number(0),
    }
}

/// A density over the errors, per degree.
fn density(mixture: &BearingMixture, reach_deg: f64) -> Points {
    let at = |part: i16| {
        let degrees = reach_deg * f64::from(part) / 360.0;
        [degrees, mixture.density(degrees.to_radians()).to_radians()]
    };
    (-360..=360).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn bars_and_densities_have_an_area_of_one() {
        let errors: Vec<f64> = (0..150).map(|i| f64::from(i) * 0.03 - 2.0).collect();
        assert_abs_diff_eq!(reach_deg(&errors), 150.0, epsilon = 1e-9);
        let curve = histogram(&errors, 150.0);
        let Mark::Bars(width) = curve.mark else { panic!("bars") };
        let area: f64 = curve.points.iter().map(|[_, up]| up * width).sum();
        assert_abs_diff_eq!(area, 1.0, epsilon = 1e-12);
        // The trapezoidal rule over a whole turn, both ends of which are there.
        let density = density(&BearingMixture::isaacs2014(), 180.0);
        let area: f64 = density.iter().skip(1).map(|[_, up]| up * 0.5).sum();
        assert_abs_diff_eq!(area, 1.0, epsilon = 1e-6);
    }
}
