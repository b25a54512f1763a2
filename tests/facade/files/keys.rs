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

/// Keys of a table, or words of a choice.
enum Expected {
    Keys(Vec<String>),
    Words(Vec<String>),
}

/// Keys or words that the error about another one at this path expects.
fn expected<T: DeserializeOwned>(whole: &Table, at: &[String], other: Value) -> Expected {
    let mut changed = whole.clone();
    let (last, tables) = at.split_last().expect("a key");
    inner(&mut changed, tables).insert(last.clone(), other);
    let Err(error) = T::deserialize(Value::Table(changed)).map(|_: T| ()) else {
        panic!("it takes any key at {at:?}")
    };
    let text = error.to_string();
    let first = text.lines().next().unwrap_or_default();
    let (_, expected) = first.split_once("expected").unwrap_or_else(|| panic!("{at:?}: {text}"));
    let listed = expected.split('`').skip(1).step_by(2).map(str::to_owned).collect();
    if first.contains("unknown variant") { Expected::Words(listed) } else { Expected::Keys(listed) }
}

/// The table at a path of tables.
fn inner<'a>(whole: &'a mut Table, tables: &[String]) -> &'a mut Table {
    tables.iter().fold(whole, |table, key| {
        let value = table.entry(key.as_str()).or_insert_with(|| Value::Table(Table::new()));
        value.as_table_mut().unwrap_or_else(|| panic!("{key} is no table"))
    })
}

/// Keys that a type takes, as its error about another key names them.
fn taken<T: DeserializeOwned>(base: &Table) -> BTreeSet<String> {
    match expected::<T>(base, &["no_such_key".to_owned()], Value::Integer(1)) {
        Expected::Keys(keys) => keys.into_iter().collect(),
        Expected::Words(words) => panic!("one of {words:?} and no table"),
    }
}

/// Paths of the keys that a type takes at a path, and in the tables below it.
fn paths<T: DeserializeOwned>(whole: &Table, at: &[String]) -> Vec<Vec<String>> {
    let below = |key: &str| [at, &[key.to_owned()]].concat();
    let Expected::Keys(keys) = expected::<T>(whole, &below("no_such_key"), Value::Integer(1))
    else {
        // A choice that is written as a table.
        return vec![at.to_vec()];
    };
    let mut found = Vec::new();
    for path in keys.iter().map(|key| below(key)) {
        match inner(&mut whole.clone(), at).get(&path[at.len()]) {
            Some(Value::Table(_)) => found.extend(paths::<T>(whole, &path)),
            _ => found.push(path),
        }
    }
    found
}

/// Other values of a setting, of which some may be of another type than its own.
fn others<T: DeserializeOwned>(whole: &Table, at: &[String], value: Option<&Value>) -> Vec<Value> {
    let floats = |values: &[f64]| values.iter().copied().map(Value::Float).collect::<Vec<_>>();
    match value {
        Some(Value::Integer(number)) => {
            // What is smaller takes less time.
            [number / 2, 1, number + 2, 2 * number + 1].map(Value::Integer).into()
        }
        Some(Value::Float(from)) => floats(&[
            2.0 * from + 1.0,
            0.5 * from,
            10.0 * from,
            0.1 * from,
            from + 10.0,
            0.02,
            1.2 * from,
        ]),
        Some(Value::Boolean(value)) => vec![Value::Boolean(!value)],
        Some(Value::String(_)) => {
            let other = Value::String("no_such_word".to_owned());
            let Expected::Words(words) = expected::<T>(whole, at, other) else { return Vec::new() };
            let alone = words.iter().cloned().map(Value::String);
            // Or with what a choice has beside it.
            let with = words.iter().flat_map(|word| {
                let tables = ["k = 0.9", "c = 0.9", "dof = 3.0"];
                tables.map(|text| {
                    let table: Table = text.parse().expect("TOML");
                    Value::Table([(word.clone(), Value::Table(table))].into_iter().collect())
                })
            });
            alone.chain(with).collect()
        }
        Some(Value::Array(parts)) => {
            let larger = parts.iter().map(|part| others::<T>(whole, at, Some(part)).swap_remove(0));
            vec![Value::Array(larger.collect()), Value::Array(parts[1..].to_vec())]
        }
        _ => {
            let mut values = floats(&[-59.0, -15.0, 0.02, 0.3, 3.0, 30.0]);
            values.extend([2, 9].map(Value::Integer));
            values.extend([true, false].map(Value::Boolean));
            values.push(Value::String("dipole".to_owned()));
            let tables = [
                "a = [300.0, 100.0]",
                "a = { kind = 'line', spacing_m = 9.0 }",
                "a = { share = 0.2, support = 100.0 }",
                "a = { spectral_density = 0.1, speed_sigma = 1.0 }",
                "a = { level_sigma_db = 4.0, bearing_sigma_deg = 10.0 }",
                "a = { detection = 0.5, wrong = 0.05, births = 0.4, most_birth = 0.2 }",
            ];
            for text in tables {
                let table: Table = text.parse().expect("TOML");
                values.extend(table.into_iter().map(|(_, value)| value));
            }
            values
        }
    }
}

/// Words by which an error refuses a setting that is not used.
const UNUSED: [&str; 4] = ["left out", "not used", "not supported", "must be 0"];

/// Settings of which no other value makes `act` return anything else of any case, and that are not
/// refused as unused either, with the refusals that they do have. What is out of its range shows
/// nothing.
pub(super) fn silent<T, C, R>(
    config: &T,
    cases: &[C],
    act: impl Fn(&T, &C) -> Result<R, String>,
) -> Vec<String>
where
    T: Serialize + DeserializeOwned,
    R: PartialEq,
{
    let whole = Table::try_from(config).expect("plain data");
    let of = |config: &T| -> Vec<R> {
        cases.iter().map(|case| act(config, case).expect("in range")).collect()
    };
    let before = of(config);
    // A NaN would differ from itself.
    assert!(before == of(config), "{whole}: it is not the same twice");
    let mut found = Vec::new();
    for path in paths::<T>(&whole, &[]) {
        let (last, tables) = path.split_last().expect("a key");
        let value = inner(&mut whole.clone(), tables).get(last).cloned();
        let mut refusals = BTreeSet::new();
        let changed = |value: Value| {
            let mut changed = whole.clone();
            inner(&mut changed, tables).insert(last.clone(), value);
            T::deserialize(Value::Table(changed)).ok()
        };
        let others = others::<T>(&whole, &path, value.as_ref());
        let mut others: Vec<T> = others.into_iter().filter_map(changed).collect();
        // All values in the first case, before any in the next.
        let mut shows = cases.iter().zip(&before).any(|(case, before)| {
            let mut differs = false;
            others.retain(|other| match act(other, case) {
                _ if differs => true,
                Ok(after) => {
                    differs = after != *before;
                    true
                }
                Err(error) => {
                    refusals.insert(error);
                    false
                }
            });
            differs
        });
        shows |= refusals.iter().any(|error| {
            error.contains(last.as_str()) && UNUSED.iter().any(|words| error.contains(words))
        });
        if !shows {
            found.push(format!("{} {refusals:?}", path.join(".")));
        }
    }
    found
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
