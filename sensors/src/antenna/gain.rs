use alloc::{boxed::Box, sync::Arc};
use core::fmt::Debug;

/// An antenna: its gain over direction.
///
/// Directions are the antenna's own: azimuth in radians counter-clockwise of the boresight, seen
/// from above, and elevation in radians above the plane through the boresight. The gain is finite
/// in every direction.
pub trait Antenna: Debug {
    /// The gain in dBi; of one whose absolute gain is not known, in dB about an unknown level.
    fn gain_dbi(&self, azimuth: f64, elevation: f64) -> f64;

    /// The mean of the gain in dB over a turn at an elevation; over whole degrees unless
    /// overridden.
    fn mean_gain_db(&self, elevation: f64) -> f64 {
        let gain = |degree: u16| self.gain_dbi(f64::from(degree).to_radians(), elevation);
        (0..360).map(gain).sum::<f64>() / 360.0
    }
}

macro_rules! forward {
    ($($pointer:ty),*) => {$(
        #[deny(clippy::missing_trait_methods)]
        impl<A: Antenna + ?Sized> Antenna for $pointer {
            fn gain_dbi(&self, azimuth: f64, elevation: f64) -> f64 {
                (**self).gain_dbi(azimuth, elevation)
            }

            fn mean_gain_db(&self, elevation: f64) -> f64 {
                (**self).mean_gain_db(elevation)
            }
        }
    )*};
}

forward!(&A, Box<A>, Arc<A>);
