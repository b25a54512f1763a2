//! Tables of extractors.

use std::f64::consts::TAU;

use foxhunt::{
    config::ExtractorConfig,
    core::{NoReading, Reading, Sample, Sweep},
    registry::Registry,
    sensors::{AntennaConfig, YagiConfig},
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::keys::silent;

/// Turns by the number of boresights, the readings at each and their σ in dB: a good one, one
/// whose readings do not show their σ, one with few boresights, and one that shows little.
const TURNS: [(u16, u16, f64); 4] = [(24, 5, 2.0), (24, 1, 1.0), (9, 1, 1.0), (24, 2, 8.0)];

/// An antenna whose gain depends on the elevation, unlike the reference's.
fn antenna() -> AntennaConfig {
    AntennaConfig::Yagi(YagiConfig::default())
}

/// Returns the readings of an extractor, one for each turn.
fn readings(config: &ExtractorConfig) -> Result<Vec<Result<Reading, NoReading>>, String> {
    let extractor = config.build().map_err(|error| error.to_string())?;
    let yagi = antenna().build().expect("in range");
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
    let mut read = |(positions, each, sigma_db): (u16, u16, f64)| {
        let samples: Vec<Sample> = (0..positions * each)
            .map(|i| {
                let position = i % positions;
                let boresight = TAU * f64::from(position) / f64::from(positions);
                let noise = sigma_db * rng.sample::<f64, _>(StandardNormal);
                // A wave from 1 rad, and a reflection from the other side.
                let power = |from: f64, dbm: f64| {
                    10_f64.powf(0.1 * (dbm + yagi.gain_dbi(from - boresight, 0.0)))
                };
                let sum = power(1.0, -70.0) + power(3.5, -77.0);
                let rss_dbm = 10.0 * sum.log10() + noise;
                Sample { time: 0.0, receiver: Default::default(), boresight, position, rss_dbm }
            })
            .collect();
        extractor.extract(&Sweep { positions, samples: &samples, ..Sweep::default() })
    };
    Ok(TURNS.into_iter().map(&mut read).collect())
}

#[test]
fn every_setting_of_every_extractor_changes_something_or_is_refused() {
    for named in Registry::builtin().extractors() {
        let config = named.config();
        let config = config.clone().with_antenna(&antenna()).unwrap_or(config);
        assert_eq!(
            silent(&config, &[()], |config, ()| readings(config)),
            [""; 0],
            "{}",
            named.name
        );
    }
}

#[test]
fn what_is_written_is_read_back_and_built() {
    for named in Registry::builtin().extractors() {
        let config = named.config();
        let text = toml::to_string(&config).expect("plain data");
        assert!(text.contains(&format!("kind = \"{}\"", named.name)), "{text}");
        assert_eq!(toml::from_str::<ExtractorConfig>(&text), Ok(config.clone()));
        let bare = format!("kind = \"{}\"", named.name);
        assert_eq!(toml::from_str::<ExtractorConfig>(&bare), Ok(config.clone()));
        assert!(config.build().is_ok(), "{}", named.name);
        let other = config.clone().with_antenna(&AntennaConfig::Isotropic);
        let known = other.as_ref().and_then(ExtractorConfig::known_antenna);
        assert_eq!(known.is_some(), config.known_antenna().is_some(), "{}", named.name);
        assert!(known.is_none_or(|(antenna, _)| *antenna == AntennaConfig::Isotropic));
    }
}

#[test]
fn mistakes_are_named() {
    for (text, expected) in [
        ("kind = 'maximum'\nwindow = 7", "window"),
        ("kind = 'maximum-likelihood'\nantena = 'dipole'", "antena"),
        ("kind = 'magic'", "magic"),
        ("kind = 'cross-correlation'\ndegrees = -7", "unknown field `degrees`"),
        ("kind = 'cross-correlation'\nmin_positions = 9", "unknown field `min_positions`"),
    ] {
        let error = toml::from_str::<ExtractorConfig>(text).expect_err(text).to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
    for (text, expected) in [
        ("kind = 'maximum'\nrss_sigma_db = 0", "rss_sigma_db is 0"),
        ("kind = 'maximum-likelihood'\nmin_positions = 2", "min_positions is 2"),
        ("kind = 'cross-correlation'\nantenna = { file = 'no.msi' }", "no.msi"),
        ("kind = 'maximum-likelihood-t'\nelevation_deg = 100", "elevation"),
        ("kind = 'maximum-likelihood'\nsteepest_deg = -95", "steepest"),
        ("kind = 'maximum-likelihood-t'\nsteepest_deg = -40", "steepest_deg is -40"),
        ("kind = 'maximum-likelihood'\ndegrees = 1000", "degrees is 1000"),
    ] {
        let config = toml::from_str::<ExtractorConfig>(text).expect(text);
        let error = config.build().map(|_| ()).expect_err(text).to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
}
