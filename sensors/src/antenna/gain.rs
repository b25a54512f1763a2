use alloc::{boxed::Box, sync::Arc};
use core::fmt::Debug;

use super::{MainLobe, figures};

/// An antenna: its gain over direction, and what follows from it.
///
/// Directions are the antenna's own: azimuth in radians, counter-clockwise from the boresight
/// as viewed from above, and elevation in radians above the plane through the boresight, from −π/2
/// to π/2.
///
/// ```
/// use foxhunt_sensors::Antenna;
///
/// /// A lobe of 9 dBi that falls by 12 dB for the square of every 45° off boresight, to −15 dBi.
/// #[derive(Debug)]
/// struct Lobe;
///
/// impl Antenna for Lobe {
///     fn gain_dbi(&self, azimuth: f64, elevation: f64) -> f64 {
///         let off = (azimuth.cos() * elevation.cos()).clamp(-1.0, 1.0).acos();
///         (9.0 - 12.0 * (off / 45_f64.to_radians()).powi(2)).max(-15.0)
///     }
/// }
///
/// let width = Lobe.half_power_beamwidth().expect("it falls by 3 dB");
/// assert!((width.to_degrees() - 45.0).abs() < 0.2);
/// ```
///
/// # Laws
///
/// The gain is finite in every direction, and the same after a whole turn of azimuth.
pub trait Antenna: Debug {
    /// The gain in dBi; of one whose absolute gain is not known, in dB about an unknown level.
    fn gain_dbi(&self, azimuth: f64, elevation: f64) -> f64;

    /// The mean of the gain in dB over a turn at an elevation; over whole degrees unless
    /// overridden.
    fn mean_gain_db(&self, elevation: f64) -> f64 {
        let gain = |degree: u16| self.gain_dbi(f64::from(degree).to_radians(), elevation);
        (0..360).map(gain).sum::<f64>() / 360.0
    }

    /// The direction of the largest gain: searched in steps of 1°, then refined. The one nearest to
    /// the horizon is taken of equal ones.
    fn main_lobe(&self) -> MainLobe {
        figures::main_lobe(|a, e| self.gain_dbi(a, e))
    }

    /// The angle in radians between the half-power points about the main lobe, in the cut of
    /// azimuth at its elevation; `None` where the gain never falls by half.
    fn half_power_beamwidth(&self) -> Option<f64> {
        figures::azimuth_beamwidth(&self.main_lobe(), |a, e| self.gain_dbi(a, e))
    }

    /// The angle in radians between the half-power points in the cut of elevation through the main
    /// lobe; `None` where the gain does not fall by
    /// half within a quarter turn up and down.
    fn elevation_half_power_beamwidth(&self) -> Option<f64> {
        figures::elevation_beamwidth(&self.main_lobe(), |a, e| self.gain_dbi(a, e))
    }

    /// The gain of the main lobe over that straight opposite to it, in dB.
    fn front_to_back_db(&self) -> f64 {
        let lobe = self.main_lobe();
        lobe.gain_dbi - self.gain_dbi(lobe.azimuth + core::f64::consts::PI, -lobe.elevation)
    }

    /// The power of the main lobe over its mean over the sphere, in dBi (IEEE Std 145-2013): the
    /// gain without losses.
    fn directivity_dbi(&self) -> f64 {
        figures::directivity_dbi(&self.main_lobe(), |a, e| self.gain_dbi(a, e))
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

            fn main_lobe(&self) -> MainLobe {
                (**self).main_lobe()
            }

            fn half_power_beamwidth(&self) -> Option<f64> {
                (**self).half_power_beamwidth()
            }

            fn elevation_half_power_beamwidth(&self) -> Option<f64> {
                (**self).elevation_half_power_beamwidth()
            }

            fn front_to_back_db(&self) -> f64 {
                (**self).front_to_back_db()
            }

            fn directivity_dbi(&self) -> f64 {
                (**self).directivity_dbi()
            }
        }
    )*};
}

forward!(&A, Box<A>, Arc<A>);
