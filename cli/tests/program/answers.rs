//! The numbers of many answers against what they were: recordings of most formats, hunts of most
//! scenarios, comparisons and pictures. A change of an engine or of a format changes some of them
//! with intent; no other change may.
//!
//! A file in `answers` holds commands, and below each what it answered: a line for each part, with
//! the count of its numbers and their weighted sum. With `FOXHUNT_RENEW_ANSWERS=1` the files are
//! written again; lines that hold stay as they are.

use std::{
    collections::{BTreeMap, BTreeSet},
    env, fs,
    path::Path,
};

use serde_json::Value;

use crate::support::{folder, foxhunt_in};

/// The share of a sum by which machines differ.
const TOLERANCE: f64 = 1e-8;

/// Numbers in the order in which they were printed.
#[derive(Default)]
struct Sum {
    count: u32,
    sum: f64,
    /// The sum, were all of them positive.
    size: f64,
}

impl Sum {
    /// Counts a number: its place weighs, so that two that change places are seen, and its size
    /// only by a logarithm, so that a time in seconds does not hide a bearing in radians.
    fn add(&mut self, number: f64) {
        let weight = 1.0 + f64::from(self.count % 13);
        self.count += 1;
        self.sum += weight * number.asinh();
        self.size += weight * number.asinh().abs();
    }

    /// Counts every number below a value; words do not count.
    fn add_below(&mut self, value: &Value) {
        match value {
            Value::Bool(is) => self.add(f64::from(u8::from(*is))),
            Value::Number(number) => self.add(number.as_f64().unwrap_or(f64::MAX)),
            Value::Array(values) => values.iter().for_each(|value| self.add_below(value)),
            Value::Object(fields) => fields.values().for_each(|value| self.add_below(value)),
            Value::Null | Value::String(_) => {}
        }
    }

    /// Counts every number that stands in a text.
    fn add_text(&mut self, text: &str) {
        let apart = |c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e' | 'E'));
        text.split(apart).filter_map(|word| word.parse().ok()).for_each(|number| self.add(number));
    }
}

/// The parts of what the program printed: the fields of a JSON value, or all of a text.
fn printed(text: &str) -> BTreeMap<String, Sum> {
    let mut parts: BTreeMap<String, Sum> = BTreeMap::new();
    match serde_json::from_str(text) {
        Ok(Value::Object(fields)) => {
            for (field, value) in fields {
                parts.entry(field).or_default().add_below(&value);
            }
        }
        Ok(value) => parts.entry("answer".into()).or_default().add_below(&value),
        Err(_) => parts.entry("answer".into()).or_default().add_text(text),
    }
    parts
}

/// Numbers of a file that the program wrote: of a report those of its data, not the page's own.
fn written(text: &str) -> Sum {
    let mut sum = Sum::default();
    let (_, data) =
        text.split_once(r#"<script type="application/json" id="data">"#).unwrap_or(("", text));
    let data = data.split("</script>").next().unwrap_or(data);
    match serde_json::from_str(data) {
        Ok(value) => sum.add_below(&value),
        Err(_) => sum.add_text(data),
    }
    sum
}

/// Parts of a command's answer: what it prints, its exit code, and the files that it writes to
/// `out`. `known` has the files that lie there already.
fn answer(
    command: &str,
    out: &Path,
    known: &mut BTreeMap<String, String>,
) -> BTreeMap<String, Sum> {
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../archive/tests/data");
    let path = out.to_str().expect("UTF-8");
    let ran = foxhunt_in(data, command.split_whitespace().map(|word| word.replace("OUT", path)));
    // Where the folder lies is no part of the answer.
    let mut answered = printed(&ran.stdout.replace(path, "OUT"));
    let mut exit = Sum::default();
    exit.add(ran.code.into());
    answered.insert("exit".into(), exit);
    let files = fs::read_dir(out).expect("the folder was made").filter_map(Result::ok);
    for file in files {
        let name = file.file_name().to_string_lossy().into_owned();
        // A picture of dots is no text.
        let Ok(text) = fs::read_to_string(file.path()) else { continue };
        if known.get(&name) != Some(&text) {
            answered.insert(name.clone(), written(&text));
            known.insert(name, text);
        }
    }
    answered.retain(|_, sum| sum.count > 0);
    answered
}

/// Runs every command of a file of answers and holds what it says against the lines below it.
fn hold(name: &str) {
    let file = format!("{}/tests/program/answers/{name}.txt", env!("CARGO_MANIFEST_DIR"));
    let kept = fs::read_to_string(&file).expect("it lies beside this test");
    let out = folder(&format!("answers-{name}"));
    let mut known = BTreeMap::new();
    let mut renewed = String::new();
    let mut wrong = Vec::new();
    for block in kept.split("$ ").skip(1) {
        let mut lines = block.lines();
        let command = lines.next().expect("a command");
        let before: BTreeSet<&str> = lines.filter(|line| !line.is_empty()).collect();
        renewed += &format!("$ {command}\n");
        let mut met = 0;
        for (part, Sum { count, sum, size }) in answer(command, &out, &mut known) {
            let line = format!("{part}: {count} {sum:.10}");
            let same = before.iter().find(|line| {
                let numbers = line.strip_prefix(&format!("{part}: {count} "));
                let old = numbers.and_then(|sum| sum.parse::<f64>().ok());
                old.is_some_and(|old| (old - sum).abs() <= TOLERANCE * size + 1e-9)
            });
            renewed += &format!("{}\n", same.map_or(line.as_str(), |line| line));
            match same {
                Some(_) => met += 1,
                None => wrong.push(format!("$ {command}\n  {line}")),
            }
        }
        if met < before.len() {
            wrong.push(format!("$ {command}: {met} of {} parts as before", before.len()));
        }
    }
    if env::var_os("FOXHUNT_RENEW_ANSWERS").is_some() {
        return fs::write(&file, renewed).expect("the sources can be written to");
    }
    assert!(wrong.is_empty(), "{} lines differ from {file}:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn recordings_are_answered_as_before() {
    hold("recordings");
}

#[test]
fn settings_change_answers_as_before() {
    hold("settings");
}

#[test]
fn hunts_end_as_before() {
    hold("hunts");
}

#[test]
fn pictures_and_files_are_as_before() {
    hold("files");
}
