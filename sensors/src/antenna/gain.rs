//! An antenna's gain over direction, its figures of merit, and its gain with reflections.

use alloc::{boxed::Box, sync::Arc};
use core::{
    f64::consts::{FRAC_PI_2, LOG10_2, PI},
    fmt::Debug,
};

/// 10 log₁₀ 2: the loss at half the power, in dB.
const HALF_POWER_DB: f64 = 10.0 * LOG10_2;

/// Steps of a search, in radians: a narrower lobe may be missed.
const STEP: f64 = PI / 180.0;

/// Waves that cancel are this far below the direct one on boresight, in dB.
const CANCELLED_DB: f64 = -200.0;

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
        main_lobe(|a, e| self.gain_dbi(a, e))
    }

    /// The angle in radians between the half-power points about the main lobe, in the cut of
    /// azimuth at its elevation; `None` where the gain never falls by half.
    fn half_power_beamwidth(&self) -> Option<f64> {
        azimuth_beamwidth(&self.main_lobe(), |a, e| self.gain_dbi(a, e))
    }

    /// The angle in radians between the half-power points in the cut of elevation through the main
    /// lobe; `None` where the gain does not fall by
    /// half within a quarter turn up and down.
    fn elevation_half_power_beamwidth(&self) -> Option<f64> {
        elevation_beamwidth(&self.main_lobe(), |a, e| self.gain_dbi(a, e))
    }

    /// The gain of the main lobe over that straight opposite to it, in dB.
    fn front_to_back_db(&self) -> f64 {
        let lobe = self.main_lobe();
        lobe.gain_dbi - self.gain_dbi(lobe.azimuth + core::f64::consts::PI, -lobe.elevation)
    }

    /// The power of the main lobe over its mean over the sphere, in dBi (IEEE Std 145-2013): the
    /// gain without losses.
    fn directivity_dbi(&self) -> f64 {
        directivity_dbi(&self.main_lobe(), |a, e| self.gain_dbi(a, e))
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

/// The direction of an antenna's largest gain.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct MainLobe {
    /// Azimuth in radians counter-clockwise of the boresight.
    pub azimuth: f64,
    /// Elevation in radians above the plane through the boresight.
    pub elevation: f64,
    /// The gain there.
    pub gain_dbi: f64,
}

/// A wave that reaches an antenna beside the direct one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectedWave {
    /// Azimuth that it comes from, in radians counter-clockwise of the boresight.
    pub azimuth: f64,
    /// Elevation that it comes from, in radians above the plane through the boresight.
    pub elevation: f64,
    /// The amplitude of its field over that of the direct wave, before the antenna.
    pub amplitude: f64,
    /// Phase by which it leads the direct wave, in radians.
    pub phase: f64,
}

fn degrees(whole: i16) -> f64 {
    f64::from(whole).to_radians()
}

/// The strongest direction: on a grid of whole degrees from the horizon up and down, then by
/// halving steps. The first of equal ones is taken, so that a gain that does not depend on
/// elevation has a level lobe.
fn main_lobe(gain_dbi: impl Fn(f64, f64) -> f64) -> MainLobe {
    let lobe = |azimuth: f64, elevation: f64| {
        let (azimuth, elevation) = over_the_pole(azimuth, elevation);
        MainLobe { azimuth, elevation, gain_dbi: gain_dbi(azimuth, elevation) }
    };
    let mut best = lobe(0.0, 0.0);
    for level in 0..=90 {
        for elevation in [level, -level] {
            for azimuth in (0..180).flat_map(|a| [a, -1 - a]) {
                let other = lobe(degrees(azimuth), degrees(elevation));
                // Rounding must not make one of two equal directions the better one.
                if other.gain_dbi > best.gain_dbi + 1e-9 {
                    best = other;
                }
            }
        }
    }
    let mut step = 0.5 * STEP;
    while step > 1e-9 {
        let from = best;
        let beside = [(step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)];
        for (across, up) in beside {
            let other = lobe(from.azimuth + across, from.elevation + up);
            if other.gain_dbi > best.gain_dbi + 1e-12 {
                best = other;
            }
        }
        if best == from {
            step *= 0.5;
        }
    }
    best
}

/// Brings a direction's elevation within a quarter turn of the horizon.
fn over_the_pole(azimuth: f64, elevation: f64) -> (f64, f64) {
    if elevation > FRAC_PI_2 {
        (azimuth + PI, PI - elevation)
    } else if elevation < -FRAC_PI_2 {
        (azimuth + PI, -PI - elevation)
    } else {
        (azimuth, elevation)
    }
}

/// The angle between the half-power points of a cut about its maximum at 0, each at most `most`
/// degrees from it.
fn beamwidth(cut: impl Fn(f64) -> f64, most: i16) -> Option<f64> {
    let level = cut(0.0) - HALF_POWER_DB;
    let crossing = |side: f64| {
        let mut outside = (1..=most).map(|i| side * degrees(i)).find(|&a| cut(a) < level)?;
        let mut inside = outside - side * STEP;
        for _ in 0..60 {
            let middle = 0.5 * (inside + outside);
            *(if cut(middle) < level { &mut outside } else { &mut inside }) = middle;
        }
        Some(0.5 * (inside + outside).abs())
    };
    Some(crossing(1.0)? + crossing(-1.0)?)
}

/// The cut of azimuth through a direction, at its elevation.
fn azimuth_beamwidth(lobe: &MainLobe, gain_dbi: impl Fn(f64, f64) -> f64) -> Option<f64> {
    beamwidth(|a| gain_dbi(lobe.azimuth + a, lobe.elevation), 180)
}

/// The great circle of elevation through a direction, a quarter turn up and down.
fn elevation_beamwidth(lobe: &MainLobe, gain_dbi: impl Fn(f64, f64) -> f64) -> Option<f64> {
    let cut = |up: f64| {
        let (azimuth, elevation) = over_the_pole(lobe.azimuth, lobe.elevation + up);
        gain_dbi(azimuth, elevation)
    };
    beamwidth(cut, 90)
}

/// The mean over the sphere of a function of azimuth and elevation: bands of 1°, each weighted by
/// its share of the sphere. Errs by about 10⁻⁵ for a beam tens of degrees wide.
pub(super) fn mean_over_sphere(of: impl Fn(f64, f64) -> f64) -> f64 {
    let band = |below: i16| {
        let share = 0.5 * (libm::sin(degrees(below + 1)) - libm::sin(degrees(below)));
        let elevation = degrees(below) + 0.5 * STEP;
        share * (0..360).map(|a| of(degrees(a), elevation)).sum::<f64>() / 360.0
    };
    (-90..90).map(band).sum()
}

/// 10 log₁₀(4π U_max / ∮ U dΩ) (IEEE Std 145-2013; Balanis 2016, eq. 2-22), with the
/// radiation intensity U in proportion to the gain.
fn directivity_dbi(lobe: &MainLobe, gain_dbi: impl Fn(f64, f64) -> f64) -> f64 {
    let largest = lobe.gain_dbi;
    // Relative to the maximum, so that no level overflows.
    -10.0 * libm::log10(mean_over_sphere(|a, e| linear(gain_dbi(a, e) - largest)))
}

/// Converts a gain in dB to a factor of power.
pub(super) fn linear(gain_db: f64) -> f64 {
    libm::exp10(0.1 * gain_db)
}

/// Gain of an antenna for a direct wave and its reflections, in dB over the direct wave at an
/// isotropic antenna: 20 log₁₀ |g(a) + Σ Γᵢ e^(jφᵢ) g(aᵢ)| with the amplitude g =
/// 10^(G/20).
///
/// The antenna's own phase is taken for the same in all directions; patterns do not hold it.
#[must_use]
pub fn multipath_gain_dbi(
    antenna: &(impl Antenna + ?Sized),
    azimuth: f64,
    elevation: f64,
    reflected: &[ReflectedWave],
) -> f64 {
    let direct = antenna.gain_dbi(azimuth, elevation);
    if reflected.is_empty() {
        return direct;
    }
    let mut real = 1.0;
    let mut imaginary = 0.0;
    for wave in reflected {
        let gain = antenna.gain_dbi(wave.azimuth, wave.elevation) - direct;
        let amplitude = wave.amplitude * libm::sqrt(linear(gain));
        real += amplitude * libm::cos(wave.phase);
        imaginary += amplitude * libm::sin(wave.phase);
    }
    let sum = 20.0 * libm::log10(libm::hypot(real, imaginary));
    direct + sum.max(CANCELLED_DB)
}
