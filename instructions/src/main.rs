//! Counts instructions under valgrind and compares them with `baselines.toml`.
//!
//! Counts do not depend on what else a computer does, and hardly on which it is: valgrind gives the
//! program vectors of 256 bits wherever there are such or wider ones. `.ci/instructions` builds and
//! runs it.

#![expect(clippy::print_stdout, reason = "a program prints its table")]

use std::{
    collections::BTreeMap,
    env,
    error::Error,
    fmt::Write as _,
    fs,
    hint::black_box,
    process::{Command, ExitCode},
};

mod cases;

use cases::{CASES, WITH_DUAL_NUMBERS, Work};

const BASELINES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/baselines.toml");

/// Largest allowed difference of a count from its baseline, as a share.
const TOLERANCE: f64 = 0.05;

/// Counts of instructions, by the names of the cases.
type Counts = BTreeMap<String, u64>;

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match *arguments.as_slice() {
        [] => compare(),
        ["--renew"] => renew(),
        // What valgrind runs.
        ["--run", case] => {
            let (_, ready) = CASES.iter().find(|(name, _)| *name == case).ok_or("no such case")?;
            counted(ready()?);
            Ok(ExitCode::SUCCESS)
        }
        _ => Err("usage: instructions [--renew], which writes the baselines anew".into()),
    }
}

/// Calls what is counted: valgrind looks for this function by its name.
#[inline(never)]
fn counted(work: Work) {
    black_box(work());
}

/// The instructions of a case.
fn count(case: &str) -> Result<u64, Box<dyn Error>> {
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null", "--toggle-collect=*counted*"])
        .arg(env::current_exe()?)
        .args(["--run", case])
        .output()
        .map_err(|error| format!("valgrind does not start: {error}"))?;
    let output = String::from_utf8_lossy(&run.stderr);
    let collected = output.lines().find_map(|line| line.split_once("Collected : "));
    let count = collected.and_then(|(_, count)| count.trim().parse().ok()).filter(|n| *n > 0);
    match count {
        Some(count) if run.status.success() => Ok(count),
        _ => Err(format!("{case}: {}, {output}", run.status).into()),
    }
}

fn baselines() -> Result<Counts, Box<dyn Error>> {
    Ok(toml::from_str(&fs::read_to_string(BASELINES)?)?)
}

fn renew() -> Result<ExitCode, Box<dyn Error>> {
    let mut counts = baselines()?;
    // Its count stays where it is not built.
    counts.retain(|case, _| case == WITH_DUAL_NUMBERS);
    for (case, _) in CASES {
        counts.insert((*case).to_owned(), count(case)?);
    }
    let mut text =
        "# Instructions under valgrind, written by `.ci/instructions --renew`.\n".to_owned();
    write!(text, "{}", toml::to_string(&counts)?)?;
    fs::write(BASELINES, text)?;
    Ok(ExitCode::SUCCESS)
}

#[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
fn compare() -> Result<ExitCode, Box<dyn Error>> {
    let mut baselines = baselines()?;
    let mut risen = false;
    let mut fallen = false;
    println!("{:40} {:>13} {:>13} {:>8}", "instructions", "baseline", "now", "change");
    for (case, _) in CASES {
        let now = count(case)?;
        let before = baselines.remove(*case).ok_or(format!("{case} has no baseline: --renew"))?;
        let change = now as f64 / before as f64 - 1.0;
        let moved = if change.abs() > TOLERANCE { "  <--" } else { "" };
        println!("{case:40} {before:13} {now:13} {:+7.1}%{moved}", 100.0 * change);
        risen |= change > TOLERANCE;
        fallen |= change < -TOLERANCE;
    }
    if !cfg!(feature = "dual") {
        baselines.remove(WITH_DUAL_NUMBERS);
    }
    if let Some((case, _)) = baselines.first_key_value() {
        return Err(format!("there is no case {case:?} any more: --renew").into());
    }
    if fallen {
        println!("Keep what was won: `.ci/instructions --renew` writes the baselines anew.");
    }
    if risen {
        println!("What rose for a good reason is kept by `.ci/instructions --renew`.");
    }
    Ok(if risen { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}
