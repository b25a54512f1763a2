use nalgebra::Vector3;

/// Standard gravity in m/s².
pub(super) const GRAVITY: f64 = 9.806_65;

/// Place and attitude, and how fast each changes: heading ψ, pitch θ and roll φ as in a
/// [`Pose`](foxhunt_core::Pose), the heading not wrapped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct State {
    pub(super) position: Vector3<f64>,
    pub(super) velocity: Vector3<f64>,
    /// ψ, θ, φ in radians.
    pub(super) attitude: Vector3<f64>,
    /// Their derivatives in radians per second.
    pub(super) rates: Vector3<f64>,
}

/// The inputs of the rotors and the air, held over a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Inputs {
    /// Thrust over mass, along the body's up axis, in m/s².
    pub(super) thrust: f64,
    /// Torque over inertia about ψ, θ and φ, in rad/s².
    pub(super) torque: Vector3<f64>,
    /// The air's velocity over ground in m/s.
    pub(super) wind: Vector3<f64>,
    /// Drag over mass and airspeed, per second.
    pub(super) drag: f64,
}

impl State {
    /// The simplified rigid body (Isaacs et al. 2014, eq. 3–8), written in East-North-Up with the
    /// heading in the thrust, and with linear drag:
    ///
    /// ẍ = u (−sin θ cos φ cos ψ + sin φ sin ψ),
    /// ÿ = u (−sin θ cos φ sin ψ − sin φ cos ψ),
    /// z̈ = u cos θ cos φ − g, and ψ̈, θ̈, φ̈ = τ.
    fn derivative(&self, inputs: &Inputs) -> Self {
        let [heading, pitch, roll] = self.attitude.into();
        let forward = -libm::sin(pitch) * libm::cos(roll);
        let left = -libm::sin(roll);
        let sin = libm::sin(heading);
        let cos = libm::cos(heading);
        let thrust = Vector3::new(
            forward * cos - left * sin,
            forward * sin + left * cos,
            libm::cos(pitch) * libm::cos(roll),
        ) * inputs.thrust;
        let drag = (inputs.wind - self.velocity) * inputs.drag;
        Self {
            position: self.velocity,
            velocity: thrust + drag - Vector3::z() * GRAVITY,
            attitude: self.rates,
            rates: inputs.torque,
        }
    }

    /// One step of the classical Runge-Kutta method.
    pub(super) fn step(&self, inputs: &Inputs, dt: f64) -> Self {
        let first = self.derivative(inputs);
        let second = self.after(&first, 0.5 * dt).derivative(inputs);
        let third = self.after(&second, 0.5 * dt).derivative(inputs);
        let fourth = self.after(&third, dt).derivative(inputs);
        self.after(&first, dt / 6.0)
            .after(&second, dt / 3.0)
            .after(&third, dt / 3.0)
            .after(&fourth, dt / 6.0)
    }

    /// The state after `dt` seconds of a constant change.
    pub(super) fn after(&self, change: &Self, dt: f64) -> Self {
        Self {
            position: self.position + change.position * dt,
            velocity: self.velocity + change.velocity * dt,
            attitude: self.attitude + change.attitude * dt,
            rates: self.rates + change.rates * dt,
        }
    }

    /// The state `dt` seconds later if nothing accelerates it.
    pub(super) fn coasting(&self, dt: f64) -> Self {
        let change = Self { position: self.velocity, attitude: self.rates, ..Self::default() };
        self.after(&change, dt)
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_core::Pose;

    use super::*;

    #[test]
    fn thrust_acts_along_the_up_axis_of_the_pose() {
        let attitude = Vector3::new(2.0, 0.3, -0.4);
        let state = State { attitude, ..State::default() };
        let inputs = Inputs { thrust: 12.0, ..Inputs::default() };
        let pose = Pose { heading: 2.0, pitch: 0.3, roll: -0.4, ..Pose::default() };
        let felt = state.derivative(&inputs).velocity + Vector3::z() * GRAVITY;
        assert!((pose.to_body(&felt) - Vector3::z() * 12.0).norm() < 1e-12);
    }

    #[test]
    fn a_fall_through_air_is_the_exact_one() {
        let inputs = Inputs { drag: 0.5, ..Inputs::default() };
        let mut state = State::default();
        for _ in 0..1000 {
            state = state.step(&inputs, 0.005);
        }
        // v = −(g / k) (1 − e^(−k t)), 5 s.
        let exact = -GRAVITY / 0.5 * (1.0 - (-2.5_f64).exp());
        assert!((state.velocity.z - exact).abs() < 1e-10, "{}", state.velocity.z);
    }
}
