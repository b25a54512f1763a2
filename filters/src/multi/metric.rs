//! Distances between sets of points: OSPA and GOSPA.

use alloc::vec::Vec;

use foxhunt_core::parameter::{ParameterError, positive, require};
use nalgebra::{DMatrix, SVector};

use super::assign;
use crate::count::number;

/// The optimal sub-pattern assignment distance of two sets, in the points' unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ospa {
    /// The distance: ((localisation part)ᵖ + (cardinality part)ᵖ)^(1/p).
    pub distance: f64,
    /// The part of the distance by errors of assigned points.
    pub localisation: f64,
    /// The part of the distance by the difference of the numbers of points.
    pub cardinality: f64,
}

/// The generalised optimal sub-pattern assignment distance of two sets with α = 2, in the points'
/// unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gospa {
    /// The distance: (Σ dᵖ + cᵖ/2 (missed + false))^(1/p).
    pub distance: f64,
    /// (Σ dᵖ)^(1/p) over the assigned pairs.
    pub localisation: f64,
    /// Number of assigned pairs.
    pub assigned: usize,
    /// Number of true points without an estimate.
    pub missed: usize,
    /// Number of estimates without a true point.
    pub false_alarms: usize,
}

/// The OSPA distance between estimates and true points (Schuhmacher, Vo & Vo 2008, eq. 3), with
/// the cut-off c in the points' unit and the order p; zero for two empty sets.
///
/// ```
/// use foxhunt_core::nalgebra::Vector2;
/// use foxhunt_filters::multi::ospa;
///
/// # fn main() -> Result<(), foxhunt_core::parameter::ParameterError> {
/// let truth = [Vector2::new(0.0, 0.0), Vector2::new(100.0, 0.0)];
/// let one_found = ospa(&[Vector2::new(3.0, 4.0)], &truth, 50.0, 1.0)?;
/// assert!((one_found.distance - 27.5).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
///
/// [`ParameterError`] when `cutoff` is not positive, `order` is below 1, or a point is not finite.
pub fn ospa<const D: usize>(
    estimates: &[SVector<f64, D>],
    truths: &[SVector<f64, D>],
    cutoff: f64,
    order: f64,
) -> Result<Ospa, ParameterError> {
    let powers = powers(estimates, truths, cutoff, order)?;
    let most = estimates.len().max(truths.len());
    if most == 0 {
        return Ok(Ospa { distance: 0.0, localisation: 0.0, cardinality: 0.0 });
    }
    let located = assign(&powers).map_or(0.0, |best| best.cost);
    let unmatched = number(most - powers.nrows()) * libm::pow(cutoff, order);
    let root = |sum: f64| libm::pow(sum / number(most), 1.0 / order);
    Ok(Ospa {
        distance: root(located + unmatched),
        localisation: root(located),
        cardinality: root(unmatched),
    })
}

/// The GOSPA distance between estimates and true points with α = 2 (Rahmathullah,
/// García-Fernández & Svensson 2017, proposition 1), with the cut-off c in the points' unit and
/// the order p. A pair as far apart as the cut-off is not assigned: its truth is missed, and its
/// estimate is a false alarm.
///
/// ```
/// use foxhunt_core::nalgebra::Vector2;
/// use foxhunt_filters::multi::gospa;
///
/// # fn main() -> Result<(), foxhunt_core::parameter::ParameterError> {
/// let truth = [Vector2::new(0.0, 0.0), Vector2::new(100.0, 0.0)];
/// let found = gospa(&[Vector2::new(3.0, 4.0), Vector2::new(900.0, 0.0)], &truth, 50.0, 1.0)?;
/// assert_eq!((found.assigned, found.missed, found.false_alarms), (1, 1, 1));
/// assert!((found.distance - (5.0 + 25.0 + 25.0)).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
///
/// [`ParameterError`] when `cutoff` is not positive, `order` is below 1, or a point is not finite.
pub fn gospa<const D: usize>(
    estimates: &[SVector<f64, D>],
    truths: &[SVector<f64, D>],
    cutoff: f64,
    order: f64,
) -> Result<Gospa, ParameterError> {
    let powers = powers(estimates, truths, cutoff, order)?;
    let most = libm::pow(cutoff, order);
    let columns = assign(&powers).map_or_else(Vec::new, |best| best.columns);
    let pairs = columns.iter().enumerate().map(|(row, column)| powers[(row, *column)]);
    let near: Vec<f64> = pairs.filter(|power| *power < most).collect();
    let located: f64 = near.iter().sum();
    let assigned = near.len();
    let missed = truths.len() - assigned;
    let false_alarms = estimates.len() - assigned;
    let root = |sum: f64| libm::pow(sum, 1.0 / order);
    Ok(Gospa {
        distance: root(located + 0.5 * most * number(missed + false_alarms)),
        localisation: root(located),
        assigned,
        missed,
        false_alarms,
    })
}

/// min(d, c)ᵖ for each pair; the smaller set has the rows.
fn powers<const D: usize>(
    estimates: &[SVector<f64, D>],
    truths: &[SVector<f64, D>],
    cutoff: f64,
    order: f64,
) -> Result<DMatrix<f64>, ParameterError> {
    positive("the cut-off", cutoff)?;
    require(order >= 1.0 && order.is_finite(), "the order", order, "at least 1")?;
    for coordinate in estimates.iter().chain(truths).flatten() {
        require(coordinate.is_finite(), "a coordinate", *coordinate, "finite")?;
    }
    let (few, many) =
        if estimates.len() < truths.len() { (estimates, truths) } else { (truths, estimates) };
    Ok(DMatrix::from_fn(few.len(), many.len(), |row, column| {
        libm::pow((few[row] - many[column]).norm().min(cutoff), order)
    }))
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use nalgebra::Vector2;
    use proptest::prelude::*;

    use super::*;

    fn points(most: usize) -> impl Strategy<Value = Vec<Vector2<f64>>> {
        let point = (-50.0..50.0_f64, -50.0..50.0_f64).prop_map(|(x, y)| Vector2::new(x, y));
        proptest::collection::vec(point, 0..=most)
    }

    proptest! {
        /// Both are metrics: zero between equal sets, symmetric, with the triangle inequality.
        #[test]
        fn both_are_metrics(
            a in points(4), b in points(4), c in points(4), order in 1.0..3.0_f64,
        ) {
            let ospa = |x: &[_], y: &[_]| ospa(x, y, 20.0, order).expect("proper").distance;
            let gospa = |x: &[_], y: &[_]| gospa(x, y, 20.0, order).expect("proper").distance;
            // The root of a rounding error of 1e-16 is about 1e-8.
            prop_assert!(ospa(&a, &a) < 1e-6 && gospa(&a, &a) < 1e-6);
            prop_assert!(abs_diff_eq!(ospa(&a, &b), ospa(&b, &a), epsilon = 1e-9));
            prop_assert!(abs_diff_eq!(gospa(&a, &b), gospa(&b, &a), epsilon = 1e-9));
            prop_assert!(ospa(&a, &c) <= ospa(&a, &b) + ospa(&b, &c) + 1e-9);
            prop_assert!(gospa(&a, &c) <= gospa(&a, &b) + gospa(&b, &c) + 1e-9);
        }

        /// The parts of GOSPA add up, and OSPA is bounded by its cut-off.
        #[test]
        fn the_parts_add_up(a in points(4), b in points(4), order in 1.0..3.0_f64) {
            let found = gospa(&a, &b, 20.0, order).expect("proper");
            let count = number(found.missed + found.false_alarms);
            let sum = libm::pow(found.localisation, order)
                + 0.5 * libm::pow(20.0, order) * count;
            prop_assert!(abs_diff_eq!(libm::pow(found.distance, order), sum, epsilon = 1e-6));
            prop_assert_eq!(found.assigned + found.missed, b.len());
            prop_assert_eq!(found.assigned + found.false_alarms, a.len());
            prop_assert!(ospa(&a, &b, 20.0, order).expect("proper").distance <= 20.0 + 1e-9);
        }
    }

    #[test]
    fn the_distances_have_the_values_by_hand() {
        let truth = [Vector2::new(0.0, 0.0), Vector2::new(10.0, 0.0), Vector2::new(0.0, 10.0)];
        let found = [Vector2::new(0.0, 1.0), Vector2::new(11.0, 0.0)];
        // Two pairs 1 apart and one missed truth, c = 4, p = 2.
        let of = gospa(&found, &truth, 4.0, 2.0).expect("proper");
        assert_abs_diff_eq!(of.distance, libm::sqrt(1.0 + 1.0 + 8.0), epsilon = 1e-12);
        assert_abs_diff_eq!(of.localisation, libm::sqrt(2.0), epsilon = 1e-12);
        let of = ospa(&found, &truth, 4.0, 2.0).expect("proper");
        assert_abs_diff_eq!(of.distance, libm::sqrt((1.0 + 1.0 + 16.0) / 3.0), epsilon = 1e-12);
        assert_abs_diff_eq!(of.cardinality, libm::sqrt(16.0 / 3.0), epsilon = 1e-12);
        assert_abs_diff_eq!(of.localisation, libm::sqrt(2.0 / 3.0), epsilon = 1e-12);
        let none: [Vector2<f64>; 0] = [];
        assert_abs_diff_eq!(ospa(&none, &none, 4.0, 2.0).expect("proper").distance, 0.0);
        let all = gospa(&none, &truth, 4.0, 1.0).expect("proper");
        assert_abs_diff_eq!(all.distance, 6.0, epsilon = 1e-12);
    }

    #[test]
    fn improper_settings_and_points_are_refused() {
        let at = [Vector2::new(0.0, 0.0)];
        for (cutoff, order) in [(0.0, 2.0), (-1.0, 2.0), (f64::NAN, 2.0), (1.0, 0.5)] {
            assert!(ospa(&at, &at, cutoff, order).is_err(), "{cutoff}, {order}");
            assert!(gospa(&at, &at, cutoff, order).is_err(), "{cutoff}, {order}");
        }
        assert!(ospa(&at, &[Vector2::new(f64::NAN, 0.0)], 1.0, 2.0).is_err());
    }
}
