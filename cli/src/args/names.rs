use clap::{Arg, Command, builder::PossibleValuesParser};
use foxhunt::registry::{EstimatorEntry, Registry};

/// The subcommands that have all receptions before they begin.
const AT_ONCE: [&str; 2] = ["locate", "judge"];

/// Restricts every `--estimator`, `--extractor` and `--planner` of a command and its subcommands to
/// the names of a registry.
pub(super) fn command(command: Command, registry: &Registry) -> Command {
    let at_once = AT_ONCE.contains(&command.get_name());
    command
        .mut_args(|arg| argument(arg, registry, at_once))
        .mut_subcommands(|subcommand| self::command(subcommand, registry))
}

fn argument(arg: Arg, registry: &Registry, at_once: bool) -> Arg {
    let names: Vec<String> = match arg.get_id().as_str() {
        "estimator" => {
            let suits = |entry: &&EstimatorEntry| at_once || !entry.needs().all_at_once;
            let suitable = registry.estimators().iter().filter(suits);
            suitable.map(|entry| entry.name.to_string()).collect()
        }
        "extractor" => registry.extractors().iter().map(|entry| entry.name.to_string()).collect(),
        "planner" => registry.planners().iter().map(|entry| entry.name.to_string()).collect(),
        _ => return arg,
    };
    arg.value_parser(PossibleValuesParser::new(names))
}

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
            assert!(!takes(path, "estimator", "shadowing-grid"), "{path:?}");
        }
        for path in [&["locate"][..], &["judge"]] {
            assert!(takes(path, "estimator", "shadowing-grid"), "{path:?}");
        }
        assert!(takes(&["compare", "planners"], "planner", "orbit"));
        assert!(takes(&["compare", "extractors"], "extractor", "main-lobe"));
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
