//! Rows become turns of the antenna.

use std::f64::consts::TAU;

use foxhunt_archive::recording::{Mapping, ReadOptions, RecordedSweep, Recording, RecordingError};
use foxhunt_core::angle::distance;

fn read(text: &str) -> Recording {
    Recording::from_reader(text.as_bytes(), "flight.csv", &ReadOptions::default())
        .expect("a recording")
}

fn sizes(sweeps: &[RecordedSweep]) -> Vec<usize> {
    sweeps.iter().map(|sweep| sweep.sweep.samples.len()).collect()
}

/// Rows of a boresight that goes on by `step` degrees, one a second.
fn rotation(rows: u32, step: f64, start: f64) -> String {
    let mut text = "time_s,boresight_deg_compass,rss_dbm\n".to_owned();
    for row in 0..rows {
        let angle = (start + step * f64::from(row)).rem_euclid(360.0);
        text.push_str(&format!("{row},{angle},-60\n"));
    }
    text
}

#[test]
fn a_turn_ends_where_it_began() {
    for (start, step) in [(0.0, 45.0), (100.0, -45.0), (359.9, 45.0), (17.0, 44.0)] {
        let sweeps = read(&rotation(20, step, start)).sweeps(8).expect("8 positions");
        assert_eq!(sizes(&sweeps), [8, 8, 4], "from {start}° by {step}°");
        let ends: Vec<_> = sweeps.iter().map(|sweep| sweep.sweep.time).collect();
        assert_eq!(ends, [7.0, 15.0, 19.0]);
        assert!(sweeps.iter().all(|sweep| !sweep.located && sweep.turn.is_none()));
    }
    // A body that swings about its course does not end the turn.
    let mut text = "boresight_deg_compass,rss_dbm\n".to_owned();
    for angle in [0, 30, 20, 60, 50, 110, 90, 200, 180, 290, 270, 340, 330, 10, 30] {
        text.push_str(&format!("{angle},-60\n"));
    }
    assert_eq!(sizes(&read(&text).sweeps(36).expect("36 positions")), [13, 2]);
}

#[test]
fn the_turn_column_decides() {
    let text = "turn,beacon,drone,time_s,antenna_deg,heading_deg_compass,rss_dbm\n\
                7,a,x,0,0,90,-60\n7,a,x,1,90,90,-61\n7,b,x,1,90,90,-71\n7,a,y,1,90,90,-81\n\
                8,a,x,2,0,90,-62\n7,a,x,3,180,90,-63\n";
    let sweeps = read(text).sweeps(4).expect("4 positions");
    let turns: Vec<_> = sweeps
        .iter()
        .map(|s| {
            (s.turn, s.beacon_name.as_deref(), s.drone.as_str(), s.sweep.samples.len(), s.line)
        })
        .collect();
    assert_eq!(
        turns,
        [
            (Some(7), Some("b"), "x", 1, 4),
            (Some(7), Some("a"), "y", 1, 5),
            (Some(8), Some("a"), "x", 1, 6),
            (Some(7), Some("a"), "x", 3, 2),
        ],
        "in the order in which the turns ended"
    );
    // The nose to the East and the antenna a quarter clockwise from it: South.
    let south = sweeps[3].sweep.samples[1];
    assert!(distance(south.boresight, -TAU / 4.0) < 1e-12 && south.position == 3);
    assert!(distance(south.receiver.heading, 0.0) < 1e-12);
}

#[test]
fn gaps_and_whole_files_are_turns_too() {
    let mapping = |turns: &str| {
        let text = format!(
            "name = 'm'\ndescription = 'd'\nheader = []\nturns = {turns}\n[columns]\n\
             time_s = 'time_s'\nboresight_deg_compass = 'boresight_deg_compass'\nrss_dbm = \
             'rss_dbm'"
        );
        ReadOptions::default().with_format(Mapping::parse(&text, "m.toml").expect("a mapping"))
    };
    let text = "time_s,boresight_deg_compass,rss_dbm\n0,0,-60\n1,90,-60\n3.5,180,-60\n4,0,-60\n";
    let sizes = |turns| {
        let recording = Recording::from_reader(text.as_bytes(), "f", &mapping(turns));
        sizes(&recording.expect("a recording").sweeps(4).expect("4 positions"))
    };
    assert_eq!(sizes("{ gap_s = 2.0 }"), [2, 2]);
    assert_eq!(sizes("{ gap_s = 0.7 }"), [1, 1, 2]);
    assert_eq!(sizes("'file'"), [4]);
}

#[test]
fn samples_are_in_the_order_of_time_and_the_receiver_is_the_mean() {
    let text = "time_s,boresight_deg_compass,heading_deg_compass,east_m,north_m,up_m,rss_dbm\n\
                2,180,350,3,0,5,-60\n0,0,10,1,2,5,-62\n1,90,0,2,4,8,-61\n";
    let sweeps = read(text).sweeps(4).expect("4 positions");
    let [sweep] = &sweeps[..] else { panic!("one turn, not {sweeps:?}") };
    let times: Vec<_> = sweep.sweep.samples.iter().map(|sample| sample.time).collect();
    assert_eq!(times, [0.0, 1.0, 2.0]);
    assert!((sweep.sweep.receiver.position - nalgebra::Vector3::new(2.0, 2.0, 6.0)).norm() < 1e-12);
    assert!(
        distance(sweep.sweep.receiver.heading, TAU / 4.0) < 1e-12,
        "350°, 10° and 0° mean North"
    );
    assert!(sweep.located && (sweep.sweep.time - 2.0).abs() < 1e-12 && sweep.line == 2);
}

#[test]
fn positions_must_fit_the_turn() {
    let text = "boresight_deg_compass,position,rss_dbm\n0,3,-60\n90,,-61\n";
    let recording = read(text);
    let sweep = &recording.sweeps(8).expect("8 positions")[0];
    let positions: Vec<_> = sweep.sweep.samples.iter().map(|sample| sample.position).collect();
    assert_eq!(positions, [3, 0], "as given, or else the nearest: East");
    let message = recording.sweeps(3).expect_err("no position 3").to_string();
    for part in ["flight.csv", "line 2", "position", "\"3\"", "0 to 2"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(matches!(recording.sweeps(0), Err(RecordingError::Parameter { .. })));
}
