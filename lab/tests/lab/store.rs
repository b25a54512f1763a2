//! Campaigns in a file: what was flown in one go, in pieces and elsewhere is the same.

use approx::assert_abs_diff_eq;
use std::{
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicU32, Ordering},
};

use foxhunt_hunt::{
    registry::{EstimatorEntry, Registry},
    scenario::Scenario,
};
use foxhunt_lab::{
    campaign::{CampaignReport, OWN, Repetition, campaign},
    store::{CampaignToStore, Filter, Shard, Store, StoreError, compare, merge, write_csv},
};
use rusqlite::Connection;

/// A path of its own for each test, at which there is nothing.
fn nothing_at(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    for end in ["", "-wal", "-shm", ".part"] {
        let file = PathBuf::from(format!("{}{end}", path.display()));
        if file.exists() {
            fs::remove_file(&file).expect("an old file of this test can be removed");
        }
    }
    path
}

/// One drone; some hunts are not over in time, and one of the beacons appears when some are over.
fn scenario() -> Scenario {
    let mut scenario = Scenario::find("one-drone").expect("it is built in");
    scenario.simulation.limit_s = 250.0;
    let mut late = scenario.world.beacons[0].clone();
    (late.name, late.appears_after_s) = ("late".to_owned(), Some(133.0));
    scenario.world.beacons.push(late);
    scenario
}

fn estimators(registry: &Registry) -> Vec<EstimatorEntry> {
    let names = ["ekf-pritzl2018", "ukf-pritzl2018"];
    names.map(|name| registry.estimator(name).expect("it is built in").clone()).to_vec()
}

fn to_store<'a>(
    registry: &'a Registry,
    scenario: &'a Scenario,
    estimators: &'a [EstimatorEntry],
) -> CampaignToStore<'a> {
    CampaignToStore {
        registry,
        scenario,
        estimators,
        planner: OWN,
        program: "foxhunt test",
        logs: false,
        shard: Shard::WHOLE,
    }
}

fn repetition(runs: u32) -> Repetition<'static> {
    Repetition { seed: 7, jobs: 2, ..Repetition::new(runs) }
}

/// All digits: two reports that print alike are the same.
fn digits(report: &CampaignReport) -> String {
    format!("{report:?}")
}

/// All rows of a table, as texts.
fn rows(path: &Path, table: &str) -> Vec<String> {
    let connection = Connection::open(path).expect("a database");
    let mut select =
        connection.prepare(&format!("SELECT * FROM {table} ORDER BY 1, 2, 3")).expect("a table");
    let columns = select.column_count();
    let row = |row: &rusqlite::Row<'_>| {
        (0..columns).map(|column| Ok(format!("{:?}", row.get_ref(column)?))).collect()
    };
    let rows = select.query_map([], row).expect("rows");
    rows.collect::<Result<_, _>>().expect("texts")
}

const TABLES: [&str; 5] = ["campaign", "beacon", "contender", "run", "log"];

#[test]
fn a_store_gives_the_streaming_table_however_it_was_filled() {
    let registry = Registry::builtin();
    let scenario = scenario();
    let estimators = estimators(&registry);
    let streaming = campaign(&registry, &scenario, &estimators, &repetition(60)).expect("flown");
    let failed: Vec<u32> = streaming.estimators[0].beacons.iter().map(|b| b.failed).collect();
    assert!(failed[0] > 0 && failed[1] > failed[0] && failed[1] < 60, "some fail: {failed:?}");
    let to_store = to_store(&registry, &scenario, &estimators);

    let one_go = nothing_at("one-go.sqlite");
    let store = Store::create(&one_go).expect("a new store");
    let stored = to_store.fly(&store, &repetition(60)).expect("flown");
    assert_eq!(digits(&stored), digits(&streaming));

    // Filled out of order, with a hole, and by another number of threads.
    let pieces = nothing_at("pieces.sqlite");
    let store = Store::create(&pieces).expect("a new store");
    for (seed, runs) in [(40, 9), (7, 12), (55, 3)] {
        let part = Repetition { seed, jobs: 1, ..repetition(runs) };
        to_store.fly(&store, &part).expect("flown");
    }
    drop(store);
    let store = Store::create(&pieces).expect("it is there");
    let flown = AtomicU32::new(0);
    let count = || {
        flown.fetch_add(1, Ordering::Relaxed);
    };
    let rest = Repetition { progress: &count, ..repetition(60) };
    assert_eq!(digits(&to_store.fly(&store, &rest).expect("flown")), digits(&streaming));
    assert_eq!(flown.into_inner(), 120, "progress counts what was there");
    drop(store);
    for table in TABLES {
        assert_eq!(rows(&one_go, table), rows(&pieces, table), "{table}");
    }
    let store = Store::open(&pieces).expect("it is there");
    let [summary] = &store.summaries(&Filter::default()).expect("read")[..] else {
        panic!("one campaign")
    };
    assert_eq!(digits(&summary.report), digits(&streaming));
    assert!(summary.held.iter().all(|held| (held.runs, held.missing) == (60, 0)));
}

#[test]
fn what_is_there_is_not_flown_again() {
    let registry = Registry::builtin();
    let scenario = scenario();
    let estimators = estimators(&registry);
    let to_store = to_store(&registry, &scenario, &estimators);
    let path = nothing_at("kept.sqlite");
    let store = Store::create(&path).expect("a new store");
    to_store.fly(&store, &repetition(5)).expect("flown");
    let change = Connection::open(&path).expect("a database");
    change.execute("UPDATE run SET error_m = 1234.5 WHERE seed = 9", []).expect("changed");
    let report = to_store.fly(&store, &repetition(6)).expect("flown");
    assert!(digits(&report).contains("1234.5"), "{report:?}");
    // What another program flew is another campaign, and so is another scenario.
    let mut other = scenario.clone();
    other.world.channel.sample_sigma_db += 0.5;
    let others = [
        CampaignToStore { program: "foxhunt next", ..to_store },
        CampaignToStore { scenario: &other, ..to_store },
    ];
    for other in others {
        let report = other.fly(&store, &repetition(6)).expect("flown");
        assert!(!digits(&report).contains("1234.5"), "{report:?}");
    }
    assert_eq!(store.campaigns().expect("read").len(), 3);
}

#[test]
fn shards_merge_to_what_one_process_writes() {
    let registry = Registry::builtin();
    let scenario = scenario();
    let estimators = estimators(&registry);
    let to_store = CampaignToStore { logs: true, ..to_store(&registry, &scenario, &estimators) };
    let whole = nothing_at("whole.sqlite");
    let fly = |path: &Path, shard, runs| {
        let store = Store::create(path).expect("a new store");
        let one = CampaignToStore { shard, ..to_store };
        one.fly(&store, &repetition(runs)).expect("flown")
    };
    let report = fly(&whole, Shard::WHOLE, 20);
    // The last one comes first, and one twice.
    let shards: Vec<PathBuf> = [3, 1, 2, 1]
        .map(|number| {
            let path = nothing_at(&format!("shard-{number}.sqlite"));
            let flown = fly(&path, Shard::new(number, 3).expect("one of three"), 20);
            assert!(flown.runs < 8 && flown.seed >= 7);
            path
        })
        .to_vec();
    let merged = nothing_at("merged.sqlite");
    // What a store of this name has left that was killed and removed is not replayed.
    let removed = nothing_at("removed.sqlite");
    fly(&removed, Shard::WHOLE, 20);
    let open = Connection::open(&removed).expect("a database");
    open.pragma_update(None, "journal_mode", "wal").expect("nobody else has it open");
    open.execute_batch("DELETE FROM run; VACUUM").expect("changed");
    let log = |path: &Path| PathBuf::from(format!("{}-wal", path.display()));
    assert!(fs::copy(log(&removed), log(&merged)).expect("it is open") > 0);
    drop(open);
    merge(&shards, &merged).expect("they fit");
    for table in TABLES {
        let merged = rows(&merged, table);
        let whole = rows(&whole, table);
        assert!(!whole.is_empty());
        assert_eq!(merged, whole, "{table}");
    }
    let store = Store::open(&merged).expect("a store");
    // One file, which stays one when it is read.
    store.summaries(&Filter::default()).expect("read");
    assert!(!log(&merged).exists() && !log(&whole).exists());
    let again = to_store.fly(&Store::create(&merged).expect("it"), &repetition(20));
    assert_eq!(digits(&again.expect("nothing is missing")), digits(&report));
    let [summary] = &store.summaries(&Filter::default()).expect("read")[..] else {
        panic!("one campaign")
    };
    assert_eq!(digits(&summary.report), digits(&report));
    let contender = &store.contenders().expect("two")[0];
    let log = String::from_utf8(store.log(contender, 9).expect("kept")).expect("lines");
    assert!(log.lines().count() > 5 && log.contains("\"seed\":9"), "{log}");
    assert!(matches!(store.log(contender, 999), Err(StoreError::NoLog { seed: 999, .. })));

    // A file that is there stays, and shards of something else are refused with both names.
    assert!(merge(&shards, &merged).expect_err("it is there").to_string().contains("merged"));
    let refused = |name: &str, change: &dyn Fn(&mut CampaignToStore<'_>)| {
        let path = nothing_at(name);
        let mut other = to_store;
        change(&mut other);
        let other = other.fly(&Store::create(&path).expect("a new store"), &repetition(2));
        other.expect("flown");
        let to = nothing_at("refused.sqlite");
        let error = merge(&[shards[0].clone(), path], &to).expect_err("it is another one");
        assert!(!to.exists() && !Path::new(&format!("{}.part", to.display())).exists());
        let error = error.to_string();
        assert!(error.contains(name) && error.contains("shard-3.sqlite"), "{error}");
        error
    };
    let error = refused("version.sqlite", &|other| other.program = "foxhunt next");
    assert!(error.contains("foxhunt next, not foxhunt test"), "{error}");
    let far = Scenario::find("pritzl-6.1").expect("it is built in");
    let error = refused("scenario.sqlite", &|other| {
        other.planner = "another";
    });
    assert!(error.contains("planner another"), "{error}");
    let path = nothing_at("far.sqlite");
    let other = CampaignToStore { scenario: &far, ..to_store };
    other.fly(&Store::create(&path).expect("new"), &repetition(1)).expect("flown");
    let error = merge(&[shards[0].clone(), path], &nothing_at("refused.sqlite"));
    let error = error.expect_err("another scenario").to_string();
    assert!(error.contains("scenario pritzl-6.1, not one-drone"), "{error}");
    let error = refused("estimators.sqlite", &|other| other.estimators = &other.estimators[..1]);
    assert!(error.contains("ukf-pritzl2018@"), "{error}");

    // The same run with another result.
    let change = Connection::open(&shards[1]).expect("a database");
    change.execute("UPDATE run SET path_m = 1 WHERE seed = 8", []).expect("changed");
    let error = merge(&[whole, shards[1].clone()], &nothing_at("refused.sqlite"));
    let error = error.expect_err("they contradict").to_string();
    assert!(error.contains("seed 8") && error.contains("whole.sqlite"), "{error}");
}

#[test]
fn results_are_filtered_compared_and_exported() {
    let registry = Registry::builtin();
    let scenario = scenario();
    let estimators = estimators(&registry);
    let path = nothing_at("results.sqlite");
    let store = Store::create(&path).expect("a new store");
    let to_store = to_store(&registry, &scenario, &estimators);
    to_store.fly(&store, &repetition(30)).expect("flown");

    let filter = Filter {
        estimators: vec!["ekf-pritzl2018".to_owned()],
        beacon: Some(scenario.world.beacons[0].name.clone()),
        seeds: Some(10..20),
        ..Filter::default()
    };
    let [summary] = &store.summaries(&filter).expect("read")[..] else { panic!("one campaign") };
    let some = Repetition { seed: 10, ..repetition(10) };
    let mut flown = campaign(&registry, &scenario, &estimators[..1], &some).expect("flown");
    flown.estimators[0].beacons.truncate(1);
    assert_eq!(digits(&summary.report), digits(&flown));
    for none in [
        Filter { planner: Some("other".to_owned()), ..Filter::default() },
        Filter { scenario: Some("other".to_owned()), ..Filter::default() },
        Filter { estimators: vec!["other".to_owned()], ..Filter::default() },
    ] {
        assert_eq!(store.summaries(&none).expect("read"), []);
    }

    let mut csv = Vec::new();
    let count = write_csv(&store, &filter, &mut csv).expect("written");
    let csv = String::from_utf8(csv).expect("text");
    assert_eq!((count, csv.lines().count()), (10, 11));
    assert!(csv.lines().nth(1).expect("a row").contains("foxhunt test,one-drone,"), "{csv}");

    let errors = |estimator: &str| -> Vec<(u64, f64)> {
        let contenders = store.contenders().expect("two");
        let of = contenders.iter().find(|contender| contender.is(estimator)).expect("it");
        let mut errors = Vec::new();
        store
            .rows::<StoreError>(of, &(0..100), |row| {
                let good = row.run.steps > 0 && row.beacon == 0;
                errors.extend(row.run.error_m.filter(|_| good).map(|error| (row.seed, error)));
                Ok(())
            })
            .expect("read");
        errors
    };
    let ekf = errors("ekf-pritzl2018");
    let ukf = errors("ukf-pritzl2018");
    let differences: Vec<f64> = ekf
        .iter()
        .filter_map(|(seed, error)| {
            ukf.iter().find(|(other, _)| other == seed).map(|(_, other)| error - other)
        })
        .collect();
    let compared =
        compare(&store, &Filter::default(), "ekf-pritzl2018", "ukf-pritzl2018").expect("read");
    let first = compared.iter().find(|c| c.figure == "error_m").expect("it is compared");
    let difference = first.difference.expect("there are pairs");
    assert_eq!(difference.pairs, differences.len());
    let mean =
        differences.iter().sum::<f64>() / f64::from(u32::try_from(differences.len()).expect("few"));
    assert_abs_diff_eq!(difference.mean, mean, epsilon = 1e-9);
    let turned =
        compare(&store, &Filter::default(), "ukf-pritzl2018", "ekf-pritzl2018").expect("read");
    assert_abs_diff_eq!(turned[0].difference.expect("pairs").mean + mean, 0.0, epsilon = 1e-9);
    let unknown = compare(&store, &Filter::default(), "grid", "ekf-pritzl2018");
    let unknown = unknown.expect_err("nobody of that name").to_string();
    assert!(unknown.contains("grid") && unknown.contains("ekf-pritzl2018@"), "{unknown}");
}

/// Every row and column, read back, is that of the CSV.
#[cfg(feature = "parquet")]
#[test]
fn parquet_reads_back() {
    use foxhunt_lab::store::write_parquet;
    use parquet::file::reader::{FileReader, SerializedFileReader};

    let registry = Registry::builtin();
    let scenario = scenario();
    let estimators = estimators(&registry);
    let path = nothing_at("parquet.sqlite");
    let store = Store::create(&path).expect("a new store");
    to_store(&registry, &scenario, &estimators).fly(&store, &repetition(6)).expect("flown");
    let mut csv = Vec::new();
    write_csv(&store, &Filter::default(), &mut csv).expect("written");
    let file = nothing_at("runs.parquet");
    let out = fs::File::create(&file).expect("a file");
    let count = write_parquet(&store, &Filter::default(), out).expect("written");
    assert_eq!(count, 24);
    let file = fs::File::open(&file).expect("a file");
    let reader = SerializedFileReader::new(file).expect("Parquet");
    let mut read = Vec::new();
    for row in reader.get_row_iter(None).expect("rows") {
        let row = row.expect("a row");
        let cells = row.get_column_iter().map(|(_, field)| match field {
            parquet::record::Field::Null => String::new(),
            parquet::record::Field::Str(text) => text.clone(),
            parquet::record::Field::Double(number) => number.to_string(),
            other => other.to_string(),
        });
        read.push(cells.collect::<Vec<_>>());
    }
    let mut reader = csv::Reader::from_reader(&csv[..]);
    let texts: Vec<Vec<String>> = reader
        .records()
        .map(|record| record.expect("a row").iter().map(str::to_owned).collect())
        .collect();
    assert_eq!(read, texts);
}

#[test]
fn what_is_no_store_is_refused_and_stays_as_it_is() {
    let text = nothing_at("text.sqlite");
    fs::write(&text, "a text that is long enough to be no header of a database at all")
        .expect("it");
    let empty = nothing_at("other.sqlite");
    Connection::open(&empty).expect("new").execute_batch("CREATE TABLE t (a)").expect("made");
    for path in [&text, &empty] {
        let before = fs::read(path).expect("a file");
        for opened in [Store::open(path), Store::create(path)] {
            let error = opened.expect_err("it is none");
            assert!(matches!(error, StoreError::NotAStore { .. }), "{error}");
        }
        assert_eq!(fs::read(path).expect("a file"), before);
    }
    assert!(Store::open(&nothing_at("absent.sqlite")).is_err());
    let path = nothing_at("format.sqlite");
    drop(Store::create(&path).expect("a new store"));
    let change = Connection::open(&path).expect("a database");
    change.pragma_update(None, "user_version", 99).expect("changed");
    let error = Store::open(&path).expect_err("of another format").to_string();
    assert!(error.contains("99") && error.contains("format.sqlite"), "{error}");

    let registry = Registry::builtin();
    let scenario = scenario();
    let estimators = estimators(&registry);
    let path = nothing_at("row.sqlite");
    let store = Store::create(&path).expect("a new store");
    let to_store = to_store(&registry, &scenario, &estimators);
    to_store.fly(&store, &repetition(2)).expect("flown");
    let change = Connection::open(&path).expect("a database");
    change.execute("UPDATE run SET ended = 'eaten' WHERE seed = 8", []).expect("changed");
    let error = store.summaries(&Filter::default()).expect_err("no such end").to_string();
    assert!(error.contains("seed 8") && error.contains("ended"), "{error}");
    let last = Repetition { seed: u64::MAX, ..repetition(1) };
    assert!(matches!(to_store.fly(&store, &last), Err(StoreError::Seeds { .. })));
}
