use foxhunt_core::Remark;
use foxhunt_wire::geodesy::radians_to_compass_deg;
use nalgebra::Vector2;

use super::{
    law::MOST_TO_COMPARE,
    paths::{Fit, Hypotheses, MOST_PER_HYPOTHESIS, least},
    shadowing::Shadowed,
};

/// Twice the logarithm of the likelihood ratio from which on a transmitter moves. χ² with two
/// degrees of freedom exceeds it once in 1,800; some fifty velocities are tried.
const MOVES: f64 = 15.0;

/// Velocities of one axis at first, as shares of the extent of the receivers over the duration.
const SHARES: [f64; 7] = [-1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0];

/// Rounds about the best velocity, each twice as fine.
const FINER: u32 = 3;

/// Returns a remark with twice the logarithm of its likelihood ratio if the levels fit a
/// transmitter that moves steadily far better than one that stays.
pub(super) fn moves(hypotheses: &Hypotheses<'_>, shadowed: &Shadowed<'_>) -> Option<(f64, Remark)> {
    let (_, half_m) = hypotheses.area_without_margin.square();
    let most_mps = 2.0 * half_m / hypotheses.duration_s;
    let at = |velocity: Vector2<f64>, most: usize| hypotheses.drifting(velocity, most);
    let velocities = SHARES
        .iter()
        .flat_map(|east| SHARES.iter().map(move |north| Vector2::new(*east, *north) * most_mps));
    let coarse: Vec<Fit<Vector2<f64>>> =
        velocities.filter_map(|velocity| at(velocity, MOST_PER_HYPOTHESIS)).collect();
    let best = least(&coarse)?.hypothesis;
    if best.norm() <= 0.0 {
        return None;
    }
    // By more levels from here on.
    let mut tried: Vec<Fit<Vector2<f64>>> = at(best, MOST_TO_COMPARE).into_iter().collect();
    let mut step_mps = 0.15 * most_mps;
    for _ in 0..FINER {
        let about = least(&tried)?.hypothesis;
        let steps = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
        let steps = steps.map(|(east, north)| about + Vector2::new(east, north) * step_mps);
        tried.extend(steps.into_iter().filter_map(|velocity| at(velocity, MOST_TO_COMPARE)));
        step_mps *= 0.5;
    }
    let best = least(&tried)?;
    let likelihood = shadowed.log_likelihood(&best.residuals);
    if 2.0 * (likelihood - shadowed.of_one) < MOVES {
        return None;
    }
    let ratio = 2.0 * (likelihood - shadowed.of_likeliest());
    let velocity = best.hypothesis;
    let compass = radians_to_compass_deg(libm::atan2(velocity.y, velocity.x));
    let text = format!(
        "the levels fit a transmitter that moves far better, by some {:.2} m/s to {compass:.0}° \
         ({:.0} m in all): the place is of none of its times; follow it with --track",
        velocity.norm(),
        velocity.norm() * hypotheses.duration_s,
    );
    (ratio >= MOVES).then(|| (ratio, Remark::new("transmitter-moves", text)))
}
