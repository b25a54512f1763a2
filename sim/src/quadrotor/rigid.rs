//! The full rigid body of a quadrotor: a rotation, body rates and moments of inertia.

use foxhunt_core::{Pose, angle};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{GRAVITY, Inputs, State};

/// The rigid body of Isaacs et al. 2014, eq. 1 and 2, written in East-North-Up with axes of the
/// body forward, left and up, and with linear drag:
///
/// ẍ = u R e₃ − g e₃ + k (w − ẋ), Ṙ = R \[ω\]ₓ, and J ω̇ = τ − ω × J ω.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RigidBody {
    /// Moments of inertia about the forward, left and up axes, in kg m².
    inertia: Vector3<f64>,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    /// Turns vectors of the body into the world; of unit norm between steps.
    rotation: Quaternion<f64>,
    /// ω about the forward, left and up axes, in radians per second.
    rates: Vector3<f64>,
}

/// The derivative of a [`RigidBody`] with respect to time.
struct Change {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    rotation: Quaternion<f64>,
    rates: Vector3<f64>,
}

impl RigidBody {
    /// A body with the place, the attitude and the motion of `state`.
    pub(super) fn new(inertia: [f64; 3], state: &State) -> Self {
        let [heading, pitch, roll] = state.attitude.into();
        let rotation = Pose { heading, pitch, roll, ..Pose::default() }.rotation().into_inner();
        let [turning, pitching, rolling] = state.rates.into();
        let level = libm::cos(roll);
        let tilted = libm::sin(roll);
        let about_up = turning * libm::cos(pitch);
        let rates = Vector3::new(
            rolling + turning * libm::sin(pitch),
            about_up * tilted - pitching * level,
            about_up * level + pitching * tilted,
        );
        Self {
            inertia: Vector3::from(inertia),
            position: state.position,
            velocity: state.velocity,
            rotation,
            rates,
        }
    }

    /// The body in the angles that the controllers use, with the heading that is nearest to
    /// `heading`.
    pub(super) fn state(&self, heading: f64) -> State {
        let rotation = UnitQuaternion::new_unchecked(self.rotation);
        let Pose { heading: wrapped, pitch, roll, .. } = Pose::default().with_rotation(&rotation);
        let level = libm::cos(roll);
        let tilted = libm::sin(roll);
        let about_up = self.rates.y * tilted + self.rates.z * level;
        // With the nose straight up, heading and roll turn about one axis.
        let turning = about_up / libm::cos(pitch).max(1e-6);
        let pitching = self.rates.z * tilted - self.rates.y * level;
        let rolling = self.rates.x - turning * libm::sin(pitch);
        State {
            position: self.position,
            velocity: self.velocity,
            attitude: Vector3::new(heading + angle::wrap(wrapped - heading), pitch, roll),
            rates: Vector3::new(turning, pitching, rolling),
        }
    }

    /// This body at rest on a place, with the attitude of `state`.
    #[cfg(feature = "emulators")]
    pub(super) fn put(&self, state: &State) -> Self {
        Self::new(self.inertia.into(), state)
    }

    /// One step of the classical Runge-Kutta method. The torques of `inputs` over the moments of
    /// inertia act about the body's axes.
    pub(super) fn step(&self, inputs: &Inputs, dt: f64) -> Self {
        let first = self.derivative(inputs);
        let second = self.after(&first, 0.5 * dt).derivative(inputs);
        let third = self.after(&second, 0.5 * dt).derivative(inputs);
        let fourth = self.after(&third, dt).derivative(inputs);
        let end = self
            .after(&first, dt / 6.0)
            .after(&second, dt / 3.0)
            .after(&third, dt / 3.0)
            .after(&fourth, dt / 6.0);
        Self { rotation: end.rotation.normalize(), ..end }
    }

    fn derivative(&self, inputs: &Inputs) -> Change {
        let up = UnitQuaternion::new_normalize(self.rotation) * Vector3::z();
        let drag = (inputs.wind - self.velocity) * inputs.drag;
        let [yaw, pitch, roll] = inputs.torque.into();
        let torque = self.inertia.component_mul(&Vector3::new(roll, -pitch, yaw));
        let momentum = self.inertia.component_mul(&self.rates);
        let gyroscopic = self.rates.cross(&momentum);
        Change {
            position: self.velocity,
            velocity: up * inputs.thrust + drag - Vector3::z() * GRAVITY,
            rotation: self.rotation * Quaternion::from_imag(0.5 * self.rates),
            rates: (torque - gyroscopic).component_div(&self.inertia),
        }
    }

    /// The body after `dt` seconds of a constant change.
    fn after(&self, change: &Change, dt: f64) -> Self {
        Self {
            inertia: self.inertia,
            position: self.position + change.position * dt,
            velocity: self.velocity + change.velocity * dt,
            rotation: self.rotation + change.rotation * dt,
            rates: self.rates + change.rates * dt,
        }
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use nalgebra::Rotation3;

    use super::*;

    const STEP: f64 = 1.0 / 400.0;

    /// A body that tumbles from an attitude away from every axis.
    fn tumbling(inertia: [f64; 3], rates: Vector3<f64>) -> RigidBody {
        let attitude = Vector3::new(0.7, -0.4, 1.1);
        let state = State { attitude, ..State::default() };
        RigidBody { rates, ..RigidBody::new(inertia, &state) }
    }

    fn rotation(body: &RigidBody) -> Rotation3<f64> {
        UnitQuaternion::new_normalize(body.rotation).to_rotation_matrix()
    }

    /// Angular momentum in the world, and kinetic energy of the rotation.
    fn integrals(body: &RigidBody) -> (Vector3<f64>, f64) {
        let momentum = body.inertia.component_mul(&body.rates);
        (rotation(body) * momentum, 0.5 * momentum.dot(&body.rates))
    }

    #[test]
    fn attitude_and_rates_are_those_of_the_pose() {
        let attitude = Vector3::new(2.0 + 3.0 * std::f64::consts::TAU, 0.3, -0.4);
        let rates = Vector3::new(1.5, -0.7, 0.4);
        let state = State { attitude, rates, ..State::default() };
        let body = RigidBody::new([2e-3, 3e-3, 5e-3], &state);
        let pose = Pose { heading: 2.0, pitch: 0.3, roll: -0.4, ..Pose::default() };
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let world = rotation(&body) * axis;
            assert!((pose.to_body(&world) - axis).norm() < 1e-12);
        }
        let back = body.state(attitude.x + 1.0);
        assert!((back.attitude - attitude).norm() < 1e-12, "{}", back.attitude);
        assert!((back.rates - rates).norm() < 1e-12, "{}", back.rates);
        // A tenth of a millisecond of these rates, against the angles themselves.
        let dt = 1e-4;
        let turned = body.step(&Inputs::default(), dt).state(attitude.x).attitude;
        assert!(((turned - attitude) / dt - rates).norm() < 1e-3, "{turned}");
    }

    /// 10 s at several turns a second: the classical Runge-Kutta method loses (ω dt)⁴ of the phase
    /// in each radian, 1e-6 rad over the 100 rad here, and less of the integrals.
    #[test]
    fn a_free_body_keeps_its_angular_momentum_and_energy() {
        let start = tumbling([2e-3, 3e-3, 4.5e-3], Vector3::new(1.0, 8.0, 2.0));
        let before = integrals(&start);
        let mut body = start;
        for _ in 0..4000 {
            body = body.step(&Inputs::default(), STEP);
            let now = integrals(&body);
            assert!((now.0 - before.0).norm() < 1e-6 * before.0.norm(), "{}", now.0);
            assert_abs_diff_eq!(now.1 / before.1, 1.0, epsilon = 1e-6);
        }
        // About the middle axis it is not stable, and turns over.
        assert!((body.rates - start.rates).norm() > 0.1);
    }

    /// A body with two equal moments: the attitude is a turn about the angular momentum in the
    /// world after one about the axis of symmetry, each at a constant rate.
    #[test]
    fn a_symmetric_body_precesses_at_the_known_rates() {
        let equal = 2e-3;
        let other = 4e-3;
        let rates = Vector3::new(1.0, -2.0, 5.0);
        let start = tumbling([equal, equal, other], rates);
        let momentum = integrals(&start).0;
        let mut body = start;
        for step in 1..=4000 {
            body = body.step(&Inputs::default(), STEP);
            let time = f64::from(step) * STEP;
            let outer = Rotation3::new(momentum * (time / equal));
            let inner = Rotation3::new(Vector3::z() * (rates.z * (1.0 - other / equal) * time));
            let exact = outer * rotation(&start) * inner;
            let error = (rotation(&body).matrix() - exact.matrix()).norm();
            assert!(error < 1e-5, "{error} after {time} s");
        }
    }

    /// sn, cn and dn of parameter m = k², by the descending Landen transformation (Abramowitz and
    /// Stegun 1964, 16.4).
    fn jacobi(u: f64, m: f64) -> (f64, f64, f64) {
        let mut means = vec![(1.0, m.sqrt())];
        let mut b = (1.0 - m).sqrt();
        while let Some(&(a, _)) = means.last().filter(|(_, c)| c.abs() > 1e-15) {
            means.push((0.5 * (a + b), 0.5 * (a - b)));
            b = (a * b).sqrt();
        }
        let last = means.len() - 1;
        let mut angle = f64::powi(2.0, i32::try_from(last).expect("few")) * means[last].0 * u;
        let mut before = angle;
        for &(a, c) in means[1..].iter().rev() {
            before = angle;
            angle = 0.5 * (angle + (c / a * angle.sin()).asin());
        }
        (angle.sin(), angle.cos(), angle.cos() / (before - angle).cos())
    }

    /// A body with three unlike moments, against Jacobi's elliptic functions (Landau and Lifshitz
    /// 1976, *Mechanics*, §37).
    #[test]
    fn an_asymmetric_body_turns_by_elliptic_functions() {
        let [i1, i2, i3] = [2e-3, 3e-3, 4.5e-3];
        let start = tumbling([i1, i2, i3], Vector3::new(4.0, 0.0, 5.0));
        let (momentum, energy) = integrals(&start);
        let twice = 2.0 * energy;
        let square = momentum.norm_squared();
        assert!(square > twice * i2, "it turns about the third axis");
        let high = twice * i3 - square;
        let low = square - twice * i1;
        let m = (i2 - i1) * high / ((i3 - i2) * low);
        let pace = ((i3 - i2) * low / (i1 * i2 * i3)).sqrt();
        let mut body = start;
        for step in 1..=4000 {
            body = body.step(&Inputs::default(), STEP);
            let (sn, cn, dn) = jacobi(pace * f64::from(step) * STEP, m);
            let exact = Vector3::new(
                (high / (i1 * (i3 - i1))).sqrt() * cn,
                (high / (i2 * (i3 - i2))).sqrt() * sn,
                (low / (i3 * (i3 - i1))).sqrt() * dn,
            );
            assert!((body.rates - exact).norm() < 1e-5, "{} and {exact}", body.rates);
        }
    }

    /// Equations 3 to 8 leave out what is of second order in tilt and rates: a hundredth of both
    /// leaves a ten-thousandth of the difference.
    #[test]
    fn with_little_tilt_it_is_the_simplified_body() {
        let apart = |scale: f64| {
            let attitude = Vector3::new(0.8, 0.1 * scale, -0.2 * scale);
            let rates = Vector3::new(0.5, 0.3, -0.1) * scale;
            let start = State { attitude, rates, ..State::default() };
            let torque = Vector3::new(0.4, -0.2, 0.3) * scale;
            let inputs = Inputs { thrust: GRAVITY, torque, drag: 0.2, ..Inputs::default() };
            let mut simplified = start;
            let mut rigid = RigidBody::new([2e-3, 3e-3, 4.5e-3], &start);
            for _ in 0..400 {
                simplified = simplified.step(&inputs, STEP);
                rigid = rigid.step(&inputs, STEP);
            }
            let rigid = rigid.state(simplified.attitude.x);
            (rigid.attitude - simplified.attitude).norm()
        };
        let full = apart(1.0);
        let hundredth = apart(0.01);
        assert!(full > 1e-2, "{full}");
        assert!((0.5e-4..2e-4).contains(&(hundredth / full)), "{hundredth} of {full}");
    }
}
