use super::Antenna;

/// An antenna that has the same gain in all directions: 0 dBi.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Isotropic;

impl Antenna for Isotropic {
    fn gain_dbi(&self, _azimuth: f64, _elevation: f64) -> f64 {
        0.0
    }

    fn mean_gain_db(&self, _elevation: f64) -> f64 {
        0.0
    }
}
