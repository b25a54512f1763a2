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

    let propagated = model.propagate(state, dt);
    let offset = State::repeat(1e-3);
    let change = model.propagated_change(state, &propagated, &offset, dt);
    let difference = minus(&model.propagate(&(state + offset), dt), &propagated);
    let error = minus(&change, &difference).norm();
    assert!(error <= 1e-9 * (1.0 + propagated.norm()), "propagated_change is off by {error}");

    let numeric = numeric_jacobian(state, |x| model.propagate(x, dt), minus);
    let error = (model.jacobian(state, dt) - numeric).norm();
    assert!(error <= 1e-6 * (1.0 + numeric.norm()), "the jacobian is off by {error}");

    if model.is_linear() {
        let error = minus(&(model.jacobian(state, dt) * state), &propagated).norm();
        assert!(error <= 1e-12 * (1.0 + propagated.norm()), "F x is off by {error}");
    }

    // Three states at once: each from its own column and with its own noise.
    let states = [*state, state * 0.5, -state];
    let white = [1.0, -0.3, 2.0]
        .map(|draw| State::from_fn(|row, _| if row % 2 == 0 { draw } else { 0.7 - draw }));
    let column = |states: &[State<N>; 3]| -> [[f64; 3]; N] {
        core::array::from_fn(|row| states.map(|state| state[row]))
    };
    let mut moved = column(&states);
    let noise = column(&white);
    model.move_columns(moved.each_mut().map(|c| &mut c[..]), noise.each_ref().map(|c| &c[..]), dt);
    for (i, (state, white)) in states.iter().zip(&white).enumerate() {
        let one = model.propagate(state, dt) + model.noise_factor(state, dt) * white;
        let all = State::from_fn(|row, _| moved[row][i]);
        let error = minus(&all, &one).norm();
        assert!(error <= 1e-12 * (1.0 + one.norm()), "columns are moved elsewhere, by {error}");
    }
}
