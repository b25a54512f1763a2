use foxhunt_core::{
    Axis, Covariance, Estimate, EstimatorError, Observation, Role, State, angle::Resultant,
};

use crate::Innovation;

/// The mean and covariance of a mixture whose weights sum to 1 (Bar-Shalom, Li & Kirubarajan
/// 2001, §1.4.16).
///
/// Deviations on an angle are taken about the direction of the means' resultant; where they
/// cancel, about the first mean.
///
/// # Errors
///
/// When what comes out is not finite.
pub(super) fn combine<const N: usize>(
    parts: impl Iterator<Item = (f64, Estimate<N>)> + Clone,
    axes: &[Axis; N],
) -> Result<Estimate<N>, EstimatorError> {
    let first = parts.clone().next().map_or_else(State::zeros, |(_, part)| part.mean);
    let origin = State::from_fn(|row, _| match axes[row] {
        Axis::Linear => first[row],
        Axis::Angle => {
            let mut resultant = Resultant::default();
            parts.clone().for_each(|(w, part)| resultant.add(part.mean[row], w));
            resultant.direction(1e-9).unwrap_or(first[row])
        }
    });
    let mut mean = origin;
    for (weight, part) in parts.clone() {
        mean += Axis::difference(axes, &part.mean, &origin) * weight;
    }
    let mut covariance = Covariance::zeros();
    for (weight, part) in parts {
        let deviation = Axis::difference(axes, &part.mean, &mean);
        covariance += (part.covariance + deviation * deviation.transpose()) * weight;
    }
    covariance.fill_upper_triangle_with_lower_triangle();
    if !mean.iter().chain(covariance.iter()).all(|v| v.is_finite()) {
        return Err(EstimatorError::NotFinite { role: Role::Posterior });
    }
    Ok(Estimate { mean: Axis::difference(axes, &mean, &State::zeros()), covariance })
}

/// yᵀ S⁻¹ y with the moments of a mixture's innovation, deviations taken about the observation.
/// `None` where they are not finite.
pub(super) fn nis<const M: usize>(
    parts: impl Iterator<Item = (f64, Innovation<M>)> + Clone,
    observation: &Observation<M>,
) -> Option<f64> {
    // Each residual is the short way round from the observation, so they share an origin.
    let as_estimate = |(weight, innovation): (f64, Innovation<M>)| {
        (weight, Estimate { mean: innovation.residual, covariance: innovation.covariance })
    };
    let mixed = combine(parts.map(as_estimate), &[Axis::Linear; M]).ok()?;
    let residual = observation.strike(mixed.mean);
    let factor = mixed.covariance.cholesky()?;
    Some(residual.dot(&factor.solve(&residual))).filter(|nis| nis.is_finite())
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn two_parts_across_the_cut() {
        let part = |x: f64, angle: f64| Estimate {
            mean: Vector2::new(x, angle),
            covariance: Matrix2::new(1.0, 0.1, 0.1, 0.01),
        };
        let parts = [(0.25, part(0.0, 3.1)), (0.75, part(4.0, -3.1))];
        let axes = [Axis::Linear, Axis::Angle];
        let mixed = combine(parts.into_iter(), &axes).expect("finite");
        // By hand: the angles lie 2π − 6.2 apart, the means at ¾ of the way.
        let apart = core::f64::consts::TAU - 6.2;
        assert!((mixed.mean.x - 3.0).abs() < 1e-14);
        assert!((mixed.mean.y - foxhunt_core::angle::wrap(3.1 + 0.75 * apart)).abs() < 1e-14);
        let between = 0.25 * 0.75;
        let expected = Matrix2::new(
            1.0 + between * 16.0,
            0.1 + between * 4.0 * apart,
            0.1 + between * 4.0 * apart,
            0.01 + between * apart * apart,
        );
        assert!((mixed.covariance - expected).norm() < 1e-13, "{}", mixed.covariance);
    }
}
