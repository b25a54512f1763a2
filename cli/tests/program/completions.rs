//! Completions of shells, and manual pages.

use std::{fs, process::Command};

use crate::support::{folder, foxhunt};

/// Completions of the last of these words by bash, with the program's script.
fn completed(script: &str, words: &[&str]) -> Vec<String> {
    let last = words.len() - 1;
    let call = format!(
        "set -eu; source {script}; complete -p foxhunt >/dev/null; COMP_WORDS=({}); \
         COMP_CWORD={last}; _foxhunt foxhunt \"{}\" \"{}\"; printf '%s\\n' \"${{COMPREPLY[@]}}\"",
        words.join(" "),
        words[last],
        words[last - 1],
    );
    let ran = Command::new("bash").args(["--norc", "-c", &call]).output().expect("there is a bash");
    assert!(ran.status.success() && ran.stderr.is_empty(), "{words:?}: {ran:?}");
    String::from_utf8(ran.stdout).expect("UTF-8").lines().map(str::to_owned).collect()
}

#[test]
fn bash_completes_commands_flags_and_names() {
    let folder = folder("completions");
    let script = folder.join("foxhunt.bash");
    let bash = foxhunt(["completions", "bash"]);
    assert_eq!(bash.code, 0, "{bash:?}");
    fs::write(&script, bash.stdout).expect("a file");
    let script = script.to_str().expect("UTF-8");
    assert_eq!(completed(script, &["foxhunt", "cam"]), ["campaign"]);
    assert_eq!(completed(script, &["foxhunt", "hunt", "--plan"]), ["--planner"]);
    let planners = completed(script, &["foxhunt", "hunt", "--planner", "inf"]);
    assert_eq!(planners, ["information"]);
    let estimators = completed(script, &["foxhunt", "locate", "--estimator", "shadow"]);
    assert_eq!(estimators, ["shadowing-grid"]);
    // Those that help texts leave out are completed all the same.
    let estimators = completed(script, &["foxhunt", "hunt", "--estimator", "ekf-it"]);
    assert_eq!(estimators, ["ekf-iterated"]);
}

#[test]
fn every_shell_has_a_script() {
    for (shell, text) in [
        ("zsh", "#compdef foxhunt"),
        ("fish", "complete -c foxhunt"),
        ("powershell", "Register-ArgumentCompleter"),
        ("elvish", "edit:completion:arg-completer[foxhunt]"),
    ] {
        let ran = foxhunt(["completions", shell]);
        assert!(ran.code == 0 && ran.stdout.contains(text), "{shell}: {}", ran.stdout);
    }
    foxhunt(["completions", "csh"]).failed(2, &["csh", "zsh"]);
    let json = foxhunt(["--json", "completions", "fish"]).json();
    assert!(json.as_str().is_some_and(|script| script.contains("campaign")));
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = folder("man");
    let path = folder.to_str().expect("UTF-8");
    let pages = foxhunt(["--json", "man", path]).json();
    let pages = pages.as_array().expect("a list");
    assert!(pages.len() > 30, "{pages:?}");
    let read = |name: &str| fs::read_to_string(folder.join(name)).expect("a page");
    assert!(read("foxhunt.1").contains("foxhunt\\-hunt(1)"), "{}", read("foxhunt.1"));
    let main = read("foxhunt.1");
    let at = |page: &str| main.find(&format!("foxhunt\\-{page}(1)")).expect("a command");
    assert!(at("hunt") < at("locate") && at("judge") < at("list"), "in the order of the help");
    let hunt = read("foxhunt-hunt.1");
    assert!(hunt.contains("imm: levels and bearings of a beacon that stands"), "{hunt}");
    let compare = read("foxhunt-compare-planners.1");
    assert!(compare.starts_with(".ie") && compare.contains("\\-\\-markdown"), "{compare}");
    // Where there is a manual reader it has nothing to warn of.
    for page in pages {
        let page = page.as_str().expect("a path");
        let read = Command::new("groff")
            .args(["-k", "-Kutf8", "-man", "-Tutf8", "-ww", "-z", page])
            .output();
        if let Ok(read) = read {
            assert!(read.status.success() && read.stderr.is_empty(), "{page}: {read:?}");
        }
    }
}
