use std::{
    ffi::OsString,
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::support::{Ran, folder, foxhunt, has, scenario};

const ESTIMATORS: [&str; 4] = ["--estimator", "ekf-pritzl2018", "--estimator", "ukf-pritzl2018"];

/// A campaign of a scenario's file with two estimators.
fn campaign(scenario: &Path, more: &[&str]) -> Vec<OsString> {
    let mut args: Vec<OsString> = vec!["campaign".into(), scenario.into()];
    args.extend(ESTIMATORS.iter().chain(more).map(OsString::from));
    args
}

fn path(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// The most memory that a process has held so far, in KiB.
fn peak_kib(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

/// Starts the program, waits until it has printed `lines` lines of progress, one for each
/// hundredth, and for this share of the time of a hundredth, and kills it (SIGKILL). The most
/// memory that it held, in KiB, and 0 where the system does not show it; nothing where it had
/// ended.
fn killed_after(args: &[OsString], lines: usize, share: f64) -> Option<u64> {
    let mut child = Command::new(env!("CARGO_BIN_EXE_foxhunt"))
        .arg("--json=lines")
        .args(args)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program was built for this test");
    let progress = BufReader::new(child.stdout.take().expect("it is piped"));
    let begun = Instant::now();
    // What was there before is reported at once, so the last hundredth is what counts.
    let mut last = begun;
    let mut before = begun;
    let mut reported = 0;
    for line in progress.lines().take(lines) {
        line.expect("it is piped");
        (before, last, reported) = (last, Instant::now(), reported + 1);
    }
    thread::sleep(last.duration_since(before).mul_f64(share));
    let peak_kib = peak_kib(child.id()).unwrap_or(0);
    child.kill().expect("it may be killed, ended or not");
    let ended = child.wait().expect("it was ours");
    (reported == lines && !ended.success()).then_some(peak_kib)
}

/// Runs the program to its end; what it printed, and the most memory that it held, in KiB.
fn watched(args: &[OsString]) -> (String, u64) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_foxhunt"))
        .args(args)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program was built for this test");
    let mut most = 0;
    // What it prints waits in the pipe, which has room for a table.
    while child.try_wait().expect("it is ours").is_none() {
        most = peak_kib(child.id()).unwrap_or(0).max(most);
        thread::sleep(Duration::from_millis(5));
    }
    let printed = child.wait_with_output().expect("it was ours");
    assert!(printed.status.success(), "{printed:?}");
    (String::from_utf8(printed.stdout).expect("it prints UTF-8"), most)
}

/// A campaign that is killed again and again at instants that a generator draws gives the table
/// of one that was not, to the byte, and takes no more memory for more rows.
fn kill_and_go_on(name: &str, runs: &str, kills: usize) {
    let folder = folder(name);
    let file = folder.join("small.toml");
    let store = folder.join("runs.sqlite");
    fs::write(&file, scenario()).expect("a file");
    let fixed = ["--runs", runs, "--jobs", "2"];
    let stored = campaign(&file, &[&fixed[..], &["--store", path(&store)]].concat());
    let mut random = Xoshiro256PlusPlus::seed_from_u64(19);
    let mut peaks_kib = Vec::new();
    for kill in 0..kills {
        // Each in its own part of the first three quarters, so that all of them meet work.
        let lines = random.random_range(1 + 75 * kill / kills..=75 * (kill + 1) / kills);
        let killed = killed_after(&stored, lines, random.random());
        peaks_kib.push(killed.unwrap_or_else(|| panic!("it had ended before line {lines}")));
        // Whatever is there is whole: it can be read, and has no half of a run.
        let held = foxhunt(["--json".as_ref(), "results".as_ref(), store.as_os_str()]);
        let none_yet = held.code == 2 && held.stderr.contains("no runs fit");
        assert!(held.code == 0 || none_yet, "{held:?}");
    }
    let (resumed, peak) = watched(&stored);
    peaks_kib.push(peak);
    let (again, peak) = watched(&stored);
    peaks_kib.push(peak);
    assert_eq!(again, resumed);
    let results = foxhunt(["results".as_ref(), store.as_os_str()]);
    assert!(results.stdout.starts_with(resumed.trim_end()), "{results:?}");
    // All rows of the large one would be 27 MiB.
    let most = peaks_kib.iter().max().copied().unwrap_or(0);
    assert!(most <= peaks_kib[0] + 16 * 1024, "{peaks_kib:?} KiB");
    let in_one_go = foxhunt(campaign(&file, &fixed));
    assert_eq!(in_one_go.code, 0, "{in_one_go:?}");
    assert_eq!(resumed, in_one_go.stdout);
}

#[test]
fn a_killed_campaign_goes_on_where_it_was() {
    kill_and_go_on("killed", "60", 4);
}

#[test]
#[ignore = "2 × 10⁵ hunts twice and ten kills: half an hour of a processor"]
fn a_large_campaign_is_killed_ten_times() {
    kill_and_go_on("killed_often", "100000", 10);
}

#[test]
fn three_shards_merge_to_one() {
    let folder = folder("shards");
    let file = folder.join("small.toml");
    fs::write(&file, scenario()).expect("a file");
    let whole = folder.join("whole.sqlite");
    let fixed = ["--runs", "20", "--seed", "11"];
    let with = |store: &Path, more: &[&str]| {
        let more = [&fixed[..], &["--store", path(store)], more].concat();
        campaign(&file, &more)
    };
    let one = foxhunt(with(&whole, &[]));
    let shard = |number: u32| folder.join(format!("{number}.sqlite"));
    // As it is given, as an array of SLURM numbers it, and as MPI does.
    assert_eq!(foxhunt(with(&shard(1), &["--shard", "1/3"])).code, 0);
    for (number, variables) in [
        (2, [("SLURM_ARRAY_TASK_ID", "1"), ("SLURM_ARRAY_TASK_COUNT", "3")]),
        (3, [("OMPI_COMM_WORLD_RANK", "2"), ("OMPI_COMM_WORLD_SIZE", "3")]),
    ] {
        let ran = Command::new(env!("CARGO_BIN_EXE_foxhunt"))
            .args(with(&shard(number), &["--shard", "auto"]))
            .envs(variables)
            .output()
            .expect("the program was built for this test");
        assert!(ran.status.success(), "{ran:?}");
    }
    let merged = folder.join("merged.sqlite");
    let merge = |shards: &[u32], to: &Path| -> Ran {
        let mut args: Vec<OsString> = vec!["results".into(), "merge".into()];
        args.extend(shards.iter().map(|number| shard(*number).into_os_string()));
        args.extend(["--to".into(), to.into()]);
        foxhunt(args)
    };
    let printed = merge(&[1, 2, 3], &merged);
    assert!(printed.stdout.starts_with(one.stdout.trim_end()), "{printed:?}");
    let results = |store: &Path| foxhunt(["results".as_ref(), store.as_os_str()]).stdout;
    assert_eq!(results(&merged), results(&whole));
    let csv = |store: &Path| {
        let to = folder.join("runs.csv");
        let ran = foxhunt(["results", path(store), "--csv", path(&to)]);
        assert_eq!(ran.code, 0, "{ran:?}");
        fs::read(to).expect("it was written")
    };
    assert_eq!(csv(&merged), csv(&whole));
    merge(&[1, 2, 3], &merged).failed(1, &["merged.sqlite", "exists"]);
    // Without its middle part there is a gap.
    let gap = merge(&[1, 3], &folder.join("gap.sqlite"));
    assert!(gap.stdout.contains("13 runs; 7 seeds up to the last one have none"), "{gap:?}");
    // Another scenario is refused with both names.
    let text = scenario().replace("sample_sigma_db = 1.0", "sample_sigma_db = 1.5");
    fs::write(&file, text).expect("a file");
    assert_eq!(foxhunt(with(&shard(4), &["--shard", "2/3"])).code, 0);
    merge(&[1, 4], &folder.join("other.sqlite")).failed(
        2,
        &["1.sqlite", "4.sqlite", "sample_sigma_db = 1.5", "not `sample_sigma_db = 1.0`"],
    );
}

#[test]
fn results_are_shown_compared_and_written() {
    let folder = folder("results");
    let file = folder.join("small.toml");
    let store = folder.join("runs.sqlite");
    fs::write(&file, scenario()).expect("a file");
    let args = ["--runs", "10", "--store", path(&store), "--store-logs"];
    let flown = foxhunt(campaign(&file, &args));
    assert_eq!(flown.code, 0, "{flown:?}");
    let results = |more: &[&str]| foxhunt([&["results", path(&store)], more].concat());
    let report = foxhunt(["--json", "results", path(&store), "--seeds", "2..5"]).json();
    let campaign = &report["campaigns"][0];
    has(campaign, &["campaign", "held", "report"]);
    assert_eq!((&campaign["report"]["runs"], &campaign["report"]["seed"]), (&4.into(), &2.into()));
    has(&campaign["campaign"], &["digest", "program", "scenario", "planner", "beacons"]);

    let compared = results(&["--compare", "ekf-pritzl2018", "ukf-pritzl2018"]);
    for text in ["ekf-pritzl2018@", "minus ukf-pritzl2018@", "fox", "error_m", "p (ranks)"] {
        assert!(compared.stdout.contains(text), "{text} is missing in {}", compared.stdout);
    }
    results(&["--compare", "ekf", "ukf-pritzl2018"]).failed(2, &["\"ekf\"", "ukf-pritzl2018@"]);

    let picture = folder.join("runs.svg");
    assert_eq!(results(&["--svg", path(&picture)]).code, 0);
    let svg = fs::read_to_string(&picture).expect("it was written");
    assert!(svg.contains("small, fox") && svg.contains("ukf-pritzl2018, 10 runs"), "{svg}");

    let page = folder.join("runs.html");
    assert_eq!(results(&["--report", path(&page)]).code, 0);
    let html = fs::read_to_string(&page).expect("it was written");
    // A table, a figure and a comparison; nothing is fetched from anywhere.
    for text in ["<h3>fox</h3>", "<td>ukf-pritzl2018</td><td>10</td>", "<td>ukf-pritzl2018@"] {
        assert!(html.contains(text), "{text} is missing in {html}");
    }
    assert_eq!((html.matches("<svg").count(), html.matches("<script").count()), (1, 0));
    // The comparison on the page is the command's.
    let difference = compared.stdout.lines().find(|line| line.contains("error_m"));
    let mean = difference.and_then(|line| line.split_whitespace().nth(3)).expect("a mean");
    assert!(html.contains(&format!("<td>{mean}</td>")), "{mean} is missing in {html}");

    let log = folder.join("hunt.jsonl");
    let chosen = ["--estimator", "ekf-pritzl2018", "--log-of", "3", "--log", path(&log)];
    assert_eq!(results(&chosen).code, 0);
    let replayed = foxhunt(["--json".as_ref(), "replay".as_ref(), log.as_os_str()]).json();
    assert_eq!(replayed["identical"], replayed["compared"], "{replayed}");
    assert!(replayed["compared"].as_u64() > Some(0), "{replayed}");
    results(&chosen[2..]).failed(2, &["2 contenders", "ukf-pritzl2018@"]);

    for (args, texts) in
        [(&["--seeds", "5..2"][..], &["A..B"][..]), (&["--planner", "orbit"], &["no runs fit"])]
    {
        results(args).failed(2, texts);
    }
    foxhunt(["results"]).failed(2, &["FILE"]);
    foxhunt(["results", "/no/such/store"]).failed(1, &["/no/such/store"]);
    foxhunt(["results".as_ref(), file.as_os_str()]).failed(2, &["small.toml is not a store"]);
    for (args, text) in [
        (&["--shard", "1/3"][..], "--store"),
        (&["--shard", "4/3", "--store", "x"], "4/3"),
        (&["--shard", "auto", "--store", "x"], "SLURM_ARRAY_TASK_ID"),
        (&["--store-logs"], "--store"),
        (&["--store", "x", "--hunts-to", "y"], "--hunts-to"),
    ] {
        foxhunt([&["campaign", "--runs", "1"], args].concat()).failed(2, &[text]);
    }
}
