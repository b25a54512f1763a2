//! Who may import whom: reads the manifests and fails on any edge that the architecture does not
//! have, and on clocks and self-seeded generators where there must be none.

use std::{collections::BTreeSet, fs, path::Path};

/// Each package's folder and the foxhunt packages that its normal dependencies may name.
const MAY_IMPORT: [(&str, &[&str]); 9] = [
    ("core", &[]),
    ("filters", &["foxhunt-core"]),
    ("sensors", &["foxhunt-core"]),
    ("formation", &["foxhunt-core"]),
    ("wire", &["foxhunt-core"]),
    ("hardware", &["foxhunt-core", "foxhunt-wire"]),
    ("sim", &["foxhunt-core", "foxhunt-sensors", "foxhunt-wire"]),
    (
        "",
        &[
            "foxhunt-core",
            "foxhunt-filters",
            "foxhunt-sensors",
            "foxhunt-formation",
            "foxhunt-hardware",
            "foxhunt-sim",
            "foxhunt-wire",
        ],
    ),
    ("cli", &["foxhunt"]),
];

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

/// What prints or ends the program, and may stand in `cli` alone.
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
            let found: BTreeSet<&str> =
                table.keys().map(String::as_str).filter(|k| k.starts_with("foxhunt")).collect();
            // Tests of the facade may enable features of any part, and of itself.
            let extra: &[&str] =
                if section == "dev-dependencies" { &["foxhunt-core"] } else { &[] };
            for name in found {
                assert!(
                    allowed.contains(&name) || extra.contains(&name),
                    "{}: [{section}] imports {name}, which the architecture does not allow",
                    path.display()
                );
            }
        }
    }
}

#[test]
fn every_package_is_listed() {
    let text = fs::read_to_string(root().join("Cargo.toml")).expect("the root has a manifest");
    let manifest: toml::Table = text.parse().expect("a manifest is TOML");
    let members = manifest["workspace"]["members"].as_array().expect("a list of members");
    for member in members {
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
            // The tests of a file stand at its end and may print what they skipped.
            let code: String = text
                .lines()
                .take_while(|line| line.trim() != "#[cfg(test)]")
                .filter(|line| !line.trim_start().starts_with("//"))
                .map(|line| format!("{line}\n"))
                .collect();
            let forbidden = |words: &[&str]| {
                for word in words {
                    assert!(!code.contains(word), "{}: {word} stands here", path.display());
                }
            };
            if !matches!(folder, "hardware" | "cli") {
                forbidden(&OUTSIDE_ONLY);
            }
            if folder != "cli" {
                forbidden(&PROGRAM_ONLY);
            }
        }
    }
}

fn collect(folder: &Path, files: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).expect("a source folder can be listed") {
        let path = entry.expect("an entry can be read").path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
}
