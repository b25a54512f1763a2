//! Ranges and differences in recordings.

use foxhunt_archive::{
    recorded::{ReceptionConfig, receptions},
    recording::{Column, Mapping, ReadOptions, Recording, RecordingError},
};
use foxhunt_core::{Quantity, Reception};
use foxhunt_sensors::Pritzl2018;

fn read(text: &str, options: &ReadOptions) -> Result<Recording, RecordingError> {
    Recording::from_reader(text.as_bytes(), "flight.csv", options)
}

fn received(recording: Recording) -> Vec<Reception> {
    let config = ReceptionConfig::default();
    receptions(&[recording], None, &Pritzl2018::default(), &config)
        .expect("they are of use")
        .iter()
        .collect()
}

#[test]
fn a_range_with_a_sigma_is_measured_and_one_without_is_known() {
    let text =
        "east_m,north_m,range_m,range_sigma_m,rss_dbm\n0,0,50,2,-60\n1,0,,,-61\n2,0,,3,-62\n";
    let recording = read(text, &ReadOptions::default()).expect("a recording");
    assert!(recording.records().iter().all(|record| record.known_range.is_none()));
    let received = received(recording);
    let range = received[0].measured.get(Quantity::RANGE).expect("measured");
    assert_eq!((range.value, range.sigma), (50.0, 2.0));
    assert!(received[0].level.is_some() && received[1..].iter().all(|r| r.measured.is_empty()));

    let known = read("range_m,rss_db\n50,-60\n", &ReadOptions::default()).expect("a recording");
    assert_eq!(known.records()[0].known_range, Some(50.0));
    assert!(known.records()[0].measured.is_empty());
}

#[test]
fn a_mapping_names_the_columns_and_a_constant_is_the_sigma() {
    let mapping = "name = 'tdoa'\ndescription = 'd'\nheader = ['dr_km']\n[columns]\neast_m = 'x'\n\
                   north_m = 'y'\nrange_difference_m = { column = 'dr_km', scale = 1000 }\n\
                   [constants]\nrange_difference_sigma_m = 3.5\n";
    let mapping = Mapping::parse(mapping, "tdoa.toml").expect("a mapping");
    let options = ReadOptions::default().with_format(mapping);
    let text = "x,y,dr_km\n0,0,-0.25\n5,0,\n9,0,0.125\n";
    let recording = read(text, &options).expect("two rows");
    assert_eq!(recording.dropped()[0].rule, "a measurement");
    let received = received(recording);
    let of = |i: usize| received[i].measured.get(Quantity::RANGE_DIFFERENCE).copied();
    let [first, last] = [of(0), of(1)].map(|measured| measured.expect("measured"));
    assert_eq!((first.value, first.sigma), (-250.0, 3.5));
    assert_eq!((last.value, last.sigma), (125.0, 3.5));
}

#[test]
fn level_differences_are_read_and_rows_of_an_antenna_keep_their_ranges() {
    let text = "east_m,north_m,rss_difference_db,rss_difference_sigma_db\n0,0,-6,2\n";
    let level = received(read(text, &ReadOptions::default()).expect("a recording"));
    let level = level[0].measured.get(Quantity::RSS_DIFFERENCE).copied().expect("measured");
    assert_eq!((level.value, level.sigma), (-6.0, 2.0));

    let text = "time_s,east_m,north_m,boresight_deg_compass,rss_dbm,range_m,range_sigma_m\n\
                0,0,0,0,-60,,\n1,0,0,90,-62,40,1\n2,0,0,180,-65,,\n3,0,0,270,-61,,\n";
    let received = received(read(text, &ReadOptions::default()).expect("a recording"));
    let [range, turn] = &received[..] else { panic!("{received:?}") };
    assert!(range.level.is_none() && !range.measured.is_empty());
    assert!(turn.level.is_some() && turn.measured.is_empty());
}

#[test]
fn mistakes_name_file_line_field_and_value() {
    for (text, parts) in [
        (
            "east_m,north_m,range_m,range_sigma_m\n0,0,50,2\n0,0,50,\n",
            ["line 3", "range_sigma_m", "\"\"", "must not be empty"],
        ),
        (
            "east_m,north_m,range_m,range_sigma_m\n0,0,50,-2\n",
            ["line 2", "range_sigma_m", "\"-2\"", "between"],
        ),
        (
            "east_m,north_m,range_m,range_sigma_m\n0,0,-50,2\n",
            ["line 2", "range_m", "\"-50\"", "between"],
        ),
        (
            "east_m,north_m,range_difference_m,range_difference_sigma_m\n0,0,far,2\n",
            ["line 2", "range_difference_m", "\"far\"", "not a number"],
        ),
        (
            "east_m,north_m,range_difference_m\n0,0,50\n",
            ["line 1", "range_difference_m", "needs", "range_difference_sigma_m"],
        ),
        (
            "east_m,north_m,rss_dbm,range_sigma_m\n0,0,-60,1\n",
            ["line 1", "range_sigma_m", "needs", "range_m"],
        ),
    ] {
        let strict = ReadOptions::default().with_strict(true);
        let error = read(text, &strict).expect_err(text).to_string();
        for part in parts.iter().chain(&["flight.csv"]) {
            assert!(error.contains(part), "{part}: {error}");
        }
    }
    let options = ReadOptions::default().with_constant(Column::RangeSigmaM, 0.0);
    let error = read("east_m,north_m,rss_dbm,range_m\n0,0,-60,50\n", &options);
    let error = error.expect_err("σ is 0").to_string();
    assert!(error.contains("range_sigma_m: \"0\""), "{error}");
}
