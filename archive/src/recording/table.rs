use std::{borrow::Cow, sync::Arc};

use csv::{ByteRecord, StringRecord};

use super::{
    FieldProblem, RecordingError, Source,
    converted::Rows,
    coordinate::{self, is_decimal, number},
    near_miss::near_miss,
};

/// Longer cells are cut in messages: an unclosed quote swallows the rest of the file.
const SHOWN: usize = 60;

/// Number of lines in which the header is looked for.
const PREAMBLE_LINES: usize = 20;

/// The byte order mark of UTF-8, which some programs begin a file with.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A CSV file with a header, read row by row; lines that begin with `#` are comments.
pub(super) struct Table<'b> {
    file: Arc<str>,
    bytes: &'b [u8],
    reader: csv::Reader<&'b [u8]>,
    /// The byte at which the reader began.
    begin: usize,
    separator: u8,
    /// Lines before the header that are neither empty nor comments.
    preamble: u64,
    /// True if rows may have more cells than there are names.
    open_ended: bool,
    /// True if rows may have fewer cells than there are names.
    padded: bool,
    /// The line of the file in which each line of the table began; empty if they are the same.
    lines: &'b [u64],
    header: Vec<String>,
    header_line: u64,
    /// The byte up to which lines are counted, and their number.
    counted: (usize, u64),
    record: ByteRecord,
}

/// One row.
pub(super) struct Row {
    file: Arc<str>,
    line: u64,
    separator: u8,
    cells: StringRecord,
}

/// A line in which the header may be.
#[derive(Clone, Copy)]
struct Candidate {
    begin: usize,
    end: usize,
    number: u64,
    is_comment: bool,
}

impl<'b> Table<'b> {
    /// Reads the header; its most frequent separator separates the cells unless one is given. A
    /// file without a header has these names.
    pub(super) fn open(
        file: &str,
        bytes: &'b [u8],
        separator: Option<char>,
        names: &[String],
    ) -> Result<Self, RecordingError> {
        let mut table = Self::begin_at(file, bytes, mark_end(bytes), separator);
        table.open_ended = !names.is_empty();
        table.header = names.to_vec();
        if table.open_ended {
            return Ok(table);
        }
        table.read_header()?;
        Ok(table)
    }

    /// Opens a table without a header, whose columns the user has named: rows are as long as the
    /// list of names, and the separator is the sign that gives the first row that length.
    pub(super) fn open_named(
        file: &str,
        bytes: &'b [u8],
        separator: Option<char>,
        names: &[String],
    ) -> Self {
        let begin = mark_end(bytes);
        let row = first_row(bytes.get(begin..).unwrap_or_default());
        let fits = |separator: &char| {
            let count = row.iter().filter(|byte| char::from(**byte) == *separator).count();
            count + 1 == names.len()
        };
        let separator = separator.or_else(|| ['\t', ';', ','].into_iter().find(fits));
        let mut table = Self::begin_at(file, bytes, begin, separator);
        table.header = names.to_vec();
        table
    }

    /// Opens a table that was made of a file of another shape.
    pub(super) fn open_rows(file: &str, rows: &'b Rows) -> Self {
        let mut table = Self::begin_at(file, &rows.csv, 0, Some(','));
        table.header.clone_from(&rows.header);
        table.padded = true;
        table.lines = &rows.lines;
        table
    }

    /// Reads the header, which is the first line that fits: lines of text may come before it, and
    /// it may be a comment. The first line is the header if no line fits.
    pub(super) fn open_fitting(
        file: &str,
        bytes: &'b [u8],
        separator: Option<char>,
        fits: impl Fn(&[String]) -> bool,
    ) -> Result<Self, RecordingError> {
        let first = Self::open(file, bytes, separator, &[]);
        if first.as_ref().is_ok_and(|table| fits(&table.header)) {
            return first;
        }
        let lines = candidates(bytes);
        // A comment may show what a header looks like, so that a line of the table goes first.
        let plain = lines.iter().filter(|line| !line.is_comment);
        for line in plain.chain(lines.iter().filter(|line| line.is_comment)) {
            let text = bytes.get(line.begin..line.end).unwrap_or_default();
            let Ok(header) = Self::open(file, text, separator, &[]) else { continue };
            if !fits(&header.header) {
                continue;
            }
            let end = bytes.get(line.end..).and_then(|rest| rest.iter().position(|b| *b == b'\n'));
            let next = line.end + end.map_or(0, |end| end + 1);
            let mut table = Self::begin_at(file, bytes, next, None);
            table.separator = header.separator;
            table.header = header.header;
            table.header_line = line.number;
            let before = |other: &&Candidate| !other.is_comment && other.number < line.number;
            table.preamble = lines.iter().filter(before).count() as u64;
            table.restart(next);
            return Ok(table);
        }
        first
    }

    /// A table without a header, from a byte on.
    fn begin_at(file: &str, bytes: &'b [u8], begin: usize, separator: Option<char>) -> Self {
        let given = separator.and_then(|separator| u8::try_from(separator).ok());
        let rest = bytes.get(begin..).unwrap_or_default();
        let separator = given.unwrap_or_else(|| most_frequent_separator(rest));
        Self {
            file: file.into(),
            bytes,
            reader: reader(rest, separator),
            begin,
            separator,
            preamble: 0,
            open_ended: false,
            padded: false,
            lines: &[],
            header: Vec::new(),
            header_line: 1,
            counted: (0, 0),
            record: ByteRecord::new(),
        }
    }

    fn read_header(&mut self) -> Result<(), RecordingError> {
        let nothing = RecordingError::Empty { file: self.file.to_string() };
        let Some((line, cells)) = self.advance()? else { return Err(nothing) };
        self.header_line = line;
        self.header = cells.iter().map(str::to_owned).collect();
        if self.header.iter().all(String::is_empty) { Err(nothing) } else { Ok(()) }
    }

    /// Reads on from a byte.
    fn restart(&mut self, begin: usize) {
        self.begin = begin;
        self.reader = reader(self.bytes.get(begin..).unwrap_or_default(), self.separator);
    }

    /// The number of lines before the header that are neither empty nor comments.
    pub(super) fn preamble(&self) -> u64 {
        self.preamble
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

    /// Returns the index of a column; `None` if it is missing.
    pub(super) fn index_of(&self, column: &str) -> Result<Option<usize>, RecordingError> {
        let mut found = self.header.iter().enumerate().filter(|(_, name)| *name == column);
        let first = found.next().map(|(index, _)| index);
        if found.next().is_some() {
            return Err(RecordingError::DuplicateColumn {
                file: self.file.to_string(),
                line: self.header_line,
                column: column.to_owned(),
            });
        }
        Ok(first)
    }

    /// Returns the indices of columns; `None` if one of them is missing.
    pub(super) fn indices_of(
        &self,
        columns: &[String],
    ) -> Result<Option<Vec<usize>>, RecordingError> {
        columns.iter().map(|column| self.index_of(column)).collect()
    }

    /// Returns the indices of columns that a format needs.
    pub(super) fn require(
        &self,
        columns: &[String],
        format: &str,
    ) -> Result<Vec<usize>, RecordingError> {
        columns.iter().map(|column| self.require_one(column, format)).collect()
    }

    /// Returns the index of a column that a format needs.
    pub(super) fn require_one(&self, column: &str, format: &str) -> Result<usize, RecordingError> {
        self.index_of(column)?.ok_or_else(|| self.missing_column(column, format))
    }

    /// The error that a column is missing that a format needs.
    pub(super) fn missing_column(&self, column: &str, format: &str) -> RecordingError {
        RecordingError::MissingColumn {
            file: self.file.to_string(),
            line: self.header_line,
            column: column.to_owned(),
            format: format.to_owned(),
            meant: near_miss(column, self.header.iter().map(String::as_str)).map(str::to_owned),
        }
    }

    /// The next row, as long as the header; cells without a name may be missing, if empty.
    pub(super) fn next(&mut self) -> Result<Option<Row>, RecordingError> {
        let Some((line, cells)) = self.advance()? else { return Ok(None) };
        let named =
            self.header.iter().rposition(|name| !name.is_empty()).map_or(0, |last| last + 1);
        let is_short = cells.len() < named && !self.padded;
        let is_long = cells.iter().skip(self.header.len()).any(|cell| !cell.is_empty());
        if is_short || (is_long && !self.open_ended) {
            self.undo_unclosed_quote();
            let last = cells.len().saturating_sub(1);
            return Err(RecordingError::FieldCount {
                file: self.file.to_string(),
                line,
                expected: self.header.len(),
                found: cells.len(),
                column: self.column_name(last),
                value: shown(cells.get(last).unwrap_or_default()),
            });
        }
        if let Some(index) = self.unclosed(&cells) {
            self.undo_unclosed_quote();
            return Err(RecordingError::Field {
                file: self.file.to_string(),
                line,
                column: self.column_name(index),
                value: shown(cells.get(index).unwrap_or_default()),
                problem: FieldProblem::Unclosed,
            });
        }
        Ok(Some(Row { file: Arc::clone(&self.file), line, separator: self.separator, cells }))
    }

    /// Takes back the memory of a row for the next one.
    pub(super) fn recycle(&mut self, row: Row) {
        self.record = row.cells.into_byte_record();
    }

    /// The cell that holds a whole row of the table: its quote is not closed.
    fn unclosed(&self, cells: &StringRecord) -> Option<usize> {
        let between = self.header.len().checked_sub(1).filter(|between| *between > 0)?;
        let separator = char::from(self.separator);
        let is_row = |line: &str| line.matches(separator).count() == between;
        cells.iter().position(|cell| cell.contains('\n') && cell.lines().skip(1).any(is_row))
    }

    /// Reads on from the line behind the one in which the last row began: an unclosed quote in it
    /// makes one row of all that follows.
    fn undo_unclosed_quote(&mut self) {
        let row = self.bytes.get(self.counted.0..).unwrap_or_default();
        let end = usize::try_from(self.reader.position().byte()).unwrap_or(usize::MAX);
        let Some(line) = row.iter().position(|byte| *byte == b'\n') else { return };
        let next = self.counted.0 + line + 1;
        if next < self.begin.saturating_add(end) {
            self.restart(next);
        }
    }

    fn advance(&mut self) -> Result<Option<(u64, StringRecord)>, RecordingError> {
        let more = self.reader.read_byte_record(&mut self.record).map_err(|error| {
            RecordingError::Read { file: self.file.to_string(), source: error.into() }
        })?;
        if !more {
            return Ok(None);
        }
        let start = self.record.position().map_or(0, csv::Position::byte);
        let start = usize::try_from(start).unwrap_or(usize::MAX);
        let line = self.line_at(self.begin.saturating_add(start));
        let number = usize::try_from(line).unwrap_or(usize::MAX);
        let line = number.checked_sub(1).and_then(|at| self.lines.get(at)).copied().unwrap_or(line);
        let has_spaces = |cell: &[u8]| match cell {
            [first, .., last] => first.is_ascii_whitespace() || last.is_ascii_whitespace(),
            [only] => only.is_ascii_whitespace(),
            [] => false,
        };
        // Trimming copies the row.
        if self.record.iter().any(has_spaces) {
            self.record.trim();
        }
        match StringRecord::from_byte_record(std::mem::take(&mut self.record)) {
            Ok(cells) => Ok(Some((line, cells))),
            Err(error) => {
                let index = error.utf8_error().field();
                let record = error.into_byte_record();
                let cell = record.get(index).unwrap_or_default();
                Err(RecordingError::NotUtf8 {
                    file: self.file.to_string(),
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
        lines += passed.iter().filter(|byte| **byte == b'\n').count() as u64;
        // Most files have none.
        if passed.contains(&b'\r') {
            let returns = passed.iter().enumerate().filter(|(_, byte)| **byte == b'\r');
            let alone = |(offset, _): &(usize, &u8)| {
                rest(self.counted.0 + offset + 1).first() != Some(&b'\n')
            };
            lines += returns.filter(alone).count() as u64;
        }
        self.counted = (at.max(self.counted.0), lines);
        lines + 1
    }

    fn column_name(&self, index: usize) -> String {
        self.header.get(index).cloned().unwrap_or_else(|| format!("column {}", index + 1))
    }
}

impl Row {
    /// The name of the row's file.
    pub(super) fn file(&self) -> &str {
        &self.file
    }

    /// The row's line in its file, from 1.
    pub(super) fn line(&self) -> u64 {
        self.line
    }

    /// A cell, without the spaces around it.
    pub(super) fn cell(&self, index: usize) -> &str {
        self.cells.get(index).unwrap_or_default()
    }

    /// The number in a text of this row. A comma is a decimal point where it does not separate
    /// cells, unless the row has decimal points as well. Between commas it stands in quotes, where
    /// three digits behind it may be thousands.
    pub(super) fn parse(&self, text: &str) -> Option<f64> {
        if let Ok(number) = text.parse() {
            return Some(number);
        }
        number(text, |text| {
            let behind = text.rsplit(',').next().unwrap_or_default();
            let may_be_thousands = self.separator == b',' && behind.len() == 3;
            !may_be_thousands && !self.cells.iter().any(|cell| is_decimal(cell, '.'))
        })
    }

    /// All cells, without the spaces around them.
    pub(super) fn cells(&self) -> &StringRecord {
        &self.cells
    }

    /// The cells from one on.
    pub(super) fn cells_from(&self, index: usize) -> impl Iterator<Item = &str> {
        self.cells.iter().skip(index)
    }

    /// The cells of several columns as one; `None` if one of them is empty.
    pub(super) fn joined(&self, indices: &[usize], between: &str) -> Option<Cow<'_, str>> {
        if let [index] = indices {
            let cell = self.cell(*index);
            return (!cell.is_empty()).then_some(Cow::Borrowed(cell));
        }
        let cells: Vec<&str> = indices.iter().map(|index| self.cell(*index)).collect();
        let whole = cells.iter().all(|cell| !cell.is_empty());
        whole.then(|| Cow::Owned(cells.join(between)))
    }

    /// Returns the value of a column of ours, as its source reads it; numbers are not yet scaled.
    pub(super) fn value(
        &self,
        indices: &[usize],
        source: &Source,
    ) -> Result<Option<Cow<'_, str>>, RecordingError> {
        let Some(cell) = self.joined(indices, &source.between) else { return Ok(None) };
        if source.missing.iter().any(|value| value.is(&cell)) {
            return Ok(None);
        }
        if let Some(part) = source.part {
            let wrong = |problem| self.wrong(&source.label(), &cell, problem);
            let pair = coordinate::pair(&cell).map_err(wrong)?;
            return Ok(pair.get(part).map(|half| Cow::Owned(half.clone().into_owned())));
        }
        if source.lookup.is_empty() {
            return Ok(Some(cell));
        }
        match source.lookup.get(cell.as_ref()) {
            Some(value) => Ok(Some(Cow::Owned(value.to_string()))),
            None => Err(self.wrong(&source.label(), &cell, FieldProblem::NotInLookup)),
        }
    }

    /// The error that a cell is wrong.
    pub(super) fn wrong(&self, column: &str, cell: &str, problem: FieldProblem) -> RecordingError {
        RecordingError::Field {
            file: self.file.to_string(),
            line: self.line,
            column: column.to_owned(),
            value: shown(cell),
            problem,
        }
    }
}

fn reader(bytes: &[u8], separator: u8) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .from_reader(bytes)
}

/// The lines behind the first one in which a header may be, and comments without their sign.
fn candidates(bytes: &[u8]) -> Vec<Candidate> {
    let mut lines = Vec::new();
    let mut begin = mark_end(bytes);
    for number in (1..).take(PREAMBLE_LINES) {
        let Some(rest) = bytes.get(begin..).filter(|rest| !rest.is_empty()) else { break };
        let length = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        let line = rest.get(..length).unwrap_or_default();
        let signs = line.iter().take_while(|byte| matches!(byte, b'#' | b' ')).count();
        let is_comment = line.starts_with(b"#");
        if line.iter().any(|byte| !byte.is_ascii_whitespace()) {
            let skipped = if is_comment { signs } else { 0 };
            let candidate =
                Candidate { begin: begin + skipped, end: begin + length, number, is_comment };
            lines.push(candidate);
        }
        begin += length + 1;
    }
    lines
}

/// The first byte behind the byte order mark.
fn mark_end(bytes: &[u8]) -> usize {
    if bytes.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 }
}

/// The first line that is neither empty nor a comment.
fn first_row(bytes: &[u8]) -> &[u8] {
    let mut lines = bytes.split(|byte| matches!(byte, b'\n' | b'\r'));
    lines.find(|line| !line.is_empty() && !line.starts_with(b"#")).unwrap_or_default()
}

/// A table whose cells are separated by spaces alone, with tabs in place of them; `None` if its
/// first row has another separator, or more or fewer words than `columns`.
pub(super) fn spaces_as_tabs(bytes: &[u8], columns: usize) -> Option<Vec<u8>> {
    let row = first_row(bytes.get(mark_end(bytes)..)?);
    let has_separator = row.iter().any(|byte| matches!(byte, b'\t' | b';'));
    let is_word = |word: &&[u8]| !word.is_empty();
    let words = row.split(|byte| *byte == b' ').filter(is_word).count();
    // A comma within a row of the right number of words is a decimal one.
    if has_separator || columns < 2 || words != columns || row.contains(&b'"') {
        return None;
    }
    if row.split(|byte| *byte == b' ').any(|word| word.ends_with(b",")) {
        return None;
    }
    Some(tabbed(bytes))
}

/// A table below a header that fits, whose names and cells are separated by spaces alone, with tabs
/// in place of them; `None` for any other, and if the first row has more or fewer words.
pub(super) fn spaced_header(bytes: &[u8], fits: impl Fn(&[String]) -> bool) -> Option<Vec<u8>> {
    let text = bytes.get(mark_end(bytes)..)?;
    let mut lines = text.split(|byte| *byte == b'\n').filter(|line| !line.is_empty());
    let header = lines.next()?;
    let row = lines.find(|line| !line.starts_with(b"#"))?;
    let is_spaced = |line: &[u8]| !line.iter().any(|byte| b"\t;\"".contains(byte));
    if !is_spaced(header) || header.contains(&b',') || !is_spaced(row) {
        return None;
    }
    let words = |line: &[u8]| -> Option<Vec<String>> {
        let line = std::str::from_utf8(line).ok()?.trim_start_matches(['#', ' ']);
        Some(line.split_whitespace().map(str::to_owned).collect())
    };
    let names = words(header)?;
    let has_commas = row.split(|byte| *byte == b' ').any(|word| word.ends_with(b","));
    if names.len() < 2 || has_commas || words(row)?.len() != names.len() || !fits(&names) {
        return None;
    }
    // The sign of a comment is no name.
    let signs = text.iter().take_while(|byte| matches!(byte, b'#' | b' ')).count();
    let sign = if text.starts_with(b"#") { &b"#"[..] } else { &b""[..] };
    Some([sign, &tabbed(text.get(signs..)?)].concat())
}

/// Lines with tabs in place of spaces.
fn tabbed(bytes: &[u8]) -> Vec<u8> {
    let is_word = |word: &&[u8]| !word.is_empty();
    let mut tabs = Vec::with_capacity(bytes.len());
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        let mut words = line.split(|byte| *byte == b' ').filter(is_word);
        tabs.extend(words.next().unwrap_or_default());
        for word in words {
            if !matches!(word, b"\n" | b"\r\n") {
                tabs.push(b'\t');
            }
            tabs.extend(word);
        }
    }
    tabs
}

/// The most frequent of comma, semicolon and tab in the header; a comma without any.
fn most_frequent_separator(bytes: &[u8]) -> u8 {
    let header = first_row(bytes);
    let mut counts = [(b'\t', 0_usize), (b';', 0), (b',', 0)];
    let mut quoted = false;
    // Among other signs a comma between digits is a decimal one.
    let has_others = header.iter().any(|byte| matches!(byte, b'\t' | b';'));
    let is_digit = |byte: Option<&u8>| byte.is_some_and(u8::is_ascii_digit);
    for (index, byte) in header.iter().enumerate() {
        quoted ^= *byte == b'"';
        let before = index.checked_sub(1).and_then(|before| header.get(before));
        let between = is_digit(before) && is_digit(header.get(index + 1));
        let is_point = *byte == b',' && has_others && between;
        let counted = |separator: u8| separator == *byte && !quoted && !is_point;
        for (_, count) in counts.iter_mut().filter(|(separator, _)| counted(*separator)) {
            *count += 1;
        }
    }
    // Of equals the last one wins.
    counts.into_iter().max_by_key(|(_, count)| *count).map_or(b',', |(separator, _)| separator)
}

/// A cell as messages show it.
pub(super) fn shown(cell: &str) -> String {
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
        let mut table = Table::open("t.csv", text.as_bytes(), None, &[]).expect("a header");
        let mut lines = vec![(table.header_line(), table.header().join("|"))];
        while let Some(row) = table.next().expect("whole rows") {
            lines.push((row.line(), format!("{}|{}", row.cell(0), row.cell(1))));
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
    fn separators_are_found_by_the_header() {
        for (text, header) in [
            ("a;b,c;d\n", "a|b,c|d"),
            ("# x;y;z\na\tb\tc;d\n", "a|b|c;d"),
            ("\"a;b;c\",d,e\n", "a;b;c|d|e"),
            ("a,b;c\n", "a|b;c"),
            ("a\n", "a"),
        ] {
            let table = Table::open("t.csv", text.as_bytes(), None, &[]).expect("a header");
            assert_eq!(table.header().join("|"), header);
        }
        let stated = Table::open("t.csv", b"a,b|c,d\n", Some('|'), &[]).expect("a header");
        assert_eq!(stated.header(), ["a,b", "c,d"]);
    }

    #[test]
    fn broken_files_are_refused() {
        let open = |bytes: &'static [u8]| Table::open("t.csv", bytes, None, &[]).map(|_| ());
        assert!(matches!(open(b""), Err(RecordingError::Empty { .. })));
        assert!(matches!(open(b"# nothing\n\n"), Err(RecordingError::Empty { .. })));
        assert!(matches!(open(b" , \n"), Err(RecordingError::Empty { .. })));
        let message = open(b"a,\xff\n1,2").expect_err("not text").to_string();
        assert!(message.contains("t.csv, line 1, column 2"), "{message}");
        let mut table = Table::open("t.csv", b"a,b\n1,2\n1,2,3\n", None, &[]).expect("a header");
        assert!(table.next().is_ok());
        let message = table.next().map(|_| ()).expect_err("three").to_string();
        for part in ["t.csv, line 3", "3 fields instead of 2", "column 3", "\"3\""] {
            assert!(message.contains(part), "{message}");
        }
    }
}
