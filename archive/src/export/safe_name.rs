use std::collections::HashSet;

/// Maximum length of a name before the number that makes it unique, in bytes.
const MOST_BYTES: usize = 48;

/// Separator of names in an identifier: no safe name holds it, so that no two lists of names have
/// one identifier.
const SEPARATOR: &str = "__";

/// Returns a name of ASCII letters, digits, `-` and single `_`, as Home Assistant's identifiers and
/// MQTT's topics allow.
///
/// A name that is changed in more than its spaces has the checksum of its own letters behind it:
/// two names stay two, whatever other names there are.
pub(super) fn safe(name: &str) -> String {
    let mut safe = String::new();
    for letter in name.chars() {
        match letter {
            'a'..='z' | 'A'..='Z' | '0'..='9' | '-' => safe.push(letter),
            'ä' => safe.push_str("ae"),
            'ö' => safe.push_str("oe"),
            'ü' => safe.push_str("ue"),
            'Ä' => safe.push_str("Ae"),
            'Ö' => safe.push_str("Oe"),
            'Ü' => safe.push_str("Ue"),
            'ß' => safe.push_str("ss"),
            _ if safe.ends_with('_') || safe.is_empty() => {}
            _ => safe.push('_'),
        }
    }
    safe.truncate(MOST_BYTES);
    let safe = safe.trim_end_matches('_');
    let checksum = checksum(name);
    match safe {
        "" => format!("{checksum:08x}"),
        _ if name.replace(' ', "_") == safe => safe.to_owned(),
        _ => format!("{safe}_{checksum:08x}"),
    }
}

/// Returns safe names of which no two are one: one that is used again has a number behind it.
pub(super) fn unique_safe(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut used = HashSet::new();
    let unique = |name: String| {
        let name = safe(&name);
        let mut free = name.clone();
        for number in 2_u32.. {
            if used.insert(free.clone()) {
                break;
            }
            free = format!("{name}_{number}");
        }
        free
    };
    names.map(unique).collect()
}

/// Returns the identifier of a list of safe names.
pub(super) fn identifier(names: &[&str]) -> String {
    names.join(SEPARATOR)
}

/// FNV-1a of a text: the same in every build, unlike a hash of the standard library.
fn checksum(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |sum, byte| (sum ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_names_stay_and_others_keep_apart() {
        for (name, expected) in [
            ("fox", "fox"),
            ("Fox-1", "Fox-1"),
            ("drone 1", "drone_1"),
            ("drone_1", "drone_1"),
            ("Füchse", "Fuechse_ec66bf45"),
        ] {
            assert_eq!(safe(name), expected);
        }
        let hostile = [
            "a+b", "a#b", "a/b", "a b", "a  b", " a b", "a b ", "a__b", "ä", "ae", "Ä", "狐", "狸",
            "", "$SYS", "_", "a\u{0}b", "fox\n",
        ];
        let long = ["x".repeat(300), "x".repeat(301)];
        let names: Vec<_> = hostile.map(str::to_owned).into_iter().chain(long).collect();
        let safes: HashSet<_> = names.iter().map(|name| safe(name)).collect();
        assert_eq!(safes.len(), names.len(), "{safes:?}");
        for safe in &safes {
            let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            assert!(!safe.is_empty() && safe.len() < 64 && safe.chars().all(allowed), "{safe:?}");
            let is_whole = !safe.contains(SEPARATOR) && safe.trim_matches('_') == safe;
            assert!(is_whole, "{safe:?} could belong to two lists of names");
        }
    }

    #[test]
    fn names_that_are_used_again_have_a_number_that_no_other_has() {
        let names = ["drone 1", "drone_1", "drone_1_2", "drone 1"].map(str::to_owned);
        let unique = unique_safe(names.into_iter());
        assert_eq!(unique, ["drone_1", "drone_1_2", "drone_1_2_2", "drone_1_3"]);
    }
}
