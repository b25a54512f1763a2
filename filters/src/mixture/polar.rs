use foxhunt_core::Estimate;
use nalgebra::{Matrix2, Vector2};

/// The mean and covariance of a vector whose length and direction are independent: a length of
/// this mean and standard deviation, and a normal direction, in radians counter-clockwise from
/// East.
///
/// Exact however uncertain the direction is (Lerro & Bar-Shalom 1993; Longbin et al. 1998): with
/// its deviation δ, E cos δ = exp(−σ² / 2) and E cos² δ = (1 + exp(−2 σ²)) / 2.
#[must_use]
pub fn polar_moments(
    (length, sigma_length): (f64, f64),
    (direction, sigma_direction): (f64, f64),
) -> Estimate<2> {
    let variance = sigma_direction * sigma_direction;
    let square = length * length + sigma_length * sigma_length;
    let shrunk = libm::exp(-0.5 * variance);
    let twice = libm::exp(-2.0 * variance);
    // Along the mean direction and across it. The difference of the first is that of a thin
    // fan's length, spelled out so that nothing cancels: E[r²] (1 + e^(−2σ²)) / 2 − r² e^(−σ²).
    let fan = libm::expm1(-variance);
    let along =
        0.5 * length * length * fan * fan + 0.5 * sigma_length * sigma_length * (1.0 + twice);
    let across = -0.5 * square * libm::expm1(-2.0 * variance);
    let (sin, cos) = libm::sincos(direction);
    let turn = Matrix2::new(cos, -sin, sin, cos);
    let mut covariance =
        turn * Matrix2::from_diagonal(&Vector2::new(along, across)) * turn.transpose();
    covariance.fill_upper_triangle_with_lower_triangle();
    Estimate { mean: Vector2::new(cos, sin) * (length * shrunk), covariance }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moments_are_those_of_an_integral() {
        for (sigma, direction, spread) in [(0.3, 0.7, 0.9), (2.0, -2.0, 0.05), (1.0, 3.0, 2.0)] {
            let made = polar_moments((5.0, sigma), (direction, spread));
            let mut mass = 0.0;
            let mut mean = Vector2::zeros();
            let mut second = Matrix2::zeros();
            for i in -200..=200 {
                let at = f64::from(i) * 0.04;
                let weight = libm::exp(-0.5 * at * at);
                let (sin, cos) = libm::sincos(direction + spread * at);
                let unit = Vector2::new(cos, sin);
                mass += weight;
                mean += unit * (5.0 * weight);
                second += unit * unit.transpose() * (weight * (25.0 + sigma * sigma));
            }
            mean /= mass;
            let covariance = second / mass - mean * mean.transpose();
            assert!((made.mean - mean).norm() < 1e-12, "{}", made.mean);
            assert!((made.covariance - covariance).norm() < 1e-11, "{}", made.covariance);
        }
    }

    #[test]
    fn a_thin_fan_keeps_its_digits() {
        let made = polar_moments((1e4, 1.0), (0.0, 1e-6));
        // Across: (r σ)² (1 − σ²) + …; along: σ_r² and half of (r σ²)².
        assert!((made.covariance[(1, 1)] - 1e-4).abs() < 1e-10);
        assert!((made.covariance[(0, 0)] - 1.0).abs() < 1e-10);
    }
}
