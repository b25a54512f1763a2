//! The recordings that tests read.

use std::path::{Path, PathBuf};

/// A file of the shared data beside the checkout; reports it and is `None` where it is missing.
#[expect(clippy::print_stdout, reason = "a test reports what it skips")]
pub(crate) fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")).join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: no recordings at {}", path.display());
    None
}
