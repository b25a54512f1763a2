use alloc::vec::Vec;

use foxhunt_core::Estimate;
use nalgebra::{Matrix2, Vector2};

use super::{BearingLine, line::check};
use crate::{batch::BatchError, count::number};

/// Place where lines of bearing meet, by medians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepeatedMedianFix {
    /// The repeated median and the jackknife's covariance, East and North in metres.
    pub position: Estimate<2>,
    /// The jackknife's place: the same with its bias of order 1/n taken off, and less robust.
    pub jackknife: Vector2<f64>,
}

/// Triangulation by repeated medians (Siegel 1982; Lenth 1981): the median over the bearings of
/// the median of where each crosses the others, for each coordinate.
///
/// It breaks down only when half of the bearings are wrong, needs no start and no model of the
/// errors, and wastes some of what good bearings know. Crossings behind a receiver do not count; a
/// bearing that crosses none is taken for its receiver's own place. (It is not in the paper, but
/// only this gives its table.) The covariance is the jackknife's (Tukey 1958).
///
/// # Errors
///
/// [`BatchError::TooFew`] below four bearings, [`BatchError::Value`] for a number that is not
/// finite, [`BatchError::Flat`] when no two bearings cross or the jackknife sees no spread.
pub fn repeated_median(lines: &[BearingLine]) -> Result<RepeatedMedianFix, BatchError> {
    check(lines.iter(), 4)?;
    let flat = BatchError::Flat { rcond: 0.0 };
    let n = number(lines.len());
    let mean = median_of_medians(lines).ok_or(flat)?;
    let mut left_out = Vec::with_capacity(lines.len());
    for out in 0..lines.len() {
        let mut rest = lines.to_vec();
        rest.remove(out);
        // The pseudo-value of this bearing.
        left_out.push(mean * n - median_of_medians(&rest).ok_or(flat)? * (n - 1.0));
    }
    let jackknife = left_out.iter().sum::<Vector2<f64>>() / n;
    let square = |v: &Vector2<f64>| (v - jackknife) * (v - jackknife).transpose();
    let covariance = left_out.iter().map(square).sum::<Matrix2<f64>>() / (n * (n - 1.0));
    if covariance.cholesky().is_none() {
        return Err(flat);
    }
    Ok(RepeatedMedianFix { position: Estimate { mean, covariance }, jackknife })
}

/// `None` where no two bearings cross in front of their receivers.
fn median_of_medians(lines: &[BearingLine]) -> Option<Vector2<f64>> {
    let mut any = false;
    let mut medians: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for (i, line) in lines.iter().enumerate() {
        let others = lines.iter().enumerate().filter(|(j, _)| *j != i);
        let crossings: Vec<_> = others.filter_map(|(_, other)| crossing(line, other)).collect();
        any |= !crossings.is_empty();
        for (axis, medians) in medians.iter_mut().enumerate() {
            let coordinates = crossings.iter().map(|place| place[axis]).collect();
            medians.push(median(coordinates).unwrap_or(line.receiver[axis]));
        }
    }
    let [east, north] = medians.map(median);
    Some(Vector2::new(east?, north?)).filter(|_| any)
}

/// Returns the place where two rays cross, if any.
fn crossing(a: &BearingLine, b: &BearingLine) -> Option<Vector2<f64>> {
    let first = a.normal();
    let second = b.normal();
    let normals = Matrix2::from_rows(&[first.transpose(), second.transpose()]);
    // About the first receiver, which lies on its own line.
    let away = Vector2::new(0.0, second.dot(&(b.receiver - a.receiver)));
    // Rays less than a microradian apart are parallel.
    let parallel = normals.determinant().abs() < 1e-6;
    let place = normals.lu().solve(&away).filter(|_| !parallel)? + a.receiver;
    (a.looks_at(&place) && b.looks_at(&place)).then_some(place)
}

/// The middle value, or the mean of the middle two; `None` of nothing.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let half = values.len() / 2;
    let upper = *values.get(half)?;
    let lower = if values.len().is_multiple_of(2) { values.get(half - 1) } else { None };
    Some(lower.map_or(upper, |lower| 0.5 * (lower + upper)))
}
