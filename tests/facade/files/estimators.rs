//! Settings of estimators, as logs hold them.

use foxhunt::{
    config::{EstimatorConfig, FilterConfig, ParticleConfig},
    core::{
        Bearing, BearingMode, BearingModes, Estimate, Level, MeasurementModel, Pose, Reception,
    },
    registry::Registry,
    sensors::{LogDistance, RssBearing},
};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::keys::silent;

const TURNS: u8 = 14;

/// Turns after which a reception comes late, or is of another direction, or has none at all.
const LATE: u8 = 9;
const WRONG: u8 = 11;
const LEVEL_ALONE: u8 = 3;

/// Returns what an estimator believes after each turn on a circle about a transmitter.
fn believed(config: &EstimatorConfig) -> Result<Vec<String>, String> {
    let model = RssBearing::new(LogDistance::new(-29.06, 2.765).expect("in range"));
    let prior = Estimate::isotropic(Vector2::zeros(), 60.0);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
    let track = config.track(model, &prior, 1, false);
    let mut track = track.map_err(|error| error.to_string())?;
    let mut said = Vec::new();
    for turn in 0..TURNS {
        let around = f64::from(turn) * 0.7;
        let receiver = Pose::at(60.0 * around.cos(), 60.0 * around.sin(), 10.0);
        let z = MeasurementModel::<2, 2>::expected(&model, &Vector2::new(30.0, 5.0), &receiver);
        let mut noise = || random.sample::<f64, _>(StandardNormal);
        let level = Level { rss_dbm: z[0] + 3.0 * noise(), sigma_db: 3.0 };
        let angle = z[1] + 0.1 * noise() + if turn == WRONG { 2.0 } else { 0.0 };
        let mode = |weight, angle| BearingMode { weight, angle, sigma: 0.1 };
        let modes = match turn % 4 {
            1 => BearingModes::new(&[mode(0.7, angle), mode(0.3, angle + 2.0)]),
            _ => BearingModes::new(&[]),
        };
        let bearing = Bearing { angle, sigma: 0.1, confidence: 1.0 };
        let reception = Reception {
            time: 3.0 * f64::from(turn) - if turn == LATE { 4.0 } else { 0.0 },
            receiver,
            level: Some(level),
            bearing: Some(bearing).filter(|_| turn != LEVEL_ALONE),
            modes: modes.unwrap_or_default(),
            ..Reception::default()
        };
        let step = track.heard_by(usize::from(turn % 3)).update(&reception, turn < 3);
        let found = track.found();
        let learned = track.learned_receivers();
        said.push(format!("{step:?} {:?} {found:?} {learned:?}", track.position()));
    }
    Ok(said)
}

#[test]
fn every_setting_of_every_estimator_changes_something_or_is_refused() {
    let mut found = Vec::new();
    for named in Registry::builtin().estimators() {
        let Some(mut settings) = named.settings().copied() else { continue };
        // Small ones, as quick as can be.
        match &mut settings.filter {
            FilterConfig::Particle(ParticleConfig { count, adaptive_bin: None, .. })
            | FilterConfig::RaoBlackwellised { count } => {
                *count = 200;
            }
            FilterConfig::Grid { side, .. } => *side = 16,
            _ => {}
        }
        let keys = silent(&settings, &[()], |settings, ()| believed(settings));
        if !keys.is_empty() {
            found.push(format!("{}: {keys:?}", named.name));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
