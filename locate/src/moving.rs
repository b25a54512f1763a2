use core::f64::consts::{LN_10, PI};

use foxhunt_core::{
    ByQuantity, Estimate, Intake, MeasurementModel, Observation, Pose, Quantity, Reception,
    Receptions, angle, elementary,
    parameter::positive,
    vectorised::{self, Kernel},
};
use foxhunt_filters::{Places, PosteriorMap, TrackGrid, TrackModel};
use foxhunt_sensors::BearingOnly;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::{
    Listener, LocateConfig, LocateError, Located, Measurand, Power, Residual,
    area::extent_m,
    examination::{of_nearest_mode, two_sided},
    region::regions,
};

/// Settings for tracking a moving transmitter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackingConfig {
    /// Length of a time window in seconds: what is received within it is of one place.
    pub window_s: f64,
    /// Seconds within which the receptions of one receiver count as one reading: shadowing and
    /// reflections change only as the transmitter goes some hundred metres. Errors that fall to 1/e
    /// in τ are worth a reading each 2 τ. Levels, in which the receiver's gain is, stay alike four
    /// times as long. Receivers at other places are readings of their own.
    pub correlation_s: f64,
    /// The root mean square speeds that it may have, in m/s, equally likely before.
    pub speeds_mps: Vec<f64>,
}

/// Windows of 30 s; speeds of 0.3, 1, 3 and 10 m/s, from a resting animal's to a flying one's.
impl Default for TrackingConfig {
    fn default() -> Self {
        Self { window_s: 30.0, correlation_s: 240.0, speeds_mps: vec![0.3, 1.0, 3.0, 10.0] }
    }
}

/// Track of a moving transmitter, with the probabilities of its speeds and exponents.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracked {
    /// The time of each window in which something was received, in seconds, and the place then,
    /// given all that was received before and after.
    pub places: Vec<(f64, Located)>,
    /// The speeds that it may have, in m/s, each with its probability.
    pub speeds_mps: Vec<(f64, f64)>,
    /// The path-loss exponents, each with its probability; empty without levels.
    pub exponents: Vec<(f64, f64)>,
    /// The probability on the border of the area that was searched, averaged over time.
    pub border_mass: f64,
    /// The residual of each level, bearing and silence from the place at its time.
    pub residuals: Vec<Residual>,
}

/// Tracks a transmitter that moves: levels, bearings and silences of one or several receivers,
/// brought together in time windows and smoothed over time ([`TrackGrid`]).
///
/// A level has the log-distance law with a residual of 7 dB and the tails of a Student's t of four
/// degrees of freedom, for shadowing and the body of the transmitter's carrier; where the
/// power is not known, it is averaged over powers and exponents by their evidence. A bearing has
/// its competing directions, and one in twenty points anywhere. A listener that receives nothing
/// while another does was out of reach, or lost the burst (one in ten). A reception without level,
/// bearing and silence states only that its receiver was not silent then.
///
/// # Errors
///
/// [`LocateError`] where there is too little to go by, or the receptions cannot be used.
pub fn track(
    receptions: &Receptions,
    listeners: &[Listener],
    locate: &LocateConfig,
    config: &TrackingConfig,
) -> Result<Tracked, LocateError> {
    track_watched(receptions, listeners, locate, config, &|_, _| {})
}

/// [`track`] with a `watch` that is given how many steps are done, and how many there are at most.
///
/// # Errors
///
/// As [`track`].
pub fn track_watched(
    receptions: &Receptions,
    listeners: &[Listener],
    locate: &LocateConfig,
    config: &TrackingConfig,
    watch: &dyn Fn(usize, usize),
) -> Result<Tracked, LocateError> {
    positive("window_s", config.window_s)?;
    for &speed in &config.speeds_mps {
        positive("speed_mps", speed)?;
    }
    positive("correlation_s", config.correlation_s)?;
    let mut windows = windows(receptions, listeners, config.window_s)?;
    let repeated = share_of_repeated_levels(receptions, config.correlation_s);
    share_out(&mut windows, config.correlation_s, repeated);
    let receivers: Vec<Pose> = receptions.iter().map(|r| r.receiver).collect();
    let laws = laws(&windows, locate.power, extent_m(receptions));
    let up = locate.target_up_m;
    let models: Vec<Model<'_>> = laws
        .into_iter()
        .map(|(weight, law)| Model { weight, law, up, windows: &windows })
        .collect();
    let speeds_mps = &config.speeds_mps;
    let walks: Vec<_> =
        speeds_mps.iter().map(|&speed_mps| move |seconds| walked_m2(speed_mps, seconds)).collect();
    let times: Vec<f64> = windows.iter().map(|window| window.time).collect();
    let grid = TrackGrid { margin_m: locate.margin_m, ..TrackGrid::default() };
    let bearings = |time: usize, places: &Places<'_>, out: &mut [f64]| {
        windows[time].add_bearings(places, out);
    };
    let fix = grid
        .smooth_watched(&receivers, &times, &models, &walks, bearings, watch)
        .map_err(LocateError::Track)?;
    let located = |((time, map), window): ((f64, &PosteriorMap), &Window)| {
        let place = Located {
            observations: window.received.iter().map(|received| received.count).sum(),
            border_mass: Some(map.border_mass()),
            regions_95: regions(map, 0.95),
            ..Located::at(map.about(map.median()))
        };
        (time, place)
    };
    let maps = times.iter().copied().zip(&fix.maps);
    let pairs =
        || models.iter().flat_map(|model| speeds_mps.iter().map(move |speed| (model, speed)));
    let share = |of: &dyn Fn(&Model<'_>, f64) -> Option<f64>| {
        let mut shares: Vec<(f64, f64)> = Vec::new();
        for ((model, speed_mps), probability) in pairs().zip(&fix.probabilities) {
            let Some(value) = of(model, *speed_mps) else { continue };
            match shares.iter_mut().find(|share| share.0.total_cmp(&value).is_eq()) {
                Some(share) => share.1 += probability,
                None => shares.push((value, *probability)),
            }
        }
        shares
    };
    let places: Vec<(f64, Located)> = maps.zip(&windows).map(located).collect();
    let mean = pairs().zip(&fix.probabilities).fold(None, |mean: Option<Law>, (pair, share)| {
        let Law { reference_dbm, exponent } = pair.0.law?;
        let before = mean.unwrap_or(Law { reference_dbm: 0.0, exponent: 0.0 });
        Some(Law {
            reference_dbm: before.reference_dbm + share * reference_dbm,
            exponent: before.exponent + share * exponent,
        })
    });
    Ok(Tracked {
        residuals: residuals(receptions, &places, mean, up),
        places,
        speeds_mps: share(&|_, speed_mps| Some(speed_mps)),
        exponents: share(&|model, _| model.law.map(|law| law.exponent)),
        border_mass: fix.border_mass,
    })
}

/// Returns the residuals of receptions from the places of a track, under the mean of the laws.
///
/// The p of a level is that of its Student's t, of a bearing that of its normal distribution, and
/// of a silence that of a level below the floor or a lost burst. All are widened by the place's own
/// covariance. A bearing with directions that compete has no p.
fn residuals(
    receptions: &Receptions,
    places: &[(f64, Located)],
    law: Option<Law>,
    up: f64,
) -> Vec<Residual> {
    let mut residuals = Vec::new();
    for (reception, received) in receptions.iter().enumerate() {
        let Some(at) = place_at(places, received.time) else { continue };
        let way = at.mean - received.receiver.position.xy();
        let square = (way.norm_squared() + (up - received.receiver.position.z).powi(2)).max(1.0);
        let mut add = |kind, residual, p| {
            residuals.push(Residual { reception, kind, residual, p, left_out: false });
        };
        let level = received.any_level().map(|level| level.rss_dbm);
        if let (Some(law), Some(level_dbm)) = (law, level) {
            let expected_dbm = law.reference_dbm - 5.0 * law.exponent * libm::log10(square);
            let slope = way * (10.0 * law.exponent / (LN_10 * square));
            let of_place = slope.dot(&(at.covariance * slope)).max(0.0);
            let apart = level_dbm - expected_dbm;
            let below = students_below(apart / libm::hypot(LEVEL_SCALE_DB, of_place.sqrt()));
            let tail = 2.0 * below.min(1.0 - below);
            match (received.level, received.silence) {
                (Some(_), _) => add(Measurand::Level, apart, Some(tail)),
                (None, Some(_)) => {
                    let p = LOST + (1.0 - LOST) * below;
                    add(Measurand::Silence, apart.min(0.0), Some(p));
                }
                (None, None) => add(Measurand::Saturation, apart.max(0.0), Some(1.0 - below)),
            }
        }
        if let Some(nearest) = of_nearest_mode(&received, &at.mean) {
            add(Measurand::Bearing, nearest, None);
        } else if let Some(bearing) = received.bearing {
            let across = Vector2::new(-way.y, way.x) / square;
            let of_place = across.dot(&(at.covariance * across)).max(0.0);
            let residual = angle::wrap(bearing.angle - libm::atan2(way.y, way.x));
            let deviation = residual / libm::hypot(bearing.sigma, of_place.sqrt());
            add(Measurand::Bearing, residual, two_sided(deviation));
        }
    }
    residuals
}

/// Returns the place of a track at a time: between its neighbours in time, or the first or last.
fn place_at(places: &[(f64, Located)], time: f64) -> Option<Estimate<2>> {
    let next = places.partition_point(|(own, _)| *own < time);
    let after = places.get(next);
    let Some((from, before)) = next.checked_sub(1).and_then(|last| places.get(last)) else {
        return after.map(|(_, located)| located.estimate);
    };
    let Some((to, after)) = after else { return Some(before.estimate) };
    let share = (time - from) / (to - from);
    let [before, after] = [before.estimate, after.estimate];
    Some(Estimate {
        mean: before.mean.lerp(&after.mean, share),
        covariance: before.covariance * (1.0 - share) + after.covariance * share,
    })
}

/// Returns what [`track`] needs of a reception that it shall not use: that something was received,
/// or might have been. Without it the receiver would count as silent.
#[must_use]
pub fn left_out(reception: &Reception) -> Reception {
    let Reception { beacon, time, receiver, .. } = *reception;
    Reception { beacon, time, receiver, ..Reception::default() }
}

/// Readings of a receiver that has moved by less than this are of one place, in metres.
const APART_M: f64 = 25.0;

/// The scale of a level's residual in dB; with four degrees of freedom σ is 7 dB (3GPP TR 38.901,
/// table 7.4.1-1: 4 to 8 dB).
const LEVEL_SCALE_DB: f64 = 5.0;

/// σ of a known power's error over a whole track, in dB: how the transmitter is worn and held, and
/// where it goes.
const COMMON_SIGMA_DB: f64 = 8.0;

/// Share of bursts that a listener within reach loses.
const LOST: f64 = 0.1;

/// Share of bearings that point anywhere, reflections that the extractor did not find among them.
const OUTLIERS: f64 = 0.05;

/// Time in which the correlation of the transmitter's velocity falls to 1/e, in seconds.
const PERSISTENCE_S: f64 = 60.0;

/// Receptions and silences of a time window.
#[derive(Debug)]
struct Window {
    /// The mean time of its receptions.
    time: f64,
    received: Vec<Received>,
    silent: Vec<Silent>,
}

/// A receiver that received nothing.
#[derive(Debug)]
struct Silent {
    listener: Listener,
    /// Part that is new, as of [`Received::level_share`].
    share: f64,
}

/// Receptions of a receiver in one place.
#[derive(Debug)]
struct Received {
    receiver: Pose,
    /// Part that is new: the rest has the errors of the window before in which the receiver
    /// received or was silent.
    share: f64,
    /// Part of the level that is new.
    level_share: f64,
    count: usize,
    /// The sum of the levels, and how many there are.
    levels: (f64, u32),
    bearings: Vec<Observation<1>>,
}

impl Received {
    fn level_dbm(&self) -> Option<f64> {
        let (sum, count) = self.levels;
        (count > 0).then(|| sum / f64::from(count))
    }
}

/// Returns the part of a level that is new after another one of the same receiver within
/// `correlation_s`, by how much the two differ: an autoregressive error whose neighbours correlate
/// by ρ is worth (1 − ρ)/(1 + ρ) of an independent one (Bayley & Hammersley 1946), and half the
/// mean squared difference of neighbours is σ² (1 − ρ). Zero where too few levels tell, and without
/// a network: the levels of one or two receivers follow no single law, and count for little.
fn share_of_repeated_levels(receptions: &Receptions, correlation_s: f64) -> f64 {
    let mut last: Vec<(Pose, f64, f64)> = Vec::new();
    let mut differences: Vec<f64> = Vec::new();
    for (_, reception) in receptions.in_time() {
        let Some(level) = reception.level else { continue };
        let here = reception.receiver;
        let near =
            |(at, ..): &&mut (Pose, f64, f64)| (at.position - here.position).norm() < APART_M;
        match last.iter_mut().rev().find(near) {
            Some((_, before_s, before_dbm)) => {
                if (f64::MIN_POSITIVE..correlation_s).contains(&(reception.time - *before_s)) {
                    differences.push((level.rss_dbm - *before_dbm).abs());
                }
                (*before_s, *before_dbm) = (reception.time, level.rss_dbm);
            }
            None => last.push((here, reception.time, level.rss_dbm)),
        }
    }
    if differences.len() < LEAST_DIFFERENCES || last.len() < LEAST_RECEIVERS {
        return 0.0;
    }
    differences.sort_by(f64::total_cmp);
    let Some(median) = differences.get(differences.len() / 2) else { return 0.0 };
    let half_square = 0.5 * (median / QUARTILE).powi(2);
    let correlation = (1.0 - half_square / SHADOWING_DB.powi(2)).max(0.0);
    (1.0 - correlation) / (1.0 + correlation)
}

/// Least number of level differences from which their correlation is estimated.
const LEAST_DIFFERENCES: usize = 20;

/// Places of receivers that make a network.
const LEAST_RECEIVERS: usize = 3;

/// Median of the absolute value of a standard normal.
const QUARTILE: f64 = 0.674_49;

/// σ of shadowing in dB, for which differences of neighbours are judged.
const SHADOWING_DB: f64 = 6.0;

/// Sets the shares of readings that follow others of the same receiver within `correlation_s`;
/// `repeated` is the least share of a level.
fn share_out(windows: &mut [Window], correlation_s: f64, repeated: f64) {
    let mut last: Vec<(Pose, f64)> = Vec::new();
    for window in windows {
        // A share of bearings, where there are any, and one of levels.
        let mut shares: Vec<(Pose, Option<&mut f64>, &mut f64)> = Vec::new();
        for Received { receiver, share, level_share, .. } in &mut window.received {
            *level_share = repeated;
            shares.push((*receiver, Some(share), level_share));
        }
        for Silent { listener, share } in &mut window.silent {
            *share = 0.0;
            shares.push((listener.receiver, None, share));
        }
        let mut now: Vec<usize> = Vec::new();
        for (receiver, of_bearings, of_levels) in shares {
            let near =
                |(at, _): &(Pose, f64)| (at.position - receiver.position).norm() < SAME_SHADOWS_M;
            let known = last.iter().rposition(near).unwrap_or_else(|| {
                last.push((receiver, f64::NEG_INFINITY));
                last.len() - 1
            });
            let before = last.get(known).map_or(f64::NEG_INFINITY, |(_, before)| *before);
            let share = (window.time - before) / correlation_s;
            if let Some(of_bearings) = of_bearings {
                *of_bearings = share.min(1.0);
            }
            *of_levels = of_levels.max((share / LEVELS_LONGER).min(1.0));
            now.push(known);
        }
        for known in now {
            if let Some((_, before)) = last.get_mut(known) {
                *before = window.time;
            }
        }
    }
}

/// Time for which a receiver's levels err alike over that for which its bearings do: its gain, and
/// what stands about it, stay.
const LEVELS_LONGER: f64 = 4.0;

/// Distance between receivers in metres below which they are shadowed alike.
const SAME_SHADOWS_M: f64 = 50.0;

fn windows(
    receptions: &Receptions,
    listeners: &[Listener],
    window_s: f64,
) -> Result<Vec<Window>, LocateError> {
    let mut windows: Vec<Window> = Vec::new();
    let mut of_window: Vec<(usize, Reception)> = Vec::new();
    let mut ordered = receptions.in_time().peekable();
    while let Some(first) = ordered.peek().map(|(_, reception)| reception.time) {
        of_window.clear();
        while let Some(next) = ordered.next_if(|(_, r)| r.time < first + window_s) {
            of_window.push(next);
        }
        let window = Window::of(&of_window, listeners, first + window_s)?;
        if !window.received.is_empty() {
            windows.push(window);
        }
    }
    if windows.is_empty() {
        return Err(LocateError::Nothing { receptions: receptions.len() });
    }
    Ok(windows)
}

impl Window {
    fn of(
        receptions: &[(usize, Reception)],
        listeners: &[Listener],
        until: f64,
    ) -> Result<Self, LocateError> {
        let mut received = Vec::<Received>::new();
        let mut silent = Vec::<Silent>::new();
        let mut heard: Vec<Pose> = Vec::new();
        let mut sum_s = 0.0;
        let mut count = 0.0;
        let mut first = f64::INFINITY;
        for (index, reception) in receptions {
            let bearing = ByQuantity([Quantity::BEARING]).observation(reception);
            let bearing = bearing.map_err(|source| LocateError::Reception {
                index: *index,
                time: reception.time,
                source: source.into(),
            })?;
            let here = reception.receiver;
            let time = reception.time;
            if let Some(floor) = reception.silence {
                let floor_dbm = floor.rss_dbm;
                let listener = Listener { receiver: here, from: time, until: time, floor_dbm };
                silent.push(Silent { listener, share: 1.0 });
                continue;
            }
            (sum_s, count, first) = (sum_s + time, count + 1.0, first.min(time));
            heard.push(here);
            if bearing.is_none() && reception.level.is_none() {
                continue;
            }
            let same = |received: &&mut Received| {
                (received.receiver.position - here.position).norm() < APART_M
            };
            let of_place = match received.iter_mut().find(same) {
                Some(of_place) => of_place,
                None => {
                    received.push(Received {
                        receiver: here,
                        share: 1.0,
                        level_share: 1.0,
                        count: 0,
                        levels: (0.0, 0),
                        bearings: Vec::new(),
                    });
                    let Some(of_place) = received.last_mut() else { continue };
                    of_place
                }
            };
            of_place.count += 1;
            if let Some(level) = reception.level {
                of_place.levels.0 += level.rss_dbm;
                of_place.levels.1 += 1;
            }
            of_place.bearings.extend(bearing);
        }
        // A place that also received something within the window was not silent in it.
        let quiet = |silent: &Silent| {
            let from = silent.listener.receiver.position;
            let away = |heard: &Pose| (heard.position - from).norm() >= APART_M;
            heard.iter().all(away)
        };
        let listens = |listener: &&Listener| listener.from <= first && until <= listener.until;
        let without = |listener: &Listener| Silent { listener: *listener, share: 1.0 };
        silent.extend(listeners.iter().filter(listens).map(without));
        silent.retain(quiet);
        Ok(Self { time: sum_s / count, received, silent })
    }

    /// Adds the log likelihood of the bearings.
    fn add_bearings(&self, places: &Places<'_>, out: &mut [f64]) {
        let Ok(model) = BearingOnly::new().with_outliers(OUTLIERS) else { return };
        for received in self.received.iter().filter(|received| !received.bearings.is_empty()) {
            #[expect(clippy::cast_precision_loss, reason = "readings of a window are few")]
            let share = received.share / received.bearings.len() as f64;
            for bearing in &received.bearings {
                add_bearing(&model, bearing, share, places, out);
            }
        }
    }
}

/// Adds a share of the log likelihood of a bearing. From near, a cell is seen over some angle, by
/// which σ grows.
fn add_bearing(
    model: &BearingOnly,
    bearing: &Observation<1>,
    share: f64,
    places: &Places<'_>,
    out: &mut [f64],
) {
    let from = bearing.receiver().position;
    let variance = bearing.noise()[(0, 0)];
    // Places whose σ is alike, up to where it is that of any direction.
    let class = |(east, north): (&f64, &f64)| {
        let square = (east - from.x).powi(2) + (north - from.y).powi(2);
        let seen = (places.variance_m2() / square).min(PI * PI / 3.0);
        (CLASSES_AN_OCTAVE * libm::log2(1.0 + seen / variance)).round()
    };
    let classes: Vec<f64> = places.east.iter().zip(places.north).map(class).collect();
    let mut order: Vec<usize> = (0..classes.len()).collect();
    order.sort_by(|&a, &b| classes[a].total_cmp(&classes[b]));
    for alike in order.chunk_by(|&a, &b| classes[a].total_cmp(&classes[b]).is_eq()) {
        let octaves = alike.first().map_or(0.0, |&first| classes[first] / CLASSES_AN_OCTAVE);
        let wider = bearing.with_noise_scaled(0, (0.5 * octaves).exp2());
        let column = |of: &[f64]| -> Vec<f64> { alike.iter().map(|&i| of[i]).collect() };
        let (east, north, mut one) =
            (column(places.east), column(places.north), vec![0.0; alike.len()]);
        MeasurementModel::<2, 1>::log_likelihoods(model, [&east, &north], &wider, &mut one);
        alike.iter().zip(&one).for_each(|(&i, one)| out[i] += share * one);
    }
}

/// Variances of bearings that differ by less than half of an octave over this count as alike.
const CLASSES_AN_OCTAVE: f64 = 4.0;

/// Log-distance law of the levels.
#[derive(Clone, Copy, Debug)]
struct Law {
    reference_dbm: f64,
    exponent: f64,
}

/// Errors of a known reference power, in its σ.
const OFFSETS: [f64; 9] = [-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0];

/// Least share of the mean exponent that a node of it may be.
const LEAST_SHARE_OF_EXPONENT: f64 = 0.1;

/// The laws that may hold, each with its prior weight; one `None` without levels.
fn laws(windows: &[Window], power: Power, extent_m: f64) -> Vec<(f64, Option<Law>)> {
    let received = || windows.iter().flat_map(|window| &window.received);
    let mut levels: Vec<f64> = received().filter_map(Received::level_dbm).collect();
    levels.sort_by(f64::total_cmp);
    let Some(&median) = levels.get(levels.len() / 2) else { return vec![(1.0, None)] };
    let exponents: Vec<(f64, f64)> = match power {
        Power::Known { reference_dbm, exponent } => {
            let law = |offset: f64| {
                let reference_dbm = reference_dbm + COMMON_SIGMA_DB * offset;
                (libm::exp(-0.5 * offset * offset), Some(Law { reference_dbm, exponent }))
            };
            return OFFSETS.map(law).to_vec();
        }
        Power::Calibrated(calibrated) => {
            let centroid = calibrated.centroid();
            let sigma_db = libm::hypot(COMMON_SIGMA_DB, centroid.variance.sqrt());
            // Gauss and Hermite's three nodes of a normal distribution.
            let exponents = [(-3.0_f64.sqrt(), 1.0), (0.0, 4.0), (3.0_f64.sqrt(), 1.0)];
            let known = centroid.exponent_sigma <= 0.0;
            let exponents = exponents.into_iter().filter(|(node, _)| !known || *node == 0.0);
            let laws = exponents.flat_map(|(node, weight)| {
                let exponent = (centroid.exponent + node * centroid.exponent_sigma)
                    .max(LEAST_SHARE_OF_EXPONENT * centroid.exponent);
                OFFSETS.map(|offset: f64| {
                    let reference_dbm = centroid.reference_dbm(exponent) + sigma_db * offset;
                    let law = Law { reference_dbm, exponent };
                    (weight * libm::exp(-0.5 * offset * offset), Some(law))
                })
            });
            return laws.collect();
        }
        Power::FreeReference { exponent } => vec![(exponent, 1.0)],
        // N(2.3, 0.5²), as for transmitters that stand still.
        Power::Free => [1.8, 2.4, 3.0]
            .map(|exponent: f64| (exponent, libm::exp(-2.0 * (exponent - 2.3).powi(2))))
            .to_vec(),
    };
    // The power is such that the median level comes from 30 m, 42 m … 5.4 km, and beyond from no
    // farther than the receivers are apart.
    let mut ranges_m = vec![30.0];
    let most_m = extent_m.max(5_400.0);
    while let Some(range_m) = ranges_m.last().map(|range_m| range_m * core::f64::consts::SQRT_2)
        && range_m < most_m
    {
        ranges_m.push(range_m);
    }
    let laws = exponents.into_iter().flat_map(|(exponent, weight)| {
        let law = move |range_m: f64| {
            let reference_dbm = median + 10.0 * exponent * libm::log10(range_m);
            (weight, Some(Law { reference_dbm, exponent }))
        };
        ranges_m.iter().copied().map(law).collect::<Vec<_>>()
    });
    laws.collect()
}

/// The variance in m² of the way on each axis after some seconds, at a root mean square speed: a
/// velocity that forgets itself (Uhlenbeck & Ornstein 1930; for animals Johnson et al. 2008).
fn walked_m2(speed_mps: f64, seconds: f64) -> f64 {
    let forgotten = -libm::expm1(-seconds / PERSISTENCE_S);
    speed_mps.powi(2) * PERSISTENCE_S * (seconds - PERSISTENCE_S * forgotten)
}

/// A law that the levels of some windows may follow.
#[derive(Clone, Copy, Debug)]
struct Model<'a> {
    weight: f64,
    law: Option<Law>,
    up: f64,
    windows: &'a [Window],
}

impl TrackModel for Model<'_> {
    fn weight(&self) -> f64 {
        self.weight
    }

    fn add_log_likelihoods(&self, time: usize, places: &Places<'_>, out: &mut [f64]) {
        let (Some(law), Some(window)) = (self.law, self.windows.get(time)) else { return };
        for received in &window.received {
            let Some(level_dbm) = received.level_dbm() else { continue };
            let law = ExpectedLevel::new(law, self.up, &received.receiver, places);
            let share = received.level_share;
            vectorised::run(OfLevel { law, level_dbm, share, places, out });
        }
        for silent in &window.silent {
            let Listener { receiver, floor_dbm, .. } = &silent.listener;
            let law = ExpectedLevel::new(law, self.up, receiver, places);
            let floor_dbm = *floor_dbm;
            vectorised::run(OfSilence { law, floor_dbm, share: silent.share, places, out });
        }
    }
}

/// The level that a receiver expects from each cell.
#[derive(Clone, Copy, Debug)]
struct ExpectedLevel {
    reference_dbm: f64,
    /// Decibels per unit of the logarithm of the squared range.
    slope: f64,
    receiver: [f64; 2],
    height_square: f64,
    nearest_square: f64,
    /// Square of the deviation of a cell's level at a range of 1 m, over the scale.
    spread: f64,
}

impl ExpectedLevel {
    fn new(law: Law, up: f64, receiver: &Pose, places: &Places<'_>) -> Self {
        let slope = 5.0 * law.exponent / LN_10;
        Self {
            reference_dbm: law.reference_dbm,
            slope,
            receiver: [receiver.position.x, receiver.position.y],
            height_square: (up - receiver.position.z).powi(2),
            nearest_square: (0.25 * places.cell_m * places.cell_m).max(1.0),
            spread: places.variance_m2() * (2.0 * slope / LEVEL_SCALE_DB).powi(2),
        }
    }

    /// Returns a level's residual over its scale, and the factor by which the cell widens the
    /// scale's square: 1 where that adds less than a hundredth.
    #[inline(always)]
    fn residual(&self, level_dbm: f64, east: f64, north: f64) -> (f64, f64) {
        let x = east - self.receiver[0];
        let y = north - self.receiver[1];
        let square = x * x + y * y + self.height_square;
        let square = if square > self.nearest_square { square } else { self.nearest_square };
        let expected_dbm = self.reference_dbm - self.slope * elementary::ln(square);
        let residual = (level_dbm - expected_dbm) / LEVEL_SCALE_DB;
        let widened = if square > 100.0 * self.spread { 1.0 } else { 1.0 + self.spread / square };
        (residual, widened)
    }
}

/// Adds the log-likelihood of a level: Student's t of four degrees of freedom.
struct OfLevel<'a, 'b> {
    law: ExpectedLevel,
    level_dbm: f64,
    share: f64,
    places: &'a Places<'b>,
    out: &'a mut [f64],
}

impl Kernel for OfLevel<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let half_share = 0.5 * self.share;
        let places = self.places.east.iter().zip(self.places.north);
        for (out, (east, north)) in self.out.iter_mut().zip(places) {
            let (residual, widened) = self.law.residual(self.level_dbm, *east, *north);
            // Of t = residual / √widened, with the density's own 1 / √widened: a power of
            // squares⁵ / widened⁴.
            let squares = widened + 0.25 * residual * residual;
            let ratio = (squares / widened) * (squares / widened);
            *out -= half_share * elementary::ln(ratio * ratio * squares);
        }
    }
}

/// Adds the log-likelihood of a silence: the level is below the floor, or the signal was lost.
struct OfSilence<'a, 'b> {
    law: ExpectedLevel,
    floor_dbm: f64,
    share: f64,
    places: &'a Places<'b>,
    out: &'a mut [f64],
}

impl Kernel for OfSilence<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let places = self.places.east.iter().zip(self.places.north);
        for (out, (east, north)) in self.out.iter_mut().zip(places) {
            let (residual, widened) = self.law.residual(self.floor_dbm, *east, *north);
            let below = students_below(residual / elementary::sqrt(widened));
            *out += self.share * elementary::ln(LOST + (1.0 - LOST) * below);
        }
    }
}

/// The probability of less than `t` under Student's t of four degrees of freedom.
#[inline(always)]
fn students_below(t: f64) -> f64 {
    let square = 1.0 + 0.25 * t * t;
    0.5 + 0.375 * (t / elementary::sqrt(square)) * (1.0 - t * t / (12.0 * square))
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use foxhunt_core::{Bearing, Level};
    use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::StandardNormal;
    use statrs::distribution::{ContinuousCDF, StudentsT};

    use super::*;

    #[test]
    fn the_distribution_is_students() {
        let students = StudentsT::new(0.0, 1.0, 4.0).expect("a distribution");
        for t in [-7.0, -1.3, -0.2, 0.0, 0.4, 2.0, 11.0] {
            assert!(abs_diff_eq!(students_below(t), students.cdf(t), epsilon = 1e-9), "{t}");
        }
    }

    /// A receiver 30 m up, and cells of 20 m: σ of a place is 20 m / √12 on each axis.
    #[test]
    fn a_cell_expects_its_level_and_widens_the_scale_where_it_is_near() {
        let law = Law { reference_dbm: -30.0, exponent: 2.5 };
        let places = Places { east: &[], north: &[], cell_m: 20.0 };
        let expected = ExpectedLevel::new(law, 0.0, &Pose::at(100.0, 0.0, 30.0), &places);
        for east in [140.0_f64, 200.0, 1100.0] {
            let range = (east - 100.0).hypot(30.0);
            let (residual, widened) = expected.residual(-70.0, east, 0.0);
            let off_db = -70.0 - (-30.0 - 25.0 * range.log10());
            assert_abs_diff_eq!(residual, off_db / LEVEL_SCALE_DB, epsilon = 1e-9);
            // dL/dr is 10 γ / (r ln 10).
            let of_cell_db = 25.0 / LN_10 / range * (400.0_f64 / 12.0).sqrt();
            let square = (of_cell_db / LEVEL_SCALE_DB).powi(2);
            let widens = if square < 0.01 { 1.0 } else { 1.0 + square };
            assert_abs_diff_eq!(widened, widens, epsilon = 1e-12);
        }
    }

    /// Three stations, each of which receives down to −95 dBm.
    const STATIONS: [[f64; 2]; 3] = [[0.0, 0.0], [900.0, 100.0], [300.0, 800.0]];

    /// An error that is forgotten over `memory_s`, of σ 1.
    fn next_error(error: f64, dt: f64, memory_s: f64, rng: &mut Xoshiro256PlusPlus) -> f64 {
        let kept = (-dt / memory_s).exp();
        let new: f64 = rng.sample(StandardNormal);
        kept * error + (1.0 - kept * kept).sqrt() * new
    }

    /// Receptions of a burst each 20 s from a transmitter that walks at 1 m/s, and its places:
    /// levels of P₀ −25 dBm and exponent 2.6 with σ 6 dB, bearings with σ 15°.
    fn walk(seed: u64, memory_s: f64) -> (Vec<Reception>, Vec<(f64, Vector2<f64>)>) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut place = Vector2::new(400.0, 300.0);
        let mut velocity = [0.7, 0.1];
        let mut errors = [[0.0; 2]; 3];
        let mut received = Vec::new();
        let mut way = Vec::new();
        let sigma = 15.0_f64.to_radians();
        for burst in 0..40 {
            let time = 20.0 * f64::from(burst);
            for (station, errors) in STATIONS.iter().zip(&mut errors) {
                for error in errors.iter_mut() {
                    *error = next_error(*error, 20.0, memory_s, &mut rng);
                }
                let ahead = place - Vector2::from(*station);
                let rss_dbm = -25.0 - 26.0 * ahead.norm().log10() + 6.0 * errors[0];
                if rss_dbm > -95.0 {
                    let angle = ahead.y.atan2(ahead.x) + sigma * errors[1];
                    received.push(Reception {
                        time,
                        receiver: Pose::at(station[0], station[1], 0.0),
                        level: Some(Level { rss_dbm, sigma_db: 6.0 }),
                        bearing: Some(Bearing { angle, sigma, confidence: 1.0 }),
                        ..Reception::default()
                    });
                }
            }
            way.push((time, place));
            velocity = velocity.map(|v| 0.71 * next_error(v / 0.71, 20.0, 60.0, &mut rng));
            place += Vector2::from(velocity) * 20.0;
        }
        (received, way)
    }

    fn listeners() -> Vec<Listener> {
        let listens = |[east, north]: [f64; 2]| Listener {
            receiver: Pose::at(east, north, 0.0),
            from: 0.0,
            until: 800.0,
            floor_dbm: -95.0,
        };
        STATIONS.map(listens).to_vec()
    }

    fn follow(
        received: &[Reception],
        listeners: &[Listener],
        locate: &LocateConfig,
        config: &TrackingConfig,
    ) -> Result<Tracked, LocateError> {
        track(&received.into(), listeners, locate, config)
    }

    /// Errors, NEES and whether the ellipse holds the truth, over all places of some tracks.
    fn judged(tracks: u64, memory_s: f64, config: &TrackingConfig) -> (f64, f64, f64) {
        let mut error = 0.0;
        let mut nees = 0.0;
        let mut held = 0.0;
        let mut count = 0.0;
        for seed in 0..tracks {
            let (received, way) = walk(700 + seed, memory_s);
            let tracked = follow(&received, &listeners(), &LocateConfig::default(), config);
            for (time, located) in tracked.expect("a track").places {
                // A window's time is that of its bursts on average: between two of them.
                let at = |&&(other, _): &&(f64, Vector2<f64>)| other <= time + 1e-9;
                let (before, from) = *way.iter().rfind(at).expect("a burst before");
                let to = way.iter().find(|(other, _)| *other > time).map_or(from, |(_, to)| *to);
                let truth = from.lerp(&to, (time - before) / 20.0);
                error += (located.estimate.mean - truth).norm();
                nees += located.estimate.nees(&truth).expect("a covariance");
                held += f64::from(u8::from(located.ellipse_95_holds(&truth) == Some(true)));
                count += 1.0;
            }
        }
        (error / count, nees / count, held / count)
    }

    #[test]
    fn ellipses_of_a_network_hold_what_they_promise() {
        // Every burst has errors of its own, so that a window of one burst is a reading.
        let alone =
            TrackingConfig { window_s: 15.0, correlation_s: 15.0, ..TrackingConfig::default() };
        let (error_m, nees, held) = judged(5, 1e-3, &alone);
        assert!(error_m < 60.0, "{error_m} m off");
        assert!((0.8..2.4).contains(&nees) && held > 0.93, "mean NEES {nees}, {held} held");
        // Errors that stay for minutes, as those of reflections do, and the defaults: an error that
        // falls to 1/e in 120 s has as many independent readings as one in 240 s.
        let (error_m, nees, held) = judged(16, 120.0, &TrackingConfig::default());
        assert!(error_m < 150.0, "{error_m} m off");
        assert!((1.0..3.2).contains(&nees) && held > 0.85, "mean NEES {nees}, {held} held");
        // Taken for independent, such errors make ellipses that are too small.
        let (_, nees, held) = judged(6, 240.0, &alone);
        assert!(nees > 4.0 && held < 0.75, "mean NEES {nees}, {held} held");
    }

    /// Seven nodes on a ring of 400 m hear a tag that walks at 1 m/s one after the other, each
    /// every 70 s with shadowing that stays for two minutes.
    fn in_turns(seed: u64) -> (Vec<Reception>, Vec<Vector2<f64>>) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut shadows: [f64; 7] = std::array::from_fn(|_| rng.sample(StandardNormal));
        let mut received = Vec::new();
        let mut way = Vec::new();
        for burst in 0..140_u16 {
            let time = 10.0 * f64::from(burst);
            let place = Vector2::new(-250.0 + 0.3 * time, 120.0 * (0.004 * time).sin());
            for shadow in &mut shadows {
                *shadow = next_error(*shadow, 10.0, 120.0, &mut rng);
            }
            let node = usize::from(burst % 7);
            let angle = 2.0 * PI * f64::from(burst % 7) / 7.0;
            let receiver = Pose::at(400.0 * angle.cos(), 400.0 * angle.sin(), 2.0);
            let range_m = (place - receiver.position.xy()).norm();
            let rss_dbm = -25.0 - 26.0 * range_m.log10() + 6.0 * shadows[node];
            let level = Some(Level { rss_dbm, sigma_db: 6.0 });
            received.push(Reception { time, receiver, level, ..Reception::default() });
            way.push(place);
        }
        (received, way)
    }

    #[test]
    fn receivers_that_hear_in_turns_are_readings_of_their_own() {
        let config = TrackingConfig { window_s: 5.0, ..TrackingConfig::default() };
        let mut errors = Vec::new();
        let mut majors = Vec::new();
        let mut held = 0;
        for seed in 0..6 {
            let (received, way) = in_turns(seed);
            let tracked = follow(&received, &[], &LocateConfig::default(), &config);
            for ((_, located), truth) in tracked.expect("a track").places.iter().zip(&way) {
                errors.push((located.estimate.mean - truth).norm());
                majors.push(located.ellipse_95().map_or(f64::INFINITY, |e| e.semi_major));
                held += usize::from(located.ellipse_95_holds(truth) == Some(true));
            }
        }
        let count = errors.len();
        errors.sort_by(f64::total_cmp);
        majors.sort_by(f64::total_cmp);
        let error_m = errors[count / 2];
        let major_m = majors[count / 2];
        // On coarse cells a tag far away explained as much: 1.2 km off, with ellipses of 4 km.
        assert!(error_m < 160.0 && major_m < 450.0, "{error_m} m, {major_m} m");
        assert!(held * 100 >= 90 * count, "{held} of {count}");
    }

    #[test]
    fn silence_is_a_reading() {
        // One station receives levels alone: the transmitter is on a circle about it, but not near
        // the others, which receive nothing.
        let receiver = Pose::at(0.0, 0.0, 0.0);
        let level = Some(Level { rss_dbm: -90.0, sigma_db: 6.0 });
        let at = |time: f64| Reception { time, receiver, level, ..Reception::default() };
        let received: Vec<Reception> = (0..6).map(|i| at(10.0 + 200.0 * f64::from(i))).collect();
        let power = Power::Known { reference_dbm: -25.0, exponent: 2.6 };
        let config = LocateConfig { power, ..LocateConfig::default() };
        let mean_of = |received: &[Reception], listeners: &[Listener]| {
            let tracked = follow(received, listeners, &config, &TrackingConfig::default());
            let places = tracked.expect("a track").places;
            places.iter().map(|(_, located)| located.estimate.mean.sum()).sum::<f64>() / 6.0_f64
        };
        let mean = |listeners: &[Listener]| mean_of(&received, listeners);
        let without = mean(&[]);
        let with = mean(&listeners());
        assert_abs_diff_eq!(without, 0.0, epsilon = 40.0);
        assert!(with < -80.0, "{with}: away from the silent stations in the north-east");
        // What they received is struck out: they were not silent for that.
        let theirs = received.iter().flat_map(|one| {
            let at = |listener: Listener| Reception { receiver: listener.receiver, ..*one };
            listeners().into_iter().map(at)
        });
        let struck: Vec<Reception> = theirs.map(|one| left_out(&one)).collect();
        let received = [received.clone(), struck].concat();
        let without = mean_of(&received, &[]);
        let with = mean_of(&received, &listeners());
        assert_abs_diff_eq!(with, without, epsilon = 1e-6);
    }

    /// Five bearings that meet within metres, and one a minute later, when it may be anywhere in a
    /// kilometre: the cells of that search are larger than what the first ones tell.
    #[test]
    fn the_wrong_bearing_of_a_track_has_the_least_p() {
        let mut p = Vec::new();
        for seed in 0..6 {
            let (mut received, _) = walk(seed, 1e-3);
            let turned = received.len() / 2;
            if let Some(bearing) = &mut received[turned].bearing {
                bearing.angle = angle::wrap(bearing.angle + 1.5);
            }
            let tracked = follow(
                &received,
                &listeners(),
                &LocateConfig::default(),
                &TrackingConfig::default(),
            );
            let of = |kind| move |own: &&Residual| own.kind == kind;
            let rows = tracked.expect("a track").residuals;
            let bearings: Vec<_> = rows.iter().filter(of(Measurand::Bearing)).collect();
            assert_eq!(bearings.len(), received.len());
            let worst = bearings.iter().min_by(|a, b| a.p.partial_cmp(&b.p).expect("numbers"));
            let worst = worst.expect("there are some");
            assert_eq!(worst.reception, turned, "seed {seed}");
            assert!((0.9..2.1).contains(&worst.residual) && worst.p < Some(1e-2), "{worst:?}");
            p.extend(rows.iter().filter(of(Measurand::Level)).filter_map(|own| own.p));
        }
        // Of residuals with a true σ one in twenty is below 5 %; the 7 dB of the law are more than
        // the 6 dB here.
        let small = p.iter().filter(|p| **p < 0.05).count();
        assert!(p.len() > 200 && small < p.len() / 20, "{small} of {}", p.len());
    }

    #[test]
    fn a_wide_search_does_not_lose_a_sharp_place() {
        let places = [(0.0, 0.0), (60.0, 0.0), (0.0, 60.0), (60.0, 60.0), (40.0, 0.0), (20.0, 0.0)];
        for size in [1.0, 1.5, 2.0, 5.0] {
            let truth = size * Vector2::new(40.0, 30.0);
            let mut times = [0.0, 0.0, 0.0, 0.0, 0.0, 60.0].iter();
            let received = places.map(|(east, north)| {
                let receiver = Pose::at(size * east, size * north, 0.0);
                let angle = f64::atan2(truth.y - size * north, truth.x - size * east);
                let bearing = Some(Bearing { angle, sigma: 0.1, confidence: 1.0 });
                let time = times.next().copied().unwrap_or_default();
                Reception { time, receiver, bearing, ..Reception::default() }
            });
            let locate = LocateConfig::default();
            let config = TrackingConfig::default();
            let tracked = follow(&received, &[], &locate, &config).expect("a track");
            let (_, first) = &tracked.places[0];
            assert!(first.ellipse_95_holds(&truth) == Some(true), "{first:?}");
            let major = first.ellipse_95().map_or(f64::INFINITY, |ellipse| ellipse.semi_major);
            assert!(major < 100.0, "{major} m for a base of {size}");
        }
    }

    #[test]
    fn bad_input_is_named() {
        let config = TrackingConfig::default();
        let refused = |received: &[Reception], config: &TrackingConfig| {
            let error = follow(received, &[], &LocateConfig::default(), config);
            error.expect_err("refused").to_string()
        };
        assert!(refused(&[], &config).contains("0 receptions"));
        let window = TrackingConfig { window_s: 0.0, ..config.clone() };
        assert!(refused(&[], &window).contains("window_s"));
        let speed = TrackingConfig { speeds_mps: vec![f64::NAN], ..config.clone() };
        assert!(refused(&[], &speed).contains("speed_mps"));
        let none = TrackingConfig { speeds_mps: Vec::new(), ..config };
        let (received, _) = walk(1, 1.0);
        assert!(refused(&received, &none).contains("0 walks"));
    }
}
