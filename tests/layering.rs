//! Who may import whom: reads the manifests and fails on any edge that the architecture does not
//! have, on circles between the modules of a package, and on clocks and self-seeded generators
//! where there must be none.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

/// Each package's folder and the foxhunt packages that its dependencies may name. Tests may besides
/// name the package itself, to have all of its features, and `foxhunt-core` with its laws; those of
/// `archive` also `foxhunt-sim`, whose recordings they read back.
const MAY_IMPORT: [(&str, &[&str]); 17] = [
    ("core", &[]),
    ("filters", &["core"]),
    ("sensors", &["core"]),
    ("formation", &["core"]),
    ("estimators", &["core", "filters", "sensors"]),
    ("signal", &["core"]),
    ("wire", &["core"]),
    ("hardware", &["core", "signal", "wire"]),
    ("sim", &["core", "sensors", "wire"]),
    ("hunt", &["core", "estimators", "filters", "formation", "sensors", "sim", "wire"]),
    ("lab", &["core", "filters", "formation", "hunt", "sensors", "sim", "wire"]),
    ("archive", &["core", "filters", "formation", "hunt", "sensors", "wire"]),
    ("field", &["core", "formation", "hardware", "hunt", "sensors", "sim", "wire"]),
    (
        "",
        &[
            "archive",
            "core",
            "field",
            "filters",
            "formation",
            "hardware",
            "hunt",
            "lab",
            "sensors",
            "signal",
            "sim",
            "wire",
        ],
    ),
    ("cli", &[""]),
    ("instructions", &["", "core", "filters", "sensors"]),
    ("replayer", &["archive", "hunt"]),
];

/// The name of the package in a folder.
fn package(folder: &str) -> String {
    if folder.is_empty() { "foxhunt".to_owned() } else { format!("foxhunt-{folder}") }
}

/// What reads a clock or seeds itself, and may stand in `hardware` and `cli` alone.
const OUTSIDE_ONLY: [&str; 10] = [
    "Instant::now",
    "SystemTime::now",
    "Utc::now",
    "Local::now",
    "rand::rng()",
    "rand::random",
    "SysRng",
    "thread_rng",
    "from_os_rng",
    "make_rng",
];

/// What prints or ends the program, and may stand in programs alone.
const PROGRAM_ONLY: [&str; 4] = ["println!", "eprintln!", "print!(", "process::exit"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn no_new_edges() {
    for (folder, allowed) in MAY_IMPORT {
        let path = root().join(folder).join("Cargo.toml");
        let text = fs::read_to_string(&path).expect("every package has a manifest");
        let manifest: toml::Table = text.parse().expect("a manifest is TOML");
        for section in ["dependencies", "dev-dependencies", "build-dependencies"] {
            let Some(table) = manifest.get(section).and_then(toml::Value::as_table) else {
                continue;
            };
            let mut may: BTreeSet<String> = allowed.iter().map(|folder| package(folder)).collect();
            if section == "dev-dependencies" {
                may.extend([package(folder), package("core")]);
                if folder == "archive" {
                    may.insert(package("sim"));
                }
            }
            for name in table.keys().filter(|name| name.starts_with("foxhunt")) {
                assert!(
                    may.contains(name),
                    "{}: [{section}] imports {name}, which the architecture does not allow",
                    path.display()
                );
            }
        }
    }
}

/// The modules at the top of a package import each other in one direction only.
#[test]
fn no_circle_between_modules() {
    for (folder, _) in MAY_IMPORT.iter().filter(|(folder, _)| !folder.is_empty()) {
        let source = root().join(folder).join("src");
        let heads = ["lib.rs", "main.rs"].map(|head| source.join(head));
        let head = heads.iter().find(|head| head.exists()).expect("a package has a first file");
        let exports = exports(&code_of(head));
        let mut edges: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        let mut files = Vec::new();
        collect(&source, &mut files);
        for path in files {
            let inside = path.strip_prefix(&source).expect("it was found there");
            let first = inside.components().next().expect("a file has a name");
            let module = Path::new(first.as_os_str()).with_extension("");
            let module = module.to_str().expect("UTF-8").to_owned();
            if matches!(module.as_str(), "lib" | "main" | "bin") {
                continue;
            }
            let imported = imports(&code_of(&path));
            let of = |name: String| exports.get(&name).cloned().unwrap_or(name);
            let others = imported.into_iter().map(of).filter(|name| *name != module);
            edges.entry(module.clone()).or_default().extend(others.collect::<Vec<_>>());
        }
        let known: BTreeSet<String> = edges.keys().cloned().collect();
        for module in &known {
            let mut open = vec![vec![module.clone()]];
            let mut reached = BTreeSet::new();
            while let Some(path) = open.pop() {
                let last = path.last().expect("a path has a module");
                for next in edges[last].iter().filter(|next| known.contains(*next)) {
                    let way = path.join(" -> ");
                    assert_ne!(next, module, "{folder}: a circle of modules, {way} -> {module}");
                    if reached.insert(next.clone()) {
                        open.push(path.iter().chain([next]).cloned().collect());
                    }
                }
            }
        }
    }
}

/// `hunt::hunt` is the machine alone: it knows nothing of files, names and scenarios.
#[test]
fn the_machine_imports_no_other_module() {
    let mut files = Vec::new();
    collect(&root().join("hunt/src/hunt"), &mut files);
    for path in files {
        let imported = imports(&code_of(&path));
        let other = imported.iter().find(|name| *name != "hunt");
        assert_eq!(other, None, "{} imports it", path.display());
    }
}

/// The module that each name at the root of a package comes from.
fn exports(root: &str) -> BTreeMap<String, String> {
    let mut exports = BTreeMap::new();
    for statement in root.split(';') {
        let Some((_, tree)) = statement.split_once("use ") else { continue };
        for path in leaves(tree) {
            if let (Some(first), Some(last)) = (path.first(), path.last())
                && path.len() > 1
            {
                exports.insert(last.clone(), first.clone());
            }
        }
    }
    exports
}

/// The first segments behind `crate::` in a file.
fn imports(code: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        let end = rest.find(';').unwrap_or(rest.len());
        if rest.starts_with('{') {
            names.extend(leaves(&rest[..end]).into_iter().filter_map(|path| path.first().cloned()));
        } else {
            let letters = |c: &char| c.is_alphanumeric() || *c == '_';
            names.insert(rest.chars().take_while(letters).collect());
        }
    }
    names
}

/// The paths that a tree of imports stands for.
fn leaves(tree: &str) -> Vec<Vec<String>> {
    let tree = tree.trim();
    let Some((before, inside)) = tree.split_once('{') else {
        let path = tree.split(" as ").next().unwrap_or(tree);
        return vec![path.split("::").map(|segment| segment.trim().to_owned()).collect()];
    };
    let before: Vec<String> = before
        .split("::")
        .map(|segment| segment.trim().to_owned())
        .filter(|segment| !segment.is_empty())
        .collect();
    let inside = inside.rsplit_once('}').map_or(inside, |(inside, _)| inside);
    let (mut depth, mut start, mut parts) = (0_i32, 0, Vec::new());
    for (at, letter) in inside.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&inside[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&inside[start..]);
    let parts = parts.into_iter().filter(|part| !part.trim().is_empty());
    let whole = |path: Vec<String>| before.iter().cloned().chain(path).collect();
    parts.flat_map(leaves).map(whole).collect()
}

/// A file without its comments and its tests, which stand at its end.
fn code_of(path: &Path) -> String {
    let text = fs::read_to_string(path).expect("sources are UTF-8");
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(&text);
    code.lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .map(|line| format!("{line}\n"))
        .collect()
}

#[test]
fn every_package_is_listed() {
    let text = fs::read_to_string(root().join("Cargo.toml")).expect("the root has a manifest");
    let manifest: toml::Table = text.parse().expect("a manifest is TOML");
    let members = manifest["workspace"]["members"].as_array().expect("a list of members");
    // The benches measure all packages and are measured by none.
    for member in members.iter().filter(|member| member.as_str() != Some("benches")) {
        let member = member.as_str().expect("a path");
        assert!(MAY_IMPORT.iter().any(|(folder, _)| *folder == member), "{member} is not listed");
    }
}

#[test]
fn clocks_and_output_stay_outside() {
    for (folder, _) in MAY_IMPORT {
        let mut files = Vec::new();
        collect(&root().join(folder).join("src"), &mut files);
        assert!(!files.is_empty(), "no sources in {folder:?}");
        for path in files {
            let code = code_of(&path);
            let forbidden = |words: &[&str]| {
                for word in words {
                    assert!(!code.contains(word), "{}: {word} stands here", path.display());
                }
            };
            if !matches!(folder, "hardware" | "cli") {
                forbidden(&OUTSIDE_ONLY);
            }
            if !matches!(folder, "cli" | "instructions") {
                forbidden(&PROGRAM_ONLY);
            }
        }
    }
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a source folder can be listed") {
        let path = entry.expect("an entry can be read").path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
}
