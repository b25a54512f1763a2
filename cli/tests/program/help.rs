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
    for name in ["range-difference-bearing", "maximum-likelihood-reflection", "steepest-descent"] {
        assert!(hunt.contains(name), "{name} is missing in {hunt}");
    }
    assert!(!hunt.contains("lenth1981"), "it takes all receptions at once");
    assert!(foxhunt(["locate", "--help"]).stdout.contains("lenth1981"));
}
