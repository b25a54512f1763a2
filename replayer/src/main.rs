//! Replays the log of a hunt, or locates again from recordings, without the receptions that were
//! struck out.
//!
//! Standard input holds the lines of the log or of the receptions (`foxhunt_show::relocation`),
//! an empty line, and the list of struck receptions (`foxhunt_archive::struck`); standard output
//! then holds what the report page shows, as one JSON value. As WebAssembly (`wasm32-wasip1`) it is
//! part of every page whose bearings can be struck out, so that the page runs the program's own
//! estimators; it touches no file, no clock and no network.

use std::{
    io::{self, Read, Write},
    path::Path,
    process::ExitCode,
};

use foxhunt_archive::{
    replay::ReplayError,
    struck::{Struck, StruckError, StruckRows},
};
use foxhunt_hunt::{
    log::{Log, LogError},
    registry::{Registry, RegistryError},
};
use foxhunt_show::{
    overview::Overview,
    page,
    relocation::{Relocation, RelocationError},
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

/// Returns the page's contents, from the log and the list of struck receptions.
fn replayed(input: &str) -> Result<String, Failure> {
    let (lines, struck) = input.split_once("\n\n").ok_or(Failure::NoList)?;
    let registry = Registry::builtin();
    let list = Path::new("the list");
    if let Some(relocation) = Relocation::parse(lines)? {
        let struck = StruckRows::parse(struck, list, &relocation.ids())?;
        return Ok(page::relocated(&relocation.locate(&registry, &struck)?)?);
    }
    let log = Log::parse(lines, Path::new("the page's log"))?;
    let struck = Struck::parse(struck, list, &log)?;
    let (overview, replay) = Overview::of_log(&log, &registry, None, &struck, Vec::new(), None)?;
    Ok(page::restruck(&overview, &replay)?)
}

/// Reason why there is no replay.
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
    Relocation(#[from] RelocationError),
    #[error(transparent)]
    Registry(#[from] RegistryError),
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    #[error(transparent)]
    Io(#[from] io::Error),
}
