//! The documents show what the program prints and draws.
//!
//! A block ```` ```console ```` has commands behind `$ `, each with the output that it prints on
//! standard output. A line `…` stands for any lines; a command without output in the block is run
//! and its output is not compared. The commands of a page run in their order in a folder of its
//! own, from which the repository's folders can be read. A picture `figures/PAGE/NAME.svg` of a
//! page is the file `NAME.svg` that its commands leave there.
//!
//! Below a line `<!-- keys: TABLE -->` is the table of that name of `foxhunt list keys`; its words
//! may be links.
//!
//! With `FOXHUNT_RENEW_DOCUMENTS=1` outputs without `…`, pictures and tables are written anew.

use std::{
    collections::BTreeMap,
    env, fs,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::{Mutex, PoisonError},
    thread,
};

use serde_json::Value;

use crate::support::{folder, foxhunt};

/// Line of an output that stands for any lines.
const ELIDED: &str = "…";

/// Most bytes of a picture of a page.
const MOST_BYTES: usize = 40 * 1024;

/// Held by a test that reads documents, so that none is written meanwhile.
static DOCUMENTS: Mutex<()> = Mutex::new(());

/// Folders of the repository that commands read.
const READ: [&str; 5] = ["archive", "docs", "examples", "hunt", "lab"];

/// A command of a document with the output that stands below it.
struct Shown {
    command: String,
    output: Vec<String>,
    /// Lines of the document that hold the output, counted from 0.
    lines: std::ops::Range<usize>,
}

fn repository() -> PathBuf {
    fs::canonicalize(Path::new(env!("CARGO_MANIFEST_DIR")).join("..")).expect("the repository")
}

/// The README and every document.
fn pages() -> Vec<PathBuf> {
    let root = repository();
    let mut pages = vec![root.join("README.md")];
    for folder in ["docs", "docs/devices"] {
        let entries = fs::read_dir(root.join(folder)).expect("the documents");
        pages.extend(entries.map(|entry| entry.expect("an entry").path()));
    }
    pages.retain(|page| page.extension().is_some_and(|extension| extension == "md"));
    pages.sort();
    pages
}

fn shown(text: &str) -> Vec<Shown> {
    let mut found: Vec<Shown> = Vec::new();
    let mut inside = false;
    for (number, line) in text.lines().enumerate() {
        if line.starts_with("```") {
            inside = line == "```console";
        } else if let Some(command) = line.strip_prefix("$ ").filter(|_| inside) {
            let lines = number + 1..number + 1;
            found.push(Shown { command: command.to_owned(), output: Vec::new(), lines });
        } else if inside {
            let last = found.last_mut().expect("a block begins with a command");
            last.output.push(line.to_owned());
            last.lines.end = number + 1;
        }
    }
    found
}

/// Returns true if an output is what a document shows of it.
fn agree(shown: &[String], printed: &[String]) -> bool {
    let mut parts = shown.split(|line| line == ELIDED);
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = printed.strip_prefix(first) else { return false };
    let mut others: Vec<&[String]> = parts.collect();
    let Some(last) = others.pop() else { return rest.is_empty() };
    for part in others.into_iter().filter(|part| !part.is_empty()) {
        let Some(at) = rest.windows(part.len()).position(|lines| lines == part) else {
            return false;
        };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

/// Runs a command of a document; returns what it printed on standard output.
fn run(command: &str, at: &Path) -> Result<Vec<String>, String> {
    let program = Path::new(env!("CARGO_BIN_EXE_foxhunt"));
    let built = program.parent().expect("a folder");
    // Those who read have the source; here both are built.
    let examples = format!("{}/examples/", built.display());
    let command = command
        .replace("cargo run --release -- ", "foxhunt ")
        .replace("cargo run -p foxhunt-cli --example ", &examples)
        .replace(" -- ", " ");
    let path = env::var("PATH").unwrap_or_default();
    let ran = Command::new("sh")
        .args(["-ec", &command])
        .current_dir(at)
        .env("PATH", format!("{}:{path}", built.display()))
        .env_remove("COLUMNS")
        .env_remove("FOXHUNT_DATA")
        .stdin(Stdio::null())
        .output()
        .expect("there is a shell");
    if !ran.status.success() {
        let error = String::from_utf8_lossy(&ran.stderr).into_owned();
        return Err(format!(
            "{error}\n(examples are built by `cargo build -p foxhunt-cli --examples`)"
        ));
    }
    let text = String::from_utf8(ran.stdout).expect("it prints UTF-8");
    Ok(text.lines().map(|line| line.trim_end().to_owned()).collect())
}

/// Runs the commands of a page; returns what is wrong with it.
fn check(page: &Path, renew: bool) -> Vec<String> {
    let root = repository();
    let name = page.strip_prefix(&root).expect("a page of the repository").display().to_string();
    let text = fs::read_to_string(page).expect("a document");
    let commands = shown(&text);
    let mut wrong = Vec::new();
    if commands.is_empty() {
        return wrong;
    }
    let at = folder(&format!("document_{}", name.replace(['/', '.'], "_")));
    for read in READ {
        symlink(root.join(read), at.join(read)).expect("a link");
    }
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    // From behind, so that the lines of those before stay where they are.
    let mut renewed = Vec::new();
    for Shown { command, output, lines } in commands {
        let place = format!("{name}, line {}: {command}", lines.start);
        match run(&command, &at) {
            Err(error) => wrong.push(format!("{place}\n{error}")),
            Ok(printed) if output.is_empty() || agree(&output, &printed) => {}
            Ok(printed) if renew && !output.iter().any(|line| line == ELIDED) => {
                renewed.push((lines, printed));
            }
            Ok(printed) => wrong.push(format!("{place}\nprints\n{}", printed.join("\n"))),
        }
    }
    for (range, printed) in renewed.into_iter().rev() {
        lines.splice(range, printed);
    }
    if renew {
        fs::write(page, lines.join("\n") + "\n").expect("it can be written");
    }
    let stem = page.file_stem().expect("a name").to_string_lossy();
    let pictures = format!("](figures/{stem}/");
    for link in text.split(&pictures).skip(1) {
        let picture = link.split(')').next().expect("the rest of a link");
        let kept = page.parent().expect("a folder").join(format!("figures/{stem}")).join(picture);
        match fs::read(at.join(picture)) {
            Err(error) => wrong.push(format!("{name}: nothing draws {picture}: {error}")),
            Ok(drawn) if drawn.len() > MOST_BYTES => {
                wrong.push(format!("{name}: {picture} has {} bytes", drawn.len()));
            }
            Ok(drawn) if renew => {
                fs::create_dir_all(kept.parent().expect("a folder")).expect("a folder");
                fs::write(&kept, drawn).expect("it can be written");
            }
            Ok(drawn) if fs::read(&kept).ok().as_ref() == Some(&drawn) => {}
            Ok(_) => wrong.push(format!("{name}: {picture} is not what the program draws")),
        }
    }
    wrong
}

#[test]
fn documents_show_what_the_program_prints_and_draws() {
    let renew = env::var_os("FOXHUNT_RENEW_DOCUMENTS").is_some();
    let _reading = DOCUMENTS.lock().unwrap_or_else(PoisonError::into_inner);
    let pages = pages();
    let wrong: Vec<String> = thread::scope(|scope| {
        let checks: Vec<_> =
            pages.iter().map(|page| scope.spawn(move || check(page, renew))).collect();
        checks.into_iter().flat_map(|check| check.join().expect("it does not panic")).collect()
    });
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
    let text = |page: &PathBuf| fs::read_to_string(page).expect("a document");
    let compared: usize = pages
        .iter()
        .map(|page| shown(&text(page)).iter().filter(|shown| !shown.output.is_empty()).count())
        .sum();
    assert!(compared >= 12, "{compared} outputs");
}

/// A line of a Markdown table without its links.
fn without_links(line: &str) -> String {
    let mut plain = String::new();
    let mut rest = line;
    while let Some((before, link)) = rest.split_once('[') {
        let Some((text, (target, after))) =
            link.split_once("](").and_then(|(text, behind)| Some((text, behind.split_once(')')?)))
        else {
            break;
        };
        assert!(!target.is_empty(), "{line}");
        plain += before;
        plain += text;
        rest = after;
    }
    plain + rest
}

#[test]
fn tables_of_keys_are_those_of_the_program() {
    let renew = env::var_os("FOXHUNT_RENEW_DOCUMENTS").is_some();
    let _reading = DOCUMENTS.lock().unwrap_or_else(PoisonError::into_inner);
    let listed = foxhunt(["list", "keys", "--json"]).json();
    let mut tables: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for table in listed.as_array().expect("a list") {
        let row = |key: &Value| {
            let cell = |name: &str| key[name].as_str().expect("a text").to_owned();
            let cells =
                [format!("`{}`", cell("name")), cell("unit"), cell("default"), cell("meaning")];
            format!("| {} |", cells.join(" | ")).replace("|  |", "| |")
        };
        let keys = table["keys"].as_array().expect("a list");
        tables.insert(table["name"].as_str().expect("a name"), keys.iter().map(row).collect());
    }
    let mut wrong = Vec::new();
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a document");
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        // From behind, so that the lines of those before stay where they are.
        for at in (0..lines.len()).rev() {
            let marked =
                lines[at].strip_prefix("<!-- keys: ").map(|line| line.trim_end_matches(" -->"));
            let Some(name) = marked.map(str::to_owned) else { continue };
            let rows = tables.remove(&*name);
            let rows = rows.unwrap_or_else(|| panic!("{}: no other table {name}", page.display()));
            let from = (at..lines.len()).find(|line| lines[*line].starts_with("| key |"));
            let from = from.unwrap_or_else(|| panic!("{name} has no table")) + 2;
            let count = lines[from..].iter().take_while(|line| line.starts_with('|')).count();
            let shown: Vec<String> =
                lines[from..from + count].iter().map(|line| without_links(line)).collect();
            if shown == rows {
                continue;
            }
            if renew {
                lines.splice(from..from + count, rows);
            } else {
                wrong.push(format!("{}: {name} is\n{}", page.display(), rows.join("\n")));
            }
        }
        if renew {
            fs::write(&page, lines.join("\n") + "\n").expect("it can be written");
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
    assert!(tables.is_empty(), "on no page: {:?}", tables.keys());
}

#[test]
fn an_output_agrees_to_the_letter_but_where_it_is_elided() {
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
    let agree = |shown: &str, printed: &str| agree(&lines(shown), &lines(printed));
    assert!(agree("a\nb", "a\nb"));
    for other in ["a", "a\nb\nc", "a\nB", ""] {
        assert!(!agree("a\nb", other), "{other:?}");
    }
    assert!(agree("a\n…", "a\nb\nc") && agree("…\nc", "a\nb\nc") && agree("a\n…\nc", "a\nc"));
    assert!(agree("a\n…\nc\n…\ne", "a\nb\nc\nd\ne"));
    assert!(!agree("a\n…\nc\n…\ne", "a\nb\nd\ne") && !agree("a\n…\nb", "a\nb\nc"));
    assert!(!agree("a\n…\na", "a"), "no line stands for two");
}
