//! Keys of scenarios beside the types that take them.

use std::collections::BTreeSet;

use approx::abs_diff_eq;
use foxhunt::formation::{AirspaceConfig, AttendanceConfig, EnduranceConfig, StopRules, Void};
use foxhunt::sensors::{BodyConfig, OmnidirectionalConfig, StepperConfig, TurnGoalConfig};
use foxhunt::sim::{
    BeaconConfig, ChannelConfig, DipoleConfig, DroneConfig, OtherConfig, PulseTrain,
    RangeDifferenceConfig, ReliefConfig, ScatteringConfig, SimStepperConfig, ThreeAxisConfig,
    VehicleConfig, WindConfig,
};
use serde::{Serialize, de::DeserializeOwned};
use toml::{Table, Value};

use foxhunt::{
    config::{ExtractorConfig, ModelConfig},
    hunt::HuntConfig,
    scenario::{Key, SimulationConfig, scenario_keys},
};

/// Keys that a type takes, as its error about another key names them.
pub(super) fn taken<T: DeserializeOwned>(base: &Table) -> BTreeSet<String> {
    let mut table = base.clone();
    table.insert("no_such_key".to_owned(), Value::Integer(1));
    let Err(error) = T::deserialize(Value::Table(table)).map(|_: T| ()) else {
        panic!("it takes any key")
    };
    let text = error.to_string();
    let (_, expected) = text.split_once("expected").unwrap_or_else(|| panic!("{text}"));
    expected.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The number or the word at the beginning of a default.
fn stated(default: &str) -> Option<Value> {
    let first = default.split([' ', ',']).next()?.trim_matches('`').replace('−', "-");
    let number = first.parse().ok().map(Value::Float);
    let word = match first.as_str() {
        "true" => Some(Value::Boolean(true)),
        "false" => Some(Value::Boolean(false)),
        _ => None,
    };
    let text = first.strip_prefix('"').and_then(|text| text.strip_suffix('"'));
    number.or(word).or_else(|| text.map(|text| Value::String(text.to_owned())))
}

/// Checks keys, needs and defaults of a table against those of a type. The type's `others`
/// stand in another table.
fn held<T: Serialize + DeserializeOwned>(table: &str, value: &T, others: &[&str]) {
    let listed = scenario_keys().iter().find(|known| known.table == table);
    let listed = listed.unwrap_or_else(|| panic!("there is no table {table}"));
    let value = Table::try_from(value).unwrap_or_else(|error| panic!("{table}: {error}"));
    let kind: Table = value.clone().into_iter().filter(|(key, _)| key == "kind").collect();
    let mut known: BTreeSet<String> = listed.keys.iter().map(|k| k.name.to_owned()).collect();
    assert_eq!(known.len(), listed.keys.len(), "{table} has a key twice");
    known.extend(others.iter().map(|&key| key.to_owned()));
    assert_eq!(known, taken::<T>(&kind), "{table}");
    for Key { name, default, .. } in listed.keys {
        let at = format!("{table}.{name}: {default}");
        let mut without = value.clone();
        without.remove(*name);
        let needed = T::deserialize(Value::Table(without)).is_err();
        assert_eq!(needed, *default == "needed", "{at}");
        let default = stated(default).filter(|_| !needed);
        match value.get(*name) {
            _ if needed => {}
            Some(Value::Float(number)) => assert_near(default.as_ref(), *number, &at),
            Some(Value::Integer(number)) => {
                assert_near(default.as_ref(), f64::from(i32::try_from(*number).expect(&at)), &at);
            }
            Some(Value::Table(_) | Value::Array(_)) => {}
            Some(other) => assert_eq!(default.as_ref(), Some(other), "{at}"),
            // What is left out where it has its default: absent, empty, false or zero.
            None => assert!(
                matches!(default, None | Some(Value::Boolean(false)))
                    || default == Some(Value::Float(0.0)),
                "{at}"
            ),
        }
    }
}

fn assert_near(stated: Option<&Value>, is: f64, at: &str) {
    let stated = stated.and_then(Value::as_float).unwrap_or(f64::NAN);
    // Three digits of a number that has more.
    assert!(abs_diff_eq!(stated, is, epsilon = 1e-3 * is.abs()), "{at} is not {is}");
}

#[test]
fn each_table_has_the_keys_and_defaults_of_its_type() {
    let mut tables: BTreeSet<&str> = scenario_keys().iter().map(|known| known.table).collect();
    assert_eq!(tables.len(), scenario_keys().len(), "a table stands there twice");
    macro_rules! check {
        ($($table:literal: $value:expr $(, but $others:expr)?;)*) => {$(
            let others: &[&[&str]] = &[$(&$others[..])?];
            held($table, &$value, &others.concat());
            assert!(tables.remove($table), "{}", $table);
        )*};
    }
    let differences = RangeDifferenceConfig { reference_m: [0.0; 3], sigma_m: 3.0 };
    let train = PulseTrain { pulse_s: 0.02, interval_s: 1.3, jitter_s: 0.0, phase_s: 0.0 };
    let scattering =
        ScatteringConfig { k_db: 5.0, k_sigma_db: 0.0, waves: 6, elevation_sigma_deg: 0.0 };
    let other =
        OtherConfig { east_m: 0.0, north_m: 0.0, up_m: 0.0, scatter_m: None, presence: 1.0 };
    let dipole =
        DipoleConfig { moment_ma_m2: 6.3, azimuth_deg_ccw_from_east: 0.0, elevation_deg: 0.0 };
    let model = ModelConfig {
        reference_dbm: -29.06,
        exponent: 2.765,
        target_up_m: 0.0,
        antenna: None,
        reference_m: None,
        pulses: None,
        terrain: None,
    };
    let quadrotor: VehicleConfig = toml::from_str("kind = \"quadrotor\"").expect("its defaults");
    let kinds = ["kind", "speed_mps", "climb_mps", "reports_velocity"];
    let quadrotors = [
        "acceleration_mps2",
        "tilt_limit_deg",
        "thrust_limit",
        "yaw_limit_rad_s2",
        "drag_per_s",
        "rate_hz",
        "piloting",
        "dynamics",
        "inertia_kg_m2",
        "gains",
        "wind",
    ];
    let pritzl: ExtractorConfig = toml::from_str("kind = \"pritzl2018\"").expect("its defaults");
    check! {
        "world.beacons": BeaconConfig::default();
        "world.beacons.pulses": train;
        "world.beacons.dipole": dipole;
        "world.beacons.others": other;
        "world.drones": DroneConfig::default();
        "world.channel": ChannelConfig::default();
        "world.channel.scattering": scattering;
        "world.terrain": ReliefConfig::default();
        "world.vehicle": VehicleConfig::default(), but quadrotors;
        "world.vehicle quadrotor": quadrotor, but kinds;
        "world.vehicle.wind": WindConfig::default();
        "world.stepper": SimStepperConfig::default();
        "source stepper": StepperConfig::default();
        "source rotating-body": BodyConfig::default();
        "source omnidirectional": OmnidirectionalConfig::default();
        "source range-difference": differences;
        "source three-axis": ThreeAxisConfig::default();
        "turns": TurnGoalConfig { bearing_sigma_deg: 6.0, longest_s: 80.0 };
        "model": model;
        "extractor pritzl2018": pritzl;
        "hunt": HuntConfig::default();
        "hunt.airspace": AirspaceConfig::default();
        "hunt.void": Void { radius_m: 5.0, probability: 0.05 };
        "hunt.endurance": EnduranceConfig::default();
        "hunt.attendance": AttendanceConfig::default();
        "hunt.stop": StopRules::default();
        "simulation": SimulationConfig::default();
    }
    assert!(tables.is_empty(), "not held against any type: {tables:?}");
}
