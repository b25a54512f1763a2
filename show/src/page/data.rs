use foxhunt_core::{Ellipse, HeightSource, Remark};
use foxhunt_hunt::{
    hunt::PlaceEstimate,
    locate::{Measurand, Searched},
};
use nalgebra::{Vector2, Vector3};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::points::{Cells, Points};
use crate::{
    overview::{Believed, Health, Knot, Notice, Overview, Received, SearchOverview, Turn},
    raster::{self, Raster},
};
use foxhunt_archive::{recorded::RowResidual, replay::Replay, struck::ReceptionKey};

/// Maximum number of bearings, path points or notices per page; longer series are decimated.
const MOST: usize = 5000;

/// Maximum number of turns per page that keep their samples: the first ones.
const MOST_TURNS: usize = 600;

/// Cells along a side of a heat map.
const MOST_CELLS: usize = 96;

/// Cells with less than this share of the largest probability are no part of a heat map.
const LEAST_SHARE: f64 = 1e-4;

/// Data for the page's script. Lengths are metres, angles radians counter-clockwise from East,
/// times seconds since `epoch`.
#[derive(Debug, Serialize)]
pub(super) struct Data<'a> {
    title: &'a str,
    method: &'a str,
    seed: Option<u64>,
    /// UNIX time at the time 0.
    epoch: Option<f64>,
    /// Latitude and longitude of the frame's zero in degrees, and its height in metres.
    origin: Option<[f64; 3]>,
    /// True if levels are in dB about an unknown reference.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    relative_levels: bool,
    span: [f64; 2],
    receivers: Vec<Receiver<'a>>,
    received: Vec<Reception<'a>>,
    searches: Vec<Search<'a>>,
    notices: Vec<(f64, &'a str, u8)>,
    /// Doubts about the recordings: code and sentence.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    remarks: Vec<Doubt<'a>>,
    /// Interval of a consistent estimator's NIS with 95 %, for 1, 2, … degrees of freedom.
    nis_95: Vec<[f64; 2]>,
    /// Step by which receptions are decimated; 1 shows all.
    every: usize,
    /// Probability that a transmitter in each cell would have been received, where nothing was.
    #[serde(skip_serializing_if = "Option::is_none")]
    searched: Option<SearchedCells>,
    /// Abilities of the page of a hunt that goes on.
    #[serde(skip_serializing_if = "Option::is_none")]
    live: Option<Live>,
    /// Reason why no bearing can be struck out, where that is so and there is something to remark.
    #[serde(skip_serializing_if = "Option::is_none")]
    not_strikable: Option<String>,
}

/// Area that was searched in silence.
#[derive(Debug, Serialize)]
struct SearchedCells {
    #[serde(flatten)]
    pod: Cells,
    silences: usize,
    pos: f64,
    /// Range at which a level meets the floor in metres, POS, and the share of the area with a POD
    /// of 95 %.
    by_range: Vec<[f64; 3]>,
}

impl SearchedCells {
    fn of(searched: &Searched) -> Self {
        let by_range = searched.by_range.iter();
        Self {
            pod: Cells::new(&Raster::from(searched), [0.0, 1.0]),
            silences: searched.silences,
            pos: round(searched.pos, 4),
            by_range: by_range
                .map(|of| [metres(of.range_m), round(of.pos, 4), round(of.searched_95, 4)])
                .collect(),
        }
    }
}

/// Abilities of the page of a hunt that goes on besides showing it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Live {
    /// True if it can order that the flight is broken off.
    pub orders: bool,
    /// The map that it gets at `tiles/ZOOM/COLUMN/ROW`, in Web Mercator, counted from the
    /// North-West.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tiles: Option<LiveTiles>,
}

/// Zoom levels and attribution of a map, for a page.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LiveTiles {
    /// The least and the greatest zoom level.
    pub zooms: [u8; 2],
    /// Attribution of the map, as text or HTML.
    pub attribution: Option<String>,
}

/// Additions to an overview since a [`Mark`].
#[derive(Debug, Serialize)]
pub(super) struct News<'a> {
    span: [f64; 2],
    /// All receivers, each with the new part of its path and health.
    receivers: Vec<Receiver<'a>>,
    received: Vec<Reception<'a>>,
    /// All searches, each with its new beliefs and the new part of the truth.
    searches: Vec<Search<'a>>,
    notices: Vec<(f64, &'a str, u8)>,
}

/// Part of an overview that is known already, as counts.
#[derive(Clone, Debug, Default)]
pub struct Mark {
    /// Knots of each receiver's path, and entries of its health.
    paths: Vec<(usize, usize)>,
    received: usize,
    turns: usize,
    /// Beliefs of each search, and knots of the truth.
    searches: Vec<(usize, usize)>,
    notices: usize,
}

/// Estimates without the receptions that were struck out.
#[derive(Debug, Serialize)]
pub(super) struct Restruck<'a> {
    /// Outcome of each reception of a log; empty for recordings, whose receptions are used unless
    /// struck out.
    received: Vec<Restep<'a>>,
    searches: Vec<Search<'a>>,
    fixes: Vec<RestruckFix<'a>>,
}

/// Outcome of a reception.
#[derive(Debug, Serialize)]
struct Restep<'a> {
    id: Option<&'a ReceptionKey>,
    used: bool,
    nis: Option<(f64, usize)>,
}

/// A fix with all of its digits.
#[derive(Debug, Serialize)]
struct RestruckFix<'a> {
    name: &'a str,
    steps: u32,
    estimate: PlaceEstimate,
}

/// Time, share of the battery that is left, whether its messages come, σ of its position, and how
/// high it is above the ground by which of its devices.
type HealthRow = (f64, Option<f64>, bool, Option<f64>, Option<(f64, HeightSource)>);

#[derive(Debug, Serialize)]
struct Receiver<'a> {
    name: &'a str,
    /// Time, East, North, Up.
    path: Vec<[f64; 4]>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    health: Vec<HealthRow>,
}

#[derive(Debug, Serialize)]
struct Reception<'a> {
    time: f64,
    receiver: usize,
    search: Option<usize>,
    place: [f64; 3],
    /// dBm and σ in dB.
    #[serde(skip_serializing_if = "Option::is_none")]
    level: Option<[f64; 2]>,
    /// Angle, σ, confidence.
    #[serde(skip_serializing_if = "Option::is_none")]
    bearing: Option<[f64; 3]>,
    /// Weight, angle, σ of the directions that compete.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    modes: Vec<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    remark: Option<&'a str>,
    used: bool,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    struck: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<&'a ReceptionKey>,
    /// The normalised innovation squared, and its degrees of freedom.
    #[serde(skip_serializing_if = "Option::is_none")]
    nis: Option<(f64, usize)>,
    #[serde(skip_serializing_if = "Option::is_none")]
    turn: Option<PackedTurn>,
}

#[derive(Debug, Serialize)]
struct PackedTurn {
    samples: Points,
    smoothed: Points,
    fitted: Points,
}

#[derive(Debug, Serialize)]
struct Search<'a> {
    name: &'a str,
    outcome: Option<&'a str>,
    /// Time, East, North.
    truth: Vec<[f64; 3]>,
    beliefs: Vec<Belief>,
    /// The places given all receptions, where the replay is smoothed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    smoothed: Vec<Belief>,
    /// Parts of the 95 % region: borders, the holes after the outline.
    regions: Vec<Vec<Vec<[f64; 2]>>>,
    /// The posterior in the end as the probability of the region that holds each cell, where the
    /// estimator has one; the page makes that of a cloud or of an ellipse by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    heat: Option<Cells>,
    /// The level over the ground, where there are many.
    #[serde(skip_serializing_if = "Option::is_none")]
    level_map: Option<LevelCells>,
    /// East, North, density over that at the estimate.
    rivals: Vec<[f64; 3]>,
    /// Number of the user's fixes with a known truth, and by what factor the ellipse holds the
    /// transmitter with 95 % by these.
    #[serde(skip_serializing_if = "Option::is_none")]
    conformal: Option<(usize, f64)>,
    /// Doubts about the place: code and sentence.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    remarks: Vec<Doubt<'a>>,
    /// Rows of the recordings, the worst first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    rows: Vec<PageRow<'a>>,
    /// Number of all rows, where the page does not have all of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    of_rows: Option<usize>,
}

/// Mean of the level in each cell, and its σ in dB.
#[derive(Debug, Serialize)]
struct LevelCells {
    #[serde(flatten)]
    mean: Cells,
    sigma: Cells,
}

impl LevelCells {
    fn of([mean, sigma]: &[Raster; 2]) -> Self {
        let bounds = |raster: &Raster| {
            let values = raster.values.iter().copied();
            [values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max)]
        };
        let [_, most] = bounds(sigma);
        Self { mean: Cells::new(mean, bounds(mean)), sigma: Cells::new(sigma, [0.0, most]) }
    }
}

/// Code and sentence of a remark.
type Doubt<'a> = (&'a str, &'a str);

/// Row of a recording with its residual from the place.
#[derive(Debug, Serialize)]
struct PageRow<'a> {
    file: &'a str,
    line: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    receiver: Option<&'a str>,
    kind: Measurand,
    residual: f64,
    unit: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    p: Option<f64>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    left_out: bool,
}

#[derive(Debug, Serialize)]
struct Belief {
    time: f64,
    steps: u32,
    place: [f64; 2],
    /// Semi-axes of the 95 % ellipse, and the direction of the longer one.
    ellipse: Option<[f64; 3]>,
    error: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cloud: Option<Points>,
}

/// Rounds to a number of decimals; JSON has finite numbers only.
fn round(value: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    // Beyond 2^53 there are no decimals to round.
    if value.abs() * scale < 9e15 { (value * scale).round() / scale } else { value }
}

fn metres(value: f64) -> f64 {
    round(value, 3)
}

fn seconds(value: f64) -> f64 {
    round(value, 2)
}

fn radians(value: f64) -> f64 {
    round(value, 4)
}

fn flat(place: &Vector2<f64>) -> [f64; 2] {
    [metres(place.x), metres(place.y)]
}

fn high(place: &Vector3<f64>) -> [f64; 3] {
    [metres(place.x), metres(place.y), metres(place.z)]
}

impl<'a> Data<'a> {
    pub(super) fn of(
        overview: &'a Overview,
        live: Option<Live>,
        not_strikable: Option<String>,
    ) -> Self {
        let every = overview.received.len().div_ceil(MOST).max(1);
        let mut turns = 0;
        let received = overview.received.iter().step_by(every).map(|received| {
            turns += usize::from(received.turn.is_some());
            Reception::of(received, turns <= MOST_TURNS)
        });
        let receivers = overview.receivers.iter().map(|receiver| Receiver {
            name: &receiver.name,
            path: thinned(&receiver.path).map(knot).collect(),
            health: thinned(&receiver.health).map(health).collect(),
        });
        let searches = overview.searches.iter().enumerate().map(|(index, search)| {
            let level_map = raster::level(overview, index).as_ref().map(LevelCells::of);
            Search { level_map, ..Search::of(search, &search.truth, &search.beliefs) }
        });
        let origin = overview.frame.map(|frame| frame.origin());
        Self {
            title: &overview.title,
            method: &overview.method,
            seed: overview.seed,
            epoch: overview.epoch_unix_s,
            origin: origin.map(|origin| {
                [round(origin.lat_deg, 8), round(origin.lon_deg, 8), metres(origin.alt_m)]
            }),
            relative_levels: overview.relative_levels,
            span: overview.span().map(seconds),
            received: received.collect(),
            receivers: receivers.collect(),
            searches: searches.collect(),
            notices: thinned(&overview.notices).map(notice).collect(),
            remarks: overview.remarks.iter().map(doubt).collect(),
            nis_95: (1..=4).filter_map(nis_95).collect(),
            every,
            searched: overview.searched.as_ref().map(SearchedCells::of),
            live,
            not_strikable,
        }
    }
}

impl<'a> News<'a> {
    /// Returns the additions to an overview since the mark, and moves the mark to its end.
    pub(super) fn since(overview: &'a Overview, mark: &mut Mark) -> Self {
        mark.paths.resize(overview.receivers.len(), (0, 0));
        mark.searches.resize(overview.searches.len(), (0, 0));
        let receivers = overview.receivers.iter().zip(&mut mark.paths);
        let receivers = receivers.map(|(receiver, (knots, healths))| Receiver {
            name: &receiver.name,
            path: rest(&receiver.path, knots).iter().map(knot).collect(),
            health: rest(&receiver.health, healths).iter().map(health).collect(),
        });
        let receivers = receivers.collect();
        let searches = overview.searches.iter().zip(&mut mark.searches);
        let searches = searches.map(|(search, (beliefs, truth))| {
            Search::of(search, rest(&search.truth, truth), rest(&search.beliefs, beliefs))
        });
        let searches = searches.collect();
        let received = rest(&overview.received, &mut mark.received).iter().map(|received| {
            mark.turns += usize::from(received.turn.is_some());
            Reception::of(received, mark.turns <= MOST_TURNS)
        });
        Self {
            span: overview.span().map(seconds),
            receivers,
            received: received.collect(),
            searches,
            notices: rest(&overview.notices, &mut mark.notices).iter().map(notice).collect(),
        }
    }

    /// Returns true if there is nothing new.
    pub(super) fn is_empty(&self) -> bool {
        self.received.is_empty()
            && self.notices.is_empty()
            && self.receivers.iter().all(|of| of.path.is_empty() && of.health.is_empty())
            && self.searches.iter().all(|search| search.beliefs.is_empty())
    }
}

impl<'a> Restruck<'a> {
    pub(super) fn of(overview: &'a Overview, replay: &'a Replay) -> Self {
        let received = overview.received.iter().map(|received| Restep {
            id: received.id.as_ref(),
            used: received.used,
            nis: rounded_nis(received),
        });
        let searches = overview.searches.iter();
        let fixes = replay.fixes.iter().map(|fix| RestruckFix {
            name: &fix.name,
            steps: fix.steps,
            estimate: (&fix.estimate).into(),
        });
        Self {
            received: received.collect(),
            searches: searches.map(|s| Search::of(s, &[], &s.beliefs)).collect(),
            fixes: fixes.collect(),
        }
    }

    pub(super) fn located(searches: &'a [SearchOverview]) -> Self {
        let fixes = searches.iter().filter_map(|search| {
            let last = search.last()?;
            let estimate = (&last.estimate).into();
            Some(RestruckFix { name: &search.name, steps: last.steps, estimate })
        });
        Self {
            received: Vec::new(),
            searches: searches.iter().map(|s| Search::of(s, &[], &s.beliefs)).collect(),
            fixes: fixes.collect(),
        }
    }
}

/// Returns the elements that are not known yet, and counts them as known.
fn rest<'a, T>(all: &'a [T], known: &mut usize) -> &'a [T] {
    let begin = std::mem::replace(known, all.len());
    all.get(begin..).unwrap_or_default()
}

fn notice(Notice { time, text, important }: &Notice) -> (f64, &str, u8) {
    (seconds(*time), text, u8::from(*important))
}

/// Decimates elements to at most [`MOST`] and the last.
fn thinned<T>(all: &[T]) -> impl Iterator<Item = &T> {
    let every = all.len().div_ceil(MOST).max(1);
    let last = all.len().saturating_sub(1);
    all.iter().enumerate().filter(move |(i, _)| i % every == 0 || *i == last).map(|(_, one)| one)
}

fn health(of: &Health) -> HealthRow {
    let percent = of.battery.map(|left| round(left, 2));
    let above_ground = of.above_ground.map(|height| (metres(height.metres), height.source));
    (seconds(of.time), percent, of.linked, of.position_sigma_m.map(metres), above_ground)
}

fn knot(knot: &Knot) -> [f64; 4] {
    let [east, north, up] = high(&knot.place);
    [seconds(knot.time), east, north, up]
}

/// Returns the interval that holds χ² with 95 %.
fn nis_95(degrees: u8) -> Option<[f64; 2]> {
    let chi_squared = ChiSquared::new(f64::from(degrees)).ok()?;
    Some([0.025, 0.975].map(|p| round(chi_squared.inverse_cdf(p), 4)))
}

impl<'a> Reception<'a> {
    fn of(received: &'a Received, with_turn: bool) -> Self {
        let modes = received.modes.as_slice().iter();
        let turn = received.turn.as_ref().filter(|_| with_turn);
        Self {
            time: seconds(received.time),
            receiver: received.receiver,
            search: received.search,
            place: high(&received.place),
            level: received.level.map(|l| [round(l.rss_dbm, 2), round(l.sigma_db, 2)]),
            bearing: (received.bearing)
                .map(|b| [radians(b.angle), radians(b.sigma), round(b.confidence, 3)]),
            modes: modes
                .map(|m| [round(m.weight, 3), radians(m.angle), radians(m.sigma)])
                .collect(),
            remark: received.remark.as_deref(),
            used: received.used,
            struck: received.struck,
            id: received.id.as_ref(),
            nis: rounded_nis(received),
            turn: turn.map(PackedTurn::of),
        }
    }
}

fn rounded_nis(received: &Received) -> Option<(f64, usize)> {
    received.nis.map(|(nis, degrees)| (round(nis, 4), degrees))
}

impl PackedTurn {
    fn of(turn: &Turn) -> Self {
        let pack = |points: &[[f64; 2]]| {
            Points::new(&points.iter().copied().map(Vector2::from).collect::<Vec<_>>())
        };
        Self {
            samples: pack(&turn.samples),
            smoothed: pack(&turn.smoothed),
            fitted: pack(&turn.fitted),
        }
    }
}

impl<'a> Search<'a> {
    fn of(search: &'a SearchOverview, truth: &[Knot], beliefs: &[Believed]) -> Self {
        let border = |outline: &Vec<Vector2<f64>>| outline.iter().map(flat).collect();
        let place = |knot: &Knot| [seconds(knot.time), metres(knot.place.x), metres(knot.place.y)];
        let mut rows: Vec<&RowResidual> = search.rows.iter().collect();
        rows.sort_by(|a, b| a.worst_first(b));
        Self {
            name: &search.name,
            outcome: search.outcome.as_deref(),
            truth: truth.iter().map(place).collect(),
            beliefs: beliefs.iter().map(Belief::of).collect(),
            smoothed: search.smoothed.iter().map(Belief::of).collect(),
            regions: (search.regions_95.iter())
                .map(|r| std::iter::once(&r.outline).chain(&r.holes).map(border).collect())
                .collect(),
            heat: search.map.as_ref().map(|map| {
                let raster = Raster::from(map).cropped(LEAST_SHARE).coarser(MOST_CELLS);
                Cells::new(&raster.cumulative(), [0.0, 1.0])
            }),
            level_map: None,
            rivals: (search.rivals.iter())
                .map(|rival| {
                    let [east, north] = flat(&rival.place);
                    [east, north, round(rival.relative_density, 3)]
                })
                .collect(),
            conformal: (search.conformal.as_ref()).map(|own| (own.fixes, round(own.ellipse, 4))),
            remarks: search.remarks.iter().map(doubt).collect(),
            of_rows: (rows.len() > MOST).then_some(rows.len()),
            rows: rows.into_iter().take(MOST).map(PageRow::of).collect(),
        }
    }
}

fn doubt(Remark { code, text }: &Remark) -> Doubt<'_> {
    (code, text)
}

impl<'a> PageRow<'a> {
    fn of(row: &'a RowResidual) -> Self {
        Self {
            file: &row.file,
            line: row.line,
            receiver: row.receiver.as_deref().filter(|receiver| !receiver.is_empty()),
            kind: row.kind,
            residual: round(row.residual, 2),
            unit: row.unit,
            p: row.p.map(rounded_p),
            left_out: row.left_out,
        }
    }
}

/// Returns a probability with two digits.
fn rounded_p(p: f64) -> f64 {
    let decimals = if p > 0.0 { 1.0 - libm::log10(p).floor() } else { 0.0 };
    #[expect(clippy::cast_possible_truncation, reason = "the logarithm of a double is below 324")]
    let decimals = decimals.clamp(0.0, 300.0) as i32;
    round(p, decimals)
}

impl Belief {
    fn of(believed: &Believed) -> Self {
        let cloud = Some(&believed.cloud).filter(|cloud| !cloud.is_empty());
        Self {
            time: seconds(believed.time),
            steps: believed.steps,
            place: flat(&believed.estimate.mean),
            ellipse: believed.ellipse_95.map(|Ellipse { semi_major, semi_minor, orientation }| {
                [metres(semi_major), metres(semi_minor), radians(orientation)]
            }),
            error: believed.error_m.map(metres),
            cloud: cloud.map(|cloud| Points::new(cloud)),
        }
    }
}
