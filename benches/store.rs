//! A campaign into a store beside the same campaign without one, and the summary of a million
//! rows.
//!
//! `RUNS=2000 WHAT=store` flies so many hunts and measures nothing, for a tool that counts time of
//! the processor or instructions; `WHAT` may also be `streaming`.

use std::{
    env, fs,
    hint::black_box,
    path::{Path, PathBuf},
};

use criterion::{BatchSize, Criterion, Throughput};
use foxhunt_hunt::{
    registry::{EstimatorEntry, Registry},
    scenario::Scenario,
};
use foxhunt_lab::{
    campaign::{CampaignReport, OWN, Repetition, campaign},
    store::{CampaignToStore, Filter, Shard, Store},
};
use rusqlite::Connection;

/// One drone, one beacon, the reference's EKF.
struct Problem {
    registry: Registry,
    scenario: Scenario,
    estimators: [EstimatorEntry; 1],
}

impl Problem {
    fn new() -> Self {
        let registry = Registry::builtin();
        let scenario = Scenario::find("one-drone").expect("it is built in");
        let estimators = [registry.estimator("ekf-pritzl2018").expect("it is built in").clone()];
        Self { registry, scenario, estimators }
    }

    fn streaming(&self, runs: u32) -> CampaignReport {
        campaign(&self.registry, &self.scenario, &self.estimators, &on_one_thread(runs))
            .expect("it can be flown")
    }

    fn to_store(&self, path: &Path, runs: u32) -> CampaignReport {
        let campaign = CampaignToStore {
            registry: &self.registry,
            scenario: &self.scenario,
            estimators: &self.estimators,
            planner: OWN,
            program: "bench",
            logs: false,
            shard: Shard::WHOLE,
        };
        let store = Store::create(path).expect("a new store");
        campaign.fly(&store, &on_one_thread(runs)).expect("it can be flown")
    }
}

fn on_one_thread(runs: u32) -> Repetition<'static> {
    Repetition { jobs: 1, ..Repetition::new(runs) }
}

/// A path at which there is no store.
fn nothing_at(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    for end in ["", "-wal", "-shm"] {
        let file = PathBuf::from(format!("{}{end}", path.display()));
        if file.exists() {
            fs::remove_file(&file).expect("an old file of this bench can be removed");
        }
    }
    path
}

/// A store of a million rows: a thousand hunts, each of them a thousand times.
fn million(problem: &Problem) -> Store {
    let path = nothing_at("million.sqlite");
    problem.to_store(&path, 1000);
    let connection = Connection::open(&path).expect("a database");
    connection
        .execute_batch(
            "CREATE TEMP TABLE flown AS SELECT * FROM run;
             WITH RECURSIVE copy(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM copy WHERE n < 999)
             INSERT INTO run SELECT contender, seed + 1000 * n, beacon, ended, failure,
                 duration_s, error_m, nees, steps, steps_to_3m, time_to_3m_s, path_m, nis_sum,
                 nis_sum_of_squares, nis_degrees_of_freedom, nis_count
             FROM copy CROSS JOIN flown;",
        )
        .expect("a store can be written");
    Store::open(&path).expect("it is a store")
}

fn measure(criterion: &mut Criterion) {
    const RUNS: u32 = 500;
    let problem = Problem::new();
    let path = nothing_at("campaign.sqlite");
    assert_eq!(
        format!("{:?}", problem.to_store(&path, 20).estimators),
        format!("{:?}", problem.streaming(20).estimators),
        "both fly the same"
    );
    let mut group = criterion.benchmark_group("campaign");
    group.sample_size(10).throughput(Throughput::Elements(RUNS.into()));
    group.bench_function("streaming", |bencher| {
        bencher.iter(|| problem.streaming(black_box(RUNS)));
    });
    group.bench_function("store", |bencher| {
        bencher.iter_batched(
            || nothing_at("campaign.sqlite"),
            |path| problem.to_store(&path, black_box(RUNS)),
            BatchSize::PerIteration,
        );
    });
    group.finish();

    let store = million(&problem);
    let mut group = criterion.benchmark_group("summary");
    group.sample_size(10).throughput(Throughput::Elements(1_000_000));
    group.bench_function("million", |bencher| {
        bencher.iter(|| {
            let summaries = store.summaries(&Filter::default()).expect("it can be read");
            assert_eq!(summaries[0].held[0].runs, 1_000_000);
            summaries
        });
    });
    group.finish();
}

fn main() {
    if let Some(runs) = env::var("RUNS").ok().and_then(|runs| runs.parse().ok()) {
        let problem = Problem::new();
        black_box(match env::var("WHAT").as_deref() {
            Ok("streaming") => problem.streaming(runs),
            _ => problem.to_store(&nothing_at("counted.sqlite"), runs),
        });
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    measure(&mut criterion);
    criterion.final_summary();
}
