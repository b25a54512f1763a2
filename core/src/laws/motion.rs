use crate::{Axis, MotionModel, State, numeric_jacobian};

/// A motion model's laws at one state and one step.
///
/// # Panics
///
/// On a breach.
pub fn motion_model<const N: usize>(model: &impl MotionModel<N>, state: &State<N>, dt: f64) {
    let axes = model.axes();
    let minus = |a: &State<N>, b: &State<N>| Axis::difference(&axes, a, b);
    let still = minus(&model.propagate(state, 0.0), state).norm();
    assert!(still <= 1e-12 * (1.0 + state.norm()), "no time moved the state by {still}");
    let none = model.noise_factor(state, 0.0).norm();
    assert!(none < 1e-12, "no time made noise: {none}");
    let factor = model.noise_factor(state, dt);
    assert!(factor.iter().all(|v| v.is_finite()), "the noise factor is not finite: {factor}");

    let numeric = numeric_jacobian(state, |x| model.propagate(x, dt), minus);
    let error = (model.jacobian(state, dt) - numeric).norm();
    assert!(error <= 1e-6 * (1.0 + numeric.norm()), "the jacobian is off by {error}");
}
