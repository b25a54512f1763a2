//! Checks before the work begins that its results can be written at the end.

use std::{
    fs::{self, OpenOptions},
    io,
    path::Path,
};

use crate::error::CliError;

/// Refuses a file that cannot be written, for want of its folder or of the right. An existing file
/// keeps its contents, and a missing one is not created.
pub(crate) fn file(path: &Path) -> Result<(), CliError> {
    check(path).map_err(|error| CliError::writing(path, error))
}

fn check(path: &Path) -> io::Result<()> {
    match OpenOptions::new().write(true).create_new(true).open(path) {
        Ok(_) => fs::remove_file(path),
        // Pipes are opened when they are written: whoever reads them would meet their end here.
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => match path.is_file() {
            true => OpenOptions::new().write(true).open(path).map(drop),
            false if path.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
            false => Ok(()),
        },
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_stay_as_they_are() {
        let folder = std::env::temp_dir().join(format!("foxhunt-writable-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let old = folder.join("old");
        let new = folder.join("new");
        fs::write(&old, "kept").expect("a file");
        assert!(file(&old).is_ok() && file(&new).is_ok());
        assert_eq!(fs::read_to_string(&old).expect("it is there"), "kept");
        assert!(!new.exists());
        for nowhere in [folder.clone(), folder.join("no/such"), old.join("within")] {
            let error = file(&nowhere).expect_err("it cannot be a file");
            let CliError::Failure(error) = error else { panic!("{error}") };
            assert!(error.to_string().contains("cannot be written"), "{error}");
        }
        fs::remove_dir_all(&folder).expect("it was ours");
    }
}
