//! Examination of an answer by the receptions that it was made from.
//!
//! Every answer to a still transmitter comes here before anybody sees it: do the measurements
//! meet, does one of them contradict the others, does the place fit them, and do they fix a
//! distance at all? The tests know nothing of the estimator.

mod clocks;
mod fit;
mod law;
mod levels;
mod motion;
mod open;
mod pair;
mod paths;
mod residuals;
mod shadowing;
mod shared;

use std::collections::BTreeSet;

use foxhunt_core::{Reception, Receptions, Remark};
use foxhunt_wire::geodesy::radians_to_compass_deg;

pub(crate) use self::fit::{Datum, Kind, Outliers, Scale, misfit_p, outliers, reversals};
use self::fit::{Meeting, meeting};
pub use self::residuals::{Measurand, Residual};
#[cfg(feature = "batch")]
pub(crate) use self::residuals::{of_nearest_mode, two_sided};
pub(crate) use self::shared::Name;
pub use self::shared::Uses;
use self::shared::{APART, data, is_assumed, scale, spoken};
use super::{Area, LocateConfig, Located};

/// Misfits less probable than this make a remark.
const MISFIT_P: f64 = 3e-3;

/// Reversed bearings meet if their misfit is at least this probable.
const MEETS_P: f64 = 0.01;

/// Bearings that scatter by more than this, in degrees, do not meet, whatever their σ.
const SCATTER_DEG: f64 = 25.0;

/// σ of a bearing without one of its own, in radians, for the question whether bearings meet: about
/// the largest that was measured of bearings taken by hand
/// (`foxhunt_archive::recorded::ReceptionConfig`).
const UNKNOWN_SIGMA: f64 = 15.0 * std::f64::consts::PI / 180.0;

/// Measurements that scatter by more than this many of their σ make a remark.
const SCATTER: f64 = 1.5;

/// Finds what casts doubt on an answer, and adds it to the answer's remarks. Returns the indices of
/// the receptions whose bearing, range or difference the others contradict.
pub fn examine(
    located: &mut Located,
    receptions: &Receptions,
    config: &LocateConfig,
    uses: Uses,
    name: Name<'_>,
) -> Vec<usize> {
    let mut data = data(receptions, config, uses, located.range_bias);
    let mut remarks: Vec<Remark> = impossible(located, &data, name).collect();
    data.retain(|datum| !is_impossible(located, datum));
    let mut left_out = Vec::new();
    let has_levels = uses.levels && receptions.kinds().iter().any(|kind| kind.level.is_some());
    if let Some(remark) = open::one_place(located, receptions, &data, config, has_levels) {
        remarks.push(remark);
    } else {
        if !data.is_empty() {
            left_out = of_fit(located, &data, config, name, &mut remarks);
        }
        if has_levels {
            let examined = levels::examine(located, receptions, config, name);
            remarks.extend(examined.remarks);
            located.clock_offset = examined.clock_offset;
        }
        let meets = |remark: &Remark| !remark.code.ends_with("do-not-meet");
        let is_open = |remark: &Remark| remark.code == "range-open";
        if remarks.iter().all(meets) && !remarks.iter().any(is_open) {
            let mut data = data;
            data.retain(|datum| !left_out.contains(&datum.reception));
            remarks.extend(open::range_open(located, receptions, &data, config, has_levels));
        }
    }
    remarks.extend(of_answer(located, receptions, config, uses));
    located.remarks.extend(remarks);
    left_out
}

/// Returns true for a difference that the estimator left out by itself, because no place has it.
fn is_impossible(located: &Located, datum: &Datum) -> bool {
    matches!(datum.kind, Kind::Difference(_)) && located.left_out.contains(&datum.reception)
}

/// Returns a remark on each difference that no place has.
fn impossible(located: &Located, data: &[Datum], name: Name<'_>) -> impl Iterator<Item = Remark> {
    data.iter().enumerate().filter_map(move |(position, datum)| {
        let Kind::Difference(reference) = datum.kind else { return None };
        let apart_m = (datum.receiver - reference).norm();
        let subject = subject(data, position, name);
        let text = format!(
            "{subject} ({:.0} m) is larger than the distance of its receiver from the reference, \
             {apart_m:.0} m: no place has it, and it was left out; check its unit, its sign and \
             --reference-m",
            datum.value
        );
        is_impossible(located, datum).then(|| Remark::new("outlier", text))
    })
}

/// Returns the residual of every measurement that an answer depends on, in the order of the
/// receptions. Level differences have none.
pub fn residuals(
    located: &Located,
    receptions: &Receptions,
    config: &LocateConfig,
    uses: Uses,
) -> Vec<Residual> {
    let left_out: BTreeSet<usize> = located.left_out.iter().copied().collect();
    let mut without = left_out.clone();
    without.extend(&located.outliers);
    let mut residuals = residuals::of_geometry(located, receptions, config, uses, &without);
    if uses.bearings && receptions.kinds().iter().any(Reception::has_bearing) {
        let place = located.estimate.mean;
        residuals.extend(receptions.iter().enumerate().filter_map(|(reception, received)| {
            let residual = residuals::of_nearest_mode(&received, &place)?;
            let kind = Measurand::Bearing;
            let left_out = without.contains(&reception);
            Some(Residual { reception, kind, residual, p: None, left_out })
        }));
    }
    if uses.levels {
        let mut of_levels = left_out;
        of_levels.extend(&located.levels_left_out);
        let mut of_levels = levels::residuals_of_rows(located, receptions, config, &of_levels);
        // There may be millions.
        if residuals.is_empty() {
            residuals = of_levels;
        } else {
            residuals.append(&mut of_levels);
        }
    }
    if !residuals.is_sorted_by_key(|residual| residual.reception) {
        residuals.sort_by_key(|residual| residual.reception);
    }
    residuals
}

/// Returns the receptions without the bearings that the others contradict, but for bearings that
/// meet where all are reversed.
#[cfg(feature = "batch")]
pub(super) fn without_outliers(receptions: &Receptions, config: &LocateConfig) -> Receptions {
    let uses = Uses { levels: false, bearings: true, differences: false, searches_area: false };
    let mut data = data(receptions, config, uses, None);
    data.retain(|datum| datum.kind == Kind::Bearing);
    let up = config.target_up_m;
    let wide = most_uncertain(&data, config);
    let misfit = meeting(&wide, up).map_or(0.0, |meeting| meeting.misfit);
    let turned = misfit_p(misfit, wide.len()) < MISFIT_P
        && reversals(&wide, up, MEETS_P).iter().any(|way| way.positions.len() > 1);
    let found = outliers(&data, up, scale(&data, config)).filter(|_| !turned);
    let outliers = found.iter().flat_map(|found| &found.outliers);
    let outliers: BTreeSet<usize> = outliers
        .filter_map(|outlier| data.get(outlier.position).map(|datum| datum.reception))
        .collect();
    let kept =
        receptions.iter().enumerate().map(|(index, reception)| match outliers.contains(&index) {
            true => foxhunt_core::Reception { bearing: None, ..reception },
            false => reception,
        });
    kept.collect()
}

/// Returns the remarks on border, regions and rivals.
fn of_answer(
    located: &Located,
    receptions: &Receptions,
    config: &LocateConfig,
    uses: Uses,
) -> Vec<Remark> {
    let mut remarks = Vec::new();
    let mean = &located.estimate.mean;
    let is_at_edge =
        || uses.searches_area && !Area::about(receptions, config.margin_m).holds_well(mean);
    if located.is_at_border() || is_at_edge() {
        remarks.push(Remark::new(
            "border",
            "the place is at the border of the area that was searched, and the transmitter may be \
             beyond; search farther with a larger --margin-m, or go nearer",
        ));
    }
    if located.ellipse_is_poor() {
        remarks.push(Remark::new(
            "ellipse-is-poor",
            "the ellipse is a poor picture of where the transmitter may be; go by the regions",
        ));
    }
    if let Some(rival) = located.rivals.first() {
        remarks.push(Remark::new(
            "rivals",
            format!(
                "{} nearly as well, the best at {} with {:.2} of the density here; receive from \
                 one more place off the line of the others to decide",
                match located.rivals.len() {
                    1 => "another place fits".to_owned(),
                    count => format!("{count} other places fit"),
                },
                spoken(&rival.place),
                rival.relative_density,
            ),
        ));
    }
    remarks
}

/// Returns the measurements with the largest σ that they may plausibly have.
fn most_uncertain(data: &[Datum], config: &LocateConfig) -> Vec<Datum> {
    let widened = |datum: &Datum| {
        let sigma = if is_assumed(datum, config) { UNKNOWN_SIGMA } else { datum.sigma };
        Datum { sigma: datum.sigma.max(sigma), ..*datum }
    };
    data.iter().map(widened).collect()
}

/// Examines whether measurements meet, and whether the place is where they do.
fn of_fit(
    located: &Located,
    data: &[Datum],
    config: &LocateConfig,
    name: Name<'_>,
    remarks: &mut Vec<Remark>,
) -> Vec<usize> {
    let up = config.target_up_m;
    let scale = scale(data, config);
    let what = what(data);
    let wide = most_uncertain(data, config);
    let (Some(now), Some(widely)) = (meeting(data, up), meeting(&wide, up)) else {
        return Vec::new();
    };
    let p = misfit_p(widely.misfit, data.len());
    let reversed = if p < MISFIT_P { reversals(&wide, up, MEETS_P) } else { Vec::new() };
    let all_turned = reversed.iter().any(|way| way.positions.len() > 1);
    if let Some(found) = outliers(data, up, scale).filter(|_| !all_turned) {
        for outlier in &found.outliers {
            let Some(datum) = data.get(outlier.position) else { continue };
            let subject = subject(data, outlier.position, name);
            let text = format!("{subject} {}", outlier_text(datum, outlier, &found, up));
            remarks.push(Remark::new("outlier", text));
        }
        remarks.extend(does_not_fit(located, &found.rest, &found.meeting, scale, up));
        let reception = |outlier: &fit::Outlier| Some(data.get(outlier.position)?.reception);
        return found.outliers.iter().filter_map(reception).collect();
    }
    if p < MISFIT_P {
        let spare = u32::try_from(data.len().saturating_sub(2).max(1)).unwrap_or(u32::MAX);
        let scatter = (widely.misfit / f64::from(spare)).sqrt();
        let is_bearings = data.iter().all(|datum| datum.kind == Kind::Bearing);
        let sigmas = wide.iter().map(|datum| datum.sigma.to_degrees());
        let scatter_deg = scatter * sigmas.fold(f64::INFINITY, f64::min);
        let text = match reversed.as_slice() {
            [] if is_bearings && scatter_deg > SCATTER_DEG => Some(format!(
                "these bearings do not meet ({}): check their North, their sense and the places \
                 of the receivers, and take them again",
                probability(p)
            )),
            [] if !is_bearings && p < 1e-6 && scatter > 2.0 * SCATTER => Some(format!(
                "these {what} do not meet ({}): check their unit, their reference and the places \
                 of the receivers",
                probability(p)
            )),
            [] => None,
            ways => Some(format!(
                "these bearings do not meet ({}){}; check whether the antenna looked the other way",
                probability(p),
                ways.iter().map(|way| reversal_text(data, way, name)).collect::<String>(),
            )),
        };
        match text {
            Some(text) => remarks.push(Remark::new(
                if is_bearings { "bearings-do-not-meet" } else { "measurements-do-not-meet" },
                text,
            )),
            // Bearings of one place that share an error are examined by the estimator itself.
            None if scatter > SCATTER && located.common_errors.is_none() => {
                let extent = if data.iter().any(|datum| is_assumed(datum, config)) {
                    format!("by {scatter_deg:.0}°, farther than those of a good compass")
                } else {
                    format!("{scatter:.1} times as far as their σ says")
                };
                remarks.push(Remark::new(
                    "sigma-too-small",
                    format!(
                        "these {what} scatter {extent} ({}): look for one that is wrong, or give \
                         a larger σ",
                        probability(p)
                    ),
                ));
            }
            None => {}
        }
        return Vec::new();
    }
    remarks.extend(does_not_fit(located, data, &now, scale, up));
    Vec::new()
}

/// Returns a remark if measurements that meet do not meet at the place of the answer.
fn does_not_fit(
    located: &Located,
    data: &[Datum],
    meeting: &Meeting,
    scale: Scale,
    up: f64,
) -> Option<Remark> {
    let place = &located.estimate.mean;
    let there: f64 = data.iter().map(|datum| datum.residual(place, up).powi(2)).sum();
    let (square, _) = scale.of(meeting.misfit, data.len());
    let gain = (there - meeting.misfit) / square.max(1.0);
    if gain < APART {
        return None;
    }
    // The answer may know that it is uncertain.
    let away = place - meeting.place;
    let own = located.estimate.covariance;
    let both = meeting
        .information
        .cholesky()
        .map_or(own, |factor| own + factor.solve(&nalgebra::Matrix2::identity()) * square.max(1.0));
    let apart = both.cholesky().map_or(f64::INFINITY, |factor| away.dot(&factor.solve(&away)));
    (apart > APART).then(|| {
        Remark::new(
            "does-not-fit",
            format!(
                "the place does not fit the {}: they meet at {}, {:.0} m away; take another \
                 estimator",
                what(data),
                spoken(&meeting.place),
                away.norm(),
            ),
        )
    })
}

/// Returns the words for a measurement: by file and line, or else by its number.
fn subject(data: &[Datum], position: usize, name: Name<'_>) -> String {
    let datum = data.get(position);
    let noun = datum.map_or("measurement", |datum| noun(datum.kind));
    match datum.and_then(|datum| name(datum.reception)) {
        Some(row) => format!("the {noun} of {row}"),
        None => format!("{noun} {} of {}", position + 1, data.len()),
    }
}

/// Returns the predicate of the sentence on an outlier, without whether it was left out.
fn outlier_text(datum: &Datum, outlier: &fit::Outlier, found: &Outliers, up: f64) -> String {
    let from = spoken(&datum.receiver.xy());
    let there = spoken(&found.meeting.place);
    let p = probability(outlier.p);
    let apart = (outlier.residual * datum.sigma).abs();
    if datum.kind != Kind::Bearing {
        return format!(
            "({:.1} m, from {from}) is {apart:.1} m off where the others \
             meet, {there} ({p})",
            datum.value
        );
    }
    let back = datum.reversed().residual(&found.meeting.place, up).abs();
    let other_way = if back < 3.0 { "; reversed it meets them" } else { "" };
    format!(
        "({:.0}°, from {from}) is {:.0}° off where the others meet, \
         {there} ({p}{other_way})",
        radians_to_compass_deg(datum.value),
        apart.to_degrees(),
    )
}

fn reversal_text(data: &[Datum], way: &fit::Reversal, name: Name<'_>) -> String {
    let there = spoken(&way.meeting.place);
    match way.positions.as_slice() {
        [only] if data.len() > 1 => {
            format!("; with {} reversed they meet at {there}", subject(data, *only, name))
        }
        _ => format!("; reversed they meet at {there}"),
    }
}

fn probability(p: f64) -> String {
    if p < 1e-9 { "p < 1e-9".to_owned() } else { format!("p = {p:.0e}") }
}

fn noun(kind: Kind) -> &'static str {
    match kind {
        Kind::Bearing => "bearing",
        Kind::Range => "range",
        Kind::Difference(_) => "range difference",
    }
}

/// Returns the plural noun of some measurements.
fn what(data: &[Datum]) -> &'static str {
    let all = |is: fn(Kind) -> bool| data.iter().all(|datum| is(datum.kind));
    if all(|kind| kind == Kind::Bearing) {
        "bearings"
    } else if all(|kind| kind == Kind::Range) {
        "ranges"
    } else if all(|kind| matches!(kind, Kind::Difference(_))) {
        "range differences"
    } else {
        "measurements"
    }
}
