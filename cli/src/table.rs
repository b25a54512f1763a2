use comfy_table::{
    CellAlignment, ColumnConstraint, ContentArrangement, LineStyle, Table, TableStyle,
};

/// The cell of an absent value.
const NOTHING: &str = "-";

/// Lines about the table and under its header.
const STYLE: TableStyle = TableStyle::new()
    .top_border(LineStyle::none().fill('─').junction('─'))
    .header_separator(LineStyle::none().fill('─').junction('─'))
    .bottom_border(LineStyle::none().fill('─').junction('─'));

/// How wide a table of texts may be.
pub(crate) const TEXT_WIDTH: u16 = 100;

/// A table of these columns; the first holds names, the others values to the right.
pub(crate) fn table(columns: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(STYLE)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(columns);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// A table of texts; long ones are wrapped.
pub(crate) fn list(columns: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(STYLE)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_width(TEXT_WIDTH)
        .set_header(columns);
    table
}

/// A table of what has a name: the first column holds the names, which are never wrapped.
pub(crate) fn catalogue(columns: &[&str], width: u16) -> Table {
    let mut table = list(columns);
    table.set_width(width);
    if let Some(names) = table.column_mut(0) {
        names.set_constraint(ColumnConstraint::ContentWidth);
    }
    table
}

/// A table in Markdown, its columns as wide as what they hold; the first `names` of them hold
/// names, the others values to the right.
pub(crate) fn markdown(columns: &[&str], names: usize, rows: &[Vec<String>]) -> String {
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

/// A number with this many decimals; a dash where there is none, or it is not finite.
pub(crate) fn number(value: impl Into<Option<f64>>, decimals: usize) -> String {
    match value.into().filter(|v| v.is_finite()) {
        Some(value) => format!("{value:.decimals$}"),
        None => NOTHING.to_owned(),
    }
}

/// A text; a dash where there is none.
pub(crate) fn text(value: Option<impl ToString>) -> String {
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
}
