use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

use super::{Column, Mapping, RecordingError, Value, table::Table};

/// The constants that lie in other files; what is fixed already stays.
pub(super) fn read_beside(
    mapping: &Mapping,
    name: &str,
    folder: Option<&Path>,
    fixed: &mut BTreeMap<Column, Value>,
) -> Result<(), RecordingError> {
    for beside in &mapping.beside {
        let wanted: Vec<_> =
            beside.columns.iter().filter(|(column, _)| !fixed.contains_key(column)).collect();
        let Some((first, _)) = wanted.first() else { continue };
        let path: Option<PathBuf> = folder.map(|folder| folder.join(&beside.file));
        let bytes = match path.as_ref().map(fs::read).transpose() {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                let file = path.map_or_else(String::new, |path| path.display().to_string());
                return Err(RecordingError::Read { file, source });
            }
            bytes => bytes.ok().flatten(),
        };
        let Some(bytes) = bytes else {
            if beside.optional {
                continue;
            }
            return Err(RecordingError::NothingBeside {
                file: name.to_owned(),
                beside: beside.file.clone(),
                column: first.name().to_owned(),
            });
        };
        let file = path.map_or_else(|| beside.file.clone(), |path| path.display().to_string());
        let mut table = Table::open(&file, &bytes)?;
        let mut indices = Vec::new();
        for (column, source) in wanted {
            let index = table.index_of(source)?.ok_or_else(|| RecordingError::MissingColumn {
                file: file.clone(),
                line: table.header_line(),
                column: source.clone(),
                format: mapping.name.clone(),
            })?;
            indices.push((*column, index));
        }
        let mut rows = 0;
        while let Some(row) = table.next()? {
            rows += 1;
            for (column, index) in &indices {
                fixed.insert(*column, Value::Text(row.cell(*index).to_owned()));
            }
        }
        if rows != 1 {
            return Err(RecordingError::NotOneRow { file, rows });
        }
    }
    Ok(())
}
