//! Laws of propagation and multipath against closed forms.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use core::f64::consts::{FRAC_PI_2, PI, TAU};

use foxhunt_sensors::{
    Cardioid, Friis, Isotropic, Polarisation, Propagation, ReflectedWave, TwoRay,
    multipath_gain_dbi,
};
use proptest::prelude::*;

const WAVELENGTH: f64 = 0.125;

fn two_ray(from: f64, to: f64) -> TwoRay {
    TwoRay::new(10.0, WAVELENGTH, from, to).expect("in range")
}

#[test]
fn over_no_ground_two_ray_is_friis() {
    let friis = Friis::new(10.0, 0.0, 0.0, WAVELENGTH).expect("in range");
    for polarisation in [Polarisation::Vertical, Polarisation::Horizontal] {
        let none = two_ray(1.5, 4.0).with_ground(1.0, polarisation).expect("in range");
        for range in [0.01, 3.0, 50.0, 4e4] {
            assert!((none.rss_dbm(range) - friis.rss_dbm(range)).abs() < 1e-9, "at {range} m");
            assert!((none.slope(range) - friis.slope(range)).abs() < 1e-9, "at {range} m");
        }
    }
}

/// The complex sum as the textbook writes it, with geometry in place of d′ = √(d² + 4 h₁ h₂).
#[test]
fn it_is_the_sum_of_two_waves() {
    let (from, to) = (1.5, 12.0);
    for (polarisation, e) in [(Polarisation::Vertical, 15.0), (Polarisation::Horizontal, 4.0)] {
        let law = two_ray(from, to).with_ground(e, polarisation).expect("in range");
        for ground in [1.0_f64, 7.0, 40.0, 333.0, 5e3] {
            let direct = ground.hypot(to - from);
            let reflected = ground.hypot(to + from);
            let grazing = (to + from).atan2(ground);
            let inside = (e - grazing.cos().powi(2)).sqrt();
            let (a, b) = match polarisation {
                Polarisation::Vertical => (e * grazing.sin(), inside),
                Polarisation::Horizontal => (grazing.sin(), inside),
            };
            let gamma = (a - b) / (a + b);
            let phase = TAU / WAVELENGTH * (reflected - direct);
            let real = 1.0 / direct + gamma * phase.cos() / reflected;
            let imaginary = gamma * phase.sin() / reflected;
            let power = 10.0 + 20.0 * (WAVELENGTH / (4.0 * PI) * real.hypot(imaginary)).log10();
            let ours = law.rss_dbm(direct);
            assert!((ours - power).abs() < 1e-6, "{ours}, not {power} dBm at {ground} m");
        }
    }
}

/// Rappaport 2002, eq. 4.52: Pt + 20 log₁₀(h₁ h₂ / d²), if both heights are many wavelengths.
#[test]
fn far_away_power_falls_with_the_fourth_power() {
    let law = two_ray(20.0, 30.0).with_ground(15.0, Polarisation::Horizontal).expect("in range");
    for range in [1e6, 1e7, 1e9] {
        let plane = 10.0 + 20.0 * (20.0_f64 * 30.0 / range / range).log10();
        assert!(abs_diff_eq!(law.rss_dbm(range), plane, epsilon = 0.05), "at {range} m");
        let per_decade = law.slope(range) * range * core::f64::consts::LN_10;
        assert!((per_decade + 40.0).abs() < 0.05, "{per_decade} dB per decade at {range} m");
    }
}

proptest! {
    #[test]
    fn the_slope_of_two_ray_is_the_derivative(
        range in 0.5..3e4, from in 0.1..20.0, to in 0.1..120.0, e in 1.0..80.0, upright: bool,
    ) {
        let polarisation =
            if upright { Polarisation::Vertical } else { Polarisation::Horizontal };
        let law = two_ray(from, to).with_ground(e, polarisation).expect("in range");
        // Within the heights' difference there is no such range.
        let range = range + (to - from).abs();
        let step = 1e-7 * range;
        let numeric: f64 = (law.rss_dbm(range + step) - law.rss_dbm(range - step)) / (2.0 * step);
        // Near a cancellation the second derivative is large.
        let scale = 1.0 + numeric.abs();
        prop_assert!((law.slope(range) - numeric).abs() < 2e-3 * scale, "{} {numeric}", law.slope(range));
    }
}

#[test]
fn two_ray_is_finite_at_every_range_and_refuses_what_is_out_of_range() {
    for law in [two_ray(1.0, 4.0), two_ray(1e-3, 1e-3), two_ray(1e4, 1e5)] {
        for range in [0.0, 1e-300, 1e-3, 1.0, 1e9, 1e300, f64::MAX, f64::INFINITY] {
            assert!(law.rss_dbm(range).is_finite() && law.slope(range).is_finite(), "{range}");
        }
        assert_abs_diff_eq!(law.slope(f64::INFINITY), 0.0, epsilon = 1e-300);
    }
    for [power, wavelength, from, to] in [
        [f64::NAN, 0.1, 1.0, 1.0],
        [0.0, 0.0, 1.0, 1.0],
        [0.0, 0.1, 0.0, 1.0],
        [0.0, 0.1, 1.0, -1.0],
    ] {
        assert!(TwoRay::new(power, wavelength, from, to).is_err());
    }
    assert!(two_ray(1.0, 1.0).with_ground(0.9, Polarisation::Vertical).is_err());
}

#[test]
fn reflections_add_in_amplitude() {
    let wave = |amplitude, phase| ReflectedWave { azimuth: 1.0, elevation: 0.0, amplitude, phase };
    let gain = |waves: &[ReflectedWave]| multipath_gain_dbi(&Isotropic, 0.0, 0.0, waves);
    assert_abs_diff_eq!(gain(&[]), 0.0, epsilon = 1e-12);
    for (phase, sum) in [(0.0, 1.5), (PI, 0.5), (FRAC_PI_2, 1.25_f64.sqrt())] {
        assert!((gain(&[wave(0.5, phase)]) - 20.0 * sum.log10()).abs() < 1e-9, "at {phase}");
    }
    assert!((gain(&[wave(0.5, 0.0), wave(0.5, PI)])).abs() < 1e-9, "two that cancel");
    assert!((gain(&[wave(1.0, PI)]) + 200.0).abs() < 120.0, "nothing is left, but a number");
    // Through a pattern: 6.02 dB less from the side than from ahead.
    let cardioid = Cardioid::default();
    let side = ReflectedWave { azimuth: FRAC_PI_2, elevation: 0.0, amplitude: 1.0, phase: 0.0 };
    let ours = multipath_gain_dbi(&cardioid, 0.0, 0.0, &[side]);
    let alone = multipath_gain_dbi(&cardioid, 0.0, 0.0, &[]);
    assert_abs_diff_eq!(ours - alone, 20.0 * 1.5_f64.log10(), epsilon = 1e-9);
}
