//! Your own measurement: range difference to a reference station, Doppler shift and bearing.

use foxhunt::nalgebra::Vector3;
use foxhunt::prelude::*;

/// The Doppler shift of the carrier, in hertz.
pub const DOPPLER: Quantity = Quantity::linear("doppler_hz");

/// Hertz for each metre per second of approach, at 433.92 MHz.
pub const HZ_PER_MPS: f64 = 433.92e6 / 299_792_458.0;

/// Measurement of a beacon on the ground by the array on a drone.
#[derive(Clone, Copy, Debug)]
pub struct TdoaDopplerBearing {
    /// Place of the reference station: East, North and Up in metres.
    pub reference: Vector3<f64>,
}

impl TdoaDopplerBearing {
    /// Range difference in metres, Doppler shift in hertz and bearing in radians.
    pub fn values(&self, target: &Vector3<f64>, receiver: &Pose) -> Vector3<f64> {
        let sight = target - receiver.position;
        let range = sight.norm().max(1e-9);
        let approach = receiver.velocity.unwrap_or_default().dot(&sight) / range;
        let difference = range - (target - self.reference).norm();
        Vector3::new(difference, HZ_PER_MPS * approach, sight.y.atan2(sight.x))
    }
}

impl MeasurementModel<2, 3> for TdoaDopplerBearing {
    fn quantities(&self) -> [Quantity; 3] {
        [Quantity::RANGE_DIFFERENCE, DOPPLER, Quantity::BEARING]
    }

    fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector3<f64> {
        self.values(&state.push(0.0), receiver)
    }
}
