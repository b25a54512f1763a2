use std::{
    fs,
    net::UdpSocket,
    path::Path,
    process::{Child, Command, Stdio},
    thread,
    time::Duration,
};

use serde_json::Value;

use crate::support::{folder, foxhunt};

/// Flies the README's demonstration in a process that is stopped now and then, for as long as a
/// busy computer may leave it without a processor. Returns its log and its samples.
fn interrupted(name: &str) -> (Vec<u8>, Vec<u8>) {
    let out = folder(name);
    let mut flight = Command::new(env!("CARGO_BIN_EXE_foxhunt"))
        .args(["--json", "fly", "--emulate", "pritzl-6.1", "--out"])
        .arg(&out)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program was built for this test");
    let process = flight.id().to_string();
    let signal = |signal: &str| Command::new("kill").args([signal, &process]).status();
    let running = |flight: &mut Child| flight.try_wait().expect("it can be waited for").is_none();
    let mut pauses = (100..1_500).step_by(100).map(Duration::from_millis);
    while running(&mut flight)
        && let Some(pause) = pauses.next()
    {
        thread::sleep(Duration::from_millis(200));
        signal("-STOP").expect("there is such a program");
        thread::sleep(pause);
        signal("-CONT").expect("there is such a program");
    }
    assert!(flight.wait().expect("it ends").success(), "{name}");
    recorded(&out)
}

/// The log and the samples that a flight left.
fn recorded(out: &Path) -> (Vec<u8>, Vec<u8>) {
    let read = |name: &str| fs::read(out.join(name)).expect("the flight leaves it");
    (read("fly-1.jsonl"), read("fly-1-samples.csv"))
}

/// The README's demonstration finds both beacons, and is the same flight on a busy computer.
#[test]
fn the_emulated_flight_is_the_same_under_load() {
    // Both at once, which take the processors from each other, too.
    let busy = thread::spawn(|| interrupted("fly-busy"));
    let out = folder("fly-idle");
    let path = out.to_str().expect("the target folder is UTF-8");
    let ran = foxhunt(["--json", "fly", "--emulate", "pritzl-6.1", "--out", path]);
    let (log, samples) = recorded(&out);
    let report = ran.json();
    assert!(report["failure"].is_null(), "{report}");
    let beacons = report["beacons"].as_array().expect("a list");
    assert_eq!(beacons.len(), 2);
    for beacon in beacons {
        assert_eq!(beacon["outcome"], "converged", "{beacon}");
        // χ² of two degrees of freedom: 1 in 10 000 is above 18.4.
        let nees = beacon["truth"]["nees"].as_f64().expect("a number");
        let error_m = beacon["truth"]["error_m"].as_f64().expect("a number");
        assert!(nees < 18.4 && error_m < 3.0, "{beacon}");
    }
    assert!(!ran.stderr.to_lowercase().contains("failsafe"), "{}", ran.stderr);
    // Batteries are in the log, and the pilot is told once that one is low.
    let text = String::from_utf8(log.clone()).expect("UTF-8");
    let events = text.lines().map(|line| serde_json::from_str(line).expect("JSON"));
    let of_first =
        events.filter(|of: &serde_json::Value| of["event"] == "health" && of["drone"] == 0);
    let left: Vec<f64> = of_first.filter_map(|of| of["battery"].as_f64()).collect();
    assert!(left.len() > 10 && left.is_sorted_by(|a, b| a >= b), "{left:?}");
    let warnings: Vec<&str> =
        ran.stderr.lines().filter(|of| of.contains("bring it home")).collect();
    let count = |line: &str| warnings.iter().filter(|other| **other == line).count();
    assert!(!warnings.is_empty() && warnings.iter().all(|line| count(line) == 1), "{warnings:?}");
    let (busy_log, busy_samples) = busy.join().expect("it flew");
    assert!(log == busy_log && samples == busy_samples, "load changes nothing");
}

#[test]
fn a_field_of_another_program_has_the_time_of_the_wall() {
    let config = folder("fly-speed").join("field.toml");
    let config = config.to_str().expect("the target folder is UTF-8");
    foxhunt(["emulate", "field", "--config", config, "--speed", "5"])
        .failed(2, &["--speed", "fly --emulate"]);
    foxhunt(["fly"]).failed(2, &["CONFIG"]);
    foxhunt(["fly", "x.toml", "--emulate", "pritzl-6.1"]).failed(2, &["--emulate"]);
}

/// The poses of a body at rest, as many as its rate makes, but for the time it is hidden.
#[test]
fn emulated_motion_capture_sends_poses() {
    let port = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    let to = port.local_addr().expect("bound").to_string();
    let fixed = ["--json", "emulate", "motion-capture", "--body", "bird", "--rate", "20"];
    let ran = foxhunt(fixed.iter().chain(&["--to", &to, "--for", "2", "--hide-at-s", "1"])).json();
    assert_eq!(ran[0]["device"], "motion capture");
    assert_eq!(ran[0]["endpoint"], format!("udpin:{to}"));
    port.set_nonblocking(true).expect("a socket");
    let mut datagram = [0; 4096];
    let mut poses = Vec::new();
    while let Ok(count) = port.recv(&mut datagram) {
        let pose: Value = serde_json::from_slice(&datagram[..count]).expect("a line of JSON");
        assert_eq!(pose["body"], "bird");
        poses.push(pose);
    }
    assert!((19..=21).contains(&poses.len()), "{} in a second of 20", poses.len());
    let up = |pose: &Value| pose["position_m"][2].as_f64().expect("a number");
    assert!(poses.iter().all(|pose| (up(pose) - up(&poses[0])).abs() < 0.02), "{poses:?}");
    let refused = ["emulate", "motion-capture", "--rate", "0"];
    foxhunt(refused).failed(2, &["motion_capture.rate_hz is 0"]);
}

/// The dry run says who watches what.
#[test]
fn a_dry_run_has_a_checklist() {
    let config = folder("fly-checklist").join("meadow.toml");
    let flight = r#"
        name = "meadow"
        site = { lat_deg = 50.0755, lon_deg = 14.4378 }
        beacons = [{ name = "fox", frequency_mhz = 150.1 }]
        model = { reference_dbm = -29.06, exponent = 2.765 }
        extractor = { kind = "pritzl2018" }
        planner = { kind = "follow-estimate" }
        [[drones]]
        name = "alpha"
        vehicle = { kind = "mavlink", endpoint = "udpin:127.0.0.1:0" }
        radio = { kind = "rtl-tcp", endpoint = "tcp:127.0.0.1:1" }
        source = { kind = "omnidirectional" }
    "#;
    fs::write(&config, flight).expect("a file");
    let config = config.to_str().expect("the target folder is UTF-8");
    let plan = foxhunt(["--json", "fly", config, "--dry-run"]).json();
    let checks = plan["checklist"].as_array().expect("a list");
    let of = |subject: &str| checks.iter().find(|check| check["subject"] == subject);
    let borders = of("borders").expect("nobody has set a fence");
    assert_eq!([&borders["watch"], &borders["state"]], ["pilot", "open"]);
    assert_eq!(of("failsafes").expect("an autopilot has some")["watch"], "autopilot");
    assert!(of("antenna").is_none(), "none turns");
    let text = foxhunt(["fly", config, "--dry-run"]);
    assert!(text.stdout.contains("for the pilot to look at"), "{}", text.stdout);
}

/// Every scenario of the list is planned with emulated devices, or refused before anything happens
/// with the reason and the remedy.
#[test]
fn every_listed_scenario_is_planned_or_refused() {
    let listed = foxhunt(["--json", "list", "scenarios"]).json();
    for scenario in listed.as_array().expect("a list") {
        let name = scenario["name"].as_str().expect("a name");
        let ran = foxhunt(["--json", "fly", "--emulate", name, "--dry-run"]);
        if NOT_EMULATED.contains(&name) {
            ran.failed(2, &["no emulated device", "foxhunt hunt SCENARIO"]);
            assert!(!ran.stderr.contains('{'), "{}", ran.stderr);
            continue;
        }
        let plan = ran.json();
        assert_eq!(
            plan["beacons"].as_array().map(Vec::len),
            scenario["beacons"].as_u64().map(|n| usize::try_from(n).expect("few")),
            "{plan}"
        );
        let endurance = plan["hunt"]["endurance"]["endurance_s"].as_f64();
        // The way of who walks counts as a drone's: a mixed team states more than a battery.
        let most_s = if name == "mixed-team" { 3600.0 } else { 1200.0 };
        assert!(endurance.is_some_and(|seconds| seconds <= most_s), "{plan}");
    }
}

/// Scenarios with sources that no emulated device is.
const NOT_EMULATED: [&str; 2] = ["avalanche", "tdoa"];

/// Each is flown from the ground to the ground. A search that ends as converged has an ellipse no
/// larger than the prior's σ.
#[test]
#[ignore = "takes minutes"]
fn every_listed_scenario_is_flown() {
    let listed = foxhunt(["--json", "list", "scenarios"]).json();
    let names = listed.as_array().expect("a list").iter().map(|of| of["name"].as_str());
    for name in names.map(|name| name.expect("a name")) {
        if !NOT_EMULATED.contains(&name) {
            flown(name);
        }
    }
}

/// A metre up in a room, and a drone that is lost on the way.
#[test]
fn low_flights_and_lost_drones_end_well() {
    for name in ["isaacs-static", "pritzl-7.4.1"] {
        flown(name);
    }
}

/// Flies a scenario with emulated devices.
fn flown(name: &str) {
    let out = folder(&format!("fly-{name}"));
    let path = out.to_str().expect("the target folder is UTF-8");
    let report = foxhunt(["--json", "fly", "--emulate", name, "--out", path]).json();
    assert!(report["failure"].is_null(), "{name}: {report}");
    for beacon in report["beacons"].as_array().expect("a list") {
        let axis_m = beacon["ellipse_95"]["semi_major"].as_f64().unwrap_or(f64::INFINITY);
        let converged = beacon["outcome"] == "converged";
        assert!(!converged || axis_m < 50.0, "{name}: {beacon}");
    }
}
