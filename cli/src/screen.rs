//! Width of the screen for what is printed.

use std::env;

use textwrap::{Options, WordSeparator, WordSplitter};

/// Width in columns if it is unknown: in a file or a pipe.
const UNKNOWN: u16 = 100;

/// Minimum width in columns; nothing is fitted to less.
const LEAST: u16 = 40;

/// Maximum width of a result in columns: `COLUMNS` if that is set, else the terminal's width.
pub fn width() -> usize {
    let given = env::var("COLUMNS").ok();
    usize::from(given.as_deref().and_then(columns).or_else(terminal).unwrap_or(UNKNOWN).max(LEAST))
}

/// Returns the columns of the terminal on standard output, if it is one.
#[cfg(not(target_family = "wasm"))]
fn terminal() -> Option<u16> {
    terminal_size::terminal_size_of(std::io::stdout()).map(|(width, _)| width.0)
}

/// Returns [`None`]: WebAssembly has no terminal.
#[cfg(target_family = "wasm")]
fn terminal() -> Option<u16> {
    None
}

/// The number of columns in a text.
fn columns(text: &str) -> Option<u16> {
    text.trim().parse().ok().filter(|columns| *columns > 0)
}

/// Wraps each line that is longer than `width` between words, its further lines indented as it is.
/// Rows of Markdown tables stay in one line.
pub fn wrapped(text: &str, width: usize) -> String {
    let line = |line: &str| {
        if line.starts_with('|') || textwrap::core::display_width(line) <= width {
            return line.to_owned();
        }
        let words = line.trim_start();
        let indent = &line[..line.len() - words.len()];
        indented(words, width, indent, indent)
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// A paragraph of at most `width` columns that begins with `first` and goes on after `rest`; no
/// word is torn.
pub fn indented(text: &str, width: usize, first: &str, rest: &str) -> String {
    let options = Options::new(width)
        .initial_indent(first)
        .subsequent_indent(rest)
        .break_words(false)
        .word_separator(WordSeparator::AsciiSpace)
        .word_splitter(WordSplitter::NoHyphenation);
    textwrap::fill(text, options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_a_number_above_zero() {
        assert_eq!(columns(" 80\n"), Some(80));
        for text in ["", "0", "-3", "wide"] {
            assert_eq!(columns(text), None, "{text}");
        }
    }

    #[test]
    fn lines_are_wrapped_between_words() {
        let text = "one two three\n  four five-six seven\n| a table | stays |\n┄┄";
        let wrapped = wrapped(text, 11);
        assert_eq!(wrapped, "one two\nthree\n  four\n  five-six\n  seven\n| a table | stays |\n┄┄");
        assert_eq!(super::wrapped("unbreakable/path/to/it", 5), "unbreakable/path/to/it");
    }
}
