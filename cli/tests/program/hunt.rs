use approx::abs_diff_eq;
use std::fs;

use crate::support::{folder, foxhunt, has, scenario};

#[test]
fn a_hunt_leaves_json_a_log_and_a_picture() {
    // Two folders deep: it is made where it is missing.
    let out = folder("hunt").join("a/b");
    let out = out.to_str().expect("the target folder is UTF-8");
    let first = foxhunt(["hunt", "--json", "--seed", "3", "--out", out]);
    let report = first.json();
    has(&report, &["seed", "estimator", "beacons"]);
    assert_eq!(report["seed"], 3);
    assert_eq!(report["estimator"], "default");
    let beacons = report["beacons"].as_array().expect("a list");
    assert_eq!(beacons.len(), 2);
    for beacon in beacons {
        has(
            beacon,
            &[
                "name",
                "truth",
                "estimate",
                "error_m",
                "nees",
                "steps",
                "steps_to_3m",
                "time_to_3m_s",
                "path_m",
                "formation_positions",
                "outcome",
            ],
        );
        has(&beacon["truth"], &["east_m", "north_m"]);
        has(&beacon["estimate"], &["east_m", "north_m", "covariance_m2"]);
        assert!(beacon["estimate"]["covariance_m2"][1][1].as_f64().expect("a number") > 0.0);
        assert!(beacon["error_m"].as_f64().expect("a number") < 30.0);
        assert!(beacon["path_m"].as_f64().expect("a number") > 10.0);
        assert!(beacon["steps_to_3m"].as_u64() <= beacon["steps"].as_u64());
    }
    assert!(first.stderr.contains("looking for beacon 2"), "progress: {}", first.stderr);

    let svg = fs::read_to_string(format!("{out}/hunt.svg")).expect("a picture");
    assert!(svg.starts_with("<svg") && svg.contains("pritzl-6.1"));
    let page = fs::read_to_string(format!("{out}/report.html")).expect("a page");
    let (_, data) = page.split_once(r#"id="data">"#).expect("data");
    let (data, _) = data.split_once("</script>").expect("their end");
    let data: serde_json::Value = serde_json::from_str(data).expect("JSON");
    let log = fs::read_to_string(format!("{out}/hunt.jsonl")).expect("a log");
    let received = data["received"].as_array().expect("a list");
    assert_eq!(received.len(), log.matches(r#""event":"received""#).count());
    assert!(received.iter().all(|one| one["turn"]["samples"].is_object()), "all turns were kept");
    for (search, beacon) in data["searches"].as_array().expect("a list").iter().zip(beacons) {
        let last = search["beliefs"].as_array().and_then(|all| all.last()).expect("a belief");
        for (index, name) in ["east_m", "north_m"].into_iter().enumerate() {
            let shown = last["place"][index].as_f64().expect("a number");
            let found = beacon["estimate"][name].as_f64().expect("a number");
            // Rounded to millimetres.
            assert!(abs_diff_eq!(shown, found, epsilon = 0.000_51), "{name}: {shown}, not {found}");
        }
    }
    assert!(log.lines().count() > 100);
    assert!(log.lines().all(|line| serde_json::from_str::<serde_json::Value>(line).is_ok()));

    let again = foxhunt(["--json", "hunt", "pritzl-6.1", "--seed", "3", "--out", out]);
    assert_eq!(again.stdout, first.stdout, "the same seed");
    assert_eq!(fs::read_to_string(format!("{out}/hunt.jsonl")).expect("a log"), log);
    let other = foxhunt(["--json", "hunt", "--seed", "4", "--out", out]).json();
    assert_ne!(other["beacons"][0]["error_m"], beacons[0]["error_m"], "another seed");
}

#[test]
fn a_hunt_from_a_file_ends_with_a_table() {
    let folder = folder("hunt_file");
    let file = folder.join("small.toml");
    fs::write(&file, scenario()).expect("the folder can be written to");
    let file = file.to_str().expect("UTF-8");
    let out = folder.to_str().expect("UTF-8");
    let ran = foxhunt(["hunt", file, "--out", out, "--estimator", "particle"]);
    assert_eq!(ran.code, 0, "{ran:?}");
    for text in ["particle, seed 1", "fox", "NEES", "hunt.jsonl", "hunt.svg"] {
        assert!(ran.stdout.contains(text), "{text} is missing in {}", ran.stdout);
    }
    assert!(!ran.stdout.contains("NaN"));
    let own = foxhunt(["hunt", file, "--out", out, "--json"]).json();
    assert_eq!(own["estimator"], "ekf-pritzl2018", "the scenario's own");
}

#[test]
fn a_hunt_flies_with_the_planner_that_is_given() {
    let out = folder("planner");
    let hunt = |more: &[&str]| {
        let args = ["hunt", "--json", "--estimator", "ekf-pritzl2018", "--out"];
        let out = out.to_str().expect("a name");
        foxhunt(args.into_iter().chain([out]).chain(more.iter().copied())).json()
    };
    let held = hunt(&["--planner", "hold"]);
    assert_eq!(held["beacons"][0]["outcome"], "move_limit");
    assert_eq!(hunt(&["--planner", "waypoints"])["beacons"][0]["outcome"], "path_done");
    assert_eq!(held["planner"], "hold");
    // What pritzl-6.1 flies with is the reference's planner.
    let own = hunt(&[]);
    let named = hunt(&["--planner", "pritzl2018"]);
    assert_eq!(own["beacons"], named["beacons"]);
    assert_eq!(
        (&own["planner"], &named["planner"]),
        (&"scenario's own".into(), &"pritzl2018".into())
    );
}

#[test]
fn a_hunt_flies_with_the_extractor_that_is_given() {
    let dir = std::env::temp_dir().join(format!("foxhunt-extractor-{}", std::process::id()));
    let out = dir.to_str().expect("a name");
    let hunt = |extractor: &str| {
        let estimator = ["--estimator", "ekf-pritzl2018"];
        let args = ["hunt", "--json", "--extractor", extractor, "--out", out];
        let ran = foxhunt(args.into_iter().chain(estimator));
        assert_eq!(ran.code, 0, "{ran:?}");
        ran.stdout
    };
    assert_ne!(hunt("pritzl2018"), hunt("maximum"));
    std::fs::remove_dir_all(&dir).expect("it is there");
}

#[test]
fn a_hunt_for_several_transmitters_lists_each() {
    let out = folder("several");
    let out = out.to_str().expect("a name");
    let hunt = ["hunt", "two-transmitters", "--seed", "1", "--out", out];
    let report = foxhunt(hunt.into_iter().chain(["--json"])).json();
    let transmitters = &report["beacons"][0]["transmitters"];
    let found = transmitters["found"].as_array().expect("a list");
    assert_eq!((found.len(), transmitters["truths"].as_array().expect("a list").len()), (2, 2));
    for of in found {
        has(of, &["existence", "estimate", "ellipse_95"]);
    }
    assert!(transmitters["gospa_m"].as_f64().is_some_and(|gospa| gospa < 10.0), "{transmitters}");
    let shown = foxhunt(hunt).stdout;
    for text in ["fox 1", "fox 2", "existence", "True number: 2; GOSPA: "] {
        assert!(shown.contains(text), "{text} is missing in {shown}");
    }
    // The log has them, too, and its receptions give the same again.
    let log = fs::read_to_string(format!("{out}/hunt.jsonl")).expect("it was written");
    assert!(log.contains(r#""transmitters":[{"existence":"#));
    let page = fs::read_to_string(format!("{out}/report.html")).expect("it was written");
    assert!(page.contains("fox 2"), "the page shows each");
    let shown = foxhunt(["replay", &format!("{out}/hunt.jsonl")]).stdout;
    assert!(shown.contains("fox 2"), "{shown}");
    let again = foxhunt(["replay", "--json", &format!("{out}/hunt.jsonl")]).json();
    assert_eq!(again["beacons"][0]["transmitters"], transmitters["found"]);
    assert_eq!(again["beacons"][0]["error_m"], report["beacons"][0]["error_m"]);
    let one = foxhunt(["hunt", "--json", "--out", out]).json();
    assert!(one["beacons"][0].get("transmitters").is_none(), "an estimator of one");
    let campaign = ["campaign", "two-transmitters", "--runs", "3"];
    let figures = foxhunt(campaign.into_iter().chain(["--json"])).json();
    let figures = &figures["estimators"][0]["beacons"][0]["transmitters"];
    has(figures, &["gospa_m", "right", "missed", "invented"]);
    let table = foxhunt(campaign).stdout;
    assert!(table.contains("all found, none") && table.contains("invented"), "{table}");
}

#[test]
fn what_a_hunt_cannot_fly_with_is_refused() {
    foxhunt(["hunt", "--extractor", "magic"]).failed(2, &["magic", "main-lobe"]);
    foxhunt(["hunt", "--antenna", "dipole"]).failed(2, &["--antenna"]);
    foxhunt(["hunt", "vhf-tag", "--estimator", "several"])
        .failed(2, &["maximum-likelihood-several"]);
    foxhunt(["hunt", "--estimator", "lenth1981"]).failed(2, &["all receptions", "foxhunt locate"]);
    foxhunt(["bearing", "x.csv", "--all", "--extractor", "maximum"]).failed(2, &["--all"]);
}

#[test]
fn a_hunt_is_exported_by_the_endings_of_files() {
    let folder = folder("hunt_exports");
    let out = folder.to_str().expect("the target folder is UTF-8");
    let file = |ending: &str| format!("{out}/hunt.{ending}");
    let mut args = vec!["hunt".to_owned(), "--out".to_owned(), out.to_owned()];
    for ending in ["geojson", "kml", "gpx", "csv", "cot", "mcap"] {
        args.extend(["--export".to_owned(), file(ending)]);
    }
    let nowhere = foxhunt(&args);
    nowhere.failed(2, &["hunt.geojson", "--origin"]);
    assert!(!folder.join("hunt.jsonl").exists(), "it is refused before it is flown");
    let place = ["--origin", "50.0755,14.4378"].map(str::to_owned);
    foxhunt(args.iter().chain(&place)).failed(2, &["hunt.cot", "--start-utc"]);
    let within = folder.join("a-file");
    fs::write(&within, "").expect("a file");
    let within = within.to_str().expect("UTF-8");
    foxhunt(["hunt", "--out", within]).failed(1, &["a-file", "cannot be written"]);
    let lost = format!("{out}/no/such/hunt.csv");
    foxhunt(["hunt", "--out", out, "--export", &lost]).failed(1, &[&lost, "cannot be written"]);
    assert!(!folder.join("hunt.jsonl").exists(), "it is refused before it is flown");
    args.extend(place);
    args.extend(["--start-utc", "2026-05-01T09:30:00"].map(str::to_owned));
    let ran = foxhunt(&args);
    assert_eq!(ran.code, 0, "{ran:?}");
    for (ending, within) in [
        ("geojson", "ellipse-95"),
        ("kml", "<Placemark>"),
        ("gpx", "<wpt"),
        ("csv", "reception,drone 1"),
        ("cot", "u-rb-a"),
    ] {
        let text = fs::read_to_string(file(ending)).expect("an export");
        assert!(text.contains(within), "{ending}: {text}");
    }
    assert!(fs::read(file("mcap")).expect("an export").starts_with(b"\x89MCAP"));
    let args = ["hunt", "--out", out, "--export", "hunt.shp"];
    foxhunt(args).failed(2, &["\"shp\""]);
}
