//! Pulses of a tag in recordings, taken one by one.

use std::fmt::Write;

use foxhunt_archive::{
    recorded::{ReceptionConfig, receptions},
    recording::{ReadOptions, Recording},
};
use foxhunt_core::{Pose, Reception, Receptions};
use foxhunt_hunt::{
    locate::{LocateConfig, LocateError},
    registry::Registry,
};
use foxhunt_sensors::{AntennaConfig, DirectionalLevel, LogDistance, PatternTable, Pritzl2018};
use nalgebra::Vector2;

const TARGET: [f64; 2] = [32.0, -21.0];
const FLOOR_DBM: f64 = -74.0;

/// Nine pulses at each of four places, with a deterministic error of up to 2 dB; without a level
/// where they lay below the floor.
fn recorded() -> String {
    let law = LogDistance::new(-30.0, 2.6).expect("in range");
    let model = DirectionalLevel::new(law, PatternTable::reference_patch());
    let mut text = "turn,drone,time_s,east_m,north_m,up_m,heading_deg_compass,\
                    boresight_deg_compass,rss_dbm,floor_dbm\n"
        .to_owned();
    let mut time = 0.0_f64;
    for (turn, [east, north]) in
        [[0.0, 0.0], [40.0, 10.0], [60.0, -40.0], [5.0, -45.0]].into_iter().enumerate()
    {
        for pulse in 0..9_u8 {
            time += 1.3;
            let compass_deg = 40.0 * f64::from(pulse) + 7.0;
            let boresight = (90.0 - compass_deg).to_radians();
            let pose = Pose::at(east, north, 10.0);
            let clean = model.level_dbm(&Vector2::from(TARGET), &pose, boresight, 0.0);
            let level = clean + 2.0 * (7.1 * time).sin();
            let level = if level > FLOOR_DBM { level.to_string() } else { String::new() };
            writeln!(
                text,
                "{turn},one,{time},{east},{north},10,90,{compass_deg},{level},{FLOOR_DBM}"
            )
            .expect("memory");
        }
    }
    text
}

fn by_sample() -> Vec<Reception> {
    let options = ReadOptions::default();
    let text = recorded();
    let recording = Recording::from_reader(text.as_bytes(), "flight.csv", &options);
    let config = ReceptionConfig { positions: 9, by_sample: true, ..ReceptionConfig::default() };
    let recordings = [recording.expect("a recording")];
    receptions(&recordings, None, &Pritzl2018::default(), &config)
        .expect("they are of use")
        .iter()
        .collect()
}

#[test]
fn a_tag_of_unknown_power_is_located_pulse_by_pulse() {
    let receptions = by_sample();
    let missed = receptions.iter().filter(|reception| reception.silence.is_some()).count();
    // Those before a turn's first level and after its last are not known to belong to it.
    assert!(missed >= 3 && receptions.len() >= 20, "{missed} of {}", receptions.len());
    let registry = Registry::builtin();
    let estimator = registry.estimator("pulses").expect("it has a name");
    assert!(estimator.takes_samples());
    let antenna = Some(AntennaConfig::ReferencePatch);
    let config = LocateConfig { antenna, margin_m: 60.0, ..LocateConfig::default() };
    let located =
        estimator.locate(&Receptions::from(&*receptions), &config).expect("it is located");
    let error_m = (located.estimate.mean - Vector2::from(TARGET)).norm();
    let nees = located.estimate.nees(&Vector2::from(TARGET)).expect("a covariance");
    assert!(error_m < 8.0 && nees < 9.2, "{error_m} m, {nees}");
    assert_eq!(located.observations, receptions.len());

    let unknown = LocateConfig { antenna: None, ..config };
    let refused = estimator
        .locate(&Receptions::from(&*receptions), &unknown)
        .expect_err("no antenna")
        .to_string();
    assert!(refused.contains("--receiver-antenna"), "{refused}");
    // A turn's level has no boresight.
    let turns: Vec<_> =
        receptions.iter().map(|r| Reception { measured: Default::default(), ..*r }).collect();
    let config = LocateConfig { antenna: Some(AntennaConfig::ReferencePatch), ..unknown };
    let unused = estimator.locate(&Receptions::from(&*turns), &config);
    assert!(matches!(unused, Err(LocateError::NotUsed { .. })), "{unused:?}");
}
