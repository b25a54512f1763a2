use statrs::distribution::{ContinuousCDF, StudentsT};

/// Number of standard errors to either side that hold the value with `probability`, for an error
/// with `freedom` degrees of freedom; `None` when `probability` is not in (0, 1).
pub(super) fn quantile(freedom: f64, probability: f64) -> Option<f64> {
    if !(probability > 0.0 && probability < 1.0) {
        return None;
    }
    let law = StudentsT::new(0.0, 1.0, freedom).ok()?;
    Some(law.inverse_cdf(0.5 + 0.5 * probability))
}

/// The probability that a Student's t with `freedom` degrees of freedom lies beyond ±`t`.
pub(super) fn two_sided(freedom: f64, t: f64) -> Option<f64> {
    let law = StudentsT::new(0.0, 1.0, freedom).ok()?;
    Some(2.0 * law.cdf(-libm::fabs(t)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Abramowitz & Stegun 1964, table 26.10.
    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, probability, expected) in
            [(1.0, 0.95, 12.706), (10.0, 0.95, 2.228), (30.0, 0.99, 2.750), (4.0, 0.9, 2.132)]
        {
            let t = quantile(freedom, probability).expect("proper");
            assert!((t - expected).abs() < 1e-3, "{t}, should be {expected}");
            let p = two_sided(freedom, -t).expect("proper");
            assert!((p - (1.0 - probability)).abs() < 1e-6, "{p}");
        }
        assert_eq!(quantile(5.0, 1.0), None);
    }
}
