//! Rows that cannot be believed: left out, counted, and named by their line.

use approx::abs_diff_eq;
use foxhunt_archive::recording::{Mapping, ReadOptions, Recording, RecordingError};

/// A drive of three minutes with a KrakenSDR, a row each 3 s.
const DRIVE: &str = include_str!("../../data/krakensdr-drive.csv");

fn kraken() -> ReadOptions {
    ReadOptions::default().with_format(Mapping::find("krakensdr").expect("it is shipped"))
}

fn read(text: &str, options: &ReadOptions) -> Result<Recording, RecordingError> {
    Recording::from_reader(text.as_bytes(), "walk.csv", options)
}

/// The lines of the drive, each changed by its number from 1.
fn drive(change: impl Fn(usize, &mut Vec<String>)) -> String {
    let line = |(index, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(", ").map(str::to_owned).collect();
        change(index + 1, &mut cells);
        cells.join(", ") + "\n"
    };
    DRIVE.lines().enumerate().map(line).collect()
}

/// A walk of 40 rows, one each second and metre, each changed by its line.
fn walk(change: impl Fn(usize, &mut [f64; 4])) -> String {
    let mut text = "time_s,east_m,north_m,rss_dbm\n".to_owned();
    for (line, second) in (2..).zip(0..40_u8) {
        let second = f64::from(second);
        let mut cells = [second, 1.5 * second, 10.0, -60.0 - second];
        change(line, &mut cells);
        text += &format!("{}\n", cells.map(|cell| cell.to_string()).join(","));
    }
    text
}

/// The lines of the records.
fn lines(recording: &Recording) -> Vec<u64> {
    recording.records().iter().map(|record| record.line).collect()
}

/// Expects the lines alone to be left out, for a reason that names them.
fn assert_left_out(text: &str, options: &ReadOptions, code: &str, out: &[u64]) {
    let recording = read(text, options).expect(code);
    let [remark] = recording.remarks() else { panic!("{code}: {:?}", recording.remarks()) };
    assert_eq!(remark.code, code, "{remark}");
    let kept = lines(&recording);
    for line in out {
        assert!(!kept.contains(line), "{code}: line {line} is kept; {remark}");
    }
    for line in out.iter().take(5) {
        let is_named = [',', ':'].map(|end| remark.text.contains(&format!("line {line}{end}")));
        assert!(is_named.contains(&true), "{line}: {remark}");
    }
    assert_eq!(kept.len() + out.len(), usize::try_from(recording.rows()).expect("few"), "{remark}");
    assert!(remark.text.contains("walk.csv"), "{remark}");
    assert!(remark.text.contains(&format!("{} of {}", out.len(), recording.rows())), "{remark}");
    let more = out.len().saturating_sub(5);
    assert_eq!(remark.text.ends_with(&format!("; and {more} more")), more > 0, "{remark}");
    let refused = read(text, &options.clone().with_strict(true)).expect_err("strict").to_string();
    assert!(refused.contains("walk.csv, line "), "{refused}");
}

#[test]
fn what_can_be_believed_gives_no_remark() {
    for (text, options) in [(DRIVE, kraken()), (&walk(|_, _| ()), ReadOptions::default())] {
        let recording = read(text, &options.with_strict(true)).expect("clean");
        assert_eq!(recording.remarks(), []);
        assert_eq!(recording.records().len() as u64, recording.rows());
    }
}

#[test]
fn rows_without_a_fix_are_left_out() {
    for out in [&[21, 22][..], &[1], &[1, 2, 3], &[60], &[5, 30, 59, 60], &[2, 3, 4, 5, 6, 7, 8]] {
        for nowhere in [["0.0", "0.0"], ["0.0000010", "-0.0000009"]] {
            let text = drive(|line, cells| {
                if out.contains(&(line as u64)) {
                    cells.splice(8..10, nowhere.map(str::to_owned));
                }
            });
            assert_left_out(&text, &kraken(), "no-position", out);
        }
    }
}

#[test]
fn a_clock_that_was_set_leaves_the_shorter_part_out() {
    // Back by an hour from line 26 on: the 25 rows before are fewer than the 35 behind.
    let set = |from: usize, to: usize, by_ms: i64| {
        drive(|line, cells| {
            if (from..=to).contains(&line) {
                let time: i64 = cells[0].parse().expect("a time");
                cells[0] = (time + by_ms).to_string();
            }
        })
    };
    let series = |range: std::ops::RangeInclusive<u64>| range.collect::<Vec<_>>();
    for (from, to, by_ms, out) in [
        (26, 60, -3_600_000, series(1..=25)),
        (41, 60, -3_600_000, series(41..=60)),
        (30, 30, -60_000, vec![30]),
        (30, 31, 3_600_000, vec![30, 31]),
        (60, 60, -3_000_000, vec![60]),
        (1, 1, 10_000, vec![1]),
    ] {
        assert_left_out(&set(from, to, by_ms), &kraken(), "clock-runs-back", &out);
    }
}

#[test]
fn rows_without_a_place_are_counted() {
    let text = "time_s,lat_deg,lon_deg,rss_dbm\n0,50,14,-60\n1,,,-60\n2,,,-61\n3,,,-62\n";
    let recording = read(text, &ReadOptions::default().with_strict(true)).expect("a row");
    let [remark] = recording.remarks() else { panic!("{:?}", recording.remarks()) };
    assert_eq!(remark.code, "no-position");
    assert!(remark.text.contains("3 of 4 rows") && remark.text.contains("line 3 has no place"));
}

#[test]
fn lines_that_were_exchanged_are_sorted() {
    let text = walk(|line, cells| {
        let swapped = match line {
            10 => 9.0,
            11 => 8.0,
            _ => return,
        };
        cells[0] = swapped;
        cells[1] = 1.5 * swapped;
    });
    let recording = read(&text, &ReadOptions::default()).expect("all of it");
    assert_eq!(recording.records().len(), 40);
    let [remark] = recording.remarks() else { panic!("{:?}", recording.remarks()) };
    assert_eq!(remark.code, "clock-runs-back");
    for part in ["walk.csv, line 11", "1 s", "in the order of time"] {
        assert!(remark.text.contains(part), "{remark}");
    }
    assert!(read(&text, &ReadOptions::default().with_strict(true)).is_err());
}

#[test]
fn places_that_cannot_be_reached_are_left_out() {
    let far = |out: &[u64], east: f64| {
        walk(|line, cells| {
            if out.contains(&(line as u64)) {
                cells[1] += east;
            }
        })
    };
    for out in [&[20][..], &[2], &[2, 3], &[41], &[40, 41], &[7, 8, 30], &[5, 6, 7, 8, 9, 10, 11]] {
        for east in [1700.0, -450.0, 90_000.0] {
            assert_left_out(&far(out, east), &ReadOptions::default(), "position-jumps", out);
        }
    }
    // A walk with a fix each 30 s: 60 m/s are far from its 0.05 m/s.
    let slow = |out: &[u64]| {
        walk(|line, cells| {
            cells[0] *= 30.0;
            if out.contains(&(line as u64)) {
                cells[1] += 1800.0;
            }
        })
    };
    for out in [&[20][..], &[2], &[41], &[19, 20], &[3, 9, 40]] {
        assert_left_out(&slow(out), &ReadOptions::default(), "position-jumps", out);
    }
    // Two scans of five transmitters each are two fixes.
    let scans: String = {
        let text = slow(&[20, 21]);
        let rows =
            text.lines().skip(1).flat_map(|row| (0..5).map(move |tag| format!("{row},{tag}\n")));
        "time_s,east_m,north_m,rss_dbm,beacon\n".to_owned() + &rows.collect::<String>()
    };
    let out: Vec<u64> = (92..=101).collect();
    assert_left_out(&scans, &ReadOptions::default(), "position-jumps", &out);
    // A receiver that goes far and stays there has moved.
    let moved = slow(&(30..=41).collect::<Vec<_>>());
    assert_eq!(read(&moved, &ReadOptions::default()).expect("all").remarks(), []);
    // 250 m/s is an airliner.
    let fast = walk(|_, cells| cells[1] = 250.0 * cells[0]);
    assert_eq!(read(&fast, &ReadOptions::default()).expect("it flies").remarks(), []);
    // Fixes that fit to none of the others are no path.
    let anywhere =
        walk(|_, cells| cells[1] = 1e3 * (7919.0 * cells[0] * cells[0]).rem_euclid(1000.0));
    let recording = read(&anywhere, &ReadOptions::default()).expect("all of it");
    assert_eq!((recording.records().len(), recording.remarks().len()), (40, 1));
    assert!(recording.remarks()[0].text.contains("40 rows"), "{recording:?}");
}

#[test]
fn a_first_place_that_is_wrong_is_not_the_origin() {
    let text = |first: &str| {
        let mut text = format!("time_s,lat_deg,lon_deg,rss_dbm\n0,{first},-60\n");
        for second in 1..10 {
            text += &format!("{second},50.{second:05},14,-60\n");
        }
        text
    };
    for (wrong, code) in [("51,14", "position-jumps"), ("5,14", "rows-left-out")] {
        let recording = read(&text(wrong), &ReadOptions::default()).expect(wrong);
        assert_eq!(recording.remarks().first().map(|remark| &*remark.code), Some(code));
        assert_eq!(recording.records().len(), 9, "{wrong}");
        let origin = recording.frame().expect("in degrees").origin();
        assert!(abs_diff_eq!(origin.lat_deg, 50.00001, epsilon = 1e-9), "{wrong}: {origin:?}");
    }
}

#[test]
fn rows_that_cannot_be_read_are_left_out() {
    let good = walk(|_, _| ());
    let with = |out: &[u64], bad: &str| {
        let line = |(line, text): (u64, &str)| match out.contains(&line) {
            true => bad.to_owned() + "\n",
            false => text.to_owned() + "\n",
        };
        (1..).zip(good.lines()).map(line).collect::<String>()
    };
    for bad in
        ["5,7,10,loud", "5,7", "5,7,10,-60,9", "noon,7,10,-60", "5,,10,-60", "end", "5,7,10,nan"]
    {
        for out in [&[9][..], &[2], &[2, 3], &[41], &[12, 20, 28], &[4, 5, 6, 7, 8, 9, 10]] {
            assert_left_out(&with(out, bad), &ReadOptions::default(), "rows-left-out", out);
        }
        // Of more than half the file is refused, with the first of them.
        let many: Vec<u64> = (2..=22).collect();
        let refused = read(&with(&many, bad), &ReadOptions::default()).expect_err(bad).to_string();
        for part in ["walk.csv, line 2", "21 of 40 rows"] {
            assert!(refused.contains(part), "{refused}");
        }
    }
    // An unclosed quote takes its own line alone.
    let quote = with(&[9], "5,7,10,\"-60");
    let kept = read(&quote, &ReadOptions::default()).expect("39 rows");
    assert_eq!((kept.rows(), kept.records().len()), (40, 39), "{:?}", kept.remarks());
}

#[test]
fn a_row_that_is_there_twice_counts_once() {
    let good = walk(|_, _| ());
    let row = |line: usize| good.lines().nth(line - 1).expect("a row").to_owned() + "\n";
    for (text, out) in [
        (good.clone() + &row(41), vec![42]),
        (good.clone() + &row(41) + &row(41), vec![42, 43]),
        (good.replacen(&row(9), &(row(9) + &row(9)), 1), vec![10]),
    ] {
        assert_left_out(&text, &ReadOptions::default(), "duplicate-rows", &out);
    }
    // Two readings of one second differ in what nothing else reads.
    let text = "time_s,east_m,north_m,rss_dbm,packet\n0,0,0,-60,1\n0,0,0,-60,2\n";
    assert_eq!(read(text, &ReadOptions::default()).expect("both").records().len(), 2);
    // Without times nothing tells a copy from a second reading.
    let text = "east_m,north_m,rss_dbm\n0,0,-60\n0,0,-60\n";
    assert_eq!(read(text, &ReadOptions::default()).expect("both").records().len(), 2);
}
