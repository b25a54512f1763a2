//! Terms that the formulas of several antennas share.

use core::f64::consts::FRAC_PI_2;

/// Power relative to the maximum, −60 dB, at which the formulas' nulls are cut off: a real
/// antenna's nulls are filled.
const NULL_POWER: f64 = 1e-6;

/// A power in dB, nulls filled.
pub(super) fn decibels(power: f64) -> f64 {
    10.0 * libm::log10(power.max(NULL_POWER))
}

/// A direction as a unit vector: forward, left, up.
pub(super) fn direction(azimuth: f64, elevation: f64) -> [f64; 3] {
    let level = libm::cos(elevation);
    [level * libm::cos(azimuth), level * libm::sin(azimuth), libm::sin(elevation)]
}

/// The lobe to the rear, over the forward component of the direction: `power` straight back, and a
/// tenth of that at about 94° from there. The form is the reference patch's.
pub(super) fn back_lobe(forward: f64, power: f64) -> f64 {
    let behind = 0.5 * (1.0 - forward);
    power * behind * behind * behind
}

/// The power of a half-wave dipole along Up, relative to that at the horizon:
/// (cos(π/2 · sin e) / cos e)² (Balanis 2016, eq. 4-84, with the angle from the axis π/2 − e).
pub(super) fn half_wave_dipole(elevation: f64) -> f64 {
    // cos(π/2 · sin e) = sin(π/2 · (1 − |sin e|)), and 1 − |sin e| = cos² e / (1 + |sin e|): no
    // cancellation at the poles.
    let cos = libm::cos(elevation);
    let sin = libm::fabs(libm::sin(elevation));
    if cos.abs() < f64::MIN_POSITIVE {
        return 0.0;
    }
    let field = libm::sin(FRAC_PI_2 * cos * cos / (1.0 + sin)) / cos;
    field * field
}
