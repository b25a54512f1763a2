use core::f64::consts::PI;

use foxhunt_core::{
    MeasurementModel, Pose, Quantity, State, numeric_jacobian,
    parameter::{self, ParameterError},
};
use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};

/// The magnetic field of a dipole near it, at a receiver of three axes: H = G m with
/// G = (3 r̂ r̂ᵀ − 1) / (4π r³), in microamperes a metre, r from the dipole to the receiver and m
/// its moment (Jackson 1999, §5.6).
///
/// It is what an avalanche beacon at 457 kHz has around it: within a sixth of the wavelength of
/// 656 m the field is that of a magnet that turns its poles. It falls with the cube of the range
/// and lies along flux lines, which lead to the beacon on curves; a bearing along them points
/// elsewhere. Farther than some 40 m off the field that is radiated counts too, which this leaves
/// out: a tenth there.
///
/// A receiver that knows no phase of the transmitter finds the field up to its sign, so that
/// residuals take the sign that fits better.
///
/// Works on every state whose first components are the target's East and North, then the moment's
/// East, North and Up in milliampere square metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MagneticDipole {
    target_up: f64,
}

/// A range below which the field is that at it, in metres: a beacon has an extent.
const LEAST_RANGE_M: f64 = 0.2;

impl MagneticDipole {
    /// The field's East, North and Up.
    pub const QUANTITIES: [Quantity; 3] = [
        Quantity::linear("field_east_ua_per_m"),
        Quantity::linear("field_north_ua_per_m"),
        Quantity::linear("field_up_ua_per_m"),
    ];

    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the height of the target, in metres: below 0 under the snow.
    ///
    /// # Errors
    ///
    /// If the height is not finite.
    pub fn with_target_up(self, target_up: f64) -> Result<Self, ParameterError> {
        Ok(Self { target_up: parameter::finite("target_up", target_up)? })
    }

    /// G, in microamperes a metre for each milliampere square metre of the moment: symmetric, of
    /// the eigenvalue 2 along the line of sight and −1 across it, over 4π r³.
    #[must_use]
    pub fn field_per_moment(&self, place: &Vector2<f64>, receiver: &Pose) -> Matrix3<f64> {
        let sight = receiver.position - place.push(self.target_up);
        let range = sight.norm();
        if !range.is_finite() {
            return Matrix3::zeros();
        }
        let direction = if range > 0.0 { sight / range } else { Vector3::z() };
        let reach = range.max(LEAST_RANGE_M);
        let scale = 1e3 / (4.0 * PI * reach * reach * reach);
        (direction * direction.transpose() * 3.0 - Matrix3::identity()) * scale
    }

    fn field<const N: usize>(&self, state: &State<N>, receiver: &Pose) -> Vector3<f64> {
        const { assert!(N >= 5, "a state holds East, North and the moment") };
        let place = Vector2::new(state[0], state[1]);
        let moment = Vector3::new(state[2], state[3], state[4]);
        let field = self.field_per_moment(&place, receiver) * moment;
        if field.iter().all(|part| part.is_finite()) { field } else { Vector3::zeros() }
    }
}

impl<const N: usize> MeasurementModel<N, 3> for MagneticDipole {
    fn quantities(&self) -> [Quantity; 3] {
        Self::QUANTITIES
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector3<f64> {
        self.field(state, receiver)
    }

    /// z − ẑ or −z − ẑ, the shorter one.
    fn residual(&self, z: &Vector3<f64>, expected: &Vector3<f64>) -> Vector3<f64> {
        if z.dot(expected) < 0.0 { -z - expected } else { z - expected }
    }

    fn expected_change(
        &self,
        state: &State<N>,
        expected: &Vector3<f64>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> Vector3<f64> {
        self.field(&(state + offset), receiver) - expected
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 3, N> {
        numeric_jacobian(state, |x| self.field(x, receiver), |a, b| a - b)
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use core::f64::consts::TAU;

    use nalgebra::SVector;

    use super::*;

    fn field(moment: [f64; 3], receiver: [f64; 3]) -> Vector3<f64> {
        let [x, y, z] = moment;
        let state = SVector::<f64, 5>::from([0.0, 0.0, x, y, z]);
        let [x, y, z] = receiver;
        MagneticDipole::new().expected(&state, &Pose::at(x, y, z))
    }

    /// A moment of 1 A m² in free space: 1/(4π r³) A/m abeam and twice that ahead.
    #[test]
    fn it_is_a_dipole() {
        let abeam = field([1e3, 0.0, 0.0], [0.0, 10.0, 0.0]);
        assert!((abeam - Vector3::new(-1e6 / (4e3 * PI), 0.0, 0.0)).norm() < 1e-9);
        let ahead = field([1e3, 0.0, 0.0], [10.0, 0.0, 0.0]);
        assert!((ahead + 2.0 * abeam).norm() < 1e-9);
        // The least that a beacon must have 10 m off (ETSI EN 300 718-1), 0.5 µA/m abeam.
        let least = field([TAU, 0.0, 0.0], [0.0, 0.0, 10.0]).norm();
        assert_abs_diff_eq!(least, 0.5, epsilon = 1e-4);
        // Twice as far an eighth.
        let far = field([TAU, 0.0, 0.0], [0.0, 0.0, 20.0]).norm();
        assert_abs_diff_eq!(far, least / 8.0, epsilon = 1e-12);
    }

    /// Flux lines: at the latitude λ from the dipole's equator the field dips by atan(2 tan λ), so
    /// that it does not point along the line of sight.
    #[test]
    fn the_field_lies_along_flux_lines() {
        for latitude in [0.3_f64, 0.8, 1.2] {
            let (sin, cos) = latitude.sin_cos();
            // The moment points North.
            let h = field([0.0, 5.0, 0.0], [10.0 * cos, 10.0 * sin, 0.0]);
            let along = h.x * cos + h.y * sin;
            let across = -h.x * sin + h.y * cos;
            assert_abs_diff_eq!(-along / across, 2.0 * latitude.tan(), epsilon = 1e-9);
        }
    }

    /// Beside a coil the field has neither sources nor curls (Maxwell's equations).
    #[test]
    fn its_divergence_and_curl_are_zero() {
        let at = |x: f64, y: f64, z: f64| field([3.0, -5.0, 8.0], [x, y, z]);
        let x = 4.0;
        let y = 7.0;
        let z = -3.0;
        let step = 1e-4;
        let slope = |a: Vector3<f64>, b: Vector3<f64>| (a - b) / (2.0 * step);
        let dx = slope(at(x + step, y, z), at(x - step, y, z));
        let dy = slope(at(x, y + step, z), at(x, y - step, z));
        let dz = slope(at(x, y, z + step), at(x, y, z - step));
        assert_abs_diff_eq!(dx.x + dy.y + dz.z, 0.0, epsilon = 1e-7);
        let curl = Vector3::new(dy.z - dz.y, dz.x - dx.z, dx.y - dy.x);
        assert!(curl.norm() < 1e-7 && dx.norm() > 0.1, "{curl}");
    }

    #[test]
    fn the_sign_of_a_field_is_not_measured() {
        let model = MagneticDipole::new();
        let z = Vector3::new(1.0, 2.0, -0.5);
        let expected = Vector3::new(-0.9, -2.1, 0.4);
        let residual = |z: &Vector3<f64>| MeasurementModel::<5, 3>::residual(&model, z, &expected);
        assert!((residual(&z) - residual(&-z)).norm() < 1e-12);
        assert!(residual(&z).norm() < 0.2);
    }
}
