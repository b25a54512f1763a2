use std::fmt;

use comfy_table::{
    CellAlignment, ColumnConstraint, ContentArrangement, LineStyle, TableStyle, Width::Fixed,
};
use textwrap::core::display_width;

use crate::screen;

/// The cell of an absent value.
const NOTHING: &str = "-";

/// Lines about the table and under its header.
const STYLE: TableStyle = TableStyle::new()
    .top_border(LineStyle::none().fill('─').junction('─'))
    .header_separator(LineStyle::none().fill('─').junction('─'))
    .bottom_border(LineStyle::none().fill('─').junction('─'));

/// The spaces about the cells of a column.
const PADDING: usize = 2;

/// Width of a column besides its cells: the spaces about them, and one to the next column.
const BESIDES: usize = PADDING + 1;

/// A table that fits the width of the screen: its headers wrap between words, and what has no room
/// beside the names of the rows is a second table, or each row is a block of lines.
#[derive(Debug)]
pub struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
    /// Number of columns, from the first on, that name a row.
    names: usize,
    kind: Kind,
}

/// Kind of the cells besides names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Values, to the right.
    Values,
    /// Texts, which may be wrapped.
    Texts,
}

/// A table of these columns; the first holds names, the others values.
pub fn table(columns: &[&str]) -> Table {
    Table::new(columns, Kind::Values)
}

/// A table of texts; the first column holds names.
pub fn list(columns: &[&str]) -> Table {
    Table::new(columns, Kind::Texts)
}

impl Table {
    fn new(columns: &[&str], kind: Kind) -> Self {
        let columns = columns.iter().map(|&column| column.to_owned()).collect();
        Self { columns, rows: Vec::new(), names: 1, kind }
    }

    /// Sets the number of columns that name a row; they come again where a table is divided.
    pub fn named_by(mut self, names: usize) -> Self {
        self.names = names;
        self
    }

    pub fn add_row<C: Into<String>>(&mut self, row: impl IntoIterator<Item = C>) {
        self.rows.push(row.into_iter().map(Into::into).collect());
    }

    /// The table in at most `width` columns, as far as its words allow it.
    fn fitted(&self, width: usize) -> String {
        let columns: Vec<usize> = (0..self.columns.len()).collect();
        if let Some(widths) = self.widths(&columns, width) {
            return self.drawn(&columns, &widths);
        }
        match self.groups(width) {
            Some(groups) => {
                let part = |columns: &Vec<usize>| {
                    let widths = self.widths(columns, width).unwrap_or_else(|| self.least(columns));
                    self.drawn(columns, &widths)
                };
                groups.iter().map(part).collect::<Vec<_>>().join("\n")
            }
            None => self.blocks(width),
        }
    }

    fn cells(&self, column: usize) -> impl Iterator<Item = &str> {
        self.rows.iter().filter_map(move |row| row.get(column)).map(String::as_str)
    }

    fn header(&self, column: usize) -> &str {
        self.columns.get(column).map_or("", String::as_str)
    }

    /// Returns true if the cells of a column may be wrapped.
    fn wraps(&self, column: usize) -> bool {
        self.kind == Kind::Texts && column >= self.names
    }

    /// The widths at which no cell and no header is wrapped.
    fn natural(&self, columns: &[usize]) -> Vec<usize> {
        let natural = |column: &usize| {
            let cells = self.cells(*column).map(display_width).max().unwrap_or(0);
            cells.max(display_width(self.header(*column)))
        };
        columns.iter().map(natural).collect()
    }

    /// The least widths at which no word is torn.
    fn least(&self, columns: &[usize]) -> Vec<usize> {
        let least = |column: &usize| {
            let of = if self.wraps(*column) { longest_word } else { display_width };
            let cells = self.cells(*column).map(of).max().unwrap_or(0);
            cells.max(longest_word(self.header(*column)))
        };
        columns.iter().map(least).collect()
    }

    /// The widths of some columns that fit side by side, if they do and are not too narrow to read.
    fn widths(&self, columns: &[usize], width: usize) -> Option<Vec<usize>> {
        /// Maximum number of lines in a cell that people still read.
        const MOST_LINES: usize = 8;

        let natural = self.natural(columns);
        let mut widths = self.least(columns);
        let mut spare = width.checked_sub(total(&widths))?;
        // Who has the most lines gets the next column.
        while spare > 0 {
            let lines = |index: &usize| natural[*index] * 1000 / widths[*index].max(1);
            let narrow = (0..widths.len()).filter(|index| widths[*index] < natural[*index]);
            let Some(next) = narrow.max_by_key(lines) else { break };
            widths[next] += 1;
            spare -= 1;
        }
        let lines = natural.iter().zip(&widths).map(|(natural, width)| natural / (*width).max(1));
        (lines.max() <= Some(MOST_LINES)).then_some(widths)
    }

    /// The columns of each table where one has no room for all: the names, and as many others as
    /// fit, evenly. [`None`] where the names leave no room, or texts are as good in blocks.
    fn groups(&self, width: usize) -> Option<Vec<Vec<usize>>> {
        if self.kind == Kind::Texts {
            return None;
        }
        let names: Vec<usize> = (0..self.names).collect();
        let taken = total(&self.least(&names));
        let others: Vec<usize> = (self.names..self.columns.len()).collect();
        let least = self.least(&others);
        let divided = |room: usize| {
            let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
            for (column, least) in others.iter().zip(&least) {
                let needed = least + BESIDES;
                match groups.last_mut() {
                    Some((used, group)) if *used + needed <= room => {
                        *used += needed;
                        group.push(*column);
                    }
                    _ => groups.push((needed, vec![*column])),
                }
            }
            groups
        };
        let widest = least.iter().max()? + BESIDES;
        let room = width.checked_sub(taken).filter(|room| widest <= *room)?;
        let count = divided(room).len();
        let even = (widest..=room).find(|room| divided(*room).len() == count)?;
        let with_names = |(_, group): (usize, Vec<usize>)| [names.as_slice(), &group].concat();
        Some(divided(even).into_iter().map(with_names).collect())
    }

    /// Some columns side by side.
    fn drawn(&self, columns: &[usize], widths: &[usize]) -> String {
        let mut table = comfy_table::Table::new();
        table
            .load_style(STYLE)
            .set_content_arrangement(ContentArrangement::Dynamic)
            .set_width(u16::try_from(total(widths)).unwrap_or(u16::MAX))
            .set_header(columns.iter().map(|column| self.header(*column)));
        for row in &self.rows {
            let cell = |column: &usize| row.get(*column).map_or("", String::as_str);
            table.add_row(columns.iter().map(cell));
        }
        for ((column, width), shown) in columns.iter().zip(widths).zip(table.column_iter_mut()) {
            let width = u16::try_from(width + PADDING).unwrap_or(u16::MAX);
            shown.set_constraint(ColumnConstraint::Absolute(Fixed(width)));
            if *column >= self.names && self.kind == Kind::Values {
                shown.set_cell_alignment(CellAlignment::Right);
            }
        }
        table.to_string()
    }

    /// Each row as a block: its names, and a line or more for each other cell that holds anything.
    fn blocks(&self, width: usize) -> String {
        let mut lines = Vec::new();
        for row in &self.rows {
            let names =
                row.iter().take(self.names).enumerate().filter(|(_, name)| !name.is_empty());
            // One name stands for itself, several with what they are.
            let named = names.map(|(column, name)| match self.names {
                1 => name.clone(),
                _ => format!("{}: {name}", self.header(column)),
            });
            let named: Vec<String> = named.collect();
            if !named.is_empty() {
                lines.push(screen::indented(&named.join(", "), width, "", "  "));
            }
            for (column, cell) in row.iter().enumerate().skip(self.names) {
                if cell.is_empty() || cell == NOTHING {
                    continue;
                }
                let text = match self.header(column) {
                    "" => cell.clone(),
                    header => format!("{header}: {cell}"),
                };
                lines.push(screen::indented(&text, width, "  ", "      "));
            }
        }
        lines.join("\n")
    }
}

/// The width of columns side by side.
fn total(widths: &[usize]) -> usize {
    widths.iter().map(|width| width + BESIDES).sum()
}

fn longest_word(text: &str) -> usize {
    text.split_whitespace().map(display_width).max().unwrap_or(0)
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.fitted(screen::width()))
    }
}

/// A table in Markdown, its columns as wide as what they hold; the first `names` of them hold
/// names, the others values to the right.
pub fn markdown(columns: &[&str], names: usize, rows: &[Vec<String>]) -> String {
    let cells = |index: usize| rows.iter().filter_map(move |row| row.get(index));
    let width = |(index, column): (usize, &&str)| {
        cells(index).map(|cell| cell.chars().count()).max().unwrap_or(0).max(column.chars().count())
    };
    let widths: Vec<usize> = columns.iter().enumerate().map(width).collect();
    let line = |row: Vec<&str>| {
        let cell = |(index, (cell, width)): (usize, (&&str, &usize))| {
            if index < names { format!(" {cell:<width$} |") } else { format!(" {cell:>width$} |") }
        };
        let cells: String = row.iter().zip(&widths).enumerate().map(cell).collect();
        format!("|{cells}")
    };
    let rule = widths.iter().enumerate().map(|(index, width)| {
        let dashes = "-".repeat(*width);
        if index < names { format!(" {dashes} |") } else { format!(" {dashes}:|") }
    });
    let rule = format!("|{}", rule.collect::<String>());
    let rows = rows.iter().map(|row| line(row.iter().map(String::as_str).collect()));
    [line(columns.to_vec()), rule].into_iter().chain(rows).collect::<Vec<_>>().join("\n")
}

/// A number with this many decimals; a dash if it is `None` or not finite.
pub fn number(value: impl Into<Option<f64>>, decimals: usize) -> String {
    match value.into().filter(|v| v.is_finite()) {
        Some(value) => format!("{value:.decimals$}"),
        None => NOTHING.to_owned(),
    }
}

/// A text; a dash for `None`.
pub fn text(value: Option<impl ToString>) -> String {
    value.map_or_else(|| NOTHING.to_owned(), |value| value.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_markdown_table() {
        let rows = [["a".to_owned(), "1.5".to_owned()], ["long".to_owned(), "-".to_owned()]];
        let table = markdown(&["name", "m"], 1, &rows.map(Vec::from));
        assert_eq!(table, "| name |   m |\n| ---- | ---:|\n| a    | 1.5 |\n| long |   - |");
    }

    #[test]
    fn no_nan_in_a_table() {
        assert_eq!(number(1.256, 2), "1.26");
        assert_eq!(number(f64::NAN, 2), "-");
        assert_eq!(number(None, 2), "-");
        assert_eq!(text(None::<u32>), "-");
    }

    fn measured() -> Table {
        let mut table = table(&["name", "first value", "second value", "third"]);
        table.add_row(["a", "1.00", "2.00", "3.00 to 4.00"]);
        table.add_row(["a longer one", "-10.00", "20.00", "-"]);
        table
    }

    fn widest(text: &str) -> usize {
        text.lines().map(display_width).max().unwrap_or(0)
    }

    #[test]
    fn a_wide_screen_has_one_table() {
        let text = measured().fitted(80);
        assert_eq!(text.lines().count(), 6, "{text}");
        assert!(text.contains("first value   second value"), "{text}");
    }

    #[test]
    fn headers_wrap_before_a_table_is_divided() {
        let text = measured().fitted(50);
        assert!(widest(&text) <= 50 && text.lines().count() == 7, "{text}");
        assert!(text.contains("3.00 to 4.00"), "no value is wrapped: {text}");
        let text = measured().fitted(40);
        assert!(widest(&text) <= 40, "{text}");
        assert_eq!(text.matches("a longer one").count(), 2, "two tables: {text}");
        for cell in ["1.00", "-10.00", "2.00", "20.00", "3.00 to 4.00", "second", "third"] {
            assert!(text.contains(cell), "{cell} in {text}");
        }
    }

    #[test]
    fn rows_are_blocks_where_their_names_leave_no_room() {
        let text = measured().named_by(3).fitted(40);
        assert!(widest(&text) <= 40, "{text}");
        assert_eq!(
            text,
            "name: a, first value: 1.00, second\n  value: 2.00\n  third: 3.00 to 4.00\n\
             name: a longer one, first value: -10.00,\n  second value: 20.00"
        );
    }

    #[test]
    fn texts_wrap_between_words() {
        let mut list = list(&["what", "remark", "source"]);
        list.add_row(["it", "so many words that no line of a screen holds them", "-"]);
        list.add_row(["more", "few words", "Author 1984"]);
        let text = list.fitted(46);
        assert!(widest(&text) <= 46 && text.contains("Author"), "{text}");
        let words = text.split_whitespace().filter(|word| *word == "screen" || *word == "words");
        assert_eq!(words.count(), 3, "no word is torn: {text}");
        // Without room for columns: blocks, without what is absent.
        list.add_row(["third", "an-unbreakable-word-of-thirty-six-letters", "none"]);
        let text = list.fitted(50);
        assert!(text.starts_with("it\n  remark: so many words"), "{text}");
        assert!(!text.contains("source: -"), "{text}");
    }
}
