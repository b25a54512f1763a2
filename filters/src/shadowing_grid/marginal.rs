/// The posterior mean and standard deviation of one number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Marginal {
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub sd: f64,
}

/// The first two moments of a mixture, component by component.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Mixture {
    weight: f64,
    mean: f64,
    /// Σ w (variance + (mean − mixture's mean)²).
    spread: f64,
}

impl Mixture {
    /// Adds a component (West 1979): no difference of large squares.
    pub(crate) fn add(&mut self, weight: f64, mean: f64, variance: f64) {
        if weight <= 0.0 {
            return;
        }
        let before = self.weight;
        self.weight += weight;
        let step = mean - self.mean;
        self.mean += step * weight / self.weight;
        self.spread += weight * variance + step * step * before * weight / self.weight;
    }

    /// The mean.
    pub(crate) fn mean(&self) -> f64 {
        self.mean
    }

    /// The variance: that of the components and that between them.
    pub(crate) fn variance(&self) -> f64 {
        if self.weight > 0.0 { self.spread / self.weight } else { 0.0 }
    }

    /// The numbers with their probabilities.
    pub(crate) fn of(numbers: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut mixture = Self::default();
        numbers.for_each(|(number, probability)| mixture.add(probability, number, 0.0));
        mixture
    }

    /// Mean and standard deviation.
    pub(crate) fn marginal(&self) -> Marginal {
        Marginal { mean: self.mean, sd: libm::sqrt(self.variance()) }
    }
}

/// Weight, first and second moment of a number about a reference that is not far from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moments {
    reference: f64,
    weight: f64,
    first: f64,
    second: f64,
}

impl Moments {
    /// No weight as yet.
    pub(super) fn about(reference: f64) -> Self {
        Self { reference, weight: 0.0, first: 0.0, second: 0.0 }
    }

    /// Adds values of some weight, with their first and second moment.
    pub(super) fn add_sums(&mut self, weight: f64, [first, second]: [f64; 2]) {
        self.weight += weight;
        self.first += first;
        self.second += second;
    }

    /// Mean and standard deviation.
    pub(super) fn marginal(&self) -> Marginal {
        let mean = self.first / self.weight;
        let variance = (self.second / self.weight - mean * mean).max(0.0);
        Marginal { mean: self.reference + mean, sd: libm::sqrt(variance) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn a_mixture_has_the_variance_of_its_parts_and_between_them() {
        let mut mixture = Mixture::default();
        mixture.add(1.0, 1e6, 4.0);
        mixture.add(0.0, f64::NAN, f64::NAN); // no weight, no effect
        mixture.add(3.0, 1e6 + 8.0, 1.0);
        assert_abs_diff_eq!(mixture.mean(), 1e6 + 6.0, epsilon = 1e-9);
        // (4 + 3 · 1) / 4 within and (36 + 3 · 4) / 4 between.
        assert_abs_diff_eq!(mixture.variance(), 13.75, epsilon = 1e-9);
        assert_abs_diff_eq!(mixture.marginal().sd, libm::sqrt(13.75), epsilon = 1e-9);
    }
}
