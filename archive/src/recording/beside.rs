use std::{
    borrow::Cow,
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

use super::{
    Beside, Column, RecordingError, Source,
    decompress::decompressed,
    near_miss::did_you_mean,
    table::{Row, Table},
};

/// A table that lies beside a recording, by the names of its rows.
pub(super) struct Joined {
    /// Name of the table's file in messages.
    pub file: String,
    /// The columns of ours that name a row; empty where one row holds for all.
    pub by: Vec<Column>,
    optional: bool,
    rows: BTreeMap<Vec<String>, Row>,
    /// Indices and source of each column of ours.
    pub columns: BTreeMap<Column, (Vec<usize>, Source)>,
}

impl Joined {
    /// Reads the table out of a recording's folder, for the columns that are not in `given`; `None`
    /// if it gives no column, or is optional and absent.
    pub(super) fn read(
        beside: &Beside,
        format: &str,
        name: &str,
        folder: Option<&Path>,
        given: impl Fn(Column) -> bool,
    ) -> Result<Option<Self>, RecordingError> {
        let wanted: Vec<_> = beside.columns.iter().filter(|(column, _)| !given(**column)).collect();
        let Some((first, _)) = wanted.first() else { return Ok(None) };
        let path: Option<PathBuf> = folder.map(|folder| folder.join(&beside.file));
        let file = path.as_ref().map_or_else(|| beside.file.clone(), |p| p.display().to_string());
        let bytes = match path.as_ref().map(fs::read).transpose() {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                return Err(RecordingError::Read { file, source });
            }
            bytes => bytes.ok().flatten(),
        };
        let Some(bytes) = bytes else {
            if beside.optional {
                return Ok(None);
            }
            return Err(RecordingError::NothingBeside {
                file: name.to_owned(),
                beside: beside.file.clone(),
                column: first.name().to_owned(),
            });
        };
        let bytes = decompressed(&bytes, &file)?;
        let mut table = Table::open(&file, &bytes, None, &[])?;
        let mut columns = BTreeMap::new();
        for (column, source) in wanted {
            let indices = table.require(&source.columns, format)?;
            columns.insert(*column, (indices, source.clone()));
        }
        let keys = beside.by.values().map(|source| table.require(&source.columns, format));
        let keys: Vec<Vec<usize>> = keys.collect::<Result<_, _>>()?;
        let mut rows: BTreeMap<Vec<String>, Row> = BTreeMap::new();
        let mut read = 0;
        while let Some(row) = table.next()? {
            read += 1;
            let mut key = Vec::new();
            for (source, indices) in beside.by.values().zip(&keys) {
                key.extend(row.value(indices, source)?.map(Cow::into_owned));
            }
            // A row without a name is of nobody.
            if key.len() < keys.len() {
                continue;
            }
            if let Some(before) = rows.get(&key)
                && !key.is_empty()
            {
                let first = before.line();
                let line = row.line();
                let name = key.join(", ");
                return Err(RecordingError::DuplicateRow { file, line, name, first });
            }
            rows.insert(key, row);
        }
        if keys.is_empty() && read != 1 {
            return Err(RecordingError::NotOneRow { file, rows: read });
        }
        let by = beside.by.keys().copied().collect();
        Ok(Some(Self { file, by, optional: beside.optional, rows, columns }))
    }

    /// The row of these names; `None` where there need not be one.
    pub(super) fn row(
        &self,
        names: &[String],
        wrong: impl FnOnce(String) -> RecordingError,
    ) -> Result<Option<&Row>, RecordingError> {
        match self.rows.get(names) {
            None if self.optional => Ok(None),
            None => {
                let known: Vec<String> = self.rows.keys().map(|key| key.join(", ")).collect();
                let meant = did_you_mean(&names.join(", "), known.iter().map(String::as_str));
                Err(wrong(format!("{}{meant}", self.file)))
            }
            row => Ok(row),
        }
    }
}
