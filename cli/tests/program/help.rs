use crate::support::foxhunt;

const SUBCOMMANDS: [&str; 14] = [
    "hunt",
    "campaign",
    "compare",
    "fleets",
    "list",
    "replay",
    "calibrate",
    "locate",
    "bearing",
    "antenna",
    "fly",
    "devices",
    "emulate",
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
    for args in [
        &[][..],
        &["fly"],
        &["hunt", "--wings"],
        &["locate"],
        &["campaign"],
        &["compare", "estimators", "--runs", "1"],
        &["fleets"],
        &["list"],
    ] {
        let ran = foxhunt(args);
        assert_eq!(ran.code, 2, "{args:?}: {ran:?}");
        assert!(ran.stdout.is_empty() && ran.stderr.contains("Usage"), "{ran:?}");
    }
}

#[test]
fn arguments_name_the_registry() {
    let hunt = foxhunt(["hunt", "--help"]).stdout;
    for name in ["range-difference:", "maximum-likelihood-reflection", "steepest-descent"] {
        assert!(hunt.contains(name), "{name} is missing in {hunt}");
    }
    // The menu, with when to use which.
    let flat = hunt.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(flat.contains("- ukf-pritzl2018: the reference system's filter, to compare"), "{flat}");
    assert!(flat.contains("`foxhunt list estimators --all` has more"), "{flat}");
    assert!(!hunt.contains("ekf-iterated"), "it is not in the menu");
    assert!(!hunt.contains("shadowing-grid"), "it takes all receptions at once");
    let locate = foxhunt(["locate", "--help"]).stdout;
    assert!(locate.contains("- shadowing-grid:") && !locate.contains("lenth1981"), "{locate}");
}

#[test]
fn commands_are_shown_in_groups() {
    for flag in ["-h", "--help"] {
        let help = foxhunt([flag]).stdout;
        let headings = help.lines().filter(|line| line.ends_with(':') && !line.starts_with(' '));
        let headings: Vec<&str> = headings.collect();
        let groups = ["Simulate:", "Recordings:", "Fly:", "Study:", "Tools:", "Options:"];
        assert_eq!(headings, groups, "{help}");
        assert!(help.contains("\n  hunt         Fly one simulated hunt\n"), "{help}");
        assert!(help.contains("--version") && help.contains("Example: fly"), "{help}");
    }
}
