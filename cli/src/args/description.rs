//! The commands and their arguments as data, for bindings to other languages.

use std::{any::TypeId, path::PathBuf};

use clap::{Arg, ArgAction, Command};
use serde::Serialize;

/// A command that can be run.
#[derive(Debug, Serialize)]
pub struct CommandDescription {
    /// Words of the command, such as `["compare", "sigmas"]`.
    words: Vec<String>,
    about: String,
    details: String,
    arguments: Vec<ArgumentDescription>,
}

/// A positional argument or a flag.
#[derive(Debug, Serialize)]
struct ArgumentDescription {
    /// The flag without its hyphens, or the name of a positional argument.
    name: String,
    positional: bool,
    required: bool,
    /// True if several values may be given.
    many: bool,
    kind: Kind,
    /// The values that are allowed, if only these are.
    choices: Vec<String>,
    default: Vec<String>,
    help: String,
}

/// Type of an argument's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    /// Given or not.
    Switch,
    Integer,
    Number,
    Path,
    Text,
}

/// Returns all commands but groups that only hold other commands, in the order of `--help`.
pub fn described(mut command: Command) -> Vec<CommandDescription> {
    command.build();
    let mut all = Vec::new();
    visit(&command, &mut Vec::new(), &mut all);
    all
}

fn visit(command: &Command, words: &mut Vec<String>, all: &mut Vec<CommandDescription>) {
    let mut subcommands: Vec<&Command> =
        command.get_subcommands().filter(|each| each.get_name() != "help").collect();
    subcommands.sort_by_key(|each| each.get_display_order());
    let is_group = !subcommands.is_empty() && command.is_subcommand_required_set();
    if !words.is_empty() && !is_group {
        let text = |text: Option<&clap::builder::StyledStr>| {
            text.map(ToString::to_string).unwrap_or_default()
        };
        let arguments = command.get_arguments().filter(|argument| {
            !["help", "version", "json"].contains(&argument.get_id().as_str())
                && !argument.is_hide_set()
        });
        all.push(CommandDescription {
            words: words.clone(),
            about: text(command.get_about()),
            details: text(command.get_long_about().or(command.get_about())),
            arguments: arguments.map(argument).collect(),
        });
    }
    for subcommand in subcommands {
        words.push(subcommand.get_name().to_owned());
        visit(subcommand, words, all);
        words.pop();
    }
}

fn argument(argument: &Arg) -> ArgumentDescription {
    let takes_several = argument.get_num_args().is_some_and(|range| range.max_values() > 1);
    let choices = match kind(argument) {
        Kind::Text => argument.get_possible_values(),
        _ => Vec::new(),
    };
    let help = argument.get_long_help().or(argument.get_help());
    ArgumentDescription {
        name: argument.get_long().unwrap_or(argument.get_id().as_str()).to_owned(),
        positional: argument.is_positional(),
        required: argument.is_required_set(),
        many: takes_several || matches!(argument.get_action(), ArgAction::Append),
        kind: kind(argument),
        choices: choices.iter().map(|value| value.get_name().to_owned()).collect(),
        default: argument
            .get_default_values()
            .iter()
            .map(|value| value.to_string_lossy().into_owned())
            .collect(),
        help: help.map(ToString::to_string).unwrap_or_default(),
    }
}

fn kind(argument: &Arg) -> Kind {
    if !argument.get_action().takes_values() {
        return Kind::Switch;
    }
    let of = argument.get_value_parser().type_id();
    let is = |types: &[TypeId]| types.iter().any(|each| of == *each);
    let integers = [
        TypeId::of::<u8>(),
        TypeId::of::<u16>(),
        TypeId::of::<u32>(),
        TypeId::of::<u64>(),
        TypeId::of::<usize>(),
        TypeId::of::<i32>(),
        TypeId::of::<i64>(),
    ];
    if is(&integers) {
        Kind::Integer
    } else if is(&[TypeId::of::<f64>()]) {
        Kind::Number
    } else if is(&[TypeId::of::<PathBuf>()]) {
        Kind::Path
    } else {
        Kind::Text
    }
}

#[cfg(test)]
mod tests {
    use foxhunt::registry::Registry;

    use super::*;

    #[test]
    fn flags_have_their_types() {
        let all = described(crate::args::command(&Registry::builtin()));
        let hunt = all.iter().find(|each| each.words == ["hunt"]).expect("a command");
        let of = |name: &str| {
            let found = hunt.arguments.iter().find(|each| each.name == name);
            found.unwrap_or_else(|| panic!("hunt has no {name}"))
        };
        assert_eq!(of("seed").kind, Kind::Integer);
        assert_eq!(of("out").kind, Kind::Path);
        assert!(of("scenario").positional);
        assert!(of("estimator").help.len() > 10);
        // Groups of commands are no commands.
        assert!(all.iter().any(|each| each.words.len() == 2));
        assert!(all.iter().all(|each| each.words != ["compare"]));
    }
}
