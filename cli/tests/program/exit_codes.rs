use std::fs;

use crate::support::{folder, foxhunt, scenario};

#[test]
fn unknown_names_list_the_known_ones() {
    foxhunt(["hunt", "--estimator", "psychic"])
        .failed(2, &["psychic", "--estimator", "ukf-pritzl2018", "particle"]);
    foxhunt(["campaign", "--runs", "2", "--estimator", "psychic"]).failed(2, &["range-difference"]);
    foxhunt(["hunt", "nowhere"]).failed(2, &["nowhere", "pritzl-6.1"]);
    foxhunt(["campaign", "nowhere", "--runs", "2"]).failed(2, &["nowhere", "pritzl-6.1"]);
}

#[test]
fn values_out_of_range_are_wrong_use() {
    foxhunt(["campaign", "--runs", "0"]).failed(2, &["--runs", "0"]);
    foxhunt(["campaign", "--runs", "2", "--jobs", "0"]).failed(2, &["--jobs", "0"]);
    foxhunt(["hunt", "--seed", "-1"]).failed(2, &["-1"]);
    foxhunt(["locate", "x.csv", "--truth", "north"]).failed(2, &["--truth", "north"]);
    foxhunt(["locate", "x.csv", "--p0-dbm", "-30"]).failed(2, &["--exponent"]);
    foxhunt(["locate", "x.csv", "--p0-dbm", "loud"]).failed(2, &["--p0-dbm", "loud", "free"]);
    foxhunt(["locate", "x.csv", "--margin-m", "0"]).failed(2, &["--margin-m"]);
    foxhunt(["calibrate", "x.csv", "--max-exponent", "-3"]).failed(2, &["--max-exponent", "-3"]);
    foxhunt(["antenna", "yagi", "--bearing-deg", "10"]).failed(2, &["--bearing-deg", "FILE|NAME"]);
    foxhunt(["locate", "x.csv", "--reference-m", "1,2"]).failed(2, &["--reference-m", "E,N,U"]);
}

#[test]
fn a_node_names_what_is_missing() {
    let drone = ["node", "drone", "--drone", "0"];
    let with = |more: &[&'static str]| [&drone[..], more].concat();
    foxhunt(with(&["--simulate", "pritzl-6.1", "--over", "mqtt"])).failed(2, &["--key <FILE>"]);
    let missing = ["--simulate", "pritzl-6.1", "--over", "mqtt", "--key", "none.key"];
    foxhunt(with(&missing)).failed(2, &["none.key"]);
    foxhunt(with(&["none.toml", "--over", "mqtt", "--unsigned"])).failed(2, &["none.toml"]);
    let port = ["--simulate", "pritzl-6.1", "--over", "mqtt", "--unsigned", "--broker", "h:x"];
    foxhunt(with(&port)).failed(2, &["\"x\" is not a port"]);
}

#[test]
fn commands_of_earlier_versions_name_the_new_ones() {
    for (args, command) in [
        (&["scenarios"][..], "foxhunt list scenarios"),
        (&["estimators"], "foxhunt list estimators"),
        (&["campaign", "planners", "--runs", "1"], "foxhunt compare planners"),
        (&["campaign", "antennas", "--runs", "1"], "foxhunt compare antennas"),
        (&["campaign", "fleets", "--runs", "1"], "foxhunt fleets"),
        (&["campaign", "bot-m", "--runs", "1"], "foxhunt compare estimators bot-m"),
        (&["campaign", "bearing-65", "--runs", "1"], "foxhunt compare extractors bearing-65"),
    ] {
        foxhunt(args).failed(2, &[command]);
    }
}

#[test]
fn missing_files_are_named() {
    for subcommand in ["replay", "calibrate", "locate", "bearing"] {
        foxhunt([subcommand, "not-there.csv"]).failed(2, &["not-there.csv", "No such file"]);
    }
}

#[test]
fn a_scenario_file_is_refused_with_line_field_and_value() {
    let folder = folder("bad_scenarios");
    let cases = [
        ("east_m = 12.0", "east_m = \"far\"", &["line 7", "east_m", "far"][..]),
        ("east_m = 12.0", "eats_m = 12.0", &["line 7", "eats_m"]),
        ("kind = \"hold\"", "kind = \"dance\"", &["dance"]),
        ("ekf-pritzl2018", "psychic", &["estimator", "psychic", "particle"]),
        ("exponent = 2.765\n\n[ext", "exponent = -2.0\n\n[ext", &["exponent", "-2"]),
        ("sample_sigma_db = 1.0", "sample_sigma_db = -1.0", &["sample_sigma_db", "-1"]),
        ("[planner]", "[hunt]\nprior_sigma_m = 0.0\n[planner]", &["prior_sigma_m", "0"]),
        ("[planner]", "[simulation]\ntick_s = 0.0\n[planner]", &["tick_s", "0"]),
    ];
    for (index, (from, to, texts)) in cases.into_iter().enumerate() {
        let text = scenario().replacen(from, to, 1);
        assert_ne!(text, scenario(), "{from}");
        let name = format!("bad{index}.toml");
        let file = folder.join(&name);
        fs::write(&file, text).expect("the folder can be written to");
        let ran = foxhunt([
            "hunt",
            file.to_str().expect("UTF-8"),
            "--out",
            folder.to_str().expect("UTF-8"),
        ]);
        ran.failed(2, texts);
        ran.failed(2, &[&name]);
    }
}

#[test]
fn what_cannot_be_written_is_a_failure() {
    let folder = folder("no_folder");
    let file = folder.join("a-file");
    fs::write(&file, "").expect("the folder can be written to");
    let ran = foxhunt(["hunt", "--out", file.to_str().expect("UTF-8")]);
    ran.failed(1, &["a-file", "cannot be written"]);
}

#[test]
fn a_hunt_that_takes_too_long_is_a_failure() {
    let folder = folder("too_long");
    let file = folder.join("short.toml");
    let text = scenario().replacen("[planner]", "[simulation]\nlimit_s = 5.0\n[planner]", 1);
    fs::write(&file, text).expect("the folder can be written to");
    let ran =
        foxhunt(["hunt", file.to_str().expect("UTF-8"), "--out", folder.to_str().expect("UTF-8")]);
    ran.failed(1, &["5", "limit_s"]);
}
