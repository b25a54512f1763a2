//! The page in which the program runs without an installation.

use std::{
    collections::BTreeMap,
    fs,
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
};

use foxhunt::{
    document,
    recording::Column,
    scenario::{builtin_scenarios, builtin_text},
    sensors::AntennaConfig,
};
use serde::Serialize;

use crate::{error::CliError, output::Context};

const HTML: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
const FIELD: &str = include_str!("field.js");
const OFFLINE: &str = include_str!("offline.js");
const SIMULATE: &str = include_str!("simulate.js");
const WASI: &str = include_str!("wasi.js");
const WORKER: &str = include_str!("worker.js");

/// This program as WebAssembly, compressed by gzip, in base64; `.ci/replayer` makes it.
const PROGRAM: &str = include_str!("program.wasm.gz.base64");

/// Write a page that locates without an installation
///
/// The page is one file that works from a disk, without a network. It holds this program as
/// WebAssembly: recordings that are dropped on it get the answers and the report page of `locate`,
/// `judge`, `bearing`, `pulses` and `replay`. Simulated hunts fly in it, too. On a phone it takes
/// levels and bearings in the field. Nothing leaves the computer.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt page --out foxhunt.html\n  \
                        foxhunt page --out site/index.html --installable")]
pub struct Args {
    /// The page to write
    #[arg(long, value_name = "HTML", default_value = "foxhunt.html")]
    out: PathBuf,
    /// Also write a service worker beside the page: from a server with https a phone can then
    /// install the page and open it without a network
    #[arg(long)]
    installable: bool,
}

/// Result in JSON.
#[derive(Debug, Serialize)]
struct Written {
    page: PathBuf,
    bytes: usize,
    service_worker: Option<PathBuf>,
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let mut text = page()?;
    let service_worker = args.installable.then(|| args.out.with_extension("js"));
    if let Some(path) = &service_worker {
        text = with_service_worker(&text, &file_name(path));
        let script = service_worker_of(&text, &file_name(&args.out))?;
        fs::write(path, script).map_err(|error| CliError::writing(path, error))?;
    }
    fs::write(&args.out, &text).map_err(|error| CliError::writing(&args.out, error))?;
    let written = Written { page: args.out.clone(), bytes: text.len(), service_worker };
    context.output.result(&written, |written| {
        let page = format!("page: {}", written.page.display());
        match &written.service_worker {
            Some(path) => format!("{page}\nservice worker: {}", path.display()),
            None => page,
        }
    })
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the page with the name of its service worker, which its policy then allows.
fn with_service_worker(page: &str, name: &str) -> String {
    let name = name.replace('&', "&amp;").replace('"', "&quot;");
    page.replacen("<html lang=\"en\">", &format!("<html lang=\"en\" data-offline=\"{name}\">"), 1)
        .replacen("worker-src blob:;", "worker-src blob: 'self';", 1)
}

/// Returns the service worker of a page. Browsers fetch the page again when its worker has changed,
/// so the worker holds the page's hash.
fn service_worker_of(page: &str, name: &str) -> Result<String, CliError> {
    let mut hasher = DefaultHasher::new();
    page.hash(&mut hasher);
    let hash = format!("{:016x}", hasher.finish());
    Ok(OFFLINE.replacen("/* page */", &json(&name)?, 1).replacen("/* hash */", &hash, 1))
}

/// Returns the text of the page.
fn page() -> Result<String, CliError> {
    let columns: Vec<&str> = Column::ALL.into_iter().map(Column::name).collect();
    let columns = json(&columns)?;
    let antennas = json(&AntennaConfig::NAMES)?;
    let scenarios = json(&scenarios()?)?;
    let mut page = HTML.to_owned();
    for (mark, text) in [
        ("/* page.css */", STYLE),
        ("/* columns */", &columns),
        ("/* antennas */", &antennas),
        ("/* scenarios */", &scenarios),
        ("/* wasi.js */", WASI),
        ("/* worker.js */", WORKER),
        ("/* version */", env!("CARGO_PKG_VERSION")),
        ("/* page.js */", SCRIPT),
        ("/* simulate.js */", SIMULATE),
        ("/* field.js */", FIELD),
        ("/* program */", PROGRAM.trim_end()),
    ] {
        page = page.replacen(mark, text, 1);
    }
    Ok(page)
}

/// Writes a value so that a script element of the page can hold it.
fn json(value: &impl Serialize) -> Result<String, CliError> {
    let text = document::to_json(value).map_err(CliError::failure)?;
    Ok(text.replace('<', "\\u003c"))
}

/// Returns the built-in scenarios by name, with the keys of their files alone.
fn scenarios() -> Result<BTreeMap<String, toml::Table>, CliError> {
    builtin_scenarios()
        .into_iter()
        .filter_map(|scenario| builtin_text(&scenario.name).map(|text| (scenario.name, text)))
        .map(|(name, text)| Ok((name, text.parse().map_err(CliError::failure)?)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Size in bytes that nobody minds to download once.
    const MOST: usize = 6_200_000;

    #[test]
    fn it_is_whole() {
        let page = page().expect("its columns are texts");
        assert!(page.len() <= MOST, "{} bytes", page.len());
        for part in [STYLE, WASI, WORKER, SCRIPT, SIMULATE, FIELD, PROGRAM.trim_end()] {
            assert_eq!(page.matches(part).count(), 1, "{}", part.get(..40).unwrap_or(part));
        }
        assert!(page.contains("\"bearing_deg_compass\""), "the names of columns");
        assert!(page.contains(env!("CARGO_PKG_VERSION")));
        assert!(page.contains("\"one-drone\":{"), "the scenarios");
        assert!(!page.contains("/* "), "a mark is left");
    }

    /// A page that loads anything is no page for a field without a network.
    #[test]
    fn it_loads_nothing() {
        let page = page().expect("its columns are texts");
        let own = page.replace(PROGRAM.trim_end(), "");
        for outside in ["http:", "https:", "src=\"", "@import", "url(", "fetch(", "XMLHttp"] {
            assert!(!own.contains(outside), "{outside}");
        }
        assert!(own.contains("content=\"default-src 'none';"));
    }

    #[test]
    fn a_service_worker_knows_its_page() {
        let page = with_service_worker(&page().expect("its columns are texts"), "index.js");
        assert!(page.contains("data-offline=\"index.js\"") && page.contains("blob: 'self';"));
        let script = service_worker_of(&page, "index.html").expect("the name is a text");
        assert!(script.contains("\"index.html\"") && !script.contains("/* "), "{script}");
        let other = service_worker_of(&format!("{page} "), "index.html");
        assert_ne!(script, other.expect("the name is a text"));
    }

    /// Scripts in a page end at the first closing tag, wherever it stands.
    #[test]
    fn its_scripts_do_not_end_early() {
        for script in [SCRIPT, SIMULATE, FIELD, WASI, WORKER] {
            assert!(!script.to_lowercase().contains("</script"));
        }
    }
}
