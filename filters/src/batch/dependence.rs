use alloc::vec::Vec;

use nalgebra::{DMatrix, DVector, Vector2};

/// Distances in metres over which the correlation of two errors may fall to 1/e, and shares of
/// their variance that may be each one's own, equally likely before, as in
/// [`ShadowingGridConfig`](crate::ShadowingGridConfig).
const LENGTHS_M: [f64; 5] = [15.0, 30.0, 60.0, 120.0, 240.0];
const OWN_SHARES: [f64; 3] = [0.03, 0.1, 0.3];

/// The errors of a longer path are looked at every few places.
const MOST: usize = 150;

/// Returns the number of independent observations that each of a path's stands for: less than 1
/// where the errors of neighbours are alike, or larger than their σ.
///
/// `residuals` are those of a least-squares fit in units of σ, a row of `jacobian` holds how the
/// expected value changes with each parameter in the same units, all in the order of `places`. The
/// errors' covariance is s² C with C that of Gudmundson 1991 with each of some lengths and nuggets,
/// or the identity; each has the evidence of the restricted likelihood (Patterson & Thompson 1971),
/// in which the parameters of the fit do not pass for small errors. The share is the inverse of the
/// mean over them of s² tr((JᵀJ)⁻¹ JᵀCJ) / p, by how much the fit's variances are larger than for
/// independent errors of σ (Kish 1965, "design effect"), and at most 1. All together stand for at
/// least one. Errors common to all, as from one place, leave no trace in the residuals. Directions
/// of which the observations tell nothing do not take part. The share is 1 where there are too few
/// residuals for it.
#[must_use]
pub fn independent_share(
    places: &[Vector2<f64>],
    residuals: &[f64],
    jacobian: &DMatrix<f64>,
) -> f64 {
    let n = residuals.len();
    let p = jacobian.ncols();
    if n < p + 3 || places.len() != n || jacobian.nrows() != n || p == 0 {
        return 1.0;
    }
    let Some(jacobian) = &informed(jacobian) else { return 1.0 };
    let stride = n.div_ceil(MOST);
    let kept: Vec<usize> = (0..n).step_by(stride).collect();
    let errors = DVector::from_iterator(kept.len(), kept.iter().map(|i| residuals[*i]));
    let slopes = jacobian.select_rows(&kept);
    let mut explanations = Vec::new();
    for length_m in LENGTHS_M {
        for own_share in OWN_SHARES {
            explanations.push((length_m, own_share));
        }
    }
    explanations.push((1.0, 1.0));
    let mut total = 0.0;
    let mut sum = 0.0;
    let mut peak = f64::NEG_INFINITY;
    for (length_m, own_share) in explanations {
        let correlation = |i: usize, j: usize| {
            let apart_m = (places[i] - places[j]).norm();
            let own = if i == j { own_share } else { 0.0 };
            (1.0 - own_share) * libm::exp(-apart_m / length_m) + own
        };
        let of_kept =
            DMatrix::from_fn(kept.len(), kept.len(), |i, j| correlation(kept[i], kept[j]));
        // Where some were left out, each that was kept stands for its neighbours, which are nearly
        // in its place.
        let among = crate::count::number(stride);
        let mut near = &of_kept * (among * among);
        for (a, i) in kept.iter().enumerate().filter(|_| stride > 1) {
            let next = correlation(*i, i.saturating_add(1).min(n - 1));
            near[(a, a)] = among * of_kept[(a, a)] + among * (among - 1.0) * next;
        }
        let Some((log_evidence, variance)) = restricted(of_kept, &errors, &slopes) else {
            continue;
        };
        let Some(effect) = design_effect(&slopes, &near, among) else { continue };
        if log_evidence > peak {
            let fade = libm::exp(peak - log_evidence);
            (total, sum, peak) = (total * fade, sum * fade, log_evidence);
        }
        let weight = libm::exp(log_evidence - peak);
        total += weight;
        sum += weight * variance * effect;
    }
    let inflation = sum / total;
    if inflation.is_finite() { 1.0 / inflation.clamp(1.0, crate::count::number(n)) } else { 1.0 }
}

/// An orthonormal basis of the columns of J: neither the restricted likelihood nor the design
/// effect hangs on which one. `None` where J is zero or not finite.
fn informed(jacobian: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    if !jacobian.iter().all(|slope| slope.is_finite()) {
        return None;
    }
    let svd = jacobian.clone().svd(true, false);
    let least = OPEN * svd.singular_values.max();
    let open = svd.singular_values.iter().map(|value| *value > least);
    let columns: Vec<usize> = open.enumerate().filter_map(|(k, own)| own.then_some(k)).collect();
    if columns.is_empty() { None } else { svd.u.map(|basis| basis.select_columns(&columns)) }
}

/// Share of the largest singular value below which others are rounding.
const OPEN: f64 = 1e-9;

/// The restricted log-likelihood with the scale integrated out, up to a constant, and the scale's
/// mean square.
fn restricted(
    correlation: DMatrix<f64>,
    errors: &DVector<f64>,
    slopes: &DMatrix<f64>,
) -> Option<(f64, f64)> {
    let factor = correlation.cholesky()?.unpack();
    let white_slopes = factor.solve_lower_triangular(slopes)?;
    let white_errors = factor.solve_lower_triangular(errors)?;
    let information = (white_slopes.transpose() * &white_slopes).cholesky()?;
    let fitted = information.solve(&(white_slopes.transpose() * &white_errors));
    let square = (white_errors - white_slopes * fitted).norm_squared();
    let freedom = crate::count::number(errors.len() - slopes.ncols());
    let logs = |diagonal: DVector<f64>| diagonal.iter().map(|d| libm::log(*d)).sum::<f64>();
    let log_roots = logs(factor.diagonal()) + logs(information.unpack().diagonal());
    Some((-log_roots - 0.5 * freedom * libm::log(square), square / (freedom - 2.0).max(1.0)))
}

/// tr((JᵀJ)⁻¹ JᵀCJ) / p, where each row of J stands for `among` observations.
fn design_effect(slopes: &DMatrix<f64>, covariance: &DMatrix<f64>, among: f64) -> Option<f64> {
    let spread = slopes.tr_mul(&(covariance * slopes));
    let information = (slopes.tr_mul(slopes) * among).cholesky()?;
    Some(information.solve(&spread).trace() / crate::count::number(slopes.ncols()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn straight(n: u16, step_m: f64) -> (Vec<Vector2<f64>>, DMatrix<f64>) {
        let places = (0..n).map(|i| Vector2::new(step_m * f64::from(i), 0.0)).collect();
        let middle = 0.5 * f64::from(n - 1);
        let jacobian = DMatrix::from_fn(n.into(), 2, |i, j| {
            let x = (crate::count::number(i) - middle) / middle;
            if j == 0 { 1.0 } else { x }
        });
        (places, jacobian)
    }

    /// Numbers as good as independent, from an even distribution of variance 1.
    fn even(i: u16) -> f64 {
        // Steele, Lea & Flood 2014, "SplitMix".
        let mut bits = (u64::from(i) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let part = f64::from((bits >> 40) as u32) / f64::from(1_u32 << 24);
        (part - 0.5) * libm::sqrt(12.0)
    }

    #[test]
    fn independent_errors_of_their_sigma_count_for_nearly_one() {
        let (places, jacobian) = straight(120, 10.0);
        let residuals: Vec<f64> = (0..120).map(even).collect();
        let share = independent_share(&places, &residuals, &jacobian);
        assert!(share > 0.5 && share <= 1.0, "{share}");
        let twice: Vec<f64> = residuals.iter().map(|r| 2.0 * r).collect();
        let share_of_twice = independent_share(&places, &twice, &jacobian);
        assert_abs_diff_eq!(share_of_twice / share, 0.25, epsilon = 0.08);
    }

    #[test]
    fn errors_that_are_alike_over_many_places_count_for_little() {
        let (places, jacobian) = straight(120, 10.0);
        // A first-order autoregression over 60 m.
        let keep = libm::exp(-10.0 / 60.0);
        let mut error = 0.0;
        let residuals: Vec<f64> = (0..120)
            .map(|i| {
                error = keep * error + libm::sqrt(1.0 - keep * keep) * even(i);
                error
            })
            .collect();
        let share = independent_share(&places, &residuals, &jacobian);
        // Of one mean (1 − ρ) / (1 + ρ) = 0.083, for errors whose length is known.
        assert!((0.02..0.25).contains(&share), "{share}");
    }

    /// Levels from one place are of one direction, and what rounding leaves of another does not
    /// count: 1e-15 of it made a share of 0. Their common error they do not show.
    #[test]
    fn levels_from_one_place_are_one() {
        let places = alloc::vec![Vector2::new(10.0, 20.0); 20];
        let residuals: Vec<f64> = (0..20).map(even).collect();
        let share = |rounding: f64| {
            let jacobian =
                DMatrix::from_fn(20, 2, |i, j| if (i + j) % 3 == 0 { 1.0 + rounding } else { 1.0 });
            independent_share(&places, &residuals, &jacobian)
        };
        for rounding in [0.0, 1e-16, 4e-16, 1e-14, 1e-12] {
            assert!((share(rounding) - 0.05).abs() < 1e-6, "{rounding}: {}", share(rounding));
        }
    }

    #[test]
    fn too_few_errors_show_no_dependence() {
        let (places, jacobian) = straight(4, 10.0);
        assert_abs_diff_eq!(independent_share(&places, &[1.0; 4], &jacobian), 1.0, epsilon = 1e-12);
    }
}
