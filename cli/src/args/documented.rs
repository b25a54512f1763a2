//! The program takes every command, scenario and flight that the documents show.

use std::{fs, path::PathBuf};

use clap::error::ErrorKind;
use foxhunt::{
    fly::{EmulatedFieldConfig, FlightConfig},
    registry::Registry,
    scenario::Scenario,
};

use super::groups::GROUPS;

/// A fenced block of a document: the words behind the fence, its text, and where it begins.
struct Block {
    kind: String,
    text: String,
    at: String,
}

fn repository() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The name and text of the README and of every document.
fn documents() -> Vec<(String, String)> {
    let folder = fs::read_dir(repository().join("docs")).expect("the documents");
    let mut paths: Vec<_> = folder.map(|entry| entry.expect("an entry").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    paths.push(repository().join("README.md"));
    paths.sort();
    let read = |path: PathBuf| {
        let name = path.file_name().expect("a file").to_string_lossy().into_owned();
        (name, fs::read_to_string(&path).expect("a document"))
    };
    paths.into_iter().map(read).collect()
}

/// The cells of the rows of the first table behind a heading.
fn rows(document: &str, heading: &str) -> Vec<Vec<String>> {
    let path = repository().join("docs").join(document);
    let text = fs::read_to_string(path).expect("a document");
    let (_, below) = text.split_once(&format!("\n{heading}\n")).expect("the heading");
    let table = below.lines().skip_while(|line| !line.starts_with('|')).skip(2);
    let cells = |line: &str| {
        let line = line.trim_matches('|').replace("\\|", "\u{0}");
        line.split('|').map(|cell| cell.trim().replace('\u{0}', "|")).collect()
    };
    table.take_while(|line| line.starts_with('|')).map(cells).collect()
}

#[test]
fn the_first_table_of_estimators_is_the_menu() {
    let registry = Registry::builtin();
    let menu = registry.menu();
    let menu = menu.iter().map(|entry| {
        vec![format!("`{}`", entry.name), entry.when().expect("it is in the menu").to_owned()]
    });
    assert_eq!(rows("estimators.md", "## Which one"), menu.collect::<Vec<_>>());
}

#[test]
fn the_tables_of_commands_are_the_groups_of_the_help() {
    for (group, names) in GROUPS {
        let mut listed: Vec<String> = rows("commands.md", &format!("## {group}"))
            .iter()
            .map(|cells| {
                let command = cells[0].trim_start_matches("`foxhunt ");
                command.split([' ', '`']).next().unwrap_or_default().to_owned()
            })
            .collect();
        listed.dedup();
        assert_eq!(listed, names, "{group}");
    }
}

fn blocks(kind: &str) -> Vec<Block> {
    let mut found = Vec::new();
    for (name, text) in documents() {
        let mut open: Option<Block> = None;
        for (number, line) in text.lines().enumerate() {
            match (line.trim_start().strip_prefix("```"), &mut open) {
                (Some(words), None) => {
                    let at = format!("{name}, line {}", number + 1);
                    open = Some(Block { kind: words.trim().to_owned(), text: String::new(), at });
                }
                (Some(_), Some(_)) => found.extend(open.take()),
                (None, Some(block)) => block.text.extend([line, "\n"]),
                (None, None) => {}
            }
        }
    }
    found.retain(|block| block.kind == kind);
    assert!(!found.is_empty(), "no document has a block of {kind}");
    found
}

/// The words of a command, with values in place of what the documents leave to the reader.
fn words(command: &str) -> Vec<String> {
    let command = command.split(" # ").next().unwrap_or_default();
    let command = command.split(" > ").next().unwrap_or_default();
    let concrete = |word: &str| match word {
        "N" => "5".to_owned(),
        "NAME" => "grid".to_owned(),
        "KIND" => "error".to_owned(),
        "SHELL" => "bash".to_owned(),
        "LAT,LON" => "50,14".to_owned(),
        _ => word.split('|').next().unwrap_or_default().trim_end_matches(['…', '.']).to_owned(),
    };
    let optional = |word: &&str| !word.starts_with('[');
    command.split_whitespace().filter(optional).map(concrete).collect()
}

/// Parses a command line that begins with the program's name.
fn parsed(line: &str) -> Result<(), clap::Error> {
    super::command(&Registry::builtin()).try_get_matches_from(words(line)).map(|_| ())
}

#[test]
fn commands_in_blocks_are_complete() {
    let mut count = 0;
    for block in blocks("sh") {
        for line in block.text.lines() {
            let line = line.replacen("cargo run --release --", "foxhunt", 1);
            if line.starts_with("foxhunt ") {
                count += 1;
                parsed(&line).unwrap_or_else(|error| panic!("{}: {line}\n{error}", block.at));
            }
        }
    }
    assert!(count >= 12, "{count}");
}

#[test]
fn commands_in_sentences_exist() {
    let mut count = 0;
    for (name, text) in documents() {
        for code in text.split('`').skip(1).step_by(2).filter(|code| code.starts_with("foxhunt ")) {
            count += 1;
            let line = code.replace("\\|", "|").replace("--planner NAME", "--planner orbit");
            let Err(error) = parsed(&line) else { continue };
            let unfinished = [
                ErrorKind::DisplayHelp,
                ErrorKind::MissingRequiredArgument,
                ErrorKind::MissingSubcommand,
                ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand,
            ];
            assert!(unfinished.contains(&error.kind()), "{name}: {code}\n{error}");
        }
    }
    assert!(count >= 40, "{count}");
}

#[test]
fn scenarios_in_blocks_are_read() {
    let base = repository().join("hunt/scenarios/pritzl-6.1.toml");
    let base: toml::Table = toml::from_str(&fs::read_to_string(base).expect("it")).expect("TOML");
    for block in blocks("toml scenario") {
        let part: toml::Table = toml::from_str(&block.text).expect("TOML");
        let mut whole = base.clone();
        for (key, value) in part {
            match (whole.get_mut(&key), value) {
                (Some(toml::Value::Table(old)), toml::Value::Table(new)) if key != "planner" => {
                    old.extend(new);
                }
                (_, value) => drop(whole.insert(key, value)),
            }
        }
        let text = toml::to_string(&whole).expect("TOML");
        Scenario::parse(&text, &block.at).unwrap_or_else(|error| panic!("{error}"));
    }
}

#[test]
fn flights_and_faults_in_blocks_are_read() {
    for block in blocks("toml flight") {
        FlightConfig::parse(&block.text, &block.at).unwrap_or_else(|error| panic!("{error}"));
    }
    for block in blocks("toml faults") {
        toml::from_str::<EmulatedFieldConfig>(&block.text)
            .unwrap_or_else(|error| panic!("{}: {error}", block.at));
    }
}
