//! A store of campaigns of which any bytes were changed: three for each, two for its place. It is
//! read, or refused with an error.
#![no_main]

use std::{fs, path::PathBuf, sync::LazyLock};

use foxhunt_hunt::{registry::Registry, scenario::Scenario};
use foxhunt_lab::{
    campaign::{OWN, Repetition},
    store::{CampaignToStore, Filter, Shard, Store, compare, write_csv},
};
use libfuzzer_sys::fuzz_target;

static PATH: LazyLock<PathBuf> = LazyLock::new(|| {
    std::env::temp_dir().join(format!("foxhunt-fuzz-{}.sqlite", std::process::id()))
});

/// The bytes of a store in order: a few runs of two estimators.
static WHOLE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let registry = Registry::builtin();
    let scenario = Scenario::find("one-drone").expect("it is built in");
    let names = ["ekf-pritzl2018", "ukf-pritzl2018"];
    let estimators = names.map(|name| registry.estimator(name).expect("it is built in").clone());
    let campaign = CampaignToStore {
        registry: &registry,
        scenario: &scenario,
        estimators: &estimators,
        planner: OWN,
        program: "fuzz",
        logs: false,
        shard: Shard::WHOLE,
    };
    let _ = fs::remove_file(&*PATH);
    let store = Store::create(&PATH).expect("a new store");
    campaign.fly(&store, &Repetition { jobs: 1, ..Repetition::new(4) }).expect("flown");
    drop(store);
    fs::read(&*PATH).expect("it was written")
});

fuzz_target!(|changes: &[u8]| {
    let mut bytes = WHOLE.clone();
    for change in changes.chunks_exact(3) {
        let place = usize::from(u16::from_le_bytes([change[0], change[1]])) % bytes.len();
        bytes[place] = change[2];
    }
    for end in ["-wal", "-shm"] {
        let _ = fs::remove_file(PATH.with_extension(format!("sqlite{end}")));
    }
    fs::write(&*PATH, &bytes).expect("the folder can be written to");
    let Ok(store) = Store::open(&PATH) else { return };
    let _ = store.summaries(&Filter::default());
    let _ = write_csv(&store, &Filter::default(), std::io::sink());
    let _ = compare(&store, &Filter::default(), "ekf-pritzl2018", "ukf-pritzl2018");
});
