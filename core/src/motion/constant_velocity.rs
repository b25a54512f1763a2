use nalgebra::Matrix4;

use crate::{MotionModel, State};

/// Nearly constant velocity in the plane, x = (E, N, Ė, Ṅ), driven by white acceleration.
///
/// Q is the continuous-time one of Bar-Shalom, Li & Kirubarajan 2001, §6.2.2: per axis
/// q [Δt³/3, Δt²/2; Δt²/2, Δt].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantVelocity {
    /// √q: the root of the acceleration's spectral density, in m s⁻² per √Hz.
    pub acceleration_density: f64,
}

impl MotionModel<4> for ConstantVelocity {
    fn propagate(&self, state: &State<4>, dt: f64) -> State<4> {
        transition(dt) * state
    }

    fn propagated_change(
        &self,
        _state: &State<4>,
        _propagated: &State<4>,
        offset: &State<4>,
        dt: f64,
    ) -> State<4> {
        transition(dt) * offset
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn noise_factor(&self, _state: &State<4>, dt: f64) -> Matrix4<f64> {
        let root = self.acceleration_density * libm::sqrt(dt);
        let position = dt / libm::sqrt(3.0);
        let coupling = libm::sqrt(3.0) / 2.0;
        let velocity = 0.5;
        #[rustfmt::skip]
        let shape = Matrix4::new(
            position, 0.0,      0.0,      0.0,
            0.0,      position, 0.0,      0.0,
            coupling, 0.0,      velocity, 0.0,
            0.0,      coupling, 0.0,      velocity,
        );
        shape * root
    }

    fn jacobian(&self, _state: &State<4>, dt: f64) -> Matrix4<f64> {
        transition(dt)
    }

    #[inline(always)]
    fn move_columns(&self, columns: [&mut [f64]; 4], white: [&[f64]; 4], dt: f64) {
        let factor = self.noise_factor(&State::zeros(), dt);
        let place = factor[(0, 0)];
        let coupling = factor[(2, 0)];
        let rate = factor[(2, 2)];
        let [east, north, east_rate, north_rate] = columns;
        for (x, v, first, second) in
            [(east, east_rate, white[0], white[2]), (north, north_rate, white[1], white[3])]
        {
            for (((x, v), first), second) in x.iter_mut().zip(v).zip(first).zip(second) {
                *x += *v * dt + place * first;
                *v += coupling * first + rate * second;
            }
        }
    }
}

fn transition(dt: f64) -> Matrix4<f64> {
    #[rustfmt::skip]
    let transition = Matrix4::new(
        1.0, 0.0, dt,  0.0,
        0.0, 1.0, 0.0, dt,
        0.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 1.0,
    );
    transition
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_is_one_of_q() {
        let dt = 1.7;
        let root = 0.3;
        let l = ConstantVelocity { acceleration_density: root }.noise_factor(&State::zeros(), dt);
        let q = l * l.transpose();
        let scale = root * root;
        assert!((q[(0, 0)] - scale * dt * dt * dt / 3.0).abs() < 1e-14);
        assert!((q[(0, 2)] - scale * dt * dt / 2.0).abs() < 1e-14);
        assert!((q[(2, 2)] - scale * dt).abs() < 1e-14);
        assert!(q[(0, 1)].abs() < 1e-14 && q[(0, 3)].abs() < 1e-14);
    }
}
