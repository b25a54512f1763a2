use clap::Command;

use crate::screen;

/// Groups of the commands, in the order of `--help`.
pub const GROUPS: [(&str, &[&str]); 5] = [
    ("Simulate", &["hunt", "campaign", "fleets", "soak"]),
    (
        "Recordings",
        &["locate", "bearing", "calibrate", "antenna", "pulses", "tags", "convert", "replay"],
    ),
    ("Fly", &["fly", "devices", "listen", "emulate", "node"]),
    ("Study", &["judge", "compare", "results", "plot"]),
    ("Tools", &["list", "page", "completions", "man"]),
];

/// Has `--help` show the subcommands in their groups; lists elsewhere keep that order.
pub fn grouped(command: Command) -> Command {
    let section = section(&command, screen::width());
    let header = command.get_styles().get_header().to_owned();
    let names = GROUPS.iter().flat_map(|(_, names)| *names).enumerate();
    let command = names.fold(command, |command, (order, name)| {
        // Some subcommands exist in some builds alone.
        match command.find_subcommand(name) {
            Some(_) => command.mut_subcommand(name, |subcommand| subcommand.display_order(order)),
            None => command,
        }
    });
    command.help_template(format!(
        "{{before-help}}{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{section}\
         {header}Options:{header:#}\n{{options}}{{after-help}}"
    ))
}

/// The commands under the headings of their groups, in at most `width` columns.
fn section(command: &Command, width: usize) -> String {
    let header = command.get_styles().get_header();
    let literal = command.get_styles().get_literal();
    let longest = command.get_subcommands().map(|known| known.get_name().len()).max().unwrap_or(0);
    let mut section = String::new();
    for (group, names) in GROUPS {
        section += &format!("{header}{group}:{header:#}\n");
        for subcommand in names.iter().filter_map(|name| command.find_subcommand(name)) {
            let name = subcommand.get_name();
            let about = subcommand.get_about().map(ToString::to_string).unwrap_or_default();
            let indent = " ".repeat(longest + 4);
            let text = screen::indented(&about, width, &indent, &indent);
            let pad = " ".repeat(longest - name.len() + 2);
            section += &format!("  {literal}{name}{literal:#}{pad}{}\n", text.trim_start());
        }
        section.push('\n');
    }
    section
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clap::CommandFactory;

    use super::*;
    use crate::args::Cli;

    #[test]
    fn every_command_is_in_one_group() {
        let grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        let once: BTreeSet<&str> = grouped.iter().copied().collect();
        assert_eq!(once.len(), grouped.len(), "a command is in one group alone");
        let command = Cli::command();
        for subcommand in command.get_subcommands() {
            let name = subcommand.get_name();
            assert!(once.contains(name), "give {name} a group in cli/src/args/groups.rs");
        }
        for name in once {
            // `results` is the one command that a build may lack.
            assert!(
                command.find_subcommand(name).is_some() || name == "results",
                "there is no command {name}"
            );
        }
    }

    #[test]
    fn help_has_each_group_with_its_commands() {
        let command = Cli::command();
        for width in [60, 100] {
            let section = section(&command, width);
            let plain = console::strip_ansi_codes(&section).into_owned();
            assert!(plain.lines().all(|line| line.chars().count() <= width), "{plain}");
            let mut at = 0;
            for (group, names) in GROUPS {
                for text in std::iter::once(format!("{group}:\n"))
                    .chain(names.iter().map(|name| format!("  {name} ")))
                {
                    let found = plain[at..].find(&text);
                    at += found.unwrap_or_else(|| panic!("{text:?} after {at} in {plain}"));
                }
            }
        }
    }
}
