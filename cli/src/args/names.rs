use std::borrow::Cow;

use clap::{
    Arg, Command,
    builder::{PossibleValue, PossibleValuesParser},
};
use foxhunt::registry::{EstimatorEntry, Registry};

/// The subcommands that have all receptions before they begin.
const AT_ONCE: [&str; 2] = ["locate", "judge"];

/// The subcommand that has the names of a store, `NAME@DIGEST` among them.
const OF_A_STORE: &str = "results";

/// Restricts every `--estimator`, `--extractor` and `--planner` of a command and its subcommands to
/// the names of a registry.
pub fn command(command: Command, registry: &Registry) -> Command {
    if command.get_name() == OF_A_STORE {
        return command;
    }
    let at_once = AT_ONCE.contains(&command.get_name());
    command
        .mut_args(|arg| match arg.get_id().as_str() {
            "estimator" => estimator(arg, registry, at_once),
            "extractor" => named(arg, registry.extractors().iter().map(|entry| &entry.name)),
            "planner" => named(arg, registry.planners().iter().map(|entry| &entry.name)),
            _ => arg,
        })
        .mut_subcommands(|subcommand| self::command(subcommand, registry))
}

fn named<'a>(arg: Arg, names: impl Iterator<Item = &'a Cow<'static, str>>) -> Arg {
    let names: Vec<String> = names.map(|name| name.to_string()).collect();
    arg.value_parser(PossibleValuesParser::new(names))
}

/// An argument that takes any estimator, and shows those to choose from. The others are hidden
/// from help texts; completions have them.
fn estimator(arg: Arg, registry: &Registry, at_once: bool) -> Arg {
    let suits = |entry: &&EstimatorEntry| at_once || !entry.needs().all_at_once;
    let others = registry.estimators().iter().filter(|entry| entry.when().is_none());
    let entries = registry.menu().into_iter().chain(others);
    let values = entries.filter(suits).map(|entry| {
        let value = PossibleValue::new(entry.name.to_string());
        match entry.when() {
            Some(when) => value.help(when.to_owned()),
            None => value.hide(true).help(entry.about.to_string()),
        }
    });
    let values: Vec<PossibleValue> = values.collect();
    let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
    arg.long_help(format!("{help}\n\n{MORE}")).value_parser(PossibleValuesParser::new(values))
}

/// Hint to the names that help texts leave out.
const MORE: &str = "These are the names to choose from; `foxhunt list estimators --all` has more.";

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::args::Cli;

    /// Returns true if a command's argument takes a value.
    fn takes(path: &[&str], argument: &str, value: &str) -> bool {
        takes_with(&Registry::builtin(), path, argument, value)
    }

    fn takes_with(registry: &Registry, path: &[&str], argument: &str, value: &str) -> bool {
        let mut command = &super::command(Cli::command(), registry);
        for name in path {
            command = command.find_subcommand(name).expect("there is such a subcommand");
        }
        let mut arguments = command.get_arguments();
        let argument = arguments.find(|arg| arg.get_id() == argument).expect("its argument");
        argument.get_possible_values().iter().any(|known| known.matches(value, false))
    }

    #[test]
    fn arguments_take_the_names_of_the_registry() {
        for path in [&["hunt"][..], &["campaign"], &["compare", "estimators"], &["replay"]] {
            assert!(takes(path, "estimator", "particle"), "{path:?}");
            assert!(takes(path, "estimator", "ekf-iterated"), "{path:?}: hidden, but known");
            assert!(!takes(path, "estimator", "shadowing-grid"), "{path:?}");
        }
        for path in [&["locate"][..], &["judge"]] {
            assert!(takes(path, "estimator", "shadowing-grid"), "{path:?}");
        }
        assert!(takes(&["compare", "planners"], "planner", "orbit"));
        assert!(takes(&["compare", "extractors"], "extractor", "main-lobe"));
    }

    #[test]
    #[cfg(feature = "store")]
    fn results_take_the_names_of_their_store() {
        let words =
            ["foxhunt", "results", "runs.sqlite", "--estimator", "ekf@1f0c", "--planner", "old"];
        let command = super::command(Cli::command(), &Registry::builtin());
        command.try_get_matches_from(words).expect("a store may have these names");
    }

    #[test]
    fn help_shows_the_menu() {
        let registry = Registry::builtin();
        let command = super::command(Cli::command(), &registry);
        let locate = command.find_subcommand("locate").expect("there is one").clone();
        let mut arguments = locate.get_arguments();
        let argument = arguments.find(|arg| arg.get_id() == "estimator").expect("its argument");
        let values = argument.get_possible_values();
        let shown = values
            .iter()
            .filter(|value| !value.is_hide_set())
            .map(|value| (value.get_name().to_owned(), value.get_help().map(ToString::to_string)));
        let menu = registry.menu();
        let menu =
            menu.iter().map(|entry| (entry.name.to_string(), entry.when().map(str::to_owned)));
        assert_eq!(shown.collect::<Vec<_>>(), menu.collect::<Vec<_>>());
        assert_eq!(values.len(), registry.estimators().len());
    }

    #[test]
    fn what_is_registered_is_a_name_everywhere() {
        let registry = Registry::builtin();
        let grid = registry.estimator("grid").expect("it is built in");
        let mut own = grid.clone();
        own.name = "mine".into();
        let mut planner = registry.planner("hold").expect("it is built in").clone();
        planner.name = "my-planner".into();
        let registry = registry.clone().with_estimator(own).with_planner(planner);
        for path in [
            &["hunt"][..],
            &["campaign"],
            &["compare", "estimators"],
            &["compare", "antennas"],
            &["compare", "planners"],
            &["fleets"],
            &["replay"],
            &["locate"],
        ] {
            assert!(takes_with(&registry, path, "estimator", "mine"), "{path:?}");
        }
        for path in [&["hunt"][..], &["campaign"], &["compare", "planners"], &["fleets"]] {
            assert!(takes_with(&registry, path, "planner", "my-planner"), "{path:?}");
        }
    }
}
