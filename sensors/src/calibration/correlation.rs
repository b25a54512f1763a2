use super::student;

/// Pearson's correlation of two series, and how likely it is by chance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correlation {
    /// The coefficient r, in [−1, 1] (Pritzl 2018, eq. 4.3).
    pub coefficient: f64,
    /// The probability of one as large if there were none, by Student's t with n − 2 degrees of
    /// freedom, on both sides.
    pub p_value: f64,
}

impl Correlation {
    /// The correlation of pairs; `None` for less than three, or where one of the two does not vary.
    #[must_use]
    pub fn of(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Option<Self> {
        let sum = |of: &dyn Fn(f64, f64) -> f64| pairs.clone().map(|(x, y)| of(x, y)).sum::<f64>();
        let points = sum(&|_, _| 1.0);
        let mean_x = sum(&|x, _| x) / points;
        let mean_y = sum(&|_, y| y) / points;
        let square_x = sum(&|x, _| (x - mean_x) * (x - mean_x));
        let square_y = sum(&|_, y| (y - mean_y) * (y - mean_y));
        // Rounding makes equal numbers differ by this much of themselves.
        let varies = |square: f64, mean: f64| square > 1e-24 * mean * mean;
        if points < 3.0 || !varies(square_x, mean_x) || !varies(square_y, mean_y) {
            return None;
        }
        let product = sum(&|x, y| (x - mean_x) * (y - mean_y));
        let coefficient = (product / libm::sqrt(square_x * square_y)).clamp(-1.0, 1.0);
        Some(Self { coefficient, p_value: p_value(coefficient, points)? })
    }
}

fn p_value(r: f64, points: f64) -> Option<f64> {
    let freedom = points - 2.0;
    let t = r * libm::sqrt(freedom / (1.0 - r * r).max(f64::MIN_POSITIVE));
    student::two_sided(freedom, t)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pritzl 2018, §7.2: r = 0.713 on 15 points has p = 0.0028.
    #[test]
    fn it_has_the_published_probability() {
        let p = p_value(0.713, 15.0).expect("enough points");
        assert!((p - 0.0028).abs() < 1e-4, "{p}");
    }

    #[test]
    fn it_is_that_of_the_pairs() {
        let of = |y: [f64; 5]| Correlation::of([1.0, 2.0, 3.0, 4.0, 5.0].into_iter().zip(y));
        let Correlation { coefficient, p_value } = of([1.1, 1.9, 3.2, 3.9, 5.1]).expect("varies");
        assert!(coefficient > 0.99 && p_value < 0.001, "{coefficient} {p_value}");
        let Correlation { coefficient, p_value } = of([1.0, -1.0, 0.0, -1.0, 1.0]).expect("varies");
        assert!(coefficient.abs() < 1e-12 && (p_value - 1.0).abs() < 1e-9);
        assert_eq!(of([0.1; 5]), None);
        assert_eq!(Correlation::of([(1.0, 2.0), (2.0, 1.0)].into_iter()), None);
    }
}
