//! Places of bearings without an iteration: linear equations, and medians of crossings.

use alloc::vec::Vec;

use foxhunt_core::Estimate;
use nalgebra::{Matrix2, Vector2};

use super::{BearingLine, check, checked, reciprocal_condition};
use crate::{
    batch::BatchError,
    count::{median, number},
};

/// The weighted sum that a closed form solves: Σ w g nᵀ (x − p) = 0.
#[derive(Clone, Debug)]
struct Equations {
    matrix: Matrix2<f64>,
    right: Vector2<f64>,
    origin: Vector2<f64>,
}

impl Equations {
    /// For each line `instrument` gives g √w; n is scaled by the √w that it gives.
    fn new(
        bearings: &[(BearingLine, f64)],
        instrument: impl Fn(&BearingLine, f64) -> (Vector2<f64>, f64),
    ) -> Self {
        // About the first receiver, so that a frame far from its origin costs no digits.
        let origin = bearings.first().map_or_else(Vector2::zeros, |(line, _)| line.receiver);
        let mut matrix = Matrix2::zeros();
        let mut right = Vector2::zeros();
        for (line, sigma) in bearings {
            let (g, weight) = instrument(line, *sigma);
            let normal = line.normal();
            matrix += g * normal.transpose() * weight;
            right += g * (weight * normal.dot(&(line.receiver - origin)));
        }
        Self { matrix, right, origin }
    }

    fn solve(&self) -> Result<Estimate<2>, BatchError> {
        let symmetric = (self.matrix + self.matrix.transpose()) * 0.5;
        let rcond = reciprocal_condition(&self.matrix);
        if rcond < 1e-14 {
            return Err(BatchError::Flat { rcond });
        }
        let step = self.matrix.lu().solve(&self.right).ok_or(BatchError::Flat { rcond })?;
        let factor = symmetric.cholesky().ok_or(BatchError::Flat { rcond })?;
        let covariance = factor.solve(&Matrix2::identity());
        let covariance = (covariance + covariance.transpose()) * 0.5;
        Ok(Estimate { mean: self.origin + step, covariance })
    }
}

/// Place where lines of bearing meet, by medians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepeatedMedianFix {
    /// The repeated median and the jackknife's covariance, East and North in metres.
    pub position: Estimate<2>,
    /// The jackknife's place: the same with its bias of order 1/n taken off, and less robust.
    pub jackknife: Vector2<f64>,
}

/// The pseudolinear estimator: least squares on the distances nᵢᵀ (x − pᵢ) of the place from the
/// lines, each bearing with its σ in radians (Lingren & Gong 1978; Nardone, Lindgren & Gong 1984).
///
/// In closed form, and biased towards the receivers: the noise of a bearing is in the matrix, too,
/// and near bearings weigh no more than far ones. A start for [`instrumental_variables`] or an
/// iteration. The covariance is that of its weights at distances taken for its own place's.
///
/// # Errors
///
/// [`BatchError::TooFew`] below two bearings, [`BatchError::Value`] for a number that is not finite
/// or a σ that is not positive, [`BatchError::Flat`] for parallel bearings,
/// [`BatchError::Contradiction`] when the lines meet behind the receivers.
pub fn pseudolinear(bearings: &[(BearingLine, f64)]) -> Result<Estimate<2>, BatchError> {
    checked(bearings, 2)?;
    in_front(bearings, start(bearings)?)
}

/// The pseudolinear estimate, wherever it lies.
fn start(bearings: &[(BearingLine, f64)]) -> Result<Estimate<2>, BatchError> {
    let even = Equations::new(bearings, |line, sigma| (line.normal(), 1.0 / (sigma * sigma)));
    let mean = even.solve()?.mean;
    let covariance = by_distance(bearings, &mean, BearingLine::normal).solve()?.covariance;
    Ok(Estimate { mean, covariance })
}

/// Stansfield's estimator (1947, "Statistical theory of D.F. fixing"): least squares on the
/// distances of the place from the lines, each in units of σᵢ dᵢ, where the [`pseudolinear`]
/// estimate gives the distances dᵢ from the receivers. Each bearing comes with its σ in radians.
///
/// Biased as that one, and better weighed.
///
/// # Errors
///
/// As [`pseudolinear`].
pub fn stansfield(bearings: &[(BearingLine, f64)]) -> Result<Estimate<2>, BatchError> {
    checked(bearings, 2)?;
    let place = start(bearings)?.mean;
    in_front(bearings, by_distance(bearings, &place, BearingLine::normal).solve()?)
}

/// The weighted instrumental variables estimator (Doğançay 2004, "Passive emitter localization
/// using weighted instrumental variables", Signal Processing 84, 487-497): the pseudolinear
/// equations weighed as [`stansfield`]'s and multiplied by normals that come from the predicted
/// bearings of a first estimate, whose noise is next to independent of the equations'. That takes
/// the bias off, and its covariance tends to the Cramér-Rao bound.
///
/// Each bearing comes with its σ in radians. The normals and distances are computed from the
/// estimate three times.
///
/// # Errors
///
/// As [`pseudolinear`].
pub fn instrumental_variables(bearings: &[(BearingLine, f64)]) -> Result<Estimate<2>, BatchError> {
    checked(bearings, 2)?;
    let mut fix = start(bearings)?;
    for _ in 0..3 {
        let place = fix.mean;
        let predicted =
            |line: &BearingLine| BearingLine { bearing: line.towards(&place), ..*line }.normal();
        // A line taken from behind the estimate would enter with the wrong sign.
        let same_side = |line: &BearingLine| {
            let normal = predicted(line);
            if normal.dot(&line.normal()) < 0.0 { -normal } else { normal }
        };
        fix = by_distance(bearings, &place, same_side).solve()?;
    }
    in_front(bearings, fix)
}

/// Weights 1/(σᵢ dᵢ)² at the distances of `place`.
fn by_distance(
    bearings: &[(BearingLine, f64)],
    place: &Vector2<f64>,
    normal: impl Fn(&BearingLine) -> Vector2<f64>,
) -> Equations {
    let farthest = bearings.iter().map(|(line, _)| (place - line.receiver).norm());
    // A receiver at the place itself must not have all the weight.
    let least = 1e-6 * farthest.fold(0.0, f64::max);
    Equations::new(bearings, |line, sigma| {
        let across = sigma * (place - line.receiver).norm().max(least);
        (normal(line), 1.0 / (across * across))
    })
}

/// Lines meet on either side of their receivers; bearings point to one.
fn in_front(bearings: &[(BearingLine, f64)], fix: Estimate<2>) -> Result<Estimate<2>, BatchError> {
    let sum: f64 = bearings.iter().map(|(line, _)| line.cosine(&fix.mean)).sum();
    let mean_cosine = sum / number(bearings.len());
    if mean_cosine > 0.0 { Ok(fix) } else { Err(BatchError::Contradiction { mean_cosine }) }
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
            let mut coordinates: Vec<f64> = crossings.iter().map(|place| place[axis]).collect();
            medians.push(median(&mut coordinates).unwrap_or(line.receiver[axis]));
        }
    }
    let [east, north] = medians.map(|mut medians| median(&mut medians));
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
