//! Small models: filters know no sensors.

use foxhunt_core::{MeasurementModel, Observation, Pose, Quantity, State};
use nalgebra::{Matrix2, SMatrix, Vector2};

/// RSS [dBm] and bearing [rad] of a transmitter on the ground; its power at 1 m is the last
/// component of the state, where there is one beside East and North.
#[derive(Clone, Copy, Debug)]
pub(super) struct LevelBearing {
    pub(super) exponent: f64,
}

pub(super) const MODEL: LevelBearing = LevelBearing { exponent: 2.3 };

/// The power at 1 m that a state of two components has.
pub(super) const POWER_DBM: f64 = -30.0;

impl<const N: usize> MeasurementModel<N, 2> for LevelBearing {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BEARING]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector2<f64> {
        let east = state[0] - receiver.position.x;
        let north = state[1] - receiver.position.y;
        let range = east.hypot(north).hypot(receiver.position.z).max(1e-3);
        let power = if N > 2 { state[N - 1] } else { POWER_DBM };
        Vector2::new(power - 10.0 * self.exponent * range.log10(), north.atan2(east))
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 2, N> {
        let east = state[0] - receiver.position.x;
        let north = state[1] - receiver.position.y;
        let flat = (east * east + north * north).max(1e-6);
        let slope = -10.0 * self.exponent / std::f64::consts::LN_10;
        let slope = slope / (flat + receiver.position.z.powi(2));
        let mut jacobian = SMatrix::<f64, 2, N>::zeros();
        (jacobian[(0, 0)], jacobian[(0, 1)]) = (slope * east, slope * north);
        (jacobian[(1, 0)], jacobian[(1, 1)]) = (-north / flat, east / flat);
        if N > 2 {
            jacobian[(0, N - 1)] = 1.0;
        }
        jacobian
    }
}

/// An observation with independent noise.
pub(super) fn observed(receiver: Pose, z: Vector2<f64>, sigma: Vector2<f64>) -> Observation<2> {
    let noise = Matrix2::from_diagonal(&sigma.component_mul(&sigma));
    Observation::new(0.0, receiver, z, noise).expect("finite, of positive variance")
}

/// Receivers at a height of 30 m along a rectangle of 200 m by 120 m from the origin on.
pub(super) fn round(count: u16) -> Vec<Pose> {
    let at = |i: u16| {
        let way = 640.0 * f64::from(i) / f64::from(count);
        let (east, north) = match way {
            w if w < 200.0 => (w, 0.0),
            w if w < 320.0 => (200.0, w - 200.0),
            w if w < 520.0 => (520.0 - w, 120.0),
            w => (0.0, 640.0 - w),
        };
        Pose::at(east, north, 30.0)
    };
    (0..count).map(at).collect()
}
