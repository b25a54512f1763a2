use std::{fs, io, path::Path};

use super::{BagError, contents::Bag};

/// Returns true if a file is a bag: MCAP, or SQLite by its first bytes.
///
/// # Errors
///
/// An error when the file cannot be read.
pub fn is_bag(path: &Path) -> io::Result<bool> {
    use io::Read as _;

    let mut first = Vec::new();
    fs::File::open(path)?.take(16).read_to_end(&mut first)?;
    Ok(first.starts_with(b"\x89MCAP0\r\n") || first.starts_with(b"SQLite format 3\0"))
}

impl Bag {
    pub(super) fn open(path: &Path) -> Result<Self, BagError> {
        let mut bag = match path.extension().is_some_and(|ending| ending == "db3") {
            true => Self::of_sqlite(path)?,
            false => Self::of_mcap(path)?,
        };
        bag.messages.sort_by_key(|message| message.time_ns);
        Ok(bag)
    }

    #[cfg(feature = "mcap")]
    fn of_mcap(path: &Path) -> Result<Self, BagError> {
        super::mcap::read(&fs::read(path).map_err(BagError::read)?)
    }

    #[cfg(not(feature = "mcap"))]
    fn of_mcap(_: &Path) -> Result<Self, BagError> {
        Err(BagError::NotBuilt { what: "MCAP", feature: "mcap" })
    }

    #[cfg(feature = "sqlite")]
    fn of_sqlite(path: &Path) -> Result<Self, BagError> {
        super::sqlite::read(path).map_err(BagError::read)
    }

    #[cfg(not(feature = "sqlite"))]
    fn of_sqlite(_: &Path) -> Result<Self, BagError> {
        Err(BagError::NotBuilt { what: "a bag in SQLite", feature: "store" })
    }
}
