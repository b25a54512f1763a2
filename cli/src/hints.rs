//! Hints on names that a build lacks, on wrong names and on commands of other versions.

use clap::{
    Error,
    builder::StyledStr,
    error::{ContextKind, ContextValue, ErrorKind},
};
use foxhunt::registry::Registry;

/// Names that the registry has only with a feature.
const NAMES: [(&str, &[&str]); 2] = [
    ("maps", &["field-map", "bayesian-optimisation"]),
    (
        "batch",
        &[
            "batch",
            "batch-robust",
            "batch-multistart",
            "lenth1981",
            "lenth1981-huber",
            "lenth1981-andrews",
            "repeated-median",
            "pseudolinear",
            "stansfield",
            "instrumental-variables",
            "multilateration",
            "range-differences",
        ],
    ),
];

/// Subcommands of earlier versions and their present commands.
const RETIRED: [(&str, &str); 4] = [
    ("scenarios", "`foxhunt list scenarios`, or for trials `foxhunt list trials`"),
    ("estimators", "`foxhunt list estimators`"),
    ("extractors", "`foxhunt list extractors`"),
    ("planners", "`foxhunt list planners`"),
];

/// The feature that a build needs for an estimator or a planner of this name.
pub fn feature_of(name: &str) -> Option<&'static str> {
    NAMES.iter().find(|(_, names)| names.contains(&name)).map(|(feature, _)| *feature)
}

/// Returns the present command for a name that `campaign` took besides scenarios in earlier
/// versions.
pub fn retired_campaign(name: &str) -> Option<String> {
    match name {
        "antennas" | "planners" => Some(format!("foxhunt compare {name}")),
        "fleets" => Some("foxhunt fleets".to_owned()),
        case if foxhunt::bearing_trial::bearing_case_named(case).is_some() => {
            Some(format!("foxhunt compare extractors {case}"))
        }
        name => {
            let is_trial = foxhunt::trial::Trial::find(name).is_ok_and(|trial| trial.is_some());
            is_trial.then(|| format!("foxhunt compare estimators {name}"))
        }
    }
}

/// Adds a hint to an error of the command line, if there is one.
pub fn with_hint(mut error: Error, registry: &Registry) -> Error {
    if let Some(hint) = hint(&error, registry) {
        let hints = ContextValue::StyledStrs(vec![StyledStr::from(hint)]);
        error.insert(ContextKind::Suggested, hints);
    }
    error
}

fn hint(error: &Error, registry: &Registry) -> Option<String> {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    match error.kind() {
        ErrorKind::InvalidSubcommand => {
            let word = text(ContextKind::InvalidSubcommand)?;
            let (_, now) = RETIRED.iter().find(|(retired, _)| *retired == word)?;
            Some(format!("it is now {now}"))
        }
        ErrorKind::InvalidValue => {
            let name = text(ContextKind::InvalidValue)?;
            let argument = text(ContextKind::InvalidArg)?;
            let known = argument
                .starts_with("--estimator")
                .then(|| registry.estimator(name).ok())
                .flatten();
            if known.is_some() {
                return Some(format!("{name} takes all receptions at once: `foxhunt locate`"));
            }
            let feature = feature_of(name)?;
            Some(format!("{name} needs a build with the feature {feature}: {}", build(feature)))
        }
        _ => None,
    }
}

/// Returns the command that installs the program with a feature.
pub fn build(feature: &str) -> String {
    format!("`cargo install foxhunt-cli --features {feature}`")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(feature = "maps")]
    fn the_names_are_those_that_the_features_bring() {
        let registry = Registry::builtin();
        for name in NAMES.iter().flat_map(|(_, names)| *names) {
            let known = registry.estimator(name).is_ok() || registry.planner(name).is_ok();
            assert!(known, "{name}");
        }
    }

    #[test]
    fn earlier_campaigns_have_a_command() {
        for (name, now) in [
            ("planners", "foxhunt compare planners"),
            ("bearing-lost", "foxhunt compare extractors bearing-lost"),
            ("bot-m", "foxhunt compare estimators bot-m"),
        ] {
            assert_eq!(retired_campaign(name).as_deref(), Some(now));
        }
        assert_eq!(retired_campaign("pritzl-6.1"), None);
    }
}
