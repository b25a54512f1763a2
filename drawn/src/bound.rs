use core::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{DMatrix, DVector};

/// The least covariance that an unbiased estimate of the place can have (Cramér & Rao), by the law
/// that a recording was drawn from: its semi-axes of one σ, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// The longer one.
    pub major_m: f64,
    /// The shorter one.
    pub minor_m: f64,
}

impl Bound {
    /// Computes the bound from the derivatives of each measurement by East, North and whatever else
    /// is unknown, and its σ. `None` where the measurements leave the place open.
    pub(crate) fn of<'a>(rows: impl IntoIterator<Item = (&'a [f64], f64)>) -> Option<Self> {
        let mut information: Option<DMatrix<f64>> = None;
        for (slopes, sigma) in rows {
            let slopes = DVector::from_column_slice(slopes) / sigma;
            let added = &slopes * slopes.transpose();
            information = Some(information.map_or(added.clone(), |sum| sum + added));
        }
        let factor = information?.cholesky()?;
        let unit = |axis: usize| {
            let mut unit = DVector::zeros(factor.l_dirty().nrows());
            unit[axis] = 1.0;
            factor.solve(&unit)
        };
        let east = unit(0);
        let north = unit(1);
        let middle = 0.5 * (east[0] + north[1]);
        let apart = (0.5 * (east[0] - north[1])).hypot(east[1]);
        let major_m = (middle + apart).sqrt();
        let minor_m = (middle - apart).max(0.0).sqrt();
        (major_m.is_finite() && minor_m > 0.0).then_some(Self { major_m, minor_m })
    }

    /// Probability that a normal error with this covariance is shorter than `radius_m`: the mean
    /// over directions of the mass along each.
    fn within(&self, radius_m: f64) -> f64 {
        /// Directions of a quarter turn: the mass is smooth in the angle, even for an axis of 1/50.
        const DIRECTIONS: u32 = 256;
        let beyond = |direction: u32| {
            let angle = FRAC_PI_2 * (f64::from(direction) + 0.5) / f64::from(DIRECTIONS);
            let (sin, cos) = angle.sin_cos();
            let square = (cos / self.major_m).powi(2) + (sin / self.minor_m).powi(2);
            (-0.5 * radius_m * radius_m * square).exp() / square
        };
        let sum: f64 = (0..DIRECTIONS).map(beyond).sum();
        let mean = sum / f64::from(DIRECTIONS);
        1.0 - mean * (TAU / (TAU * self.major_m * self.minor_m))
    }
}

/// Returns the median error over several recordings of an estimate that reaches the bound of each,
/// in metres; `None` without bounds.
#[must_use]
pub fn median_error(bounds: &[Bound]) -> Option<f64> {
    let most = bounds.iter().map(|bound| bound.major_m).fold(0.0, f64::max);
    let count = f64::from(u32::try_from(bounds.len()).ok().filter(|count| *count > 0)?);
    // Half of all errors of the widest bound are below 1.18 σ.
    let mut low = 0.0;
    let mut high = 1.2 * most;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let share = bounds.iter().map(|bound| bound.within(middle)).sum::<f64>() / count;
        if share < 0.5 {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn two_ranges_at_right_angles_bound_each_its_own_axis() {
        let rows = [([1.0, 0.0], 3.0), ([0.0, 1.0], 1.0)];
        let bound = Bound::of(rows.iter().map(|(slopes, sigma)| (&slopes[..], *sigma)));
        let bound = bound.expect("both axes are measured");
        assert_abs_diff_eq!(bound.major_m, 3.0, epsilon = 1e-12);
        assert_abs_diff_eq!(bound.minor_m, 1.0, epsilon = 1e-12);
        assert_eq!(Bound::of([(&[1.0, 0.0][..], 3.0)]), None, "North is open");
    }

    #[test]
    fn medians_are_those_of_the_normal_distribution() {
        let round = Bound { major_m: 2.0, minor_m: 2.0 };
        let median = median_error(&[round; 3]).expect("there are bounds");
        assert_abs_diff_eq!(median, 2.0 * (2.0 * 2.0_f64.ln()).sqrt(), epsilon = 1e-9);
        let flat = Bound { major_m: 1.0, minor_m: 0.02 };
        let median = median_error(&[flat]).expect("there is one");
        assert_abs_diff_eq!(median, 0.6745, epsilon = 2e-3);
        assert_eq!(median_error(&[]), None);
    }
}
