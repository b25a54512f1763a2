//! Allowed imports: reads the manifests and fails on any edge that the architecture does not have,
//! on circles between the files of a package, and on clocks and self-seeded generators where there
//! must be none.

#[path = "layering/modules.rs"]
mod modules;
#[path = "layering/tokens.rs"]
mod tokens;

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use modules::Package;

/// Each package's folder and the foxhunt packages that its dependencies may name. Tests may besides
/// name the package itself, to have all of its features, and `foxhunt-core` with its laws; the
/// tests of `show` also `foxhunt-sim`, whose courses of beacons they draw.
const MAY_IMPORT: [(&str, &[&str]); 21] = [
    ("core", &[]),
    // What judges the estimators shares no code with them: no mistake is made twice.
    ("drawn", &[]),
    ("filters", &["core"]),
    ("sensors", &["core"]),
    ("formation", &["core"]),
    ("estimators", &["core", "filters", "sensors"]),
    ("signal", &["core"]),
    ("wire", &["core"]),
    ("hardware", &["core", "signal", "wire"]),
    ("sim", &["core", "sensors", "wire"]),
    ("parts", &["core", "filters", "formation", "sensors"]),
    ("locate", &["core", "estimators", "filters", "parts", "sensors", "sim", "wire"]),
    (
        "hunt",
        &[
            "core",
            "estimators",
            "filters",
            "formation",
            "locate",
            "parts",
            "sensors",
            "sim",
            "wire",
        ],
    ),
    ("lab", &["core", "filters", "formation", "hunt", "sensors", "sim", "wire"]),
    ("archive", &["core", "filters", "hunt", "sensors", "wire"]),
    ("show", &["archive", "core", "filters", "formation", "hunt", "sensors", "wire"]),
    ("field", &["core", "formation", "hardware", "hunt", "sensors", "sim", "wire"]),
    (
        "",
        &[
            "archive",
            "core",
            "drawn",
            "field",
            "filters",
            "formation",
            "hardware",
            "hunt",
            "lab",
            "sensors",
            "show",
            "signal",
            "sim",
            "wire",
        ],
    ),
    ("cli", &[""]),
    ("instructions", &["", "core", "filters", "sensors"]),
    ("replayer", &["archive", "hunt", "show"]),
];

/// The name of the package in a folder.
fn package(folder: &str) -> String {
    if folder.is_empty() { "foxhunt".to_owned() } else { format!("foxhunt-{folder}") }
}

/// Calls that read a clock or seed themselves, and may stand in `hardware` and `cli` alone.
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

/// Calls that print or end the program, and may stand in programs alone.
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
                if folder == "show" {
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

/// Files of a package import each other in one direction only, and so do whole folders.
#[test]
fn no_circle_between_modules() {
    let mut circles = Vec::new();
    for (folder, _) in MAY_IMPORT {
        let name = package(folder);
        let found = modules_of(folder).circles().into_iter();
        circles.extend(found.map(|circle| format!("in {name}:\n{circle}")));
    }
    assert!(circles.is_empty(), "files import each other\n{}", circles.join("\n"));
}

/// `hunt::hunt` is the machine alone: it knows nothing of files, names and scenarios.
#[test]
fn the_machine_imports_no_other_module() {
    let machine = ["hunt".to_owned()];
    let mut imports = modules_of("hunt").imports().into_iter();
    let other = imports.find(|of| of.by.starts_with(&machine) && !of.from.starts_with(&machine));
    assert_eq!(other.map(|import| import.text), None);
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
            let text = fs::read_to_string(&path).expect("sources are UTF-8");
            let code = tokens::tokens(&text).concat();
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
            // The page's program has no random numbers, by which these begin.
            if matches!(
                folder,
                "core" | "estimators" | "filters" | "hunt" | "locate" | "parts" | "sensors"
            ) {
                forbidden(&["HashMap", "HashSet"]);
            }
            if !matches!(
                folder,
                "cli" | "drawn" | "field" | "hardware" | "instructions" | "lab" | "signal" | "sim"
            ) && !path.components().any(|part| part.as_os_str() == "tests")
                && !path.ends_with("tests.rs")
            {
                for function in ROUNDED_BY_THE_SYSTEM {
                    forbidden(&[&format!(".{function}("), &format!("f64::{function}")]);
                }
            }
        }
    }
}

/// Functions that the C libraries of systems round differently in the last bit. Those of `libm` and
/// of `core::elementary` give the same bits on every processor and in the page's WebAssembly.
const ROUNDED_BY_THE_SYSTEM: [&str; 20] = [
    "sin", "cos", "tan", "sin_cos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp",
    "exp_m1", "ln", "ln_1p", "log10", "log2", "powf", "cbrt", "hypot",
];

/// Reads the modules of a package's library, or of its program where it has no library.
fn modules_of(folder: &str) -> Package {
    let source = root().join(folder).join("src");
    let has_library = source.join("lib.rs").exists();
    let mut files = Vec::new();
    collect(&source, &mut files);
    let mut package = Package::default();
    for path in files {
        let file = path.strip_prefix(&source).expect("it was found there");
        // Programs beside a library are packages of their own to Rust.
        if has_library && (file == Path::new("main.rs") || file.starts_with("bin")) {
            continue;
        }
        let text = fs::read_to_string(&path).expect("sources are UTF-8");
        package.add(file.to_str().expect("UTF-8"), &text);
    }
    package
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
