use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt_core::angle::wrap;
use foxhunt_sim::ChannelConfig;

use crate::rig::{Rig, beacon, config, count, deviation, direction, level, mean, quiet};

/// The number of turns; a standard deviation estimated from them is 1.6 % uncertain.
const TURNS: usize = 2000;

/// Standard errors to either side; chance exceeds them with 5.7 × 10⁻⁷.
const WIDTH: f64 = 5.0;

fn assert_deviation(errors: &[f64], sigma: f64) {
    let band = WIDTH * sigma / (2.0 * count(errors)).sqrt();
    let found = deviation(errors);
    assert!(abs_diff_eq!(found, sigma, epsilon = band), "σ = {found}, not {sigma} ± {band}");
    let centre = mean(errors);
    let band = WIDTH * sigma / count(errors).sqrt();
    assert!(abs_diff_eq!(centre, 0.0, epsilon = band), "mean {centre} beyond ± {band}");
}

#[test]
fn the_mean_over_a_turn_follows_the_path_loss_law() {
    // Slant ranges of 3 to 39 m; the drone stands 1, 4, 12 and 36 m above the beacon.
    for (seed, (east, north, up, range)) in (1..).zip([
        (2.0, 2.0, 1.0, 3.0_f64),
        (-4.0, 7.0, 4.0, 9.0),
        (3.0, -4.0, 12.0, 13.0),
        (12.0, 9.0, 36.0, 39.0),
    ]) {
        let law = -29.06 - 27.65 * range.log10();
        let mut silent = config(quiet());
        silent.beacons = vec![beacon(1.0, 2.0, 0.5)];
        silent.drones[0].east_m = 1.0 - east;
        silent.drones[0].north_m = 2.0 - north;
        silent.drones[0].up_m = 0.5 + up;
        // Without noise all that is left is a mean over 128 points in place of an integral.
        let found = level(&Rig::new(&silent, seed).turn(0, 1));
        assert!(abs_diff_eq!(found, law, epsilon = 1e-3), "{found} dBm at {range} m, not {law}");

        let mut noisy = silent.clone();
        noisy.channel = ChannelConfig::default();
        let mut rig = Rig::new(&noisy, seed);
        let turns: Vec<f64> = (0..TURNS / 4).map(|_| level(&rig.turn(0, 1)) - law).collect();
        assert_deviation(&turns, (4.0_f64.powi(2) + 2.0_f64.powi(2) / 128.0).sqrt());
    }
}

#[test]
fn offsets_and_bearing_errors_have_their_sigma_and_are_independent() {
    let channel = ChannelConfig { sample_sigma_db: 0.0, ..ChannelConfig::default() };
    let mut rig = Rig::new(&config(channel), 5);
    let law = -29.06 - 27.65 * 50.0_f64.log10();
    let truth = 40.0_f64.atan2(30.0);
    let turns: Vec<_> = (0..TURNS).map(|_| rig.turn(0, 1)).collect();
    let offsets: Vec<f64> = turns.iter().map(|turn| level(turn) - law).collect();
    let errors: Vec<f64> = turns.iter().map(|turn| wrap(direction(turn) - truth)).collect();
    assert_deviation(&offsets, 4.0);
    assert_deviation(&errors, 30.0_f64.to_radians());

    // Products of independent draws have the product of their σ as σ.
    let product = |(a, b): (&f64, &f64)| a * b;
    let cross: Vec<f64> = offsets.iter().zip(&errors).map(product).collect();
    let serial =
        |values: &[f64]| -> Vec<f64> { values.iter().zip(&values[1..]).map(product).collect() };
    for (products, sigma) in [
        (cross, 4.0 * 30.0_f64.to_radians()),
        (serial(&offsets), 16.0),
        (serial(&errors), 30.0_f64.to_radians().powi(2)),
    ] {
        let band = WIDTH * sigma / count(&products).sqrt();
        assert!(mean(&products).abs() < band, "{} beyond ± {band}", mean(&products));
    }
}

#[test]
fn each_sample_has_its_own_noise() {
    let noisy = ChannelConfig { sample_sigma_db: 2.0, ..quiet() };
    let clean = Rig::new(&config(quiet()), 6).turn(0, 6);
    let noise: Vec<f64> = Rig::new(&config(noisy), 6)
        .turn(0, 6)
        .iter()
        .zip(&clean)
        .map(|((_, rss), (_, clean))| rss - clean)
        .collect();
    assert_deviation(&noise, 2.0);
    let serial: Vec<f64> = noise.iter().zip(&noise[1..]).map(|(a, b)| a * b).collect();
    assert_abs_diff_eq!(mean(&serial), 0.0, epsilon = WIDTH * 4.0 / count(&serial).sqrt());
}

#[test]
fn answers_are_lost_at_their_rate_and_the_others_are_as_they_were() {
    let requested = 20_000;
    let mut whole = Rig::new(&config(ChannelConfig::default()), 7);
    let lossy = ChannelConfig { loss_probability: 0.3, ..ChannelConfig::default() };
    let mut rig = Rig::new(&config(lossy), 7);
    let answers: Vec<_> = (0..requested).map(|_| (rig.request(0), whole.receive(0))).collect();
    let readings: Vec<_> =
        answers.iter().filter_map(|(rss, all)| Some((*rss)?.to_bits() == all.to_bits())).collect();
    assert!(readings.iter().all(|same| *same));
    let rate = 1.0 - count(&readings) / f64::from(requested);
    let band = WIDTH * (0.3 * 0.7 / f64::from(requested)).sqrt();
    assert_abs_diff_eq!(rate, 0.3, epsilon = band);

    let all = ChannelConfig { loss_probability: 1.0, ..quiet() };
    let mut deaf = Rig::new(&config(all), 7);
    assert!((0..1000).all(|_| deaf.request(0).is_none()));
}
