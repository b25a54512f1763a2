//! Figures.

use std::{fs, path::Path};

use crate::support::{Ran, folder, foxhunt, scenario};

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// Draws a figure and returns its text.
fn drawn(args: &[&str], out: &Path) -> String {
    let ran = foxhunt([&["plot"], args, &["--out", text(out)]].concat());
    assert_eq!(ran.code, 0, "{args:?}: {ran:?}");
    let svg = fs::read_to_string(out).expect("a figure");
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    assert!(!svg.contains("NaN") && !svg.contains(">inf"), "{args:?}");
    svg
}

#[test]
fn logs_are_drawn_over_their_steps() {
    let folder = folder("plot_logs");
    let out = folder.join("figure.svg");
    let file = folder.join("small.toml");
    fs::write(&file, scenario()).expect("a file");
    let fly = |seed: &str| {
        let to = folder.join(seed);
        let args =
            ["hunt", text(&file), "--estimator", "particle", "--seed", seed, "--out", text(&to)];
        let ran = foxhunt(args);
        assert_eq!(ran.code, 0, "{ran:?}");
        to.join("hunt.jsonl")
    };
    let one = fly("1");
    let two = fly("2");
    let trajectory = drawn(&["trajectory", text(&one)], &out);
    let picture = fs::read_to_string(folder.join("1/hunt.svg")).expect("it was written");
    assert_eq!(trajectory, picture, "one room of figures");
    let error = drawn(&["error", text(&one), text(&two)], &out);
    for name in ["fox, seed 1", "fox, seed 2", "error in metres", "small · particle"] {
        assert!(error.contains(name), "{name} in {error}");
    }
    let other = drawn(&["error", text(&one), "--estimator", "ekf", "--title", "mine"], &out);
    assert!(other.contains("mine") && !other.contains("particle"));
    assert!(drawn(&["axes", text(&one)], &out).contains("semi-axes"));
    let nees = drawn(&["nees", text(&one), text(&two)], &out);
    assert!(nees.contains("average of 2 runs") && nees.contains("χ², 95 %"));
    let machine = drawn(&["phases"], &out);
    for text in ["Phases of a search", "forming up", "measuring, finishing", "a target begins"] {
        assert!(machine.contains(text), "{text} in {machine}");
    }
    let taken = drawn(&["phases", text(&one)], &out);
    assert!(taken.contains("Phases of small") && taken.contains("a target begins (1)"), "{taken}");
    let cloud = drawn(&["cloud", text(&one)], &out);
    assert!(cloud.contains("after 0 receptions") && cloud.matches("<circle").count() > 1000);
    let measured = drawn(&["rssi", text(&one)], &out);
    assert!(measured.contains("8 levels") && measured.contains("γ"), "{measured}");
    assert!(drawn(&["bearing-errors", text(&one), text(&two)], &out).contains("16 bearings"));

    let plot =
        |args: &[&str]| -> Ran { foxhunt([&["plot"], args, &["--out", text(&out)]].concat()) };
    plot(&["error", text(&one), "--beacon", "owl"]).failed(2, &["owl", "fox"]);
    plot(&["rssi", text(&one), "--truth", "1,2"]).failed(2, &["--truth"]);
    plot(&["trajectory", text(&one), "--beacon", "fox"]).failed(2, &["--beacon"]);
    foxhunt(["plot", "error", text(&one), "--out", "figure.pdf"]).failed(2, &[".svg or .png"]);
    let lost = foxhunt(["plot", "error", text(&one), "--out", "/no/such/figure.svg"]);
    lost.failed(1, &["/no/such/figure.svg", "cannot be written"]);
}

#[test]
fn the_pictures_of_the_documents_are_what_the_program_draws() {
    let folder = folder("plot_documents");
    let args = ["hunt", "pritzl-6.1", "--seed", "3", "--estimator", "ukf-pritzl2018", "--out"];
    assert_eq!(foxhunt(args.iter().chain(&[text(&folder)])).code, 0);
    let log = folder.join("hunt.jsonl");
    for kind in ["trajectory", "error", "axes"] {
        let svg = drawn(&[kind, text(&log)], &folder.join("figure.svg"));
        let kept = format!("{}/../docs/figures/{kind}.svg", env!("CARGO_MANIFEST_DIR"));
        let kept = fs::read_to_string(kept).expect("a picture of the documents");
        assert!(svg == kept, "{kind}: .ci/figures draws it again");
    }
}

#[test]
fn recordings_are_drawn() {
    let folder = folder("plot_recordings");
    let out = folder.join("figure.svg");
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../archive/tests/data");
    let turns = data.join("foxhunt/turns.csv");
    let pattern = drawn(&["pattern", text(&turns), "--turn", "2"], &out);
    assert!(pattern.contains("turn 2 of") && pattern.contains("<circle"), "{pattern}");
    let fitted = ["pattern", text(&turns), "--extractor", "cross-correlation"];
    let fitted = drawn(&fitted, &out);
    let lines = |svg: &str| svg.matches("<polyline").count();
    assert!(lines(&fitted) > lines(&pattern) + 50, "the known antenna is dashed");
    let none = foxhunt(["plot", "pattern", text(&turns), "--turn", "99", "--out", text(&out)]);
    none.failed(2, &["--turn 99", "turns 1 to"]);
    // The same turns, received 6 m up on the way to a beacon in the East.
    let text_of = fs::read_to_string(&turns).expect("a file");
    let mut lines = text_of.lines();
    let header = lines.next().expect("a header");
    let rows = lines.map(|row| format!("{row},100,0\n"));
    let known: String =
        [format!("{header},truth_east_m,truth_north_m\n")].into_iter().chain(rows).collect();
    let known_turns = folder.join("known.csv");
    fs::write(&known_turns, known).expect("written");
    let over_angle = drawn(&["pattern", text(&known_turns), "--over-angle"], &out);
    for curve in ["samples", "moving mean", "2 dB below its top", "detected, ", "true, 0.0°"] {
        assert!(over_angle.contains(curve), "{curve}: {over_angle}");
    }
    let levels = drawn(&["levels", text(&turns)], &out);
    assert!(levels.matches("<circle").count() >= 96, "{levels}");
    let bare = folder.join("bare.csv");
    fs::write(&bare, "east_m,north_m,bearing_deg_compass\n0,0,10\n").expect("written");
    let none = foxhunt(["plot", "levels", text(&bare), "--out", text(&out)]);
    none.failed(2, &["bare.csv: no row has a time and a level"]);
    let errors = drawn(&["bearing-errors", text(&data.join("otter-telemetry/bearings.csv"))], &out);
    assert!(errors.contains("outliers") && errors.contains("Isaacs"), "{errors}");
}

#[test]
fn comparisons_are_drawn() {
    let folder = folder("plot_comparisons");
    let out = folder.join("figure.svg");
    let file = folder.join("small.toml");
    fs::write(&file, scenario()).expect("a file");
    let args = ["--json", "compare", "planners", text(&file), "--runs", "4"];
    let compared = foxhunt(args.iter().chain(&["--planner", "orbit", "--planner", "hold"]));
    let json = folder.join("planners.json");
    fs::write(&json, &compared.stdout).expect("a file");
    let svg = drawn(&["planners", text(&json)], &out);
    for name in ["orbit", "hold", "over pritzl2018", "steps to 3 m"] {
        assert!(svg.contains(name), "{name} in {svg}");
    }
    fs::write(&json, "[]").expect("a file");
    foxhunt(["plot", "planners", text(&json), "--out", text(&out)]).failed(2, &["planners.json"]);
    fs::write(&json, "{").expect("a file");
    foxhunt(["plot", "planners", text(&json), "--out", text(&out)])
        .failed(2, &["planners.json", "line 1"]);

    let store = folder.join("runs.sqlite");
    let args = ["campaign", text(&file), "--runs", "5", "--store", text(&store)];
    assert_eq!(foxhunt(args).code, 0);
    let svg = drawn(&["distributions", text(&store)], &out);
    assert!(svg.contains("5 runs"), "{svg}");
}
