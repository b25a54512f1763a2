//! An antenna's figures of merit, from its gain alone.

use core::f64::consts::{FRAC_PI_2, LOG10_2, PI};

use super::linear;

/// 10 log₁₀ 2: the loss at half the power, in dB.
const HALF_POWER_DB: f64 = 10.0 * LOG10_2;

/// Steps of a search, in radians: a narrower lobe may be missed.
const STEP: f64 = PI / 180.0;

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

fn degrees(whole: i16) -> f64 {
    f64::from(whole).to_radians()
}

/// The strongest direction: on a grid of whole degrees from the horizon up and down, then by
/// halving steps. The first of equal ones is taken, so that a gain that does not depend on
/// elevation has a level lobe.
pub(super) fn main_lobe(gain_dbi: impl Fn(f64, f64) -> f64) -> MainLobe {
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
pub(super) fn azimuth_beamwidth(
    lobe: &MainLobe,
    gain_dbi: impl Fn(f64, f64) -> f64,
) -> Option<f64> {
    beamwidth(|a| gain_dbi(lobe.azimuth + a, lobe.elevation), 180)
}

/// The great circle of elevation through a direction, a quarter turn up and down.
pub(super) fn elevation_beamwidth(
    lobe: &MainLobe,
    gain_dbi: impl Fn(f64, f64) -> f64,
) -> Option<f64> {
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

/// 10 log₁₀(4π U_max / ∮ U dΩ) (IEEE Std 145-2013; Balanis 2016, eq. 2-22), with the radiation
/// intensity U in proportion to the gain.
pub(super) fn directivity_dbi(lobe: &MainLobe, gain_dbi: impl Fn(f64, f64) -> f64) -> f64 {
    let largest = lobe.gain_dbi;
    // Relative to the maximum, so that no level overflows.
    -10.0 * libm::log10(mean_over_sphere(|a, e| linear(gain_dbi(a, e) - largest)))
}
