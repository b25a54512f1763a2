//! Words and signs of a Rust file, without comments, literals and tests.

/// Returns the words and signs of a file. Comments, literals and items under `#[cfg(test)]` are
/// left out. A string that is a path, as in `#[serde(try_from = "super::Parts")]`, counts as code.
pub(crate) fn tokens(text: &str) -> Vec<&str> {
    without_tests(&split(text))
}

fn split(text: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = if first.is_whitespace() {
            first.len_utf8()
        } else if let Some(length) = comment(rest) {
            length
        } else if let Some(length) = string(rest) {
            let inside = rest[..length].trim_matches('"');
            if ["crate::", "self::", "super::"].iter().any(|start| inside.starts_with(start)) {
                tokens.extend(split(inside));
            }
            length
        } else if let Some(length) = character_or_lifetime(rest) {
            length
        } else {
            let length = match word(rest) {
                0 if rest.starts_with("::") || rest.starts_with("..") => 2,
                0 => first.len_utf8(),
                letters => letters,
            };
            tokens.push(&rest[..length]);
            length
        };
        rest = &rest[length..];
    }
    tokens
}

/// Returns the length of the word at the start of a text; zero if a sign stands there.
fn word(text: &str) -> usize {
    text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len())
}

fn comment(text: &str) -> Option<usize> {
    if text.starts_with("//") {
        return Some(text.find('\n').unwrap_or(text.len()));
    }
    if !text.starts_with("/*") {
        return None;
    }
    let mut at = 2;
    let mut depth = 1;
    while depth > 0 && at < text.len() {
        if text[at..].starts_with("/*") {
            depth += 1;
            at += 2;
        } else if text[at..].starts_with("*/") {
            depth -= 1;
            at += 2;
        } else {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    Some(at)
}

/// Returns the length of the string at the start of a text, with its prefix.
fn string(text: &str) -> Option<usize> {
    let prefix = text.find(|c| !matches!(c, 'b' | 'c' | 'r'))?;
    let raw = text[..prefix].ends_with('r');
    let marks = text[prefix..].find(|c| c != '#')?;
    let open = prefix + marks + 1;
    if !text[prefix + marks..].starts_with('"') || (marks > 0 && !raw) {
        return None;
    }
    if raw {
        let close = format!("\"{}", "#".repeat(marks));
        return Some(text[open..].find(&close).map_or(text.len(), |at| open + at + close.len()));
    }
    let mut escaped = false;
    for (at, letter) in text[open..].char_indices() {
        match letter {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return Some(open + at + 1),
            _ => {}
        }
    }
    Some(text.len())
}

fn character_or_lifetime(text: &str) -> Option<usize> {
    let inside = text.strip_prefix('\'').or_else(|| text.strip_prefix("b'"))?;
    let open = text.len() - inside.len();
    let first = inside.chars().next()?;
    if first == '\\' {
        // The sign after the backslash may itself be a quote.
        return Some(open + 2 + inside.get(2..)?.find('\'')? + 1);
    }
    if inside[first.len_utf8()..].starts_with('\'') {
        return Some(open + first.len_utf8() + 1);
    }
    Some(open + word(inside))
}

fn without_tests<'a>(tokens: &[&'a str]) -> Vec<&'a str> {
    const TEST: [&str; 6] = ["#", "[", "cfg", "(", "test", ")"];
    const TEST_AND_MORE: [&str; 8] = ["#", "[", "cfg", "(", "all", "(", "test", ","];
    let mut kept = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        if tokens[at..].starts_with(&TEST) || tokens[at..].starts_with(&TEST_AND_MORE) {
            at = end_of_item(tokens, at);
        } else {
            kept.push(tokens[at]);
            at += 1;
        }
    }
    kept
}

/// Returns the index behind the item whose attributes begin at an index.
fn end_of_item(tokens: &[&str], start: usize) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate().skip(start) {
        match *token {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 && matches!(*token, ";" | "}") {
            return at + 1;
        }
    }
    tokens.len()
}
