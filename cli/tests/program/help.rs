use crate::support::foxhunt;

const SUBCOMMANDS: [&str; 12] = [
    "hunt",
    "campaign",
    "scenarios",
    "estimators",
    "extractors",
    "planners",
    "replay",
    "calibrate",
    "locate",
    "bearing",
    "antenna",
    "node",
];

#[test]
fn every_subcommand_explains_itself() {
    let all = foxhunt(["--help"]);
    assert_eq!(all.code, 0);
    for subcommand in SUBCOMMANDS {
        assert!(all.stdout.contains(subcommand), "{subcommand} is not listed");
        let help = foxhunt([subcommand, "--help"]);
        assert_eq!(help.code, 0, "{help:?}");
        assert!(help.stdout.contains("Example"), "{subcommand} has no example");
        assert!(help.stdout.contains(&format!("foxhunt {subcommand}")), "{subcommand}");
        assert!(help.stdout.contains("--json"), "{subcommand}");
        let paragraph = help.stdout.lines().nth(2).unwrap_or_default();
        assert!(paragraph.len() > 40, "{subcommand} is not described: {}", help.stdout);
    }
}

#[test]
fn wrong_use_is_code_2() {
    for args in [&[][..], &["fly"], &["hunt", "--wings"], &["locate"], &["campaign"]] {
        let ran = foxhunt(args);
        assert_eq!(ran.code, 2, "{args:?}: {ran:?}");
        assert!(ran.stdout.is_empty() && ran.stderr.contains("Usage"), "{ran:?}");
    }
}

#[test]
fn lists_are_tables_or_json() {
    let table = foxhunt(["estimators"]);
    assert!(table.code == 0 && table.stdout.contains("ukf-pritzl2018"), "{table:?}");
    let listed = foxhunt(["estimators", "--json"]).json();
    let first = &listed.as_array().expect("a list")[0];
    crate::support::has(first, &["name", "about", "source", "locate_only"]);
    for name in ["shadowing-grid", "lenth1981", "lenth1981-andrews", "field-map", "batch"] {
        let own = |e: &&serde_json::Value| e["name"] == name && e["locate_only"] == true;
        assert!(listed.as_array().expect("a list").iter().any(|e| own(&e)), "{name}");
        // A cell is broken where it is too narrow.
        assert!(table.stdout.contains(name), "{name} is missing in {}", table.stdout);
    }
    assert!(table.stdout.contains("(locate"), "{}", table.stdout);

    let listed = foxhunt(["--json", "scenarios"]).json();
    let listed = listed.as_array().expect("a list");
    let default: Vec<_> = listed.iter().filter(|s| s["default"] == true).collect();
    assert_eq!(default.len(), 1);
    assert_eq!(default[0]["name"], "pritzl-6.1");
    assert!(foxhunt(["scenarios"]).stdout.contains("pritzl-6.1"));
}
