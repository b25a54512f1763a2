use std::{
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use serde_json::Value;

/// The result of a call of the program.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

pub(crate) fn foxhunt<A: AsRef<OsStr>>(args: impl IntoIterator<Item = A>) -> Ran {
    foxhunt_in(".", args)
}

/// A call of the program in a folder.
pub(crate) fn foxhunt_in<A: AsRef<OsStr>>(
    folder: impl AsRef<Path>,
    args: impl IntoIterator<Item = A>,
) -> Ran {
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_foxhunt"))
        .args(args)
        .current_dir(folder)
        // Recordings of the machine would change what a test draws.
        .env_remove("FOXHUNT_DATA")
        .output()
        .expect("the program was built for this test");
    Ran {
        code: status.code().expect("nothing kills it"),
        stdout: String::from_utf8(stdout).expect("it prints UTF-8"),
        stderr: String::from_utf8(stderr).expect("it prints UTF-8"),
    }
}

impl Ran {
    /// The one JSON value that is all of standard output.
    pub(crate) fn json(&self) -> Value {
        assert_eq!(self.code, 0, "{self:?}");
        // A word may begin with it.
        for number in ["NaN", "\"inf\"", "\"-inf\""] {
            assert!(!self.stdout.contains(number), "{number} in {}", self.stdout);
        }
        serde_json::from_str(&self.stdout).expect("standard output is one JSON value")
    }

    /// Ended with this code and an error that holds all of these texts, and printed no result.
    pub(crate) fn failed(&self, code: i32, texts: &[&str]) {
        assert_eq!(self.code, code, "{self:?}");
        assert!(self.stdout.is_empty(), "{self:?}");
        assert!(!self.stderr.contains("panicked"), "{self:?}");
        for text in texts {
            assert!(self.stderr.contains(text), "{text:?} is not in {}", self.stderr);
        }
    }
}

/// An empty folder of its own for each test.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    if folder.exists() {
        fs::remove_dir_all(&folder).expect("an old folder of this test can be removed");
    }
    fs::create_dir_all(&folder).expect("a folder can be made");
    folder
}

/// The fields of an object, in their order.
pub(crate) fn has(value: &Value, fields: &[&str]) {
    for field in fields {
        assert!(value.get(field).is_some(), "{field} is missing in {value}");
    }
}

/// A small scenario of one beacon, as a file.
pub(crate) fn scenario() -> String {
    r#"
name = "small"
description = "one beacon, two drones"
estimator = "ekf-pritzl2018"

[world]
beacons = [{ name = "fox", east_m = 12.0, north_m = 5.0 }]
drones = [
    { east_m = 0.0, north_m = 0.0, up_m = 4.0 },
    { east_m = 4.0, north_m = 0.0, up_m = 4.0 },
]

[world.channel]
path_loss = { reference_dbm = -29.06, exponent = 2.765 }
antenna = "reference-patch"
pattern_sigma_db = 1.0
sample_sigma_db = 1.0
bearing_sigma_deg = 5.0

[model]
reference_dbm = -29.06
exponent = 2.765

[extractor]
kind = "pritzl2018"

[planner]
kind = "hold"
turns = 4
"#
    .to_owned()
}

/// The path of a file of the archive's tests.
pub(crate) fn data(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../archive/tests/data");
    folder.join(name).to_str().expect("UTF-8").to_owned()
}
