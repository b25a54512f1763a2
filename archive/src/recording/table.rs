use csv::{ByteRecord, StringRecord, Trim};

use super::{FieldProblem, RecordingError};

/// Longer cells are cut in messages: an unclosed quote swallows the rest of the file.
const SHOWN: usize = 60;

/// A CSV file with a header, read row by row; lines that begin with `#` are comments.
pub(super) struct Table<'b> {
    file: String,
    bytes: &'b [u8],
    reader: csv::Reader<&'b [u8]>,
    header: Vec<String>,
    header_line: u64,
    /// Up to which byte the lines are counted, and how many there were.
    counted: (usize, u64),
    record: ByteRecord,
}

/// One row.
pub(super) struct Row<'t> {
    table: &'t Table<'t>,
    pub(super) line: u64,
    cells: StringRecord,
}

impl<'b> Table<'b> {
    /// Reads the header.
    pub(super) fn open(file: &str, bytes: &'b [u8]) -> Result<Self, RecordingError> {
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(Trim::All)
            .comment(Some(b'#'))
            .from_reader(bytes);
        let mut table = Self {
            file: file.to_owned(),
            bytes,
            reader,
            header: Vec::new(),
            header_line: 1,
            counted: (0, 0),
            record: ByteRecord::new(),
        };
        let Some((line, cells)) = table.advance()? else {
            return Err(RecordingError::Empty { file: file.to_owned() });
        };
        table.header_line = line;
        table.header = cells.iter().map(str::to_owned).collect();
        if table.header.iter().all(String::is_empty) {
            return Err(RecordingError::Empty { file: file.to_owned() });
        }
        Ok(table)
    }

    pub(super) fn file(&self) -> &str {
        &self.file
    }

    pub(super) fn header(&self) -> &[String] {
        &self.header
    }

    pub(super) fn header_line(&self) -> u64 {
        self.header_line
    }

    /// Where a column is; `None` where it is not.
    pub(super) fn index_of(&self, column: &str) -> Result<Option<usize>, RecordingError> {
        let mut found = self.header.iter().enumerate().filter(|(_, name)| *name == column);
        let first = found.next().map(|(index, _)| index);
        if found.next().is_some() {
            return Err(RecordingError::DuplicateColumn {
                file: self.file.clone(),
                line: self.header_line,
                column: column.to_owned(),
            });
        }
        Ok(first)
    }

    /// The next row, as long as the header.
    pub(super) fn next(&mut self) -> Result<Option<Row<'_>>, RecordingError> {
        let Some((line, cells)) = self.advance()? else { return Ok(None) };
        if cells.len() != self.header.len() {
            let last = cells.len().saturating_sub(1);
            return Err(RecordingError::FieldCount {
                file: self.file.clone(),
                line,
                expected: self.header.len(),
                found: cells.len(),
                column: self.column_name(last),
                value: shown(cells.get(last).unwrap_or_default()),
            });
        }
        Ok(Some(Row { table: self, line, cells }))
    }

    fn advance(&mut self) -> Result<Option<(u64, StringRecord)>, RecordingError> {
        let more = self.reader.read_byte_record(&mut self.record).map_err(|error| {
            RecordingError::Read { file: self.file.clone(), source: error.into() }
        })?;
        if !more {
            return Ok(None);
        }
        let start = self.record.position().map_or(0, csv::Position::byte);
        let line = self.line_at(usize::try_from(start).unwrap_or(usize::MAX));
        match StringRecord::from_byte_record(self.record.clone()) {
            Ok(cells) => Ok(Some((line, cells))),
            Err(error) => {
                let index = error.utf8_error().field();
                let cell = self.record.get(index).unwrap_or_default();
                Err(RecordingError::NotUtf8 {
                    file: self.file.clone(),
                    line,
                    column: self.column_name(index),
                    value: shown(&String::from_utf8_lossy(cell)),
                })
            }
        }
    }

    /// The line of the record that the reader began to look for at byte `start`. The reader's
    /// own count is that of the blank lines and comments before it.
    fn line_at(&mut self, start: usize) -> u64 {
        let rest = |at: usize| self.bytes.get(at..).unwrap_or_default();
        let mut at = start;
        loop {
            match rest(at) {
                [b'\r' | b'\n', ..] => at += 1,
                [b'#', comment @ ..] => {
                    at += 1 + comment.iter().position(|b| *b == b'\n').unwrap_or(comment.len());
                }
                _ => break,
            }
        }
        let passed = self.bytes.get(self.counted.0..at).unwrap_or_default();
        let mut lines = self.counted.1;
        for (offset, byte) in passed.iter().enumerate() {
            let pair = *byte == b'\r' && rest(self.counted.0 + offset + 1).first() == Some(&b'\n');
            lines += u64::from(matches!(byte, b'\n' | b'\r') && !pair);
        }
        self.counted = (at.max(self.counted.0), lines);
        lines + 1
    }

    fn column_name(&self, index: usize) -> String {
        self.header.get(index).cloned().unwrap_or_else(|| format!("column {}", index + 1))
    }
}

impl Row<'_> {
    /// A cell, without the spaces around it.
    pub(super) fn cell(&self, index: usize) -> &str {
        self.cells.get(index).unwrap_or_default()
    }

    /// The error that a cell is wrong.
    pub(super) fn wrong(&self, column: &str, cell: &str, problem: FieldProblem) -> RecordingError {
        RecordingError::Field {
            file: self.table.file.clone(),
            line: self.line,
            column: column.to_owned(),
            value: shown(cell),
            problem,
        }
    }
}

/// A cell as messages show it.
fn shown(cell: &str) -> String {
    let mut shown: String = cell.chars().take(SHOWN).collect();
    if shown.len() < cell.len() {
        shown.push('…');
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<(u64, String)> {
        let mut table = Table::open("t.csv", text.as_bytes()).expect("a header");
        let mut lines = vec![(table.header_line(), table.header().join("|"))];
        while let Some(row) = table.next().expect("whole rows") {
            lines.push((row.line, format!("{}|{}", row.cell(0), row.cell(1))));
        }
        lines
    }

    #[test]
    fn lines_are_those_of_the_file() {
        let expected = |list: &[(u64, &str)]| -> Vec<(u64, String)> {
            list.iter().map(|(line, text)| (*line, (*text).to_owned())).collect()
        };
        for text in [
            "# what\n\na,b\n1,2\n\n\n# why\n3, 4 \n\"5\n5\",6\n7,8",
            "# what\r\n\r\na,b\r\n1,2\r\n\r\n\r\n# why\r\n3, 4 \r\n\"5\n5\",6\r\n7,8\r\n",
        ] {
            assert_eq!(
                lines(text),
                expected(&[(3, "a|b"), (4, "1|2"), (8, "3|4"), (9, "5\n5|6"), (11, "7|8")])
            );
        }
        assert_eq!(lines("\u{feff}a,b\n1,2\n"), expected(&[(1, "a|b"), (2, "1|2")]));
        assert_eq!(lines("a,b\r1,2\r3,4"), expected(&[(1, "a|b"), (2, "1|2"), (3, "3|4")]));
    }

    #[test]
    fn broken_files_are_refused() {
        let open = |bytes: &'static [u8]| Table::open("t.csv", bytes).map(|_| ());
        assert!(matches!(open(b""), Err(RecordingError::Empty { .. })));
        assert!(matches!(open(b"# nothing\n\n"), Err(RecordingError::Empty { .. })));
        assert!(matches!(open(b" , \n"), Err(RecordingError::Empty { .. })));
        let message = open(b"a,\xff\n1,2").expect_err("not text").to_string();
        assert!(message.contains("t.csv, line 1, column 2"), "{message}");
        let mut table = Table::open("t.csv", b"a,b\n1,2\n1,2,3\n").expect("a header");
        assert!(table.next().is_ok());
        let message = table.next().map(|_| ()).expect_err("three").to_string();
        for part in ["t.csv, line 3", "3 fields instead of 2", "column 3", "\"3\""] {
            assert!(message.contains(part), "{message}");
        }
    }
}
