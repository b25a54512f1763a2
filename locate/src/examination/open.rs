use foxhunt_core::{Receptions, Remark};
use foxhunt_wire::geodesy::radians_to_compass_deg;
use nalgebra::Vector2;

use super::{
    super::{LocateConfig, Located, receiver_sigma_m},
    fit::{Datum, Kind, centre, meeting},
    shared::{has_law, scale},
};

/// Receivers nearer to each other than this, in metres, are in one place.
const ONE_PLACE_M: f64 = 1.0;

/// χ² with one degree of freedom that a true value exceeds with 1 %.
const LIKELY: f64 = 6.63;

/// σ along the line of sight over the distance above which the distance is open.
const OPEN: f64 = 0.5;

/// Receivers see a transmitter from one side if it is farther away than this many times the
/// distance of the farthest from their middle.
const ONE_SIDE: f64 = 2.0;

/// Returns a remark if all measurements were made in one place and none is of a distance.
pub(super) fn one_place(
    located: &Located,
    receptions: &Receptions,
    data: &[Datum],
    config: &LocateConfig,
    has_levels: bool,
) -> Option<Remark> {
    let has_ranges = data.iter().any(|datum| datum.kind == Kind::Range);
    let has_bearings = data.iter().any(|datum| datum.kind == Kind::Bearing);
    let is_fixed = (has_ranges || has_levels && has_law(config)) && has_bearings;
    if is_fixed || receptions.len() < 2 && !has_bearings && !has_levels {
        return None;
    }
    let levels = receptions.views().filter(|r| has_levels && r.any_level_dbm().is_some());
    let places: Vec<Vector2<f64>> = (data.iter().map(|datum| datum.receiver.xy()))
        .chain(levels.map(|reception| reception.position.xy()))
        .collect();
    let first = *places.first()?;
    let where_from = if places.iter().all(|place| (place - first).norm() < ONE_PLACE_M) {
        "in one place".to_owned()
    } else if has_bearings {
        // Bearings tell by how they cross, as of drones that hover in a formation.
        return None;
    } else {
        let spread_m = standing_still(&places, receiver_sigma_m(receptions))?;
        format!(
            "in one place: the receiver's places spread by {spread_m:.1} m on each axis and make \
             no path, as errors of GNSS do (--receiver-sigma-m, if they are better known)"
        )
    };
    let mean = ray(data.iter().filter(|datum| datum.kind == Kind::Bearing));
    let known = if mean.norm() > 0.0 {
        let compass = radians_to_compass_deg(libm::atan2(mean.y, mean.x));
        format!("only the direction is known, {compass:.0}°")
    } else {
        "not even a direction is known".to_owned()
    };
    let metres = (located.estimate.mean - first).norm();
    Some(Remark::new(
        "one-place",
        format!(
            "everything was received {where_from}: {known}; the distance of {metres:.0} m is that \
             of the searched area, not of the transmitter; receive from a second place"
        ),
    ))
}

/// Returns the spread on each axis of a receiver that stands still, as far as the errors of its
/// places tell; `sigma_m` is their σ, and 0 where it is not known.
///
/// The spread is within the errors, or is no more than such errors may be while each place is as
/// far from the one before as from any other: half the mean squared difference of neighbours over
/// the variance is 1 for white errors, and small along a path (von Neumann 1941).
fn standing_still(places: &[Vector2<f64>], sigma_m: f64) -> Option<f64> {
    let mut apart: Vec<Vector2<f64>> = places.to_vec();
    apart.dedup();
    let count = u32::try_from(apart.len()).ok().filter(|count| *count >= LEAST_JITTER)?;
    let count = f64::from(count);
    let middle = apart.iter().sum::<Vector2<f64>>() / count;
    let variance = apart.iter().map(|place| (place - middle).norm_squared()).sum::<f64>() / count;
    let steps = apart.windows(2).map(|pair| match pair {
        [before, after] => (after - before).norm_squared(),
        _ => 0.0,
    });
    let ratio = 0.5 * steps.sum::<f64>() / (count - 1.0) / variance;
    let spread_m = (0.5 * variance).sqrt();
    let is_within = spread_m <= 1.5 * sigma_m;
    let is_white = ratio > 0.7 && spread_m <= MOST_JITTER_M;
    (is_within || is_white).then_some(spread_m)
}

/// Places that differ are too few below this number to tell errors from a path.
const LEAST_JITTER: u32 = 20;

/// Errors of satellite receivers spread by no more than this on each axis, in metres.
const MOST_JITTER_M: f64 = 15.0;

/// Returns a remark if the measurements do not bound the distance.
pub(super) fn range_open(
    located: &Located,
    receptions: &Receptions,
    data: &[Datum],
    config: &LocateConfig,
    has_levels: bool,
) -> Option<Remark> {
    let only_bearings = !data.is_empty() && data.iter().all(|d| d.kind == Kind::Bearing);
    if only_bearings && !has_levels {
        return bearings_open(data, config);
    }
    let levels = receptions.views().filter(|r| has_levels && r.level_dbm().is_some());
    let places: Vec<Vector2<f64>> = (data.iter().map(|datum| datum.receiver.xy()))
        .chain(levels.map(|reception| reception.position.xy()))
        .collect();
    let count = u32::try_from(places.len()).ok().filter(|count| *count > 0)?;
    let middle = places.iter().sum::<Vector2<f64>>() / f64::from(count);
    let radius = places.iter().map(|place| (place - middle).norm()).fold(0.0, f64::max);
    let away = located.estimate.mean - middle;
    let distance = away.norm();
    if distance <= ONE_SIDE * radius || distance <= 0.0 {
        return None;
    }
    let sight = away / distance;
    let sigma = sight.dot(&(located.estimate.covariance * sight)).sqrt();
    (sigma > OPEN * distance).then(|| {
        let compass = radians_to_compass_deg(libm::atan2(sight.y, sight.x));
        Remark::new(
            "range-open",
            format!(
                "the distance is open: {distance:.0} m with a σ of {sigma:.0} m; rely on the \
                 direction alone, {compass:.0}°, and receive from places farther apart"
            ),
        )
    })
}

/// The sum of unit vectors along bearings, each over its variance: it points where most of them do.
fn ray<'a>(bearings: impl Iterator<Item = &'a Datum>) -> Vector2<f64> {
    bearings.map(|d| Vector2::new(libm::cos(d.value), libm::sin(d.value)) / d.sigma.powi(2)).sum()
}

/// Returns a remark if bearings fit a transmitter at infinity nearly as well as any place.
fn bearings_open(data: &[Datum], config: &LocateConfig) -> Option<Remark> {
    let up = config.target_up_m;
    let best = meeting(data, up)?;
    let (square, _) = scale(data, config).of(best.misfit, data.len());
    // Near the receivers the errors of their places make any bearing fit, and a place there less
    // probable.
    let widened =
        |datum: &Datum| 2.0 * libm::log(datum.sigma_towards(&best.place, up) / datum.sigma);
    let most = best.misfit + data.iter().map(widened).sum::<f64>() + LIKELY * square;
    let mean = ray(data.iter());
    let direction = libm::atan2(mean.y, mean.x);
    let middle = centre(data)?;
    let at_infinity: f64 = (data.iter())
        .map(|d| (foxhunt_core::angle::wrap(d.value - direction) / d.sigma).powi(2))
        .sum();
    if at_infinity > most {
        return None;
    }
    // The nearest place on rays about the direction that still fits, by bisection.
    let reach = data.iter().map(|d| (d.receiver.xy() - middle).norm()).fold(1.0, f64::max);
    let misfit_at = |distance: f64| {
        let at = |step: i32| {
            let angle = direction + 0.02 * f64::from(step);
            let place = middle + Vector2::new(libm::cos(angle), libm::sin(angle)) * distance;
            data.iter().map(|datum| datum.residual(&place, up).powi(2)).sum::<f64>()
        };
        (-20..=20).map(at).fold(f64::INFINITY, f64::min)
    };
    let mut bounds = (0.0_f64, libm::log(1e4_f64));
    for _ in 0..20 {
        let middle = 0.5 * (bounds.0 + bounds.1);
        bounds = if misfit_at(reach * libm::exp(middle)) <= most {
            (bounds.0, middle)
        } else {
            (middle, bounds.1)
        };
    }
    let nearest = reach * libm::exp(bounds.1);
    let compass = radians_to_compass_deg(direction);
    Some(Remark::new(
        "range-open",
        format!(
            "the distance is open: the bearings are parallel within their σ; the transmitter is in \
             direction {compass:.0}°, at least {nearest:.0} m away; take bearings from places \
             farther apart across that direction"
        ),
    ))
}
