use std::path::{Path, PathBuf};

use foxhunt_signal::tags::{Association, AssociationConfig, TagTable, associate, read_pulses};

#[expect(clippy::print_stdout, reason = "a test reports what it skips")]
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
    for tag in &tags {
        println!(
            "{:?} {} {} {} n {} bursts {} missed {} {:?} dbl {} slips {}",
            tag.names,
            tag.frequency_hz,
            tag.interval_s,
            tag.jitter_s,
            tag.pulses.len(),
            tag.bursts,
            tag.missed,
            tag.log_odds,
            tag.doubled,
            tag.slips
        );
    }
    assert_eq!(tags.len(), 1);
    assert_eq!(tags[0].names, ["10695", "16357"]);
    assert_eq!((tags[0].bursts, tags[0].missed, tags[0].pulses.len()), (62, 0, 248));
    assert!((tags[0].interval_s - 19.995).abs() < 0.001, "{}", tags[0].interval_s);
    assert_eq!(others.len(), 5294 - 248);
}

#[test]
fn one_tag_of_unknown_interval() {
    let Some(pulses) = shared("pulses/pyrt_umr_150172kHz.csv") else { return };
    let Association { tags, others, .. } = associated(&pulses, &TagTable::default());
    for tag in &tags {
        println!(
            "{:?} {} {} {} n {} bursts {} missed {} {:?} dbl {} slips {}",
            tag.names,
            tag.frequency_hz,
            tag.interval_s,
            tag.jitter_s,
            tag.pulses.len(),
            tag.bursts,
            tag.missed,
            tag.log_odds,
            tag.doubled,
            tag.slips
        );
    }
    println!("{:?}", others);
    assert_eq!(tags.len(), 1);
    assert_eq!((tags[0].pulses.len(), others.len()), (4_720, 0));
    assert_eq!(tags[0].names, [""; 0]);
    assert!((tags[0].interval_s - 0.900).abs() < 0.001, "{}", tags[0].interval_s);
}
