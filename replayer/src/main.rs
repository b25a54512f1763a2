//! Replays the log of a hunt without the receptions that were struck out.
//!
//! Standard input holds the lines of the log, an empty line, and the list of struck receptions
//! (`foxhunt_archive::struck`); standard output then holds what the report page shows, as one JSON
//! value. As WebAssembly (`wasm32-wasip1`) it is part of every page whose bearings can be struck
//! out, so that the page runs the program's own estimators; it touches no file, no clock and no
//! network.

use std::{
    io::{self, Read, Write},
    path::Path,
    process::ExitCode,
};

use foxhunt_archive::{
    overview::Overview,
    page,
    replay::ReplayError,
    struck::{Struck, StruckError},
};
use foxhunt_hunt::{
    log::{Log, LogError},
    registry::Registry,
};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Where standard error is closed nobody can read it.
            let _ = write!(io::stderr(), "{error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Failure> {
    let mut input = String::new();
    io::stdin().read_to_string(&mut input)?;
    io::stdout().write_all(replayed(&input)?.as_bytes())?;
    Ok(())
}

/// What the page shows, of the log and the list of what is struck.
fn replayed(input: &str) -> Result<String, Failure> {
    let (log, struck) = input.split_once("\n\n").ok_or(Failure::NoList)?;
    let log = Log::parse(log, Path::new("the page's log"))?;
    let struck = Struck::parse(struck, Path::new("the list"), &log)?;
    let registry = Registry::builtin();
    let (overview, replay) = Overview::of_log(&log, &registry, None, &struck, Vec::new(), None)?;
    Ok(page::restruck(&overview, &replay)?)
}

/// Why there is no replay.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error("no empty line ends the log")]
    NoList,
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Struck(#[from] StruckError),
    #[error(transparent)]
    Replay(#[from] ReplayError),
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    #[error(transparent)]
    Io(#[from] io::Error),
}
