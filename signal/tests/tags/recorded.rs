use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

use flate2::{Compression, write::GzEncoder};
use foxhunt_signal::tags::{
    Association, AssociationConfig, TagTable, associate, parse_pulses, read_pulses,
};

fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")).join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: no recordings at {}", path.display());
    None
}

fn associated(pulses: &Path, table: &TagTable) -> Association {
    let list = read_pulses(pulses).expect("a list of pulses");
    associate(&list.pulses, table, &AssociationConfig::default()).expect("an association")
}

#[test]
fn all_bursts_of_a_coded_tag_and_no_other() {
    let Some(pulses) = shared("pulses/sg_kingsburg_2017-09-01_p1.csv") else { return };
    let Some(table) = shared("pulses/sg_tags.csv") else { return };
    let table = TagTable::read(&table).expect("a table");
    let Association { tags, others, .. } = associated(&pulses, &table);
    assert_eq!(tags.len(), 1);
    assert_eq!(tags[0].names, ["10695", "16357"]);
    assert_eq!((tags[0].bursts, tags[0].missed, tags[0].pulses.len()), (62, 0, 248));
    assert_abs_diff_eq!(tags[0].interval_s, 19.995, epsilon = 0.001);
    assert_eq!(others.len(), 5294 - 248);
}

/// Without the table the same bursts, of one tag that has no name, and its gaps.
#[test]
fn all_bursts_of_a_coded_tag_that_is_not_known() {
    let Some(pulses) = shared("pulses/sg_kingsburg_2017-09-01_p1.csv") else { return };
    let Association { tags, others, .. } = associated(&pulses, &TagTable::default());
    assert_eq!(tags.len(), 1, "{:?}", tags.iter().map(|tag| tag.bursts).collect::<Vec<_>>());
    assert_eq!((tags[0].bursts, tags[0].pulses.len(), tags[0].names.len()), (62, 248, 0));
    assert_abs_diff_eq!(tags[0].interval_s, 19.995, epsilon = 0.001);
    for (gap, published) in tags[0].gaps_s.iter().zip([21.7e-3, 19.6e-3, 24.3e-3]) {
        assert!(abs_diff_eq!(*gap, published, epsilon = 1e-3), "{:?}", tags[0].gaps_s);
    }
    assert_eq!(others.len(), 5294 - 248);
}

#[test]
fn one_tag_of_unknown_interval() {
    let Some(pulses) = shared("pulses/pyrt_umr_150172kHz.csv") else { return };
    let Association { tags, others, .. } = associated(&pulses, &TagTable::default());
    assert_eq!(tags.len(), 1);
    assert_eq!((tags[0].pulses.len(), others.len()), (4_720, 0));
    assert_eq!(tags[0].names, [""; 0]);
    assert_abs_diff_eq!(tags[0].interval_s, 0.900, epsilon = 0.001);
}

/// A SensorGnome's own file, compressed, is the table of its pulses; its other lines are none.
#[test]
fn a_sensorgnomes_own_file_is_its_pulses() {
    let own = "S,1366227448.192,1,frequency,166.376,0,\n\
               G,1366227449,44.34,-66.11,21.6\n\
               p1,1366227450.5,3.883,-49.09,-71.03\n\
               T1,1366227450.9,78664C33,-51\n\
               p12,1366227451.25,-1.25,-52.5,-70\n";
    let table = "time_unix_s,dfreq_kHz,sig_dB,noise_dB\n\
                 1366227450.5,3.883,-49.09,-71.03\n1366227451.25,-1.25,-52.5,-70\n";
    let file = Path::new("all.txt");
    let list = parse_pulses(file, own.as_bytes()).expect("a SensorGnome's file");
    assert_eq!(list.pulses, parse_pulses(file, table.as_bytes()).expect("a table").pulses);
    let compressed = Path::new(env!("CARGO_TARGET_TMPDIR")).join("all.txt.gz");
    let out = std::fs::File::create(&compressed).expect("a file can be written");
    let mut encoder = GzEncoder::new(out, Compression::default());
    encoder.write_all(own.as_bytes()).and_then(|()| encoder.finish()).expect("it is written");
    assert_eq!(read_pulses(&compressed).expect("it is read").pulses, list.pulses);
    let broken = own.replace("-52.5", "loud");
    let error = parse_pulses(file, broken.as_bytes()).expect_err("no level").to_string();
    assert!(error.contains("line 5, sig_dB: \"loud\""), "{error}");
}

/// The error of a file with this text, read as pulses or as a table.
fn refused(name: &str, text: &str, is_table: bool) -> String {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&file, text).expect("a file can be written");
    let error = if is_table {
        TagTable::read(&file).map(|_| ()).expect_err("it is bad")
    } else {
        read_pulses(&file).map(|_| ()).expect_err("it is bad")
    };
    error.to_string()
}

#[test]
fn bad_lines_are_named_with_field_and_value() {
    let own = "time_s,frequency_hz,width_s,power_dbm,snr_db\n1,2,0.02,-90,20\n";
    let cases: [(&str, String, bool, &[&str]); 8] = [
        ("width.csv", format!("{own}2,2,-1,-90,20\n"), false, &["line 3", "width_s", "\"-1\""]),
        ("level.csv", format!("{own}2,2,0.02,loud,20\n"), false, &["line 3", "power_dbm", "loud"]),
        ("short.csv", format!("{own}2,2\n"), false, &["short.csv", "line"]),
        ("nan.csv", format!("{own}NaN,2,0.02,-90,20\n"), false, &["time_s", "NaN", "finite"]),
        ("other.csv", "a,b\n1,2\n".to_owned(), false, &["a, b", "SensorGnome"]),
        (
            "date.csv",
            "Time;Frequency;Duration;avg (dBW);snr (dB)\nnow;1;0.02;-90;9\n".to_owned(),
            false,
            &["line 2", "Time", "now"],
        ),
        (
            "twice.csv",
            "name,interval_s\na,1\na,2\n".to_owned(),
            true,
            &["line 3", "\"a\"", "already"],
        ),
        (
            "gaps.csv",
            "name,interval_s,gaps_ms\na,1,20 x\n".to_owned(),
            true,
            &["line 2", "gaps_ms", "20 x"],
        ),
    ];
    for (name, text, is_table, wanted) in cases {
        let error = refused(name, &text, is_table);
        for part in wanted {
            assert!(error.contains(part), "{part:?} is not in {error}");
        }
    }
}
